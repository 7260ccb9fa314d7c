"""The corrective process: Jacobian-transpose descent on the distance to the goal.

The paper's **A** (section *The Corrective Process*, Figure 2). It is informed by
the primary objective only: where the goal is and how the chosen hand's position
depends on the base and the chosen arm. The other arm's joints do not change, and
a locked base coordinate has no column in the Jacobian.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

from coartic.compiled import entry, inner, joint_chain, joint_lever
from coartic.model import PAPER, MotionModel, checked_model
from coartic.movement import configuration, goal_centre, scratch_for
from coartic.robot import Array, Hand, Robot


class Correction(NamedTuple):
    """Outcome of the corrective process."""

    q: Array
    """Configuration found, shape ``(dof,)``; the last iterate if not converged."""
    converged: bool
    iterations: int
    """Descent steps, each with one Jacobian and one forward-kinematics evaluation."""


def _correct(
    q: Any,
    arm: Any,
    goal_x: float,
    goal_y: float,
    free_x: bool,
    free_y: bool,
    model: Any,
    scratch: Any,
) -> tuple[bool, int]:
    """Descend from ``q`` in place; converged, iterations."""
    xs, ys = scratch.xs, scratch.ys
    tip = len(arm.links)
    for iteration in range(model.max_iterations + 1):
        joint_chain(q, arm, xs, ys)
        error_x = goal_x - xs[tip]
        error_y = goal_y - ys[tip]
        error = math.sqrt(error_x * error_x + error_y * error_y)
        if error <= model.correction_tolerance:
            return True, iteration
        if iteration == model.max_iterations or not math.isfinite(error):
            return False, iteration
        moved = False
        if free_x:
            moved = moved or q[0] + model.gain * error_x != q[0]
            q[0] += model.gain * error_x
        if free_y:
            moved = moved or q[1] + model.gain * error_y != q[1]
            q[1] += model.gain * error_y
        for k in range(tip):
            dx, dy = joint_lever(xs, ys, k, tip)
            turned = q[arm.first + k] + model.gain * (dx * error_x + dy * error_y)
            moved = moved or turned != q[arm.first + k]
            q[arm.first + k] = turned
        if not moved:  # a stationary point away from the goal: it will not leave
            return False, iteration + 1
    return False, model.max_iterations


correct_kernel = inner(_correct)
_compiled_correct = entry(_correct)


def correct(
    robot: Robot,
    q: Array,
    hand: Hand,
    goal: tuple[float, float],
    *,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Correction:
    """A configuration that puts ``hand`` at ``goal``, found by descent from ``q``.

    ``locked_base`` holds ``"x"`` and/or ``"y"``. No convergence within
    ``model.max_iterations`` is an outcome, not an error. Raises ValueError for a
    wrong shape, for figures that are not finite, and for other locks. Source: paper,
    Figure 2 (Whitney 1969; Craig 2004).
    """
    if not set(locked_base) <= {"x", "y"}:
        raise ValueError(f"locked_base is {locked_base!r}; it may name 'x' and 'y'")
    position = configuration(robot, q)
    converged, iterations = _compiled_correct(
        position,
        robot.arm(hand),
        *goal_centre(goal),
        "x" not in locked_base,
        "y" not in locked_base,
        checked_model(model),
        scratch_for(robot),
    )
    return Correction(position, bool(converged), int(iterations))
