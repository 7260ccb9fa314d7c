"""Shipped best rewards: they hold, are taken over from folders, and get bounds."""

import json
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from coartic import CoarticError, MotionModel, execute, execute_noisy, load_task
from coartic.baselines.optimum import OptimumSearch
from coartic.motion.execution import corrective_trial, other_arm_travel
from coartic.runs.plan import reference_seed
from coartic.runs.store import open_store
from coartic.tasks import optima
from coartic.tasks.families import shipped_families
from coartic.tasks.optima import best_shipped, task_hash
from coartic.tasks.task import hands_of
from tests.support.processes import ROOT, programs
from tests.support.strategies import tiny_task
from tests.support.suites import KNOWN, cell_on, run_and_write

FOLDER = ROOT / "studies" / "optima"
RENEW, PROVE, STUDY, IN_NOISE = programs("optima", "renew", "prove", "study", "renew_in_noise")
SHIPPED = RENEW.shipped
ENTRIES = SHIPPED.read()
DRAWN = [entry for (name, *_), entry in ENTRIES.items() if "/" in name]
SOLVED = [entry for (name, *_), entry in ENTRIES.items() if "/" not in name and "reward" in entry]
ASCENDING = ("ascending", *SHIPPED.FREE)


def test_the_first_forty_test_instances_of_a_family_have_one_or_none_has():
    """A new family has none."""
    counts = Counter(entry["task"].rpartition("/")[0] for entry in DRAWN)
    assert {*counts.values()} == {40}
    assert {*counts} <= {*shipped_families()}


def held(entry):
    """The task of an entry, and the execution of the solution, which is what the entry says."""
    task = load_task(entry["task"])
    assert entry["essence"] == task_hash(task)
    execution = execute(task, SHIPPED.movements_of(entry["solution"]))
    made = entry["task"], execution.reward, execution.hands
    assert made == tuple(entry[key] for key in ("task", "reward", "hands"))
    assert entry["bound"] >= entry["reward"]
    return task, execution


def test_solutions_of_random_tasks_come_to_the_best_known_reward():
    for entry in DRAWN:
        task, execution = held(entry)
        shipped = best_shipped(task)
        known = tuple(entry[key] for key in ("reward", "hands", "bound"))
        assert (shipped.reward, shipped.hands, shipped.bound) == known
        alone = corrective_trial(task, task.initial_hands).reward
        assert alone is None or execution.reward >= alone


def name_of(entry):
    return "-".join(entry[key] for key in ("task", "other_arm", "base"))


@pytest.mark.parametrize("entry", SOLVED, ids=name_of)
def test_what_is_shipped_holds(entry):
    """The solution gives its reward, the searches agree, and only one proof has not ended."""
    task, execution = held(entry)
    assert execution.corrections == 0
    if entry["other_arm"] == "still":
        assert other_arm_travel(task, hands_of(execution.hands), execution.configurations) == 0.0
    locked = {"task": "", "y": "y", "xy": "xy"}[entry["base"]]
    for axis in (*locked, *task.locked_base):
        column = "xy".index(axis)
        assert np.all(execution.configurations[:, column] == task.q0[column])
    assert max(entry["searches"].values()) == entry["reward"]
    # On two-armed 1 with the other arm still only random starts find the best.
    apart = 3 if name_of(entry) == "two-armed-1-still-task" else 1
    assert entry["reward"] - min(entry["searches"].values()) <= apart
    assert entry["bound"] == entry["reward"] or entry["task"] == "two-armed-1"


@pytest.mark.parametrize("suite", ["comparison", "families"])
def test_no_shipped_run_exceeds_a_bound(suite, shipped_folder):
    with open_store(shipped_folder / suite) as store:
        best = store.runs().groupby("task").reward.max()
    entries = (ENTRIES[name, *SHIPPED.FREE] for name in best.index)
    assert all(e["bound"] >= e["reward"] >= best[e["task"]] for e in entries)


def test_what_is_written_is_what_was_read(tmp_path, monkeypatch):
    before = {}
    for name in ("BEST_KNOWN", "SOLUTIONS", "DATA"):
        shipped = getattr(SHIPPED, name)
        before[name] = shipped.read_bytes()
        place = tmp_path / shipped.name
        place.write_bytes(before[name])
        for module in (SHIPPED, optima):
            monkeypatch.setattr(module, name, place, raising=module is SHIPPED)
    SHIPPED.write(SHIPPED.read())
    assert before == {name: getattr(SHIPPED, name).read_bytes() for name in before}


FEW = {"graphs": 1, "chains": 1, "nodes": 60}


def test_better_rewards_of_a_folder_are_taken_over(tmp_path):
    """Of any method, under the restriction of its runs, with a solution that gives them."""
    task = load_task("ascending")
    names = ("optimum/search", "trajectory-optimisation/path-length")
    cells = [cell_on(task, KNOWN[name], **FEW) for name in names]
    cells.append(cell_on(task, KNOWN["optimum/search"], **FEW, other_arm="still"))
    cells.append(cell_on(load_task("one-armed/v1/d000"), KNOWN["corrective-alone/given"]))
    cells.append(cell_on(load_task("one-armed/v1/i003"), KNOWN["corrective-alone/given"]))
    study = run_and_write(tmp_path / "results", cells, runs=1)
    known = SHIPPED.read()
    assert RENEW.take_over(study, known) == 0
    assert known == ENTRIES
    drawn = ("one-armed/v1/i003", *SHIPPED.FREE)
    old = {ASCENDING: {"reward": -293, "bound": -292}, drawn: {"reward": -9999, "bound": None}}
    known = {**known, **{key: known[key] | worse for key, worse in old.items()}}
    assert RENEW.take_over(study, known) == 2
    entry = json.loads(json.dumps(known[ASCENDING]))
    assert (entry["reward"], entry["bound"]) == (-292, -292)
    assert entry["run_ids"][0] in set(study.runs.run_id)
    assert entry["searches"] == dict.fromkeys(names, -292)
    for key in old:
        movements = SHIPPED.movements_of(known[key]["solution"])
        assert execute(load_task(key[0]), movements).reward == known[key]["reward"] > -9999
    known = {key: entry for key, entry in known.items() if key[2] == "free"}
    assert RENEW.take_over(study, known) == 1
    assert known["ascending", "task", "still"]["reward"] == -292


def test_a_bound_below_a_known_reward_or_a_solution_without_its_reward_is_refused():
    key = "two-armed/v1/i002", *SHIPPED.FREE
    row = ENTRIES[key] | {"nodes": 1}
    with pytest.raises(
        CoarticError, match="i002: bound is -256; it must not be below the reward -255"
    ):
        SHIPPED.take_proof(SHIPPED.read(), row | {"bound": -256})
    known = SHIPPED.read()
    known[key]["reward"] = -300
    assert SHIPPED.take_proof(known, row)
    assert known == ENTRIES
    for refused in (
        lambda: SHIPPED.take_proof(known, row | {"reward": -254}),
        lambda: SHIPPED.solution_in_short(
            load_task(key[0]), SHIPPED.movements_of(row["solution"]), -254
        ),
    ):
        with pytest.raises(CoarticError, match="the solution (has|does not have) reward .*-254"):
            refused()


def test_a_task_of_ones_own_is_searched_and_proven(tmp_path, monkeypatch, capsys):
    file = tmp_path / "mine.toml"
    tiny_task(goals=[[6.0, 0.5]], hands=["right"]).save(file)
    monkeypatch.setattr(PROVE, "process_pool", ThreadPoolExecutor)
    monkeypatch.setattr(
        PROVE, "OptimumSearch", partial(OptimumSearch, OptimumSearch.Parameters(**FEW))
    )
    monkeypatch.setattr("sys.argv", ["prove.py", str(file), "--out", str(tmp_path)])
    PROVE.main()
    (sentence,), (row,) = capsys.readouterr().out.splitlines(), SHIPPED.read_log(tmp_path)
    assert sentence.startswith(f"{file} (base task, other arm free): {row['reward']}, proven opti")
    assert -200 < row["reward"] == row["bound"] < -100


# ---- In noise ----


def test_solutions_in_noise_come_to_their_mean_ticks():
    """By executions of the motion module, under the seed of references."""
    known = SHIPPED.read_in_noise()
    assert {"ascending", "descending", "two-armed-1", "two-armed-2"} <= {*known}
    for name, entry in known.items():
        task = load_task(name)
        answer = SHIPPED.movements_of(entry["solution"])
        ticks = execute_noisy(task, [answer], 0.01, 1_000, reference_seed(0, name))[0]
        assert ticks.mean() == pytest.approx(float(entry["mean_ticks"]), abs=6e-4)
        error = ticks.std(ddof=1) / np.sqrt(1_000)
        assert error == pytest.approx(float(entry["standard_error"]), abs=6e-4)
        best = best_shipped(task, IN_NOISE.MODEL)
        assert (best.reward, best.hands, best.bound) == (
            -float(entry["mean_ticks"]),
            entry["hands"],
            None,
        )
        assert best.reward < best_shipped(task).bound + 1


@pytest.mark.parametrize(
    "model", [{"motor_noise": 0.02}, {"motor_noise": 0.01, "base_weight": 2.0}]
)
def test_nothing_is_shipped_in_other_worlds(model):
    assert best_shipped(load_task("ascending"), MotionModel(**model)) is None


def test_a_better_run_in_noise_is_taken_over(tmp_path):
    """One that is worse is not, and a task that does not ship is left out."""
    tasks = load_task("ascending"), tiny_task()
    cells = [
        replace(cell_on(task, KNOWN[name]), model=IN_NOISE.MODEL)
        for task in tasks
        for name in ("corrective-alone/best-hands", "random-search")
    ]
    folder = run_and_write(tmp_path, cells, runs=2, trials=60).folder
    with open_store(folder) as store:
        known = {}
        assert IN_NOISE.take_over(store, known) == 1
        assert IN_NOISE.take_over(store, known) == 0
        (entry,) = known.values()
        runs = store.runs()
    least = runs[runs.task == "ascending"].mean_ticks.min()
    assert float(entry["mean_ticks"]) == pytest.approx(least, rel=0.01)
    known["ascending"]["mean_ticks"] = "1.0"
    with open_store(folder) as store:
        assert IN_NOISE.take_over(store, known) == 0
