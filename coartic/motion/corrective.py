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

import numpy as np

from coartic.internal.text import short_repr
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.compiled import entry, inlined, inner, joint_lever, shared
from coartic.motion.movement import check_goal, configuration, largest_square
from coartic.motion.robot_parameters import arm_of, robot_parameters_for
from coartic.motion.slots import (
    GOING,
    compact,
    load,
    near,
    padded_count,
    place,
    runs_for,
    slots_for,
    store,
    winding,
)
from coartic.motion.trigonometry import LARGEST
from coartic.robot import BASE_DOF, HANDS, Array, Hand, Robot

_AT_GOAL, _FAILED, _STUCK = 1.0, 2.0, 3.0  # statuses of a slot


class Correction(NamedTuple):
    """Result of the corrective process (:func:`correct`)."""

    q: Array
    """Configuration found, shape ``(dof,)``, length unit (base) and rad (joints); the last
    iterate if not converged."""
    converged: bool
    """Whether the hand is at the goal, as near as ``MotionModel.correction_tolerance``."""
    iterations: int
    """Descent steps, each with one Jacobian and one forward-kinematics evaluation."""

    def __repr__(self) -> str:
        return short_repr(self, converged=self.converged, iterations=self.iterations, q=self.q)


@inner
def find_statuses(at: Any, count: int, square: float) -> None:
    """Set the status of slots whose hand is near enough, or nowhere."""
    tip = len(at.length)
    for i in range(padded_count(count)):
        error_x = at.goal[0, i] - at.x[tip, i]
        error_y = at.goal[1, i] - at.y[tip, i]
        error = error_x * error_x + error_y * error_y
        status = GOING if error < math.inf else _FAILED
        at.status[i] = _AT_GOAL if error <= square else status


@inlined
def descend(at: Any, count: int, gain: float, free_x: bool, free_y: bool) -> tuple[int, bool]:
    """q += α Jᵀ e in every slot that goes on; how many have ended, and :func:`near`."""
    ended = 0
    far = 0
    tip = len(at.length)
    for i in range(padded_count(count)):
        error_x = at.goal[0, i] - at.x[tip, i]
        error_y = at.goal[1, i] - at.y[tip, i]
        going = at.status[i] == GOING
        x = at.q[0, i] + gain * error_x if free_x else at.q[0, i]
        y = at.q[1, i] + gain * error_y if free_y else at.q[1, i]
        moved = (x != at.q[0, i]) | (y != at.q[1, i])
        at.q[0, i] = x if going else at.q[0, i]
        at.q[1, i] = y if going else at.q[1, i]
        for k in range(tip):
            dx, dy = joint_lever(at.x[:, i], at.y[:, i], k, tip)
            before = at.q[BASE_DOF + k, i]
            turned = before + gain * (dx * error_x + dy * error_y)
            moved |= turned != before
            at.q[BASE_DOF + k, i] = turned if going else before
        # Where nothing moves: a stationary point away from the goal, which it will not leave.
        stuck = going & (not moved)
        at.status[i] = _STUCK if stuck else at.status[i]
        ended += 0 if (going & moved) | (i >= count) else 1
        far += 0 if winding(at.q, i) < LARGEST else 1
    return ended, far == 0


@shared
def correct_slots(slots: Any, count: int, robot_parameters: Any, runs: Any) -> None:
    """Let **A** descend in the first ``count`` slots until each has ended.

    The ``target`` of each run becomes what its slot ends with; the rest of its record says how.
    """
    at, model = slots.at[0], robot_parameters.model
    gain, free_x, free_y = model.gain, robot_parameters.free_x, robot_parameters.free_y
    square = largest_square(model.correction_tolerance)
    is_near, iteration = near(at, count), 0
    while count > 0:
        place(at, count, is_near)
        find_statuses(at, count, square)
        ended = count
        if iteration < model.max_iterations:
            ended, is_near = descend(at, count, gain, free_x, free_y)
        if ended > 0:
            for slot in range(count - 1, -1, -1):
                if at.status[slot] == GOING and iteration < model.max_iterations:
                    continue
                run = runs[at.run[slot]]
                store(at, slot, run.target)
                run.converged = at.status[slot] == _AT_GOAL
                run.iterations = iteration + (at.status[slot] == _STUCK)
                run.evaluations += run.iterations + 1
                count -= 1
                compact(slots.corrected, slot, count)
                ended -= 1
                if ended == 0:
                    break
        iteration += 1


@entry
def correct_kernel(robot_parameters: Any, slots: Any, runs: Any) -> None:
    """Correct the target of the only run."""
    run = runs[0]
    load(slots.at[0], 0, 0, run.target, arm_of(robot_parameters[0], run.hand), run.goal)
    correct_slots(slots, 1, robot_parameters[0], runs)


def correct(
    robot: Robot,
    q: Array,
    hand: Hand,
    goal: tuple[float, float],
    *,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Correction:
    """Jacobian-transpose inverse kinematics, the corrective process: find where a hand is at a
    goal.

    It descends from ``q`` on the distance to the goal. The other arm does not move.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : ndarray, shape (dof,)
        Where to begin, length unit (base) and rad (joints).
    hand : {"left", "right"}
        The hand.
    goal : tuple of float
        Centre of the goal, x and y, length unit.
    locked_base : collection of {"x", "y"}
        Coordinates of the base that do not move.
    model : MotionModel
        The constants; ``gain``, ``correction_tolerance`` and ``max_iterations`` matter.

    Returns
    -------
    Correction
        The configuration, whether it is at the goal, and how many iterations it took. Not to
        converge within ``model.max_iterations`` is an outcome, not an error.

    Raises
    ------
    ValueError
        A shape is wrong, a figure is not finite, there is no such hand, or another lock is named.

    Notes
    -----
    Source: paper, Figure 2 (Whitney 1969; Craig 2004).
    """
    if not set(locked_base) <= {"x", "y"}:
        raise ValueError(f"locked_base is {locked_base!r}; it may name 'x' and 'y'")
    robot.arm(hand)  # refuses what is no hand
    runs = runs_for(1, robot)
    run, figures = runs[0], slice(robot.dof)
    run["target"][figures] = configuration(robot, q)
    run["hand"], run["goal"] = HANDS.index(hand), check_goal(goal)
    robot_parameters = robot_parameters_for(
        robot, locked_base=tuple(locked_base), model=check_model(model)
    )
    correct_kernel(robot_parameters, slots_for(robot), runs)
    return Correction(run["target"][figures].copy(), bool(run["converged"]), int(run["iterations"]))


def explain_failure(
    robot: Robot,
    q: Array,
    hand: Hand,
    goal: tuple[float, float],
    locked_base: Collection[str],
    model: MotionModel,
) -> str:
    """Why the corrective process may have failed from ``q``, as the end of a sentence; empty where
    neither cause that users can mend is there.

    One is a hand whose joints all lie on the line to the goal: none of them moves it nearer. The
    other is a long arm. Near a goal, errors shrink by ``1 - gain σ²``, with the singular values σ
    of the Jacobian J; so the descent is stable while gain × |J|² is below 2, for the largest σ,
    which is that of the stretched arm.
    """
    free = [k for k in range(BASE_DOF) if "xy"[k] not in locked_base]
    arm = robot.joints(hand)
    error = np.subtract(goal, robot.forward_kinematics(q, hand))
    slopes = error @ robot.jacobian(q, hand)[:, [*free, *range(arm.start, arm.stop)]]
    reaches = np.cumsum(robot.arm(hand).links[::-1])
    square = float(reaches @ reaches)
    if np.abs(slopes).max() <= 1e-12 * math.sqrt(square) * math.hypot(*error):
        return ": the arm is straight and points at the goal; bend it"
    if (largest := model.gain * (square + bool(free))) < 2.0:
        return ""
    factor = math.ceil(10.0 * math.sqrt(model.gain * square / (2.0 - model.gain * bool(free)))) / 10
    return (
        f": gain × |J|² of the stretched arm is {largest:.3g}, and above 2 the descent can be "
        f"unstable; divide all lengths by {factor:g}, those of links, goals and radius"
    )
