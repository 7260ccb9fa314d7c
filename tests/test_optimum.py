"""The search for the optimum: what is shipped is found again."""

import numpy as np
import pytest

from coartic import MotionModel, execute, execute_noisy, load_task
from coartic.baselines.optimum import InModel, OptimumSearch, with_locks
from coartic.baselines.receding_horizon import RecedingHorizon
from coartic.baselines.trajectory_optimisation import PathLength
from coartic.method import MethodError
from coartic.motion.execution import other_arm_travel
from coartic.tasks.task import hands_of
from tests.support.strategies import STUCK, changed, solve, tiny_task

FEW = {"graphs": 1, "chains": 1, "nodes": 60}


def test_searches_keep_the_other_arm_still():
    goals = [[2.6, 1.0], [-1.6, 1.0]]
    start = {"left": [2.0, 0.5, 0.5, 0.0], "right": [0.5] * 4}
    task = tiny_task(goals=goals, start=start)
    few = {"nodes": 40, "graphs": 1, "chains": 1}
    travels = []
    for other_arm in ("free", "still"):
        _, execution, _ = solve(OptimumSearch, task, other_arm=other_arm, **few)
        hands = hands_of(execution.hands)
        travels.append(other_arm_travel(task, hands, execution.configurations))
    assert travels[0] > travels[1] == 0.0


def test_the_base_is_locked_beside_the_task():
    task = tiny_task(locked_base=["x"], goals=[[4.5, 0.1]])
    assert with_locks(task, "task") == task
    assert with_locks(task, "y").locked_base == ("x", "y")
    with pytest.raises(MethodError, match="out of reach") as caught:
        with_locks(load_task("ascending"), "xy")
    assert caught.value.outcome == "infeasible"


def test_the_fewest_ticks_of_all_plans_and_roundings_are_found():
    """On a task where a goal takes no movement in the plan with the fewest ticks, which is not the
    shortest plan found: that one has -198, with and without a movement to each goal."""
    goals = [[-0.825, 1.817], [-0.166, 1.024], [1.4, 1.584]]
    task = changed("two-armed/v1/d002", goals=goals, initial_hands="RRR")
    _, execution, _ = solve(OptimumSearch, task, **FEW)
    assert execution.reward >= -197


def test_a_hand_that_is_there_already_saves_a_tick():
    """The left hand stands in goal 2 from the start: it is hit as its turn comes."""
    task = changed("two-armed-2", goals=[[4.5, 1.0], [3.5, 0.1]], initial_hands="RL")
    _, execution, _ = solve(OptimumSearch, task, **FEW)
    assert execution.hands == "RL"
    assert execution.ticks_by_goal()[1] == 0
    assert execution.corrections == 0


RIGHT = {"hands": ["right"], "goals": [[6.004, 0.1]]}
"""The arm is stretched along x: only the base can bring the hand to the right, by 1.404."""


@pytest.mark.parametrize(
    ("world", "ticks"),
    [
        ({}, 142),
        ({"norm": "maximum"}, 142),
        ({"base_weight": 4.0}, 563),
        ({"base_weight": 0.5}, 72),
    ],
)
def test_the_search_in_any_world_finds_what_can_be_computed(world, ticks):
    """Whole steps of the base's weighted way, and the tick of arrival."""
    options = {"evaluations": 300, **FEW, "model": MotionModel(**world)}
    result, execution, session = solve(InModel, tiny_task(**RIGHT), **options)
    assert execution.ticks == ticks
    assert result.solution == execution.movements
    assert session.used == InModel.information


def test_the_search_in_noise_is_better_than_the_shortest_path_and_knows_by_how_much():
    task, noisy = tiny_task(goals=[[4.0, 1.0], [3.5, 1.5]]), MotionModel(motor_noise=0.02)
    few = {**FEW, "model": noisy}
    plan = solve(OptimumSearch, task, **few)[0].solution
    result, *_ = solve(InModel, task, evaluations=1500, executions=50, **few)
    assert (
        result.solution
        == solve(InModel, task, 7, evaluations=1500, executions=50, **few)[0].solution
    )
    ticks = execute_noisy(task, [result.solution, plan], 0.02, 2000, 5)
    errors = ticks.std(axis=1) / np.sqrt(2000)
    better = ticks[1] - ticks[0]
    assert better.mean() > 4 * better.std() / np.sqrt(2000)
    path = result.details["shortest path"]
    least = min(each["end"] for each in result.details.values())
    for told, mean, error in zip((least, path["start"]), ticks.mean(axis=1), errors, strict=True):
        assert abs(told - mean) < 4 * error * np.sqrt(1 + 2000 / 500)


def test_the_search_in_any_world_needs_a_path_or_corrections():
    few = {**FEW, "evaluations": 20}
    result, *_ = solve(InModel, STUCK, **few)  # the corrective process fails
    assert [*result.details] == ["shortest path"]
    far = changed("ascending", goals=[[9e3, 9e3]], locked_base=["x", "y"], initial_hands="R")
    with pytest.raises(MethodError, match="neither a path nor corrections") as caught:
        solve(InModel, far, **few)
    assert caught.value.outcome == "infeasible"


@pytest.mark.parametrize("method", [OptimumSearch, PathLength, RecedingHorizon])
def test_shortest_paths_are_those_of_the_world(method):
    """Where the base is dear it moves less, and each world's plan is the better one there."""
    task = tiny_task(goals=[[5.0, 1.0], [4.0, -1.5]], hands=["right"])
    few = {"graphs": 1, "chains": 2, "nodes": 40}
    worlds = [MotionModel(base_weight=weight, motor_noise=0.01) for weight in (0.25, 4.0)]
    solutions = [solve(method, task, model=world, **few)[0].solution for world in worlds]
    ways = []
    for own, world in enumerate(worlds):
        made = [execute(task, each, model=world.without_noise()) for each in solutions]
        assert made[own].ticks < made[1 - own].ticks
        corners = np.vstack([task.q0, made[own].configurations])
        ways.append(np.linalg.norm(np.diff(corners[:, :2], axis=0), axis=1).sum())
    assert ways[0] > 1.5 * ways[1]
