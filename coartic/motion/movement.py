"""Movements and the corrective process: what the robot does for one goal.

**Move** (paper, section *Generating Movement for Each Goal*): straight lines in joint space, one
step at a time, -1 a tick. The k-th point of a movement from q to q^t is
``q + k m (q^t - q) / |q^t - q|`` for k < n and q^t for k = n = ceil(|q^t - q| / m). Before each
step the stopping rule is evaluated: the chosen hand is within the goal's radius, or, for a movement
towards a learned or planned target, within θ^a of where the target would put it. A movement of k
steps takes k + 1 ticks, the last one being the tick that detects arrival (inferred: it gives the
published initial rewards exactly).

**A**, the corrective process (section *The Corrective Process*, Figure 2): Jacobian-transpose
descent on the distance to the goal, ``q += α Jᵀ e`` with the error e of the hand. It is informed by
the primary objective only: where the goal is and how the chosen hand's position depends on the base
and the chosen arm. The other arm's joints do not change, and a locked base coordinate has no column
in the Jacobian.

The kernels give the results of these loops for many arms side by side. Movements are made without
visiting every step (:func:`clear_steps`).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic.internal.limits import brief_value, check_limits, real_array
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion import trigonometry
from coartic.motion.batch import (
    GOING,
    Batch,
    RobotRecord,
    SlotArrays,
    are_near,
    arm_of,
    batch_for,
    compact,
    load,
    padded_count,
    place,
    robot_parameters,
    start,
    store,
    winding,
)
from coartic.motion.compile import entry, fill_row, inlined, inner, joint_lever, shared
from coartic.robot import BASE_DOF, HANDS, Array, Hand, Robot

# Distance kept clear beyond what the bounds ask for. Rounding grows with the size of positions and
# angles: _ROUNDING is relative to it, for each joint.
_CLEARANCE, _ROUNDING = 1e-9, 1e-15
# The bounds are in single precision: these outweigh its rounding (6e-8) and what it takes for 0.
_single = np.float32
_LESS, _FEWER, _UNDERFLOW = _single(1.0 - 6e-7), _single(1.0 - 1e-5), _single(1e-18)
_NOTHING, _OVERFLOW = _single(0.0), _single(math.inf)
_RANK = 1e-12  # square of the ratio of singular values up to which the smaller counts as 0
_IN_GOAL, _MISSED = 1.0, 2.0  # statuses of a slot that has moved
_AT_GOAL, _FAILED, _STUCK = 1.0, 2.0, 3.0  # and of one that has been corrected
LARGEST_ENTRY = 1e5  # of any entry of a configuration or goal, length unit or rad


class MoveResult(NamedTuple):
    """Result of one movement (:func:`move`)."""

    q: Array
    """Configuration in which the movement stopped, shape ``(dof,)``, length unit and rad."""
    ticks: int
    """Control ticks spent; the reward of the movement is ``-ticks``."""
    hit: bool
    """True if the hand is within the goal's radius."""
    evaluations: int
    """Forward-kinematics evaluations: on a path (:func:`follow`) as many as ticks."""


class Correction(NamedTuple):
    """Result of the corrective process (:func:`correct`)."""

    q: Array
    """Configuration found, shape ``(dof,)``, length unit and rad; the last iterate if not
    converged."""
    converged: bool
    """True if the hand is at the goal, as near as ``MotionModel.correction_tolerance``."""
    iterations: int
    """Iterations made, each with one Jacobian."""


@inner
def largest_square(length: float) -> float:
    """Return the largest number whose square root, as it is rounded, does not exceed ``length``."""
    square = length * length
    while math.sqrt(square) > length:
        square = np.nextafter(square, 0.0)
    while math.sqrt(np.nextafter(square, math.inf)) <= length:
        square = np.nextafter(square, math.inf)
    return square


@inner
def clear_steps(square: float, rim: float, closing: float, slowness: float, bend: float) -> Any:
    """Return a number of steps, rarely whole, for which the hand certainly stays out of a disc; 0
    if it may be in the disc.

    Along the line of a movement every absolute link angle turns at a constant rate. So per step the
    hand moves by at most ``s = |Δbase| + Σ length |Δangle|``, and its velocity changes by at most
    ``c = Σ length Δangle²``. A norm lies above its tangents: with the distance d from a fixed point
    and the closing speed u now, the distance after τ steps is at least ``d - u τ - c τ² / 2``.
    Either bound keeps the hand out of a disc of radius r < d around the point for ::

        max((d - r) / s, (sqrt(u² + 2 c (d - r)) - u) / c)

    steps. Here ``square`` is d², ``rim`` r, ``closing`` d u, ``slowness`` 1 / s and ``bend`` c. All
    is in single precision, in which roots and quotients, most of the work, cost a third.
    """
    distance = np.sqrt(_single(square))
    gap = distance * _LESS - _single(rim)
    toward, turn = _single(closing), _single(bend) * distance
    twice = (gap + gap) * distance
    root = np.sqrt(toward * toward + turn * twice)
    approaching = toward > _NOTHING
    path = twice if approaching else root - toward
    rate = toward + root if approaching else turn
    curved = path / (rate + _UNDERFLOW)
    steps = max(gap * _single(slowness), curved) * _FEWER
    return steps if (gap > _NOTHING) & (root < _OVERFLOW) else _NOTHING


@inner
def divide_steps(at: SlotArrays, count: int, step: float) -> bool:
    """Set rates, bounds and numbers of steps, of length ``step`` in joint space, of the movements
    in the first ``count`` columns of ``at`` (:func:`start`), in place; ``distance`` becomes its
    root. Return whether all link angles certainly stay below 1e5 rad in size (:func:`winding`)."""
    far = 0
    for i in range(padded_count(count)):
        distance = math.sqrt(at.distance[i])
        per_step = step / distance if distance > 0.0 else 0.0
        base_x = (at.target[0, i] - at.start[0, i]) * per_step
        base_y = (at.target[1, i] - at.start[1, i]) * per_step
        speed = math.sqrt(base_x * base_x + base_y * base_y)
        reach, rate, bend = 0.0, 0.0, 0.0
        for k in range(len(at.length)):
            reach += at.length[k, i]
            rate += (at.target[BASE_DOF + k, i] - at.start[BASE_DOF + k, i]) * per_step
            at.rate[k, i] = rate
            speed += at.length[k, i] * abs(rate)
            bend += at.length[k, i] * rate * rate
        at.base_rate[0, i], at.base_rate[1, i] = base_x, base_y
        at.distance[i], at.slowness[i], at.bend[i] = distance, 1.0 / speed, bend
        last = np.ceil(distance / step)
        # A line without a finite length has no step; its target is where it ends.
        at.step[i], at.last[i] = 0.0, last if last < math.inf else 0.0
        # No joint turns farther than at the farther end, and, where it passes it, a step.
        most = winding(at.start, i) + winding(at.target, i) + step * len(at.length)
        far += 0 if most < trigonometry.LARGEST else 1
        away = reach * (1.0 + most) + step
        for j in range(BASE_DOF):
            away += abs(at.start[j, i]) + abs(at.target[j, i]) + abs(at.shoulder[j, i])
        at.clearance[i] = _CLEARANCE + _ROUNDING * len(at.x) * away
    return far == 0


@inner
def _place_between(at: SlotArrays, count: int, step: float) -> None:
    """Set ``q`` in each of the first ``count`` columns of ``at``, in place, to the point of the
    movement at its present step; ``step`` is the length of a step in joint space."""
    for i in range(padded_count(count)):
        fraction = at.step[i] * step / at.distance[i]
        for j in range(len(at.q)):
            begin, end = at.start[j, i], at.target[j, i]
            between = begin + fraction * (end - begin)
            at.q[j, i] = end if at.step[i] == at.last[i] else between


@inner
def check(at: SlotArrays, count: int, stop_on_arrival: bool, rims: Any, squares: Any) -> int:
    """Evaluate the stopping rule of movements in the first ``count`` columns of ``at``, in place:
    set ``status`` and, where a movement goes on, the next ``step`` that can end it; return how many
    have ended.

    A movement ends at its last step, or with the hand at most ``rims[0]``, length unit, from the
    goal's centre, or, with ``stop_on_arrival``, at most ``rims[1]`` from where the target puts the
    hand. ``squares`` are the squares of ``rims`` (:func:`largest_square`).
    """
    ended = 0
    tip = len(at.length)
    for i in range(padded_count(count)):
        velocity_x = at.base_rate[0, i]
        velocity_y = at.base_rate[1, i]
        for k in range(tip):
            velocity_x -= at.rate[k, i] * (at.y[k + 1, i] - at.y[k, i])
            velocity_y += at.rate[k, i] * (at.x[k + 1, i] - at.x[k, i])
        dx, dy = at.goal[0, i] - at.x[tip, i], at.goal[1, i] - at.y[tip, i]
        to_goal = dx * dx + dy * dy
        closing = velocity_x * dx + velocity_y * dy
        rim = rims[0] + at.clearance[i]
        clear = clear_steps(to_goal, rim, closing, at.slowness[i], at.bend[i])
        stop = not at.step[i] < at.last[i]
        if stop_on_arrival:
            dx, dy = at.end[0, i] - at.x[tip, i], at.end[1, i] - at.y[tip, i]
            to_end = dx * dx + dy * dy
            stop |= to_end <= squares[1]
            closing = velocity_x * dx + velocity_y * dy
            rim = rims[1] + at.clearance[i]
            clear = min(clear, clear_steps(to_end, rim, closing, at.slowness[i], at.bend[i]))
        status = _MISSED if stop else GOING
        status = _IN_GOAL if to_goal <= squares[0] else status
        # Every step up to step + clear is clear of both discs.
        after = min(at.step[i] + 1.0 + np.floor(min(clear, at.last[i])), at.last[i])
        at.step[i] = after if status == GOING else at.step[i]
        at.status[i] = status
        ended += 0 if (status == GOING) | (i >= count) else 1
    return ended


@shared
def move_slots(batch: Batch, count: int, stop_on_arrival: bool, robot: RobotRecord) -> None:
    """Move the arms in the first ``count`` slots of ``batch``, loaded by :func:`start`, until each
    movement has ended (:func:`check`), which frees its slot. In the record of each run ``q``,
    ``hit`` and ``ticks`` are set, and ``evaluations`` grows."""
    at, evaluations, step = batch.at[0], 0, robot.model.step
    rims = robot.radius, robot.model.arrival_tolerance
    squares = largest_square(rims[0]), largest_square(rims[1])
    near = divide_steps(at, count, step)
    if stop_on_arrival:
        for j in range(len(at.q)):
            fill_row(at.q[j], at.target[j])
        place(at, count, near)
        fill_row(at.end[0], at.x[-1])
        fill_row(at.end[1], at.y[-1])
        evaluations += 1
    while count > 0:
        _place_between(at, count, step)
        place(at, count, near)
        evaluations += 1
        ended = check(at, count, stop_on_arrival, rims, squares)
        if ended == 0:
            continue
        for slot in range(count - 1, -1, -1):
            if at.status[slot] == GOING:
                continue
            run = batch.runs[at.run[slot]]
            q, target = run.q, run.target
            at_end = at.step[slot] == at.last[slot]
            fraction = 0.0 if at_end else at.step[slot] * step / at.distance[slot]
            for j in range(len(q)):
                between = q[j] + fraction * (target[j] - q[j])
                q[j] = target[j] if at_end else between
            run.hit = at.status[slot] == _IN_GOAL
            run.ticks = int(at.step[slot]) + 1
            run.evaluations += evaluations
            count -= 1
            compact(batch.moved, slot, count)
            ended -= 1
            if ended == 0:
                break


@entry
def _move_kernel(stop_on_arrival: bool, robot: NDArray[np.void], batch: Batch) -> None:
    """Move the first run of ``batch`` towards its target, and set the results in its record
    (:func:`move_slots`). ``robot`` comes from :func:`robot_parameters`."""
    run = batch.runs[0]
    start(batch.at[0], 0, 0, run, arm_of(robot[0], run.hand))
    move_slots(batch, 1, stop_on_arrival, robot[0])


def move(
    robot: Robot,
    q: Array,
    target: Array,
    hand: Hand,
    goal: tuple[float, float],
    radius: float,
    *,
    stop_on_arrival: bool = True,
    model: MotionModel = PAPER,
) -> MoveResult:
    """Move straight in joint space until the hand hits the goal or arrives at the target.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : ndarray, shape (dof,)
        Configuration in which the robot stands, length unit (base) and rad (joints).
    target : ndarray, shape (dof,)
        Target configuration, in the same units.
    hand : {"left", "right"}
        The hand that is to hit the goal.
    goal : tuple of float
        Centre of the goal, x and y, length unit.
    radius : float
        Radius of the goal, length unit.
    stop_on_arrival : bool
        True if the movement also ends where the hand is near the place to which the target brings
        it; False, as in a corrective movement, if it ends only on a hit or at its target.
    model : MotionModel
        The constants; ``step`` and ``arrival_tolerance`` matter.

    Returns
    -------
    MoveResult
        Where the robot stopped, the control ticks it took, and whether the goal is hit.

    Raises
    ------
    ValueError
        A shape is wrong, a figure is not finite or beyond 100,000, the radius is below 0, there is
        no such hand, or a constant of the model is out of bounds.
    TypeError
        ``robot``, ``model`` or ``stop_on_arrival`` has another type.

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    if not isinstance(stop_on_arrival, bool | np.bool_):
        raise TypeError(f"stop_on_arrival is {brief_value(stop_on_arrival)}; it must be a bool")
    batch = _one_run(robot, q, hand, goal, radius)
    run, figures = batch.runs[0], slice(robot.dof)
    run["target"][figures] = configuration(robot, target)
    parameters = robot_parameters(robot, radius, model=check_model(model))
    _move_kernel(stop_on_arrival, parameters, batch)
    return MoveResult(
        run["q"][figures].copy(), int(run["ticks"]), bool(run["hit"]), int(run["evaluations"])
    )


@inner
def _find_statuses(at: SlotArrays, count: int, square: float) -> None:
    """Set the status of each of the first ``count`` columns of ``at``, in place: at the goal if the
    squared distance of the hand from the goal's centre is at most ``square``, squared length unit;
    failed if it is not finite; else going on."""
    tip = len(at.length)
    for i in range(padded_count(count)):
        error_x = at.goal[0, i] - at.x[tip, i]
        error_y = at.goal[1, i] - at.y[tip, i]
        error = error_x * error_x + error_y * error_y
        status = GOING if error < math.inf else _FAILED
        at.status[i] = _AT_GOAL if error <= square else status


@inlined
def descend(
    at: SlotArrays, count: int, robot: RobotRecord, runs: Any, pull: Any
) -> tuple[int, bool]:
    """Make an iteration of the corrective process **A** in each of the first ``count`` columns of
    ``at`` that goes on, in place, with ``pull`` as in :func:`descend_to_goals`; the status of such
    a column that stays the same becomes stuck. Return how many columns have ended, and whether all
    link angles are then certain to be below 1e5 rad in size."""
    ended = 0
    far = 0
    tip = len(at.length)
    gain, free_x, free_y = robot.model.gain, robot.free_x, robot.free_y
    if pull is not None:
        pull(at, count, robot, runs)
    for i in range(padded_count(count)):
        error_x = at.goal[0, i] - at.x[tip, i]
        error_y = at.goal[1, i] - at.y[tip, i]
        going = at.status[i] == GOING
        x = at.q[0, i] + gain * error_x if free_x else at.q[0, i]
        y = at.q[1, i] + gain * error_y if free_y else at.q[1, i]
        if pull is not None:
            x, y = x + at.pull[0, i], y + at.pull[1, i]
        moved = (x != at.q[0, i]) | (y != at.q[1, i])
        at.q[0, i] = x if going else at.q[0, i]
        at.q[1, i] = y if going else at.q[1, i]
        for k in range(tip):
            dx, dy = joint_lever(at.x[:, i], at.y[:, i], k, tip)
            before = at.q[BASE_DOF + k, i]
            turned = before + gain * (dx * error_x + dy * error_y)
            if pull is not None:
                turned += at.pull[BASE_DOF + k, i]
            moved |= turned != before
            at.q[BASE_DOF + k, i] = turned if going else before
        # A stationary point away from the goal, which the process will not leave.
        stuck = going & (not moved)
        at.status[i] = _STUCK if stuck else at.status[i]
        ended += 0 if (going & moved) | (i >= count) else 1
        far += 0 if winding(at.q, i) < trigonometry.LARGEST else 1
    return ended, far == 0


@inlined
def descend_to_goals(batch: Batch, count: int, robot: RobotRecord, pull: Any) -> None:
    """Iterate the corrective process **A** in the first ``count`` slots of ``batch.at[0]`` until
    each has converged or failed: is not finite, no longer moves, or has made ``max_iterations``.
    The record of each run in these slots gets ``converged``, ``iterations`` and, in ``target``,
    base and arm of the last iterate (the entries of the other arm stay), and its ``evaluations``
    grow by ``iterations`` + 1. Afterwards the slots, which :func:`load` filled, are free.

    ``pull``: None, or a kernel ``pull(at, count, robot, runs)`` that sets ``at.pull``, what the
    next iteration adds to ``at.q`` besides α Jᵀ e: 0 for locked coordinates of the base.
    """
    at, iteration = batch.at[0], 0
    square = largest_square(robot.model.correction_tolerance)
    near = are_near(at, count)
    while count > 0:
        place(at, count, near)
        _find_statuses(at, count, square)
        ended = count
        if iteration < robot.model.max_iterations:
            ended, near = descend(at, count, robot, batch.runs, pull)
        if ended > 0:
            for slot in range(count - 1, -1, -1):
                if at.status[slot] == GOING and iteration < robot.model.max_iterations:
                    continue
                run = batch.runs[at.run[slot]]
                store(at, slot, run.target)
                run.converged = at.status[slot] == _AT_GOAL
                run.iterations = iteration + (at.status[slot] == _STUCK)
                run.evaluations += run.iterations + 1
                count -= 1
                compact(batch.corrected, slot, count)
                ended -= 1
                if ended == 0:
                    break
        iteration += 1


@inner
def project(v: Any, x: Any, y: Any) -> None:
    """Project ``v``, a change of base and joints, in place, onto the null space of a Jacobian with
    rows ``x`` and ``y``.

    v −= J⁺ J v with J⁺ = Jᵀ (J Jᵀ)⁺; ``v``, ``x`` and ``y`` have shape ``(n,)``. A singular value
    of at most a millionth of the larger counts as 0.
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
def _pull_to_preferred(at: SlotArrays, count: int, robot: RobotRecord, runs: Any) -> None:
    """Set ``at.pull[:, i]``, for each of the first ``count`` columns i, to β N(q) (p − q), 0 for
    locked base coordinates: β is the ``pull`` and p the preferred posture of the run in that
    column, ``runs[at.run[i]]``; N projects onto the null space of the hand's Jacobian at the
    column's configuration q, whose joints are at ``at.x`` and ``at.y`` already."""
    tip = len(at.length)
    for i in range(count):
        run, v = runs[at.run[i]], at.pull[:, i]
        x, y = at.jacobian[0, :, i], at.jacobian[1, :, i]
        for j in range(BASE_DOF + tip):
            v[j], x[j], y[j] = 0.0, 0.0, 0.0
        if robot.free_x:
            v[0], x[0] = run.preferred[0] - at.q[0, i], 1.0
        if robot.free_y:
            v[1], y[1] = run.preferred[1] - at.q[1, i], 1.0
        for k in range(at.links[i]):
            j = BASE_DOF + k
            v[j] = run.preferred[at.first_joint[i] + k] - at.q[j, i]
            x[j], y[j] = joint_lever(at.x[:, i], at.y[:, i], k, tip)
        project(v, x, y)
        for j in range(BASE_DOF + tip):
            v[j] *= run.pull


@shared
def pull_slots(batch: Batch, count: int, robot: RobotRecord) -> None:
    """Run the corrective process with a pull to each run's preferred posture in the first ``count``
    slots of ``batch``, and set the results in the runs' records (:func:`descend_to_goals`)."""
    descend_to_goals(batch, count, robot, _pull_to_preferred)


@shared
def correct_slots(batch: Batch, count: int, robot: RobotRecord) -> None:
    """Run the paper's corrective process in the first ``count`` slots of ``batch``, and set the
    results in the runs' records (:func:`descend_to_goals`)."""
    descend_to_goals(batch, count, robot, None)


@entry
def _correct_kernel(robot: NDArray[np.void], batch: Batch) -> None:
    """Run the corrective process for the first run of ``batch``, and set the results in its record
    (:func:`descend_to_goals`). ``robot`` comes from :func:`robot_parameters`."""
    run = batch.runs[0]
    load(batch.at[0], 0, 0, run, arm_of(robot[0], run.hand))
    correct_slots(batch, 1, robot[0])


def correct(
    robot: Robot,
    q: Array,
    hand: Hand,
    goal: tuple[float, float],
    *,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Correction:
    """Jacobian-transpose inverse kinematics, the corrective process: find a configuration with a
    hand at a goal.

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
        The constants; ``gain``, ``correction_tolerance`` (0.01 length units for None) and
        ``max_iterations`` matter.

    Returns
    -------
    Correction
        The configuration, whether it is at the goal, and how many iterations it took. Not to
        converge within ``model.max_iterations`` is an outcome, not an error.

    Raises
    ------
    TypeError
        ``robot`` or ``model`` has another type.
    ValueError
        A shape is wrong, a figure is not finite or beyond 100,000, there is no such hand,
        ``locked_base`` has an entry other than ``"x"`` and ``"y"``, or a constant of the model is
        out of bounds.

    Notes
    -----
    Source: paper, Figure 2 (Whitney 1969; Craig 2004).
    """
    batch = _one_run(robot, q, hand, goal)
    run, figures = batch.runs[0], slice(robot.dof)
    locked = tuple(map(str, locked_base if isinstance(locked_base, Collection) else [locked_base]))
    _correct_kernel(robot_parameters(robot, locked_base=locked, model=check_model(model)), batch)
    return Correction(run["target"][figures].copy(), bool(run["converged"]), int(run["iterations"]))


def follow(
    robot: Robot,
    q: Array,
    waypoints: Array,
    hand: Hand,
    goal: tuple[float, float],
    radius: float,
    *,
    model: MotionModel = PAPER,
) -> MoveResult:
    """Move from ``q`` in steps along a path through W > 0 ``waypoints``, ``(W, dof)``
    (:func:`path_points`), to the first point with the hand within ``radius``, length unit, of the
    goal's centre, or to the last waypoint; k steps take k + 1 ticks. Raises ValueError for a wrong
    shape, an unknown hand, and a figure that is not finite or out of bounds."""
    check_goal(goal, radius), check_model(model)
    points = path_points(robot, q, waypoints, model)
    last = len(points) - 1
    misses = robot.forward_kinematics(points, hand) - np.asarray(goal, dtype=np.float64)
    inside = np.flatnonzero(np.hypot(*misses.T) <= radius)
    k = int(inside[0]) if inside.size else last
    return MoveResult(np.array(points[k]), k + 1, bool(inside.size), k + 1)


def line_points(q: Array, target: Array, model: MotionModel = PAPER) -> Array:
    """Return the configurations at the n steps of a straight movement from ``q`` to ``target``,
    ``(dof,)``, both included, shape ``(n + 1, dof)``, length unit and rad, with the rounding of the
    kernels."""
    difference, square = target - q, 0.0
    for value in difference.tolist():
        square += value * value
    distance = math.sqrt(square)
    k = np.arange(math.ceil(distance / model.step))[:, None]
    return np.vstack([q + k * model.step / (distance or 1.0) * difference, target])


def segment_lengths(configurations: ArrayLike) -> Array:
    """Return the joint-space distance from each of k configurations ``(k, dof)`` to the next, shape
    ``(k - 1,)``, length unit and rad together."""
    return np.asarray(np.sqrt((np.diff(configurations, axis=0) ** 2).sum(axis=1)))


def path_points(robot: Robot, q: Array, waypoints: Array, model: MotionModel = PAPER) -> Array:
    """Return the points of the n steps of a path from ``q`` straight through W > 0 ``waypoints``,
    ``(W, dof)``, in joint space, as an array ``(n + 1, dof)``, length unit and rad. Point k < n
    lies k times ``model.step`` along the path; point n is the last waypoint. Raises ValueError for
    a wrong shape or a figure that is not finite or beyond 100,000."""
    shape = (len(waypoints), robot.dof)
    corners = np.vstack([configuration(robot, q), finite_array("waypoints", waypoints, shape)])
    ends = np.concatenate([[0.0], np.cumsum(segment_lengths(corners))])
    at = np.append(np.arange(math.ceil(ends[-1] / model.step)) * model.step, ends[-1])
    points = np.stack([np.interp(at, ends, joint) for joint in corners.T], axis=1)
    points[-1] = corners[-1]
    return points


def configuration(robot: Robot, q: Any) -> Array:
    """Return one configuration as a new contiguous array, shape ``(dof,)``. Raises ValueError for a
    wrong shape, and for an entry that is not finite or beyond ±100,000."""
    return finite_array("configuration", q, (robot.dof,))


def finite_array(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return numbers as a new contiguous array of float64. Raises ValueError, which calls the value
    ``name``, for a shape other than ``shape`` and a number that is not finite or beyond ±100,000.
    """
    array = np.array(real_array(name, value), order="C")
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; needed is {shape}")
    if not (np.abs(array) <= LARGEST_ENTRY).all():
        what = (
            f"has a figure beyond {LARGEST_ENTRY:g}"
            if np.isfinite(array).all()
            else "is not finite"
        )
        raise ValueError(f"{name} {brief_value(array.tolist())} {what}")
    return array


def _one_run(robot: Any, q: Any, hand: Any, goal: Any, radius: float = 0.0) -> Batch:
    """Return a batch of one run, whose configuration and target are ``q``, with the hand and goal
    of the run; ``radius`` is only checked. Raises TypeError if ``robot`` is no Robot, and
    ValueError for any other argument that does not fit."""
    if not isinstance(robot, Robot):
        raise TypeError(f"robot is {brief_value(robot)}; it must be a Robot")
    robot.arm(hand)
    batch = batch_for(robot, 1)
    run = batch.runs[0]
    run["q"][: robot.dof] = run["target"][: robot.dof] = configuration(robot, q)
    run["hand"], run["goal"] = HANDS.index(hand), check_goal(goal, radius)
    return batch


def check_goal(centre: Any, radius: float = 0.0) -> tuple[float, float]:
    """Return the centre of a goal, x and y, as two floats. Raises ValueError if it is not two
    finite numbers within ±100,000, or if ``radius`` is not from 0 to 100,000, length unit."""
    x, y = finite_array("goal", centre, (2,)).tolist()
    check_limits("radius", radius, 0.0, LARGEST_ENTRY)
    return x, y
