"""Null-space control: each control step against its statement, and the paths that come of it."""

import numpy as np
import pytest

from coartic import Robot, load_task
from coartic.baselines.controllers import Aim
from coartic.baselines.nullspace_qp import HandController, LeastMotion
from coartic.method import Session

ROBOT = Robot()


@pytest.mark.parametrize("locked", [(), ("y",), ("x", "y")])
def test_a_step_is_the_nearest_to_the_preferred_that_moves_the_hand_straight(locked):
    task = load_task("two-armed-2").model_copy(update={"locked_base": locked})
    rng = np.random.default_rng(3)

    class Preferring(HandController):
        def preferred(self, q, memory, steps):
            return memory

    for _ in range(10):
        controller = Preferring(Session(task, 0, LeastMotion.information, trusted=True), task, 5)
        q, wanted = rng.uniform(-1, 1, ROBOT.dof), rng.normal(size=len(controller.moving)) / 3
        (solution, preferred, _), aim = controller.step(q, (Aim("left", 2),), wanted, True), 2
        jacobian = ROBOT.jacobian(q, "left")[:, controller.moving]
        error = task.goal_array[aim] - ROBOT.forward_kinematics(q, "left")
        inverse = np.linalg.pinv(jacobian)
        velocity = error / np.linalg.norm(inverse @ error)  # the least changes are a step long
        nearest = wanted + inverse @ (velocity - jacobian @ wanted)
        np.testing.assert_allclose(preferred, wanted)
        np.testing.assert_allclose(solution.changes, nearest, rtol=0, atol=2e-3)
