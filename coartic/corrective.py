"""The corrective process: Jacobian-transpose descent on the distance to the goal.

The paper's **A** (section *The Corrective Process*, Figure 2). It is informed by
the primary objective only: where the goal is and how the chosen hand's position
depends on the base and the chosen arm. The other arm's joints do not change, and
a locked base coordinate has no column in the Jacobian.

Beyond the paper, and off by default, it can be informed of a secondary objective as
well: to change the posture as little as possible. In the nullspace of the hand's
Jacobian, where it cannot disturb the hand to first order, it then pulls towards the
configuration in which the correction started (Liegeois 1977; proposed in the paper's
Discussion after Torres & Zipser 2002).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

from coartic.compiled import entry, inner, joint_chain, joint_lever
from coartic.model import PAPER, MotionModel, checked_model
from coartic.movement import checked_goal, configuration, scratch_for
from coartic.robot import Array, Hand, Robot

# Of the smaller pivot of J Jᵀ, in units of its trace: nothing where J has full rank, above
# rounding where it has not (a straight arm on a locked base).
_DAMPING = 1e-14


class Corrector(NamedTuple):
    """How the corrective process may descend."""

    free_x: bool
    """Whether the base moves in x."""
    free_y: bool
    nullspace_gain: float = 0.0
    """β, 0 to 1 per iteration; 0 is the paper's process."""


class Correction(NamedTuple):
    """Outcome of the corrective process."""

    q: Array
    """Configuration found, shape ``(dof,)``; the last iterate if not converged."""
    converged: bool
    iterations: int
    """Descent steps, each with one Jacobian and one forward-kinematics evaluation."""


@inner
def _solve(larger: float, mixed: float, smaller: float, a: float, b: float) -> tuple[float, float]:
    """Solve [[larger, mixed], [mixed, smaller]] v = (a, b), positive semidefinite."""
    ratio = mixed / larger
    pivot = smaller - ratio * mixed + _DAMPING * (larger + smaller)
    second = (b - ratio * a) / pivot
    return (a - mixed * second) / larger, second


@inner
def _pull(q: Any, start: Any, joint: int, disturbing: float, gain: float) -> bool:
    """Pull a joint towards its start, less the part that disturbs the hand; if it moved."""
    before = q[joint]
    q[joint] += gain * (start[joint] - before - disturbing)
    return bool(q[joint] != before)


@inner
def _stay(q: Any, start: Any, arm: Any, how: Any, scratch: Any) -> bool:
    """q += β N(q) (start - q) for N = I - J⁺J, given the chain of ``q``; whether it moved.

    N r = r - Jᵀ(J Jᵀ)⁻¹ J r for r = start - q. It is never longer than r, so that a
    singular J does no harm.
    """
    xs, ys = scratch.xs, scratch.ys
    tip = len(arm.links)
    xx = 1.0 if how.free_x else 0.0  # J Jᵀ
    yy = 1.0 if how.free_y else 0.0
    xy = 0.0
    hand_x = start[0] - q[0] if how.free_x else 0.0  # J r
    hand_y = start[1] - q[1] if how.free_y else 0.0
    for k in range(tip):
        dx, dy = joint_lever(xs, ys, k, tip)
        away = start[arm.first + k] - q[arm.first + k]
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
        hand_x += dx * away
        hand_y += dy * away
    if xx >= yy:
        x, y = _solve(xx, xy, yy, hand_x, hand_y)
    else:
        y, x = _solve(yy, xy, xx, hand_y, hand_x)

    moved = False
    if how.free_x:
        moved = _pull(q, start, 0, x, how.nullspace_gain)
    if how.free_y:
        moved = _pull(q, start, 1, y, how.nullspace_gain) or moved
    for k in range(tip):
        dx, dy = joint_lever(xs, ys, k, tip)
        moved = _pull(q, start, arm.first + k, dx * x + dy * y, how.nullspace_gain) or moved
    return moved


def _correct(q: Any, arm: Any, goal: Any, how: Any, model: Any, scratch: Any) -> tuple[bool, int]:
    """Descend from ``q`` in place; converged, iterations."""
    xs, ys, start = scratch.xs, scratch.ys, scratch.start
    tip = len(arm.links)
    if how.nullspace_gain > 0.0:
        start[:] = q
    for iteration in range(model.max_iterations + 1):
        joint_chain(q, arm, xs, ys)
        error_x = goal.x - xs[tip]
        error_y = goal.y - ys[tip]
        error = math.sqrt(error_x * error_x + error_y * error_y)
        if error <= model.correction_tolerance:
            return True, iteration
        if iteration == model.max_iterations or not math.isfinite(error):
            return False, iteration
        moved = False
        if how.nullspace_gain > 0.0:
            moved = _stay(q, start, arm, how, scratch)
        if how.free_x:
            moved = moved or q[0] + model.gain * error_x != q[0]
            q[0] += model.gain * error_x
        if how.free_y:
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


@inner
def shift_kernel(
    target: Any, q: Any, arm: Any, goal: Any, mask: Any, length: float, scratch: Any
) -> None:
    """Shift ``target`` by ``length`` along the step that **A** would make from ``q``.

    Only on the joints of ``mask``; by nothing where **A** would not move them.
    """
    xs, ys, step = scratch.xs, scratch.ys, scratch.start
    tip = len(arm.links)
    joint_chain(q, arm, xs, ys)
    error_x = goal.x - xs[tip]
    error_y = goal.y - ys[tip]
    step[:] = 0.0
    step[0] = error_x
    step[1] = error_y
    for k in range(tip):
        dx, dy = joint_lever(xs, ys, k, tip)
        step[arm.first + k] = dx * error_x + dy * error_y
    square = 0.0
    for j in range(len(q)):
        if mask[j]:
            square += step[j] * step[j]
    if square > 0.0:
        scale = length / math.sqrt(square)
        for j in range(len(q)):
            if mask[j]:
                target[j] += scale * step[j]


def correct(
    robot: Robot,
    q: Array,
    hand: Hand,
    goal: tuple[float, float],
    *,
    locked_base: Collection[str] = (),
    nullspace_gain: float = 0.0,
    model: MotionModel = PAPER,
) -> Correction:
    """A configuration that puts ``hand`` at ``goal``, found by descent from ``q``.

    ``locked_base`` holds ``"x"`` and/or ``"y"``. ``nullspace_gain`` is β, 0 to 1 per
    iteration: ``q ← q + α Jᵀ e + β N(q) (q_start - q)``, N the projector on the
    nullspace of J; 0 is the paper's process. No convergence within
    ``model.max_iterations`` is an outcome, not an error. Raises ValueError for a
    wrong shape, for figures that are not finite, for other locks and other gains.
    Source: paper, Figure 2 (Whitney 1969; Craig 2004); nullspace: Liegeois (1977).
    """
    if not set(locked_base) <= {"x", "y"}:
        raise ValueError(f"locked_base is {locked_base!r}; it may name 'x' and 'y'")
    if not 0.0 <= nullspace_gain <= 1.0:
        raise ValueError(f"nullspace_gain is {nullspace_gain}; it must be 0 to 1")
    position = configuration(robot, q)
    converged, iterations = _compiled_correct(
        position,
        robot.arm(hand),
        checked_goal(goal),
        Corrector("x" not in locked_base, "y" not in locked_base, float(nullspace_gain)),
        checked_model(model),
        scratch_for(robot),
    )
    return Correction(position, bool(converged), int(iterations))
