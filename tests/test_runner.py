"""Plans performed: seeds, ids, failures and scores of runs, whoever performs them."""

import hashlib
import subprocess
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from coartic import (
    CoarticError,
    Movement,
    corrective_trial,
    initial_hands,
    load_task,
)
from coartic.analysis import TABLES
from coartic.analysis.study import load
from coartic.benchmarks import provenance, reproduce
from coartic.benchmarks.pool import Local
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import perform
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import fail
from coartic.method import Meter
from coartic.motion.kernels.slots import SLOTS
from coartic.runs.plan import Job, run_seed
from coartic.runs.record import Outcome, Times
from tests.support.strategies import STUCK, tiny_task
from tests.support.suites import (
    BROKEN,
    KNOWN,
    InProcess,
    cell_on,
    paper_cells,
    planned,
    run_and_write,
    same_results,
)

LEARNER = cell_on(load_task("ascending"), KNOWN["dual-process/EC1"])
ALONE = cell_on(load_task("ascending"), KNOWN["corrective-alone/given"])


class Silent(InProcess):
    """Of jobs nothing but that they are infeasible."""

    def perform(self, jobs):
        yield from ((job, [Outcome("infeasible", "x") for _ in job.numbers]) for job in jobs)


class Spoils(InProcess):
    """Of many runs, the process of one ends, and two state what is no solution."""

    def perform(self, jobs):
        for job, outcomes in super().perform(jobs):
            if len(outcomes) == SLOTS:
                outcomes[2:3] = fail(replace(job, numbers=(2,)), "crashed", "exit code 9", 1.0)
                fifth, seventh = (outcomes[run].parts["solution"] for run in (5, 7))
                fifth[0] = replace(fifth[0], target=fifth[0].target[1:])
                seventh.pop()
            yield job, outcomes


def test_what_goes_wrong_side_by_side_is_performed_again_alone(tmp_path, monkeypatch):
    honest, spoilt = (
        run_and_write(
            tmp_path / each.__name__, [LEARNER, ALONE], executor=each(), runs=SLOTS + 2, trials=3
        ).runs
        for each in (InProcess, Spoils)
    )
    assert (spoilt.status == "ok").all()
    assert honest.result.tolist() == spoilt.result.tolist()
    again = spoilt.together == 1
    assert again[again].index.tolist() == [2, 5, 7, len(spoilt) - 1]  # the last is the planner's


EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_and_write(tmp_path_factory.mktemp("results") / "deep" / "er")


@pytest.fixture(scope="module")
def methods():
    return registry([BROKEN, EXAMPLES / "differential_evolution.py"])


@pytest.mark.process
def test_results_do_not_depend_on_executor_or_workers(results, tmp_path):
    same_results(run_and_write(tmp_path, executor=Local(2)), results)


def test_a_run_in_a_checkout_has_its_commit(tmp_path, monkeypatch):
    """With a plus if tracked files were changed since; also where a caller sets other places."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    (folder / "tracked").touch()

    def git(*words):
        me = ["-c", "user.name=me", "-c", "user.email=me"]
        return subprocess.check_output(["git", "-C", folder, *me, *words], text=True).strip()

    def commit_of_run(name):
        provenance.current_environment.cache_clear()
        (commit,) = run_and_write(tmp_path / name, [ALONE], runs=1).runs.commit
        return commit

    for words in ("init -q", "add tracked", "commit -q -m first"):
        git(*words.split())
    monkeypatch.setattr(provenance, "PACKAGE", folder / "coartic")
    monkeypatch.setattr(provenance, "arithmetic", lambda: "")
    (folder / "untracked").touch()
    commit = git("rev-parse", "HEAD")
    monkeypatch.setenv("GIT_DIR", str(tmp_path))
    try:
        assert commit_of_run("clean") == commit
        (folder / "tracked").write_text("changed")
        assert commit_of_run("changed") == f"{commit}+"
        monkeypatch.setattr(provenance, "PACKAGE", folder / "packages" / "coartic")
        (folder / "packages").mkdir()
        assert pd.isna(commit_of_run("installed"))
    finally:
        provenance.current_environment.cache_clear()


def test_seeds_are_paired_by_task_and_run(results):
    of_runs = results.runs[["task", "run", "seed"]].drop_duplicates()
    assert len(of_runs) == 8  # 4 tasks x 2 runs
    roots, numbers = (1, 2**40 + 5, 2**63 - 1), range(0, 10**5, 9973)
    others = [(root, "é", number) for root in roots for number in numbers]
    seeds = [((0, task, run), seed) for task, run, seed in of_runs.itertuples(index=False)]
    for (root, task, run), seed in [*seeds, *((each, run_seed(*each)) for each in others)]:
        digest = hashlib.sha256(task.encode()).digest()
        words = [int.from_bytes(digest[4 * k : 4 * k + 4], "little") for k in range(4)]
        sequence = np.random.SeedSequence(root, spawn_key=(*words, run))
        assert seed == int(sequence.generate_state(1, np.uint64)[0]) >> 1


def test_run_ids_name_what_the_run_depends_on():
    def first(cells=None, **changes):
        (job,) = planned(cells or paper_cells()[:1], **{"runs": 1, "trials": 10, **changes})
        return job.run_id(0)

    (cell, other), base = paper_cells()[:2], first()
    assert base == first()
    assert base == first(time_limit_s=1.0)  # decides whether, not which
    moved = [replace(cell.method, origin=file) for file in ("x.py", "y.py")]
    assert len({first([cell_on(cell.task, method)]) for method in moved}) == 1
    others = [
        first([other]),
        first(seed=1),
        first(trials=11),
        first(trial_budget=5),
        first([cell_on(cell.task, cell.method, noise_sd=0.1)]),
        first([cell_on(cell.task.model_copy(update={"radius": 0.2}), cell.method)]),
        first([cell_on(cell.task, replace(cell.method, code="c0de"))]),
    ]
    assert len({base, *others}) == 8


def test_failures_are_kept_as_data(tmp_path):
    policy = STUCK.model_copy(update={"name": "policy", "initial_hands": "best-of-all"})
    learner = KNOWN["dual-process/EC1"]
    study = run_and_write(tmp_path, [cell_on(STUCK, learner), cell_on(policy, learner)], trials=5)
    assert list(study.runs.status) == ["infeasible"] * 4
    assert study.runs.reason.str.len().min() > 20
    assert study.runs.reward.isna().all()
    assert TABLES["methods"](study).solved.tolist() == [0, 0]
    assert list(study.runs.failed_trials[:2]) == [5, 5]
    assert [np.isnan(curve).tolist() for _, curve in study.rewards()] == [[True] * 5] * 2
    assert study.solutions.empty


@pytest.mark.parametrize(
    ("goals", "policy", "searched", "budget"),
    [(3, "best-of-all", 8, None), (13, "best-single-hand", 2, 11)],
)
def test_every_method_makes_the_trials_that_it_is_told(
    methods, tmp_path, goals, policy, searched, budget
):
    """The search for the first hands is counted apart, by the methods that need it. There are more
    sequences of 13 hands than are tried one by one."""
    task = tiny_task(initial_hands=policy, goals=[[5.0, 1.0 + 0.2 * g] for g in range(goals)])
    begin_there = ["dual-process/EC4", "hill-climbing", "cma-es/goal-by-goal"]
    try_all = ["random-search", "random-search/hands", "cma-es/bandit", "differential-evolution"]
    cells = [cell_on(task, methods[name]) for name in (*begin_there, *try_all)]
    runs = run_and_write(tmp_path, cells, runs=1, trials=20, trial_budget=budget).runs
    assert runs.status.unique().tolist() == ["ok"]
    assert runs.trials.unique().tolist() == [budget or 20]
    assert list(runs.initial_trials) == [searched] * 3 + [searched if goals > 3 else 0] * 4
    if goals > 3:  # the best hands are not known
        alone = corrective_trial(task, initial_hands(task)).reward
        assert runs.corrective_best.unique().tolist() == [alone]


def test_the_runs_of_a_batch_are_scored():
    """Solutions are the corrective process, 319 ticks; the second run lacks a tenth."""
    task, info = load_task("ascending"), KNOWN["dual-process/EC1"]
    movements = list(corrective_trial(task, "RRR").movements)
    times = Times(wall_s=2.0, cpu_s=1.0, warm=True, together=4)
    corrections = [3, *range(20, 10, -1)]  # of trial 0, then by tenths
    pretended = {"replay_reward": -1, "best_trial": "third"}  # which are columns of learners
    information = {"parts": {"solution": movements}, "times": times}
    outcomes = [
        Outcome("ok", details={"corrections": corrections}, rewards=[None, -330, -319, -319],
                meter=Meter(trials=4), **information),
        Outcome("ok", details=pretended | {"corrections": corrections[:-1]}, **information),
        Outcome("ok", times=times),
        Outcome("ok", parts={"solution": movements, "replay": movements[:1]}),
    ]  # fmt: skip
    job = Job(cell_on(task, info), 5, (0, 1, 2, 3), 60.0)
    runs = [*score(job, outcomes), *score(job, fail(job, "timeout", "too slow", wall_s=8.0))[:1]]
    columns = ["run", "status", "reward", "hands", "best_trial",
               "early_corrections", "late_corrections", "solution_corrections", "other_arm_travel",
               "replay_reward", "together", "wall_s", "cpu_s"]  # fmt: skip
    nothing = [None] * 8
    assert [[run[name] for name in columns] for run in runs] == [
        [0, "ok", -319, "RRR", 2, 20, 11, 3, 0.0, None, 4, 2.0, 1.0],
        [1, "ok", -319, "RRR", None, None, None, 3, 0.0, None, 4, 2.0, 1.0],
        [2, "solver-failed", *nothing, 4, 2.0, 1.0],
        [3, "solver-failed", *nothing, 1, None, None],
        [0, "timeout", *nothing, 4, 2.0, None],
    ]
    reasons = [run["reason"] for run in runs]
    assert "movements for goals [1]; it must" in reasons.pop(3)
    assert reasons == ["", "", "it reported ok, but returned no solution", "too slow"]
    better = replace(runs[0], rewards=[None, -310, -319, -319])  # than the solution
    assert better.downsample().rewards == [None, -310, -319, None]


def test_a_solution_that_misses_a_goal_is_infeasible():
    job = Job(cell_on(STUCK, KNOWN["corrective-alone/given"]), 0, (0,), 60.0)
    (run,) = score(job, [Outcome("ok", parts={"solution": [Movement(1, "right", "corrective")]})])
    assert (run["status"], run.movements) == ("infeasible", {})


@pytest.mark.usefixtures("in_this_process")
def test_some_runs_of_every_cell_are_performed_again(results):
    stored = reproduce.some_runs(results.folder, len(results.cells), KNOWN)
    again = [*reproduce.perform_runs_again(stored, KNOWN)]
    assert not any(reproduce.compare_runs(*pair) for pair in again)
    cells = results.runs[results.runs.run_id.isin(run["run_id"] for run, _ in again)].groupby(
        ["task", "method", "setting"]
    )
    assert len(cells) == len(again) == len(results.cells)
    with pytest.raises(CoarticError, match="has no run that can be performed again"):
        reproduce.some_runs(results.folder, 1, {})


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize(
    ("name", "repeats"), [("test/good", True), ("test/draws", True), ("test/random", False)]
)
def test_a_run_of_each_method_of_a_file_is_made_again(methods, name, repeats, tmp_path):
    """One, whatever the number of its runs and tasks; where it differs, reports have a mark."""
    tasks = [load_task("ascending"), load_task("two-armed-1")]
    plan = planned([cell_on(task, methods[name]) for task in tasks])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        progress = perform(plan, tmp_path, executor=InProcess())
        perform(plan, tmp_path, executor=InProcess())  # has nothing to perform
    assert (progress.done, progress.failed) == (progress.total, 0)
    study = load(tmp_path)
    marks = [mark for of_method in study.marks.values() for mark in of_method]
    assert [str(each.message) for each in said] == marks
    assert len(marks) == (not repeats)
    assert all(f"{name}: another result when a run was made again" in mark for mark in marks)
    assert study.methods.title[name].endswith(" ‡") == bool(marks)
    changed = replace(methods[name], code="another")
    perform(planned([cell_on(tasks[0], changed)]), tmp_path, executor=Silent())
    assert load(tmp_path).marks == {}


KEEPS = """
import time
from coartic.method import Information, Method, Result
from coartic.motion.solution import Movement
seen = []
class Keeps(Method):
    name, title, citation = "keeps", "Keeps its runs", "none"
    information = frozenset({Information.CORRECTIVE_PROCESS})
    def solve(self, session):
        time.sleep(0.2 * bool(seen))  # the first run is the quickest
        seen.append(1)
        moves = [Movement(n, "right", "corrective") for n in (1, 2, 3)]
        return Result(tuple(moves), {"n": len(seen)})
"""


@pytest.mark.process
def test_a_method_that_keeps_something_from_run_to_run_is_marked(tmp_path):
    """The run that is made again in a new process was not the first of its own."""
    (tmp_path / "keeps.py").write_text(KEEPS, encoding="utf-8")
    (method,) = (info for info in registry([tmp_path / "keeps.py"]).values() if not info.is_ours)
    plan = planned([cell_on(load_task("ascending"), method)], runs=3)
    with pytest.warns(UserWarning, match="keeps: another result when a run was made again"):
        perform(plan, tmp_path / "out", executor=Local(1))
