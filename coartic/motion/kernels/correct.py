"""The corrective process **A**: find a configuration that hits a goal.

The process is Jacobian-transpose inverse kinematics: gradient descent on half the squared distance
of the hand from the goal, ``q += α Jᵀ e``, where e is the vector from the hand to the goal (paper,
section *The Corrective Process*, Figure 2). It uses only the primary objective: where the goal is,
and how the position of the chosen hand depends on the base and the chosen arm. The joints of the
other arm do not change, and a locked base coordinate has no column in the Jacobian.

The kernels make the iterations of the process for many arms at once.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.motion.kernels import trigonometry
from coartic.motion.kernels.compile import entry, fill_row, inlined, inner, joint_lever, shared
from coartic.motion.kernels.move import largest_square, move_acting
from coartic.motion.kernels.noise import MAX_CORRECTIONS, miss_correction
from coartic.motion.kernels.slots import (
    GOING,
    Batch,
    RobotRecord,
    SlotArrays,
    arm_of,
    compact,
    find_positions,
    have_small_angles,
    load,
    padded_count,
    store,
    winding,
)
from coartic.robot import BASE_DOF

_RANK = 1e-12  # squared ratio of singular values up to which the smaller one counts as 0
_AT_GOAL, _FAILED, _STUCK = 1.0, 2.0, 3.0  # status of a slot whose correction has ended


@inner
def _find_statuses(slots: SlotArrays, count: int, square: float) -> None:
    """Set the status of corrections in the first ``count`` slots, in place.

    The status is

    - at the goal, if the squared distance of the hand from the goal's centre is at most ``square``
      (in squared length units);
    - failed, if that distance is not finite;
    - going on, otherwise.
    """
    tip = len(slots.length)
    for i in range(padded_count(count)):
        error_x = slots.goal[0, i] - slots.x[tip, i]
        error_y = slots.goal[1, i] - slots.y[tip, i]
        error = error_x * error_x + error_y * error_y
        status = GOING if error < math.inf else _FAILED
        slots.status[i] = _AT_GOAL if error <= square else status


@inlined
def descend(slots: SlotArrays, count: int, robot: RobotRecord) -> tuple[int, bool]:
    """Make an iteration of the corrective process in the first ``count`` slots, in place.

    Only the configurations of slots whose status is *going on* change. If the iteration does not
    change the configuration of such a slot, the status becomes *stuck*. Return how many slots have
    ended, and whether the absolute values of all link angles are certainly below 1e5 rad
    afterwards.
    """
    ended = 0
    large = 0
    tip = len(slots.length)
    gain, free_x, free_y = robot.model.gain, robot.free_x, robot.free_y
    for i in range(padded_count(count)):
        error_x = slots.goal[0, i] - slots.x[tip, i]
        error_y = slots.goal[1, i] - slots.y[tip, i]
        going = slots.status[i] == GOING
        x = slots.q[0, i] + gain * error_x if free_x else slots.q[0, i]
        y = slots.q[1, i] + gain * error_y if free_y else slots.q[1, i]
        moved = (x != slots.q[0, i]) | (y != slots.q[1, i])
        slots.q[0, i] = x if going else slots.q[0, i]
        slots.q[1, i] = y if going else slots.q[1, i]
        for k in range(tip):
            dx, dy = joint_lever(slots.x[:, i], slots.y[:, i], k, tip)
            angle = slots.q[BASE_DOF + k, i]
            turned = angle + gain * (dx * error_x + dy * error_y)
            moved |= turned != angle
            slots.q[BASE_DOF + k, i] = turned if going else angle
        # A stationary point outside the goal, which the process will not leave.
        stuck = going & (not moved)
        slots.status[i] = _STUCK if stuck else slots.status[i]
        ended += 0 if (going & moved) | (i >= count) else 1
        large += 0 if winding(slots.q, i) < trigonometry.MAX_ANGLE else 1
    return ended, large == 0


@shared
def correct_slots(batch: Batch, count: int, robot: RobotRecord) -> None:
    """Iterate the paper's corrective process in the first ``count`` slots until each has ended.

    A correction ends when it has converged or failed. It fails if the distance of the hand from the
    goal is not finite, if the configuration no longer changes, or after ``max_iterations``
    iterations. The caller loads the slots by :func:`load`; they are free afterwards. In the record
    of each run

    - ``converged`` is set, and ``iterations`` grows;
    - ``target`` gets the base and the arm of the last iterate, while the entries of the other arm
      do not change;
    - ``evaluations`` grows by the number of iterations plus 1.
    """
    slots, iteration = batch.slots[0], 0
    square = largest_square(robot.model.correction_tolerance)
    small_angles = have_small_angles(slots, count)
    while count > 0:
        find_positions(slots, count, small_angles)
        _find_statuses(slots, count, square)
        ended = count
        if iteration < robot.model.max_iterations:
            ended, small_angles = descend(slots, count, robot)
        if ended > 0:
            for slot in range(count - 1, -1, -1):
                if slots.status[slot] == GOING and iteration < robot.model.max_iterations:
                    continue
                run = batch.runs[slots.run[slot]]
                store(slots, slot, run.target)
                run.converged = slots.status[slot] == _AT_GOAL
                made = iteration + (slots.status[slot] == _STUCK)
                run.iterations += made
                run.evaluations += made + 1
                count -= 1
                compact(batch.corrected, slot, count)
                ended -= 1
                if ended == 0:
                    break
        iteration += 1


@inner
def project(v: Any, x: Any, y: Any) -> None:
    """Project a change of base and joints onto a Jacobian's null space, in place.

    The change becomes v − J⁺ J v with J⁺ = Jᵀ (J Jᵀ)⁺. The rows of J are ``x`` and ``y``; all
    arguments have shape ``(n,)``. A singular value of at most a millionth of the larger one is
    treated as 0.
    """
    a, b, c, along_x, along_y = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(v)):
        a, b, c = a + x[j] * x[j], b + x[j] * y[j], c + y[j] * y[j]
        along_x, along_y = along_x + x[j] * v[j], along_y + y[j] * v[j]
    # J Jᵀ = (a, b; b, c) has the eigenvalues larger and determinant / larger.
    larger = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) * (a - c) + b * b)
    determinant = a * c - b * b
    back_x, back_y = 0.0, 0.0
    if determinant > _RANK * larger * larger:
        back_x = (c * along_x - b * along_y) / determinant
        back_y = (a * along_y - b * along_x) / determinant
    elif larger > 0.0:
        u_x, u_y = (larger - c, b) if a > c else (b, larger - a)
        square = u_x * u_x + u_y * u_y
        share = (u_x * along_x + u_y * along_y) / (larger * square)
        back_x, back_y = share * u_x, share * u_y
    for j in range(len(v)):
        v[j] -= x[j] * back_x + y[j] * back_y


@inner
def _load_missed(count: int, robot: RobotRecord, batch: Batch) -> int:
    """Load each run that is to be corrected into a slot, and return the number of these runs.

    These are the runs among the first ``count`` that have missed their goal, whose trial goes on,
    and that may be corrected (``corrects``). ``acting`` becomes True for them, and False for other
    runs. ``converged`` becomes False, and the ``target`` of a loaded run its configuration.
    """
    slots, slot = batch.slots[0], 0
    for i in range(count):
        run = batch.runs[i]
        run.acting, run.converged = run.corrects and run.going and not run.hit, False
        if run.acting:
            fill_row(run.target, run.q)
            load(slots, slot, i, run, arm_of(robot, run.hand))
            slot += 1
    return slot


@inner
def _aim_converged(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Set the ``end`` of the next movement of each of the first ``count`` runs that has converged.

    The ``end`` is the ``target``, displaced by motor noise. ``acting`` and ``corrects`` become True
    for these runs, and False for other runs; the trial of a run for which **A** did not converge
    has failed. ``corrections`` of these runs grows by 1. ``spent`` of every run becomes its
    ``ticks`` so far.
    """
    for i in range(count):
        run = batch.runs[i]
        run.acting = run.converged
        run.corrects = run.converged
        run.spent, run.corrections = run.ticks, run.corrections + run.converged
        if run.converged and robot.model.motor_noise > 0.0:
            miss_correction(run, robot)
        elif run.converged:
            fill_row(run.end, run.target)


@inlined
def correct_runs(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Correct the first ``count`` runs: phase 4, *correct*.

    A run is corrected only if it has missed its goal. The process **A** looks for a configuration
    that hits the goal (:func:`correct_slots`), and the robot moves to this configuration. The
    movement ends as soon as the hand is in the goal.

    - Without noise, a run is corrected once.
    - With noise, the movement can miss the goal. Then the run is corrected again, until it hits the
      goal, **A** does not converge, or 50 corrections were made.

    ``ticks``, ``corrections`` and ``iterations`` of a run become sums over the corrections of the
    run; ``iterations`` includes the iterations of a process that does not converge. All three
    become 0 if the run is not corrected. ``target`` becomes the last iterate of the last process
    **A**; it does not change if the run is not corrected.
    """
    for i in range(count):
        run = batch.runs[i]
        run.ticks, run.corrections, run.iterations = 0, 0, 0
    for _ in range(MAX_CORRECTIONS if robot.model.motor_noise > 0.0 else 1):
        missed = _load_missed(count, robot, batch)
        if missed == 0:
            break
        correct_slots(batch, missed, robot)
        _aim_converged(count, robot, batch)
        move_acting(count, False, robot, batch)
        for i in range(count):
            run = batch.runs[i]
            if run.acting:
                run.ticks += run.spent


@entry
def correct_kernel(robot: NDArray[np.void], batch: Batch) -> None:
    """Run the corrective process for the first run of a batch (:func:`correct_slots`).

    ``iterations`` of the run is set to 0 first. ``robot`` comes from :func:`robot_parameters`.
    """
    run = batch.runs[0]
    run.iterations = 0
    load(batch.slots[0], 0, 0, run, arm_of(robot[0], run.hand))
    correct_slots(batch, 1, robot[0])
