"""The planner with a receding horizon."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial import KDTree

from coartic import PAPER, load_task
from coartic.baselines.optimum import OptimumSearch
from coartic.baselines.receding_horizon import RecedingHorizon
from tests.support.processes import apart
from tests.support.strategies import solve, tiny_task

FEW = {"graphs": 1, "chains": 1}


def solved(task, method=RecedingHorizon, **parameters):
    """Result and execution of a method on a task."""
    return solve(method, task, **{**FEW, **parameters})[:2]


def in_threads():
    """Targets of plans that threads make at once; a crash of IPOPT would end the process."""
    tasks = [*map(load_task, ["ascending", "descending"])] * 2
    with ThreadPoolExecutor(len(tasks)) as pool:
        plans = pool.map(lambda task: solved(task, nodes=20)[0].solution, tasks)
        return [[m.target.tobytes() for m in plan] for plan in plans]


@pytest.mark.process
def test_plans_are_those_of_one_thread_in_several():
    one, other, *same = apart(in_threads)
    assert [one, other] == same
    alone = solved("ascending", nodes=20)[0].solution
    assert one == [movement.target.tobytes() for movement in alone]


@pytest.mark.parametrize("name", ["descending", "two-armed/v1/d006"])
def test_with_all_goals_in_view_it_is_the_search_for_the_optimum(name):
    task = load_task(name)
    nodes = 60
    result, execution = solved(task, nodes=nodes * len(task.hands), horizon=50, starts=1000)
    reference, best = solved(task, OptimumSearch, nodes=nodes)
    assert execution.reward == best.reward
    assert result.details["windows"] == 1
    assert result.details["solves"] == reference.details["solves"]
    assert result.details["failed_solves"] == 0
    # The plan with the fewest ticks, which need not be the very shortest.
    shortest = reference.details["path_length"]
    assert shortest - 1e-8 <= result.details["path_length"] < shortest + PAPER.step


def planar_task(**changes):
    """A short arm of two links on a fixed base, whose other arm has nothing to do."""
    content = {
        "robot": {"right_links": [1.0, 0.8]},
        "start": {"left": [0.0] * 4, "right": [0.4, 0.9]},
        "goals": [[1.4, 1.3], [-0.6, 1.0]],
        "hands": ["right"],
        "locked_base": ["x", "y"],
    }
    return tiny_task(**{**content, **changes})


def hits_on_grid(task, q, goal):
    """Postures of the two links that hit a goal, ``(n, 2)``, no joint further than 3 from those of
    ``q``: on a grid; the hand by trigonometry."""
    first, second = (np.arange(q[-2 + k] - 3.0, q[-2 + k] + 3.0, 0.01) for k in (0, 1))
    a, b = np.meshgrid(first, second, indexing="ij")
    links, (x, y) = task.robot.right_links, task.robot.right_shoulder
    hand_x = x + links[0] * np.cos(a) + links[1] * np.cos(a + b)
    hand_y = y + links[0] * np.sin(a) + links[1] * np.sin(a + b)
    inside = np.hypot(hand_x - task.goals[goal][0], hand_y - task.goals[goal][1]) <= task.radius
    return np.column_stack([a[inside], b[inside]])


@pytest.mark.parametrize("horizon", [0, 1])
def test_each_movement_is_the_first_of_the_shortest_plan_for_the_goals_in_view(horizon):
    """From where the robot stands, by brute force over postures, or pairs of postures."""
    task = planar_task(goals=[[1.4, 1.3], [-0.6, 1.0], [0.9, 1.1]])
    result, execution = solved(task, horizon=horizon)
    assert result.details["windows"] == 3 - horizon  # the last reaches the last goal
    q = task.q0
    for goal, reached in enumerate(execution.configurations[: 3 - horizon]):
        here, there = (hits_on_grid(task, q, g) for g in (goal, min(goal + horizon, 2)))
        onward = KDTree(there)
        through = np.linalg.norm(here - q[-2:], axis=1) + onward.query(here)[0]
        moved = np.linalg.norm(reached[-2:] - q[-2:])
        assert moved + onward.query(reached[-2:])[0] < through.min() + 0.02
        q = reached


def test_the_shortest_starts_are_polished():
    """Of one graph's chains one has the best hands already."""
    assert solved("two-armed-2", nodes=100, horizon=3, starts=1)[1].hands == "RLRR"
