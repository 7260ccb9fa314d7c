"""The corrective process against its definition, and what it must leave alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, MotionModel, Robot, correct, reference
from coartic.robot import HANDS

from .strategies import UNEVEN, configurations

ROBOT = Robot()


@settings(max_examples=60, deadline=None)
@given(
    robot=st.just(ROBOT) | st.just(UNEVEN),
    data=st.data(),
    hand=st.sampled_from(HANDS),
    goal=st.tuples(st.floats(-6, 6), st.floats(-3, 3)),
    locked=st.sampled_from([(), ("x",), ("y",)]),
)
def test_equals_the_matrix_form(robot, data, hand, goal, locked):
    model = MotionModel(max_iterations=400)
    q = data.draw(configurations(robot, -3, 3))
    fast = correct(robot, q, hand, goal, locked_base=locked, model=model)
    slow = reference.correct(robot, q, hand, goal, locked_base=locked, model=model)
    assert fast.converged == slow.converged
    if fast.converged:
        assert fast.iterations == slow.iterations
        np.testing.assert_allclose(fast.q, slow.q, atol=1e-9)


@pytest.mark.parametrize("hand", HANDS)
def test_finds_the_goal_and_moves_nothing_else(hand):
    rng = np.random.default_rng(10)
    other = ROBOT.joints("left" if hand == "right" else "right")
    for _ in range(50):
        q, goal = rng.uniform(-2, 2, 10), rng.uniform(-6, 6, 2)
        found = correct(ROBOT, q, hand, goal)
        assert found.converged
        miss = np.hypot(*(ROBOT.forward_kinematics(found.q, hand) - goal))
        assert miss <= PAPER.correction_tolerance + 1e-12
        np.testing.assert_array_equal(found.q[other], q[other])


@pytest.mark.parametrize("locked", [("x",), ("y",), ("x", "y")])
def test_locked_base_stays(locked):
    q = np.array([0.3, -0.2, *np.full(8, 0.2)])
    found = correct(ROBOT, q, "right", (3.0, 2.0), locked_base=locked)
    assert found.converged
    for coordinate in locked:
        index = "xy".index(coordinate)
        assert found.q[index] == q[index]


def test_unknown_locks_are_refused():
    with pytest.raises(ValueError, match="it may name 'x' and 'y'"):
        correct(ROBOT, np.zeros(10), "right", (3.0, 2.0), locked_base=("Y",))


def test_already_there_costs_no_iteration():
    found = correct(ROBOT, np.zeros(10), "right", (4.505, 0.1))
    assert (found.converged, found.iterations) == (True, 0)


def test_unreachable_goal_is_an_outcome():
    found = correct(ROBOT, np.zeros(10), "right", (9.0, 3.0), locked_base=("x", "y"))
    assert not found.converged
    assert found.iterations <= PAPER.max_iterations


def test_stationary_point_ends_the_descent():
    """A straight arm on a locked base, the goal in line with it: the gradient vanishes."""
    found = correct(ROBOT, np.zeros(10), "right", (2.5, 0.1), locked_base=("x", "y"))
    assert not found.converged
    assert found.iterations == 1
    np.testing.assert_array_equal(found.q, np.zeros(10))


def test_too_large_a_gain_is_an_outcome():
    model = MotionModel(gain=1e6, max_iterations=500)
    assert not correct(ROBOT, np.full(10, 0.3), "right", (5.0, 1.0), model=model).converged
