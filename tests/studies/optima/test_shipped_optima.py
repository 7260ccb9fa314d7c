"""Shipped best rewards: they hold, are taken over from folders, and get bounds."""

import json
import lzma
import sqlite3
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pandas as pd
import pytest

from coartic import CoarticError, builtin_tasks, execute, load_task, objective
from coartic.baselines.optimum import with_locks
from coartic.motion.solution import corrective_trial, other_arm_travel
from coartic.tasks import optima
from coartic.tasks.families import shipped_families
from coartic.tasks.optima import best_shipped, task_hash
from coartic.tasks.task import hands_of
from tests.support.processes import ROOT, programs
from tests.support.strategies import tiny_task
from tests.support.suites import KNOWN, cell_on, run_and_write

FOLDER = ROOT / "studies" / "optima"
THIRD_VERSION = "dcb24843"
RENEW, PROVE, STUDY = programs("optima", "renew", "prove", "study")
SHIPPED = RENEW.shipped
ENTRIES = SHIPPED.read()
DRAWN = [entry for (name, *_), entry in ENTRIES.items() if "/" in name]
SOLVED = [entry for (name, *_), entry in ENTRIES.items() if "/" not in name and "reward" in entry]
ASCENDING = ("ascending", *SHIPPED.FREE)


def test_the_first_forty_test_instances_of_every_family_have_one():
    counts = Counter(entry["task"].rpartition("/")[0] for entry in DRAWN)
    assert counts == dict.fromkeys(shipped_families(), 40)


def held(entry):
    """The task of an entry, and the execution of the solution, which is what the entry says."""
    task = load_task(entry["task"])
    assert entry["essence"] == task_hash(task)
    execution = execute(task, SHIPPED.movements_of(entry["solution"]))
    assert (execution.reward, execution.hands) == (entry["reward"], entry["hands"])
    assert entry["bound"] >= entry["reward"]
    return task, execution


@pytest.mark.parametrize("family", sorted(shipped_families()))
def test_solutions_come_to_the_best_known_reward(family):
    for entry in (entry for entry in DRAWN if entry["task"].startswith(f"{family}/")):
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
    """The solution gives its reward, also as a point; the searches agree."""
    task, execution = held(entry)
    assert execution.corrections == 0
    if entry["other_arm"] == "still":
        assert other_arm_travel(task, hands_of(execution.hands), execution.configurations) == 0.0
    locked = {"task": "", "y": "y", "xy": "xy"}[entry["base"]]
    for axis in (*locked, *task.locked_base):
        column = "xy".index(axis)
        assert np.all(execution.configurations[:, column] == task.q0[column])
    assert max(entry["searches"].values()) == entry["reward"]
    cost = objective(with_locks(task, entry["base"]), entry["hands"])
    targets = [np.full(len(task.q0), np.nan) if m.kind == "corrective" else m.target
               for m in SHIPPED.movements_of(entry["solution"])]  # fmt: skip
    assert cost(np.array(targets)[cost.joints]) == -entry["reward"]
    # On two-armed 1 with the other arm still only random starts find the best.
    apart = 3 if name_of(entry) == "two-armed-1-still-task" else 1
    assert entry["reward"] - min(entry["searches"].values()) <= apart


@pytest.mark.parametrize("name", builtin_tasks())
def test_the_optimum_of_every_task_is_proven_or_bounded(name):
    free, still = (ENTRIES[name, "task", arm] for arm in ("free", "still"))
    assert still["reward"] <= free["reward"]
    # The proofs of two-armed 1 have not ended: they leave 5 and 20 ticks.
    left = (5, 20) if name == "two-armed-1" else (0, 0)
    assert (free["bound"] - free["reward"], still["bound"] - still["reward"]) == left
    for arm in ("free", "still"):
        locked = ENTRIES[name, "xy", arm]["infeasible"]
        assert "out of reach with the base locked in x and y" in locked
    assert ((name, "y", "free") in ENTRIES) == (name != "two-armed-1")  # its base is on a rail
    if name == "two-armed-2":
        assert ENTRIES[name, "y", "free"]["reward"] < free["reward"]


@pytest.mark.parametrize(
    ("commit", "suite", "runs"),
    [(None, "comparison", 3604), (None, "families", 7480),
     (THIRD_VERSION, "comparison", 5508), (THIRD_VERSION, "families", 2350)],
)  # fmt: skip
def test_no_run_exceeds_a_bound(tmp_path, commit, suite, runs):
    """All runs that ship, and those that shipped with version 3.0.0, from its commit."""
    place = f"benchmarks/shipped/{suite}.sqlite.xz"
    if commit is None:
        packed = (ROOT / place).read_bytes()
    else:
        shown = subprocess.run(
            ["git", "-C", ROOT, "show", f"{commit}:{place}"], capture_output=True
        )
        if shown.returncode:
            pytest.skip("the commit is not in this clone")
        packed = shown.stdout
    (tmp_path / "runs.sqlite").write_bytes(lzma.decompress(packed))
    with closing(sqlite3.connect(tmp_path / "runs.sqlite")) as file:
        best = file.execute("SELECT task, max(reward), count(*) FROM runs GROUP BY task").fetchall()
    assert sum(count for *_, count in best) == runs
    for name, reward, _ in best:
        assert ENTRIES[name, *SHIPPED.FREE]["bound"] >= reward
        assert ENTRIES[name, *SHIPPED.FREE]["reward"] >= reward


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The shipped files, as copies that may be written."""
    places = {name: tmp_path / getattr(SHIPPED, name).name
              for name in ("BEST_KNOWN", "SOLUTIONS", "DATA")}  # fmt: skip
    for name, place in places.items():
        place.write_bytes(getattr(SHIPPED, name).read_bytes())
        for module in (SHIPPED, optima):
            monkeypatch.setattr(module, name, place, raising=module is SHIPPED)
    return places


def test_what_is_written_is_what_was_read(files):
    before = {name: place.read_bytes() for name, place in files.items()}
    SHIPPED.write(SHIPPED.read())
    assert before == {name: place.read_bytes() for name, place in files.items()}


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


def prove(monkeypatch, capsys, folder, *asked):
    """What ``prove.py`` prints, in this process, and its log."""
    monkeypatch.setattr(PROVE, "process_pool", ThreadPoolExecutor)
    monkeypatch.setattr("sys.argv", ["prove.py", *map(str, asked), "--out", str(folder)])
    PROVE.main()
    return capsys.readouterr().out.splitlines(), SHIPPED.read_log(folder)


def test_proofs_go_on_where_they_stopped_and_the_sharper_bound_is_kept(
    files, tmp_path, monkeypatch, capsys
):
    """A log whose last line was cut off, as where a process was killed."""
    family = (each for each in ENTRIES.values() if each["task"].startswith("two-armed/v1"))
    task, reward = next((e["task"], e["reward"]) for e in family if e["reward"] != e["bound"])
    folder, names = tmp_path / "optima", (task, "two-armed/v1/i002..i003")
    asked = monkeypatch, capsys, folder, *names, "--seconds"
    shown, log = prove(*asked, "0.05")
    assert [row["task"] for row in log] == [names[0]]  # the others are proven
    assert shown[0].startswith(f"{task} (base task, other arm free): {reward}, no solution ")
    with (folder / SHIPPED.LOG).open("a") as file:
        file.write('{"task": "two-armed/v1/i0')
    assert prove(*asked, "0.05") == ([], log)
    _, longer = prove(*asked, "0.1")
    assert [row["asked"] for row in longer] == [0.05, 0.1]
    known = SHIPPED.read()
    key = SHIPPED.key_of(log[0])
    assert not SHIPPED.take_proof(known, log[0])
    assert known == ENTRIES
    assert SHIPPED.take_proof(known, log[0] | {"bound": reward, "nodes": 7})
    assert known[key] == ENTRIES[key] | {"bound": reward, "nodes": 7}


def test_a_bound_below_a_known_reward_or_a_solution_without_its_reward_is_refused():
    key = "two-armed/v1/i002", *SHIPPED.FREE
    row = ENTRIES[key] | {"nodes": 1}
    with pytest.raises(CoarticError, match="i002: bound -256 is below -255"):
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
        with pytest.raises(CoarticError, match="the solution does not come to -254"):
            refused()


def test_a_better_solution_is_found_on_the_way():
    """From the open subproblems of least bound, if the reward that is known is poor."""
    entry = ENTRIES["two-armed/v1/i001", *SHIPPED.FREE] | {"reward": -400}
    row = PROVE.prove(entry, 0.1)
    assert -400 < row["reward"] <= row["bound"]
    execution = execute(load_task(row["task"]), SHIPPED.movements_of(row["solution"]))
    assert (execution.reward, execution.hands) == (row["reward"], row["hands"])


def test_a_task_of_ones_own_is_searched_and_proven(tmp_path, monkeypatch, capsys):
    file = tmp_path / "mine.toml"
    tiny_task(goals=[[6.0, 0.5]], hands=["right"]).save(file)
    (sentence,), (row,) = prove(monkeypatch, capsys, tmp_path, file)
    assert sentence.startswith(f"{file} (base task, other arm free): {row['reward']}, proven opti")
    assert -200 < row["reward"] == row["bound"] < -100


def test_the_table_is_of_the_shipped_data():
    stored = pd.read_csv(FOLDER / "results.csv", index_col=0)
    table = STUDY.count(STUDY.distances(FOLDER)).drop(columns="seconds")
    counted = stored[table.columns]
    pd.testing.assert_frame_equal(table, counted, check_dtype=False, rtol=1e-5)
    assert table.instances["all families"] == len(DRAWN)
    assert table.proven["all families"] == sum(e["bound"] == e["reward"] for e in DRAWN)
    before = pd.read_csv(FOLDER / "before.csv", index_col=0)
    before = before.drop(columns="bounded")
    assert (counted[before.columns] >= before).all(axis=None)


def test_open_tasks_are_those_farther_than_five_per_cent_and_all_have_a_bound():
    stored = pd.read_csv(FOLDER / "open.csv", index_col=0)
    far = {e["task"] for e in DRAWN if e["bound"] - e["reward"] > 0.05 * -e["reward"]}
    assert far == set(stored.index)
    page = (FOLDER / "README.md").read_text("utf-8")
    assert f"For {len(far)} random instances no method comes within 5 % of the bound" in page
