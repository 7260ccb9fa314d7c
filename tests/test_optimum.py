"""The optimum: what is shipped holds, and can be found again."""

import json

import numpy as np
import pandas as pd
import pytest
import renew_optima

from coartic import builtin_tasks, execute, load_task, objective
from coartic.analysis import optima
from coartic.baselines.optimum import Optimum, with_locks
from coartic.baselines.trajectory_optimisation import PathLength
from coartic.baselines.whole_ticks import TickPlan
from coartic.method import MethodError
from coartic.motion.solution import other_arm_travel
from coartic.runs.record import movements_from
from coartic.tasks.optima import best_shipped, essence
from coartic.tasks.task import hands_of
from tests.support.strategies import changed, shipped_optima, solve, tiny_task
from tests.support.suites import KNOWN, cell_on, run_and_write

SOLVED = [entry for entry in shipped_optima() if entry.reward is not None]


def name_of(entry):
    return f"{entry.task}-{entry.other_arm}-{entry.base}"


@pytest.mark.parametrize("entry", SOLVED, ids=name_of)
def test_what_is_shipped_holds(entry):
    """The solution gives its reward, also as a point; the searches agree; the bound is not above
    it."""
    task = load_task(entry.task)
    assert entry.essence == essence(task)
    solution = movements_from(task, entry.solution)
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
    assert max(entry.searches.values()) == entry.reward
    cost = objective(with_locks(task, entry.base), entry.hands)
    targets = [np.full(len(task.q0), np.nan) if m.kind == "corrective" else m.target
               for m in solution]  # fmt: skip
    assert cost(np.array(targets)[cost.joints]) == -entry.reward
    # On two-armed 1 with the other arm still only random starts find the best.
    apart = 3 if name_of(entry) == "two-armed-1-still-task" else 1
    assert entry.reward - min(entry.searches.values()) <= apart
    assert entry.bound >= entry.reward


@pytest.mark.parametrize("name", builtin_tasks())
def test_the_optimum_of_every_task_is_proven_or_bounded(name):
    by_name = {name_of(entry): entry for entry in shipped_optima()}
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


FEW = {"graphs": 1, "chains": 1, "nodes": 60}


def test_two_searches_find_what_is_shipped_and_one_proves_it():
    task = load_task("descending")
    for method in (Optimum, PathLength):
        result, execution, session = solve(method, task, **FEW)
        assert execution.reward == -304
        assert result.details["path_length"] == pytest.approx(3.005051233, abs=1e-8)
        assert session.meter.solver_iterations > 30
        if method is Optimum:
            assert (result.details["proven_optimal"], result.details["ticks_left"]) == (True, 0)
            assert result.bound == -304
    result, _, _ = solve(Optimum, task, **FEW, most_nodes=0)
    assert result.bound is None
    assert "proven_optimal" not in result.details


def test_searches_keep_the_other_arm_still():
    goals = [[2.6, 1.0], [-1.6, 1.0]]
    start = {"base": [0.0, 0.0], "left": [2.0, 0.5, 0.5, 0.0], "right": [0.5] * 4}
    task = tiny_task(goals=goals, start=start)
    few = {"nodes": 40, "graphs": 1, "chains": 1, "most_nodes": 0}
    travels = []
    for other_arm in ("free", "still"):
        _, execution, _ = solve(Optimum, task, other_arm=other_arm, **few)
        hands = hands_of(execution.hands)
        travels.append(other_arm_travel(task, hands, execution.configurations))
    assert travels[0] > travels[1] == 0.0


def test_the_base_is_locked_beside_the_task():
    task = tiny_task(locked_base=["x"], goals=[[4.5, 0.1]], initial_hands="R")
    assert with_locks(task, "task") == task
    assert with_locks(task, "y").locked_base == ("x", "y")
    with pytest.raises(MethodError, match="out of reach") as caught:
        with_locks(load_task("ascending"), "xy")
    assert caught.value.outcome == "infeasible"

    assert TickPlan((3, 0, 2), np.empty((3, 10))).ticks == 4 + 0 + 3


def test_a_hand_that_is_there_already_saves_a_tick():
    """The left hand stands in goal 2 from the start: it is hit as its turn comes."""
    task = changed("two-armed-2", goals=[[4.5, 1.0], [3.5, 0.1]], initial_hands="RL")
    _, execution, _ = solve(Optimum, task, **FEW, most_nodes=0)
    assert execution.hands == "RL"
    assert execution.ticks_by_goal()[1] == 0
    assert execution.corrections == 0


def test_the_shipped_data_is_what_a_folder_of_the_suite_gives(tmp_path):
    task = load_task("ascending")
    names = ("optimum/branch-and-bound", renew_optima.OTHER_SEARCH)
    cells = [cell_on(task, KNOWN[name], **FEW) for name in names]
    study = run_and_write(tmp_path / "results", cells, runs=1)
    (entry,) = renew_optima.collect(study)
    entry = json.loads(json.dumps(entry))
    assert (entry["reward"], entry["bound"]) == (-292, -292)
    assert entry["run_ids"] == sorted(study.runs.run_id)
    assert entry["searches"] == dict.fromkeys(names, -292)
    assert execute(task, movements_from(task, entry["solution"])).reward == -292


def test_the_best_known_is_of_all_runs_on_the_task_and_of_what_is_shipped():
    """Also of runs that are no search; not of another base, and not of one method alone."""
    search = "optimum/branch-and-bound"
    drawn, own = "one-armed/v1/i901", load_task("ascending").model_copy(update={"radius": 0.2})
    tasks = [*map(load_task, ("ascending", "descending", "two-armed-2", drawn))]
    tasks += [own.model_copy(update={"name": name}) for name in ("mine", "yours", "still", "free")]
    rows = [
        ("ascending", search, "", -290, -280, {}),
        ("ascending", "other", "", -200, None, {"base": ""}),  # another task
        ("descending", "other", "", -309, None, {}),
        (drawn, search, "", -300, -250, {}), (drawn, "other", "", -290, None, {}),
        ("mine", search, "", -290, -280, {}), ("mine", "other", "b=2", -288, None, {}),
        ("yours", "other", "", -290, None, {}),  # to be compared with itself
        ("still", search, "other_arm=still", -290, -285, {"other_arm": "still"}),
        ("still", search, "", -290, -280, {}),
        ("free", "one", "", -301, None, {}), ("free", "one", "b=2", -300, None, {}),
    ]  # fmt: skip
    columns = ["task", "method", "setting", "reward", "proven_bound", "parameters"]
    runs = pd.DataFrame(rows, columns=columns).astype({"proven_bound": "Int64"})
    runs = runs.assign(
        status="ok", hands="RRR", parameters=runs.parameters.map(json.dumps),
        run_id=[f"run-{number}" for number in range(len(runs))],
    )  # fmt: skip
    best = optima.best_known(runs, tasks)
    shipped = {name: best_shipped(load_task(name)) for name in ("descending", "two-armed-2")}
    assert {name: (b.reward, b.bound, b.source, b.run_id) for name, b in best.items()} == {
        "ascending": (-290, -292, search, "run-0"),
        "descending": (shipped["descending"].reward, shipped["descending"].bound, "shipped", ""),
        "two-armed-2": (shipped["two-armed-2"].reward, shipped["two-armed-2"].bound, "shipped", ""),
        drawn: (-290, -250, "other", "run-4"),
        "mine": (-288, -280, "other b=2", "run-6"),
        "still": (-290, -280, f"{search} other_arm=still", "run-8"),
        "free": (-300, None, "one b=2", "run-11"),
    }
    assert [name for name, each in best.items() if each.only_here] == ["free"]
    nothing = runs.assign(status="timeout")
    assert {name: each.reward for name, each in optima.best_known(nothing, tasks).items()} == {
        name: best_shipped(load_task(name)).reward for name in ("ascending", *shipped)
    }
