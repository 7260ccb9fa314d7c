"""The kinematic module against analytic poses, finite differences and its own laws."""

import casadi
import numpy as np
import pytest

from coartic.motion.compile import entry, joint_lever
from coartic.motion.trigonometry import joint_chain
from coartic.robot import HANDS, Robot
from tests.support.strategies import UNEVEN

PAPER_ROBOT = Robot()
ROBOTS = [PAPER_ROBOT, UNEVEN]


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("hand", HANDS)
def test_forward_kinematics_against_complex_exponentials(robot, hand):
    rng = np.random.default_rng(1)
    q = rng.uniform(-4, 4, (50, robot.dof))
    shoulder = complex(*(robot.left_shoulder if hand == "left" else robot.right_shoulder))
    links = np.array(robot.left_links if hand == "left" else robot.right_links)
    angles = np.cumsum(q[:, robot.joints(hand)], axis=1)
    tips = q[:, 0] + 1j * q[:, 1] + shoulder + (links * np.exp(1j * angles)).sum(axis=1)
    position = robot.forward_kinematics(q, hand)
    np.testing.assert_allclose(position, np.stack([tips.real, tips.imag], axis=1), atol=1e-13)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("hand", HANDS)
def test_three_worlds_agree(robot, hand):
    """NumPy, on all rows at once, CasADi (its own automatic differentiation included) and the
    kernels."""
    symbol = casadi.SX.sym("q", robot.dof)
    position = robot.symbolic_hand(symbol, hand)
    symbolic = casadi.Function("f", [symbol], [position, casadi.jacobian(position, symbol)])

    @entry
    def compiled(q, arm, xs, ys, jacobian):
        joint_chain(q, arm, xs, ys)
        tip = len(arm.links)
        for k in range(tip):
            jacobian[0, arm.first + k], jacobian[1, arm.first + k] = joint_lever(xs, ys, k, tip)

    arm, every = robot.arm(hand), np.random.default_rng(3).uniform(-20, 20, (4, 50, robot.dof))
    joints, jacobians = robot.joint_positions(every, hand), robot.jacobian(every, hand)
    tips, again = robot.linearised(every, hand)
    np.testing.assert_array_equal(tips, robot.forward_kinematics(every, hand))
    np.testing.assert_array_equal(again, jacobians)
    for row in np.ndindex(every.shape[:2]):
        f, automatic = (np.array(value) for value in symbolic(every[row]))
        np.testing.assert_allclose(f.ravel(), tips[row], atol=1e-12, rtol=0)
        np.testing.assert_allclose(automatic, jacobians[row], atol=1e-12, rtol=0)
        places, columns = np.empty((2, len(arm.links) + 1)), np.eye(2, robot.dof)
        compiled(every[row], arm, *places, columns)
        np.testing.assert_allclose(places.T, joints[row], atol=1e-12, rtol=0)
        np.testing.assert_allclose(columns, jacobians[row], atol=1e-12, rtol=0)


def test_base_outline():
    outline = PAPER_ROBOT.base_outline(np.array([1.0, 2.0, *np.zeros(8)]))
    np.testing.assert_allclose(outline, [[0.5, 1.9], [1.5, 1.9], [1.5, 2.1], [0.5, 2.1]])
    # The shoulders sit on its top corners.
    q = np.zeros(10)
    np.testing.assert_allclose(
        PAPER_ROBOT.base_outline(q)[2], PAPER_ROBOT.joint_positions(q, "right")[0]
    )


def test_names_and_shapes():
    assert UNEVEN.joint_names == (
        *("base_x", "base_y", "left_1"),
        *(f"right_{k}" for k in range(1, 5)),
    )
    with pytest.raises(ValueError, match=r"shape \(9,\).*needs \(\.\.\., 10\)"):
        PAPER_ROBOT.forward_kinematics(np.zeros(9), "left")
