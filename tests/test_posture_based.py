"""Posture-based planning against closed forms and an independent optimiser."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coartic.baselines.posture_based import OneGoal, PosturePlanner, TwoGoals
from coartic.method import Session
from tests.support.strategies import least_cost, solve, steps_from, tiny_task, uneven_task

ACCURACY = 0.09  # θ^g − θ^a
STEP = 0.01  # m
QUICK = {"stored": 20, "rounds": 5}


def shortest(task, hands):
    """Least joint-space distance through the goals' discs, from three random starts."""
    moving = np.zeros((len(hands), task.robot.dof), bool)
    moving[:, :2] = [axis not in task.locked_base for axis in "xy"]
    for row, hand in zip(moving, hands, strict=True):
        row[task.robot.joints(hand)] = True
    starts = np.random.default_rng(7).normal(0, 0.6, (3, moving.sum()))
    return least_cost(task, hands, moving, starts, radius=ACCURACY)


def bent(**changes):
    start = {"left": [2.2, -0.4, -0.3, 0.2], "right": [0.8, 0.4, -0.3, 0.5]}
    return tiny_task(start=start, **changes)


@pytest.mark.parametrize(
    ("task", "hand"),
    [
        (bent(goals=[[-2.0, -1.5]], initial_hands="L", hands=["left"]), "left"),
        (bent(goals=[[3.0, -2.0]], hands=["right"], locked_base=["y"]), "right"),
        (uneven_task(goals=[[-0.5, 2.0]], hands=["right"]), "right"),
    ],
    ids=["behind", "rail", "uneven"],
)
def test_a_dense_store_gives_the_nearest_posture(task, hand):
    result, *_ = solve(OneGoal, task, stored=1000, rounds=100)
    (movement,) = result.solution
    assert movement.hand == hand
    travelled = float(np.linalg.norm(movement.target - task.q0))
    assert travelled == pytest.approx(shortest(task, [hand]), abs=0.01)


SHOULDER, REACH = 0.5, 1.0


def one_link(left, right, second=0.0):
    """One link an arm on a fixed base: each joint angle is a position on a circle.

    Goal 1 is where the circles meet: left angle 60°, right angle 120°. Goal 2 is the
    right hand's at angle ``second``.
    """
    meet = [0.0, 0.1 + math.sqrt(REACH**2 - SHOULDER**2)]
    return tiny_task(
        robot={"left_links": [REACH], "right_links": [REACH]},
        goals=[meet, [SHOULDER + math.cos(second), 0.1 + math.sin(second)]],
        locked_base=["x", "y"],
        start={"left": [left], "right": [right]},
    )


def ticks(angle):
    """Of a movement of one joint that starts so far from the goal's centre."""
    rim = 2 * math.asin(0.1 / 2 / REACH)
    return math.ceil((angle - rim) / STEP) + 1


def test_looking_ahead_takes_the_other_hand_where_that_pays():
    left, right = math.radians(60 + 45), math.radians(120 - 40)
    task = one_link(left, right)
    one, *_ = solve(OneGoal, task)
    assert [movement.hand for movement in one.solution] == ["right", "right"]
    two, execution, _ = solve(TwoGoals, task)
    assert [movement.hand for movement in two.solution] == ["left", "right"]
    assert two.details["expected_ticks"] == [ticks(math.radians(45)), ticks(right)]
    reached = right + (ticks(math.radians(40)) - 1) * STEP
    assert one.details["expected_ticks"] == [ticks(math.radians(40)), ticks(reached)]
    assert -sum(two.details["expected_ticks"]) == execution.reward


def test_the_most_promising_pair_is_the_cheapest_of_all():
    """The arm that the second posture does not use stays where the first has it."""
    task, rng = bent(goals=[[5.0, 1.0], [4.0, 2.5]]), np.random.default_rng(0)
    session = Session(task, 0, TwoGoals.information, trusted=True)
    planner = PosturePlanner(session, TwoGoals.Parameters(**QUICK), 2)
    layers = [task.q0 + rng.normal(size=(12, 10)) for _ in range(2)]
    every = [np.array([first, [*second[:6], *first[6:]]])
             for first, second in itertools.product(*layers)]  # fmt: skip

    def cost(pair):
        return np.linalg.norm(steps_from(task.q0, pair), axis=1).sum()

    found = planner.most_promising(("right", "left"), layers)
    assert cost(found) == pytest.approx(min(map(cost, every)))


@settings(max_examples=10)
@given(
    st.lists(st.tuples(st.floats(-8, 8), st.floats(-3, 3)), min_size=1, max_size=3),
    st.sampled_from([[], ["x"], ["y"]]),
    st.sampled_from([OneGoal, TwoGoals]),
    st.integers(0, 99),
)
@example(goals=[(2.7421875, 0.5), (0.0, 0.0)], locked=[], method=OneGoal, seed=56)
def test_what_is_planned_is_what_happens(goals, locked, method, seed):
    """The ticks are those expected, and the other arm stands still, up to rounding: the planner
    computes points in another order than the executor."""
    if locked == ["x"]:
        goals = [(x / 3, y) for x, y in goals]
    task = bent(goals=[list(goal) for goal in goals], initial_hands="best-of-all")
    task = task.model_copy(update={"locked_base": tuple(locked)})
    result, execution, _ = solve(method, task, seed, **QUICK)  # refuses a locked base that moves
    assert execution.completed
    assert execution.corrections == 0
    assert list(execution.ticks_by_goal()) == result.details["expected_ticks"]
    before = [task.q0, *execution.configurations]
    for movement, q in zip(result.solution, before, strict=False):
        miss = task.robot.forward_kinematics(movement.target, movement.hand)
        assert math.dist(miss, task.goals[movement.goal - 1]) <= ACCURACY + 1e-12
        other = task.robot.joints("left" if movement.hand == "right" else "right")
        np.testing.assert_allclose(movement.target[other], q[other], rtol=0, atol=1e-12)
