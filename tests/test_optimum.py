"""The optimum: what is shipped holds, and can be found again."""

import itertools
import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import renew_optima

from coartic import PAPER, builtin_tasks, correct, execute, load_task
from coartic.analysis import optima
from coartic.baselines.optimum import (
    METHODS,
    BranchAndBound,
    DynamicProgramming,
    Multistart,
    with_locks,
)
from coartic.baselines.shortest_paths import fewer
from coartic.baselines.whole_ticks import TickPlan
from coartic.benchmarks.suites import Cell
from coartic.method import MethodError, Session
from coartic.motion.solution import other_arm_travel
from coartic.runs.run import movements_from
from coartic.tasks.optima import DATA, ShippedOptimum, entries, essence
from coartic.tasks.task import hands_of
from tests.support.strategies import changed, solve, tiny_task
from tests.support.suites import KNOWN, run_and_write

SOLVED = [entry for entry in entries() if entry.reward is not None]


def name_of(entry):
    return f"{entry.task}-{entry.other_arm}-{entry.base}"


@pytest.mark.parametrize("entry", SOLVED, ids=name_of)
def test_what_is_shipped_holds(entry):
    """The solution gives its reward; the searches agree; the bound is not above it."""
    task = load_task(entry.task)
    assert entry.essence == essence(task)
    solution = movements_from(task, pd.DataFrame(list(entry.solution)))
    execution = execute(task, solution)
    assert execution.reward == entry.reward
    assert execution.hands == entry.hands
    assert execution.corrections == 0
    if entry.other_arm == "still":
        assert other_arm_travel(task, hands_of(execution.hands), execution.configurations) == 0.0
    locked = {"task": "", "y": "y", "xy": "xy"}[entry.base]
    for axis in (*locked, *task.locked_base):
        column = "xy".index(axis)
        assert np.all(execution.configurations[:, column] == task.q0[column])
    assert set(entry.searches) == {method.name for method in METHODS}
    assert max(entry.searches.values()) == entry.reward
    # On two-armed 1 with the other arm still only random starts find the best.
    apart = 3 if name_of(entry) == "two-armed-1-still-task" else 1
    assert entry.reward - min(entry.searches.values()) <= apart
    assert entry.bound >= entry.reward


@pytest.mark.parametrize("name", builtin_tasks())
def test_the_optimum_of_every_task_is_proven_or_bounded(name):
    by_name = {name_of(entry): entry for entry in entries()}
    free, still = (by_name[f"{name}-{arm}-task"] for arm in ("free", "still"))
    assert still.reward <= free.reward
    # The proofs of two-armed 1 have not ended: they leave 5 and 20 ticks.
    left = (5, 20) if name == "two-armed-1" else (0, 0)
    assert (free.bound - free.reward, still.bound - still.reward) == left
    for arm in ("free", "still"):
        locked = by_name[f"{name}-{arm}-xy"].infeasible
        assert "out of reach with the base locked in x and y" in locked
    assert (f"{name}-free-y" in by_name) == (name != "two-armed-1")  # its base is on a rail
    if name == "two-armed-2":
        assert by_name[f"{name}-free-y"].reward < free.reward


@pytest.mark.parametrize(
    ("method", "parameters"),
    [
        (DynamicProgramming, {"graphs": 1, "chains": 1, "nodes": 60}),
        (Multistart, {"starts": 5}),
        (BranchAndBound, {"graphs": 1, "chains": 1, "nodes": 60}),
    ],
)
def test_searches_find_what_is_shipped(method, parameters):
    task = load_task("descending")
    result, execution, session = solve(method, task, **parameters)
    assert execution.reward == -304
    assert result.details["path_length"] == pytest.approx(3.005051233, abs=1e-8)
    assert session.meter.solver_iterations > 30
    if method is BranchAndBound:
        assert (result.details["proven_optimal"], result.details["ticks_left"]) == (True, 0)
        assert result.bound == -304


def test_searches_keep_the_other_arm_still():
    goals = [[2.6, 1.0], [-1.6, 1.0]]
    start = {"base": [0.0, 0.0], "left": [2.0, 0.5, 0.5, 0.0], "right": [0.5] * 4}
    task, few = tiny_task(goals=goals, start=start), {"nodes": 40, "graphs": 1, "chains": 1}
    travels = []
    for other_arm in ("free", "still"):
        _, execution, _ = solve(DynamicProgramming, task, other_arm=other_arm, **few)
        hands = hands_of(execution.hands)
        travels.append(other_arm_travel(task, hands, execution.configurations))
    assert travels[0] > travels[1] == 0.0


def test_random_starts_begin_with_the_corrective_process():
    task = load_task("two-armed-2")
    session = Session(task, 0, Multistart.told, trusted=True)
    found = Multistart(Multistart.Parameters(starts=2)).starts(session, task)
    (hands, first), (_, second) = itertools.islice(found, 2)
    q, iterations = task.q0, 0
    for hand, goal, reached in zip(hands, task.goals, first, strict=True):
        correction = correct(task.robot, q, hand, goal)
        np.testing.assert_array_equal(reached, correction.q)
        q, iterations = correction.q, iterations + correction.iterations
    assert session.meter.jacobians == iterations == session.meter.forward_kinematics - 4
    assert (second != first).all()


def test_the_base_is_locked_beside_the_task():
    task = tiny_task(locked_base=["x"], goals=[[4.5, 0.1]], initial_hands="R")
    assert with_locks(task, "task") == task
    assert with_locks(task, "y").locked_base == ("x", "y")
    with pytest.raises(MethodError, match="out of reach") as caught:
        with_locks(load_task("ascending"), "xy")
    assert caught.value.outcome == "infeasible"


def test_of_as_many_ticks_fewer_corrections_are_better():
    ranked = [SimpleNamespace(ticks=t, corrections=c) for t, c in ((5, 2), (6, 0), (6, 1))]
    for one, other in itertools.product(range(3), repeat=2):
        assert fewer(ranked[one], ranked[other]) == (one < other)
    assert TickPlan((3, 0, 2), np.empty((3, 10))).ticks == 4 + 0 + 3


def test_a_hand_that_is_there_already_saves_a_tick():
    """The left hand stands in goal 2 from the start: it is hit as its turn comes."""
    task = changed("two-armed-2", goals=[[4.5, 1.0], [3.5, 0.1]], initial_hands="RL")
    _, execution, _ = solve(DynamicProgramming, task, nodes=60, graphs=1, chains=1)
    assert execution.hands == "RL"
    assert execution.ticks_by_goal()[1] == 0
    assert execution.corrections == 0


def test_the_shipped_data_is_what_a_folder_of_the_suite_gives(tmp_path):
    task, few = load_task("ascending"), {"graphs": 1, "chains": 1, "nodes": 60}
    names = ("optimum/branch-and-bound", "optimum/dynamic-programming")
    cells = [Cell(task, KNOWN[name], few) for name in names]
    study = run_and_write(tmp_path / "results", cells, runs=1)
    (entry,) = renew_optima.collect(study)
    assert (entry.reward, entry.bound) == (-292, -292)
    assert entry.run_ids == tuple(sorted(study.runs.run_id))
    assert entry.searches == dict.fromkeys(names, -292)
    again = ShippedOptimum.model_validate_json(entry.model_dump_json()).solution
    assert execute(task, movements_from(task, pd.DataFrame(list(again)))).reward == -292


def test_renewing_with_what_is_there_changes_nothing():
    shipped = entries()
    before = DATA.read_bytes()
    assert renew_optima.content_with(shipped[2:], shipped) == before
    better = shipped[0].model_copy(update={"reward": -1})
    changed = json.loads(renew_optima.content_with([better], shipped))["optima"]
    assert changed[0].pop("reward") == -1
    as_before = json.loads(before)["optima"]
    del as_before[0]["reward"]
    assert changed == as_before


def test_searches_of_a_folder_better_what_is_shipped_and_any_run_those_of_a_family():
    rows = [
        ("ascending", "optimum/multistart", -290, -280), ("ascending", "other", -200, None),
        ("one-armed/v1/i001", "optimum/multistart", -300, -250),
        ("one-armed/v1/i001", "other", -290, None),
    ]  # fmt: skip
    runs = pd.DataFrame(rows, columns=["task", "method", "reward", "proven_bound"])
    runs = runs.assign(status="ok", hands="RRR", parameters="{}")
    runs = runs.astype({"proven_bound": "Int64"})
    tasks = {name: load_task(name) for name in ("ascending", "one-armed/v1/i001")}
    best = optima.known_optima(runs, tasks, PAPER)
    free = {name: (o.reward, o.bound) for name, o in best.items()}
    assert free == {"ascending": (-290, -292), "one-armed/v1/i001": (-290, -250)}
    locked = runs.assign(parameters='{"base": "y"}')
    assert optima.known_optima(locked, tasks, PAPER)["ascending"].reward == -292
