"""The kinematic module against analytic poses, finite differences and its own laws."""

import casadi
import numpy as np
import pytest

from coartic.robot import HANDS, Robot
from tests.support.strategies import UNEVEN

PAPER_ROBOT = Robot()
ROBOTS = [PAPER_ROBOT, UNEVEN]


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("hand", HANDS)
def test_hands_and_jacobians_against_complex_exponentials_and_automatic_derivatives(robot, hand):
    """Of configurations at once; and of CasADi's symbols, one by one."""
    q = np.random.default_rng(1).uniform(-20, 20, (4, 10, robot.dof))
    shoulder = complex(*(robot.left_shoulder if hand == "left" else robot.right_shoulder))
    links = np.array(robot.left_links if hand == "left" else robot.right_links)
    levers = links * np.exp(1j * np.cumsum(q[..., robot.joints(hand)], axis=-1))
    places = (q[..., :1] + 1j * q[..., 1:2] + shoulder) + np.cumsum(levers, axis=-1)
    joints, tips = robot.joint_positions(q, hand), robot.forward_kinematics(q, hand)
    np.testing.assert_allclose(joints[..., 1:, :] @ (1, 1j), places, atol=1e-12, rtol=0)
    np.testing.assert_array_equal(joints[..., -1, :], tips)
    shoulders = q[..., :2] + (shoulder.real, shoulder.imag)
    np.testing.assert_allclose(joints[..., 0, :], shoulders, atol=1e-12, rtol=0)
    jacobians = robot.jacobian(q, hand)
    for one, both in zip(robot.linearised(q, hand), (tips, jacobians), strict=True):
        np.testing.assert_array_equal(one, both)
    symbol = casadi.SX.sym("q", robot.dof)
    position = robot.symbolic_hand(symbol, hand)
    symbolic = casadi.Function("f", [symbol], [position, casadi.jacobian(position, symbol)])
    for row in np.ndindex(q.shape[:2]):
        tip, automatic = (np.array(value) for value in symbolic(q[row]))
        np.testing.assert_allclose(tip.ravel(), tips[row], atol=1e-12, rtol=0)
        np.testing.assert_allclose(automatic, jacobians[row], atol=1e-12, rtol=0)


@pytest.mark.parametrize("hand", HANDS)
def test_the_jerk_of_a_hand_is_its_third_derivative(hand):
    """By CasADi's differentiation, along a cubic in time."""
    derivatives = np.random.default_rng(3).normal(size=(4, UNEVEN.dof))
    t = casadi.SX.sym("t")
    q = [casadi.DM(each) for each in derivatives]
    place = UNEVEN.symbolic_hand(q[0] + q[1] * t + q[2] * t**2 / 2 + q[3] * t**3 / 6, hand)
    for _ in range(3):
        place = casadi.jacobian(place, t)
    due = casadi.Function("f", [t], [place])(0)
    jerk = UNEVEN.symbolic_hand_jerk(q, hand)
    np.testing.assert_allclose(np.array(casadi.evalf(jerk)), np.array(due), rtol=1e-10)


def test_the_outline_of_the_base_is_around_its_place():
    outline = PAPER_ROBOT.base_outline(np.array([1.0, 2.0, *np.zeros(8)]))
    np.testing.assert_allclose(outline, [[0.5, 1.9], [1.5, 1.9], [1.5, 2.1], [0.5, 2.1]])


def test_names_and_shapes():
    assert UNEVEN.joint_names == (
        *("base_x", "base_y", "left_1"),
        *(f"right_{k}" for k in range(1, 5)),
    )
    with pytest.raises(ValueError, match=r"shape \(9,\); it must be \(\.\.\., 10\)"):
        PAPER_ROBOT.forward_kinematics(np.zeros(9), "left")
