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

from coartic.model import PAPER, MotionModel, checked_model
from coartic.motion.compiled import entry, inlined, inner, joint_chain, joint_lever, lanewise
from coartic.motion.lanes import (
    GOING,
    board,
    copy_lanes,
    fill,
    lanes_for,
    leave,
    near,
    padded,
    place,
    runs_for,
    winding,
)
from coartic.motion.movement import checked_goal, configuration, largest_square
from coartic.motion.trigonometry import LARGEST
from coartic.robot import BASE_DOF, Array, Hand, Robot

_CONVERGED, _FAILED, _STUCK = 1.0, 2.0, 3.0  # fates of a lane
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
def solve_semidefinite(
    larger: float, mixed: float, smaller: float, a: float, b: float
) -> tuple[float, float]:
    """Solve [[larger, mixed], [mixed, smaller]] v = (a, b), positive semidefinite."""
    ratio = mixed / larger
    pivot = smaller - ratio * mixed + _DAMPING * (larger + smaller)
    second = (b - ratio * a) / pivot
    return (a - mixed * second) / larger, second


@inner
def pull_joint(q: Any, start: Any, joint: int, disturbing: float, gain: float) -> bool:
    """Pull a joint towards its start, less the part that disturbs the hand; if it moved."""
    before = q[joint]
    q[joint] += gain * (start[joint] - before - disturbing)
    return bool(q[joint] != before)


@inner
def pull_to_start(q: Any, start: Any, xs: Any, ys: Any, how: Any) -> bool:
    """q += β N(q) (start - q) for N = I - J⁺J, given the chain of ``q``; whether it moved.

    N r = r - Jᵀ(J Jᵀ)⁻¹ J r for r = start - q. It is never longer than r, so that a
    singular J does no harm.
    """
    tip = len(xs) - 1
    xx = 1.0 if how.free_x else 0.0  # J Jᵀ
    yy = 1.0 if how.free_y else 0.0
    xy = 0.0
    hand_x = start[0] - q[0] if how.free_x else 0.0  # J r
    hand_y = start[1] - q[1] if how.free_y else 0.0
    for k in range(tip):
        dx, dy = joint_lever(xs, ys, k, tip)
        away = start[BASE_DOF + k] - q[BASE_DOF + k]
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
        hand_x += dx * away
        hand_y += dy * away
    if xx >= yy:
        x, y = solve_semidefinite(xx, xy, yy, hand_x, hand_y)
    else:
        y, x = solve_semidefinite(yy, xy, xx, hand_y, hand_x)

    moved = False
    if how.free_x:
        moved = pull_joint(q, start, 0, x, how.nullspace_gain)
    if how.free_y:
        moved = pull_joint(q, start, 1, y, how.nullspace_gain) or moved
    for k in range(tip):
        dx, dy = joint_lever(xs, ys, k, tip)
        moved = pull_joint(q, start, BASE_DOF + k, dx * x + dy * y, how.nullspace_gain) or moved
    return moved


@inner
def stay_near(at: Any, count: int, how: Any) -> None:
    """Pull every lane that goes on towards its start (:func:`pull_to_start`)."""
    for i in range(count):
        if at.fate[i] == GOING:
            moved = pull_to_start(at.q[:, i], at.start[:, i], at.x[:, i], at.y[:, i], how)
            at.pulled[i] = 1.0 if moved else 0.0


@lanewise
def find_fates(at: Any, count: int, goal: Any, square: float) -> None:
    """Set the fate of lanes whose hand is near enough, or nowhere."""
    tip = len(at.length)
    for i in range(padded(count)):
        error_x = goal.x - at.x[tip, i]
        error_y = goal.y - at.y[tip, i]
        error = error_x * error_x + error_y * error_y
        fate = GOING if error < math.inf else _FAILED
        at.fate[i] = _CONVERGED if error <= square else fate


@inlined
def descend(at: Any, count: int, goal: Any, how: Any, model: Any) -> tuple[int, bool]:
    """q += α Jᵀ e in every lane that goes on; how many have ended, and :func:`near`."""
    ended = 0
    far = 0
    tip = len(at.length)
    for i in range(padded(count)):
        error_x = goal.x - at.x[tip, i]
        error_y = goal.y - at.y[tip, i]
        going = at.fate[i] == GOING
        x = at.q[0, i] + model.gain * error_x if how.free_x else at.q[0, i]
        y = at.q[1, i] + model.gain * error_y if how.free_y else at.q[1, i]
        moved = (x != at.q[0, i]) | (y != at.q[1, i]) | (at.pulled[i] != 0.0)
        at.q[0, i] = x if going else at.q[0, i]
        at.q[1, i] = y if going else at.q[1, i]
        for k in range(tip):
            dx, dy = joint_lever(at.x[:, i], at.y[:, i], k, tip)
            before = at.q[BASE_DOF + k, i]
            turned = before + model.gain * (dx * error_x + dy * error_y)
            moved |= turned != before
            at.q[BASE_DOF + k, i] = turned if going else before
        # Where nothing moves: a stationary point away from the goal, which it will not leave.
        stuck = going & (not moved)
        at.fate[i] = _STUCK if stuck else at.fate[i]
        ended += 0 if (going & moved) | (i >= count) else 1
        far += 0 if winding(at.q, i) < LARGEST else 1
    return ended, far == 0


@inner
def correct_lanes(lanes: Any, count: int, goal: Any, how: Any, model: Any, runs: Any) -> None:
    """Let **A** descend in the first ``count`` lanes until each has ended.

    The ``target`` of each run becomes what its lane ends with; the rest of its record says how.
    """
    at = lanes.at
    if how.nullspace_gain > 0.0:
        copy_lanes(at.q, at.start)
    square = largest_square(model.correction_tolerance)
    is_near = near(at, count)
    iteration = 0
    while count > 0:
        place(at, count, is_near)
        find_fates(at, count, goal, square)
        ended = count
        if iteration < model.max_iterations:
            if how.nullspace_gain > 0.0:
                stay_near(at, count, how)
            ended, is_near = descend(at, count, goal, how, model)
        if ended > 0:
            for lane in range(count - 1, -1, -1):
                if at.fate[lane] == GOING and iteration < model.max_iterations:
                    continue
                run = runs[at.run[lane]]
                leave(at, lane, run.target)
                run.converged = at.fate[lane] == _CONVERGED
                run.iterations = iteration + (at.fate[lane] == _STUCK)
                run.evaluations += run.iterations + 1
                count -= 1
                fill(lanes.corrected, lane, count)
                ended -= 1
                if ended == 0:
                    break
        iteration += 1


@entry
def correct_kernel(arm: Any, goal: Any, how: Any, model: Any, lanes: Any, runs: Any) -> None:
    """Correct the target of the only run."""
    board(lanes.at, 0, 0, runs[0].target, arm)
    correct_lanes(lanes, 1, goal, how, model, runs)


@inner
def shift_kernel(
    target: Any, q: Any, arm: Any, goal: Any, mask: Any, length: float, scratch: Any
) -> None:
    """Shift ``target`` by ``length`` along the step that **A** would make from ``q``.

    Only on the joints of ``mask``; by nothing where **A** would not move them.
    """
    xs, ys, step = scratch.xs, scratch.ys, scratch.step
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
    runs = runs_for(1, robot)
    run, figures = runs[0], slice(robot.dof)
    run["target"][figures] = configuration(robot, q)
    correct_kernel(
        robot.arm(hand),
        checked_goal(goal),
        Corrector("x" not in locked_base, "y" not in locked_base, float(nullspace_gain)),
        checked_model(model),
        lanes_for(robot),
        runs,
    )
    return Correction(run["target"][figures].copy(), bool(run["converged"]), int(run["iterations"]))
