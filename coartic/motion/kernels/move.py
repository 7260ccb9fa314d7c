"""Movements: straight lines in joint space, and paths.

The robot moves on a straight line in joint space, one step per control tick, and each tick costs a
reward of 1 (paper, section *Generating Movement for Each Goal*). Point k of a movement from q to
q^t is ::

    q + k m (q^t - q) / |q^t - q|   for k < n
    q^t                             for k = n = ceil(|q^t - q| / m)

where m is the length of a step, and |·| the norm of the motion model. With motor noise q^t is
displaced (:mod:`coartic.motion.kernels.noise`). The stopping rule is evaluated at each point. A
movement ends if

- the chosen hand is within the goal's radius,
- the movement is towards a learned or planned target, and the hand is within θ^a of the position
  that it has at the target, or
- the point is the last one, q^t.

A movement of k steps takes k + 1 ticks; the last tick detects arrival (inferred: this gives exactly
the initial rewards that follow from the paper).

The kernels move many arms at once. They skip points at which the movement certainly cannot end
(:func:`clear_steps`). The results are those of a loop that evaluates the stopping rule at each
point.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.motion.kernels import trigonometry
from coartic.motion.kernels.compile import entry, fill_row, inlined, inner, shared
from coartic.motion.kernels.noise import displace_path, miss_target
from coartic.motion.kernels.slots import (
    GOING,
    Batch,
    RobotRecord,
    RunRecord,
    SlotArrays,
    arm_of,
    compact,
    find_positions,
    have_small_angles,
    load,
    padded_count,
    start,
    winding,
)
from coartic.robot import BASE_DOF

# Each bound has a clearance against rounding: a constant, and per joint a share (_ROUNDING) of the
# size of positions and angles.
_CLEARANCE, _ROUNDING = 1e-9, 1e-15
# The bounds are in single precision. These numbers outweigh its rounding (6e-8) and underflow.
_single = np.float32
_LESS, _FEWER, _UNDERFLOW = _single(1.0 - 6e-7), _single(1.0 - 1e-5), _single(1e-18)
_NOTHING, _OVERFLOW = _single(0.0), _single(math.inf)
_IN_GOAL, _MISSED = 1.0, 2.0  # status of a slot whose movement has ended
IDLE, CHECK, MOVE, REPEAT, FOLLOW = range(5)
"""Next action of a run:

- ``IDLE``: none;
- ``CHECK``: check whether the hand is in the goal;
- ``MOVE``: move to the target, and end on a hit or on arrival;
- ``REPEAT``: make a corrective movement, which ends on a hit or at the target;
- ``FOLLOW``: follow a path, and end on a hit or at its last waypoint.
"""


@inner
def largest_square(length: float) -> float:
    """Return the largest number whose rounded square root does not exceed ``length``."""
    square = length * length
    while math.sqrt(square) > length:
        square = np.nextafter(square, 0.0)
    while math.sqrt(np.nextafter(square, math.inf)) <= length:
        square = np.nextafter(square, math.inf)
    return square


@inner
def clear_steps(square: float, rim: float, closing: float, slowness: float, bend: float) -> Any:
    """Return a lower bound on the steps before a hand can enter a disc.

    The bound is usually not an integer. It is 0 if the hand may be in the disc already.

    Parameters
    ----------
    square : float
        d²: squared distance of the hand from the centre of the disc.
    rim : float
        r: radius of the disc.
    closing : float
        d u, where u is the speed with which the hand approaches the centre, in length units per
        step.
    slowness : float
        1 / s, where s is an upper bound on the length of the hand's path per step.
    bend : float
        c: upper bound on the change of the hand's velocity per step.

    Notes
    -----
    Along the line of a movement every absolute link angle turns at a constant rate. So in one step
    the hand moves by at most ``s = |Δbase| + Σ length |Δangle|``, and its velocity changes by at
    most ``c = Σ length Δangle²``. A norm lies above its tangents, so after τ steps the distance
    from a fixed point is at least ``d - u τ - c τ² / 2``. Both bounds keep the hand out of a disc
    of radius r < d around that point for ::

        max((d - r) / s, (sqrt(u² + 2 c (d - r)) - u) / c)

    steps. The computation is in single precision, in which roots and quotients, most of the work,
    cost a third.
    """
    distance = np.sqrt(_single(square))
    gap = distance * _LESS - _single(rim)
    toward, turn = _single(closing), _single(bend) * distance
    double = (gap + gap) * distance
    root = np.sqrt(toward * toward + turn * double)
    approaching = toward > _NOTHING
    path = double if approaching else root - toward
    rate = toward + root if approaching else turn
    curved = path / (rate + _UNDERFLOW)
    steps = max(gap * _single(slowness), curved) * _FEWER
    return steps if (gap > _NOTHING) & (root < _OVERFLOW) else _NOTHING


@inner
def divide_steps(slots: SlotArrays, count: int, model: Any) -> bool:
    """Divide the movements in the first ``count`` slots into steps, in place.

    The function sets the rates, bounds and numbers of steps. ``distance``, which :func:`start` has
    set to the squared length of the movement, becomes the length. Return whether the absolute
    values of all link angles certainly stay below 1e5 rad (:func:`winding`).
    """
    large, step = 0, model.step
    # In a step no joint turns by more than the step, and the base moves at most this far.
    base_step = step / min(model.base_weight, 1.0)
    for i in range(padded_count(count)):
        distance = math.sqrt(slots.distance[i])
        per_step = step / distance if distance > 0.0 else 0.0
        base_x = (slots.target[0, i] - slots.start[0, i]) * per_step
        base_y = (slots.target[1, i] - slots.start[1, i]) * per_step
        speed = math.sqrt(base_x * base_x + base_y * base_y)
        reach, rate, bend = 0.0, 0.0, 0.0
        for k in range(len(slots.length)):
            reach += slots.length[k, i]
            rate += (slots.target[BASE_DOF + k, i] - slots.start[BASE_DOF + k, i]) * per_step
            slots.rate[k, i] = rate
            speed += slots.length[k, i] * abs(rate)
            bend += slots.length[k, i] * rate * rate
        slots.base_rate[0, i], slots.base_rate[1, i] = base_x, base_y
        slots.distance[i], slots.slowness[i], slots.bend[i] = distance, 1.0 / speed, bend
        last = np.ceil(distance / step)
        # A line without a finite length has no step; its target is where it ends.
        slots.step[i], slots.last[i] = 0.0, last if last < math.inf else 0.0
        # A joint turns at most as far as at the farther end, plus a step if it overshoots.
        angle = winding(slots.start, i) + winding(slots.target, i) + step * len(slots.length)
        large += 0 if angle < trigonometry.MAX_ANGLE else 1
        size = reach * (1.0 + angle) + base_step
        for j in range(BASE_DOF):
            size += abs(slots.start[j, i]) + abs(slots.target[j, i]) + abs(slots.shoulder[j, i])
        slots.clearance[i] = _CLEARANCE + _ROUNDING * len(slots.x) * size
    return large == 0


@inner
def _place_between(slots: SlotArrays, count: int, step: float) -> None:
    """Set ``q`` in the first ``count`` slots to the present point of the movement.

    ``step`` is the length of a step in joint space.
    """
    for i in range(padded_count(count)):
        fraction = slots.step[i] * step / slots.distance[i]
        for j in range(len(slots.q)):
            begin, end = slots.start[j, i], slots.target[j, i]
            between = begin + fraction * (end - begin)
            slots.q[j, i] = end if slots.step[i] == slots.last[i] else between


@inner
def check(slots: SlotArrays, count: int, stop_on_arrival: bool, rims: Any, squares: Any) -> int:
    """Evaluate the stopping rule of the movements in the first ``count`` slots, in place.

    The function sets ``status``. Where a movement goes on, it also sets ``step`` to the next step
    that can end the movement. Return how many movements have ended. A movement ends

    - at its last step;
    - if the hand is within ``rims[0]`` (in length units) of the goal's centre; or
    - if ``stop_on_arrival`` is True, and the hand is within ``rims[1]`` of the position that the
      hand has at the target.

    ``squares`` are the squares of ``rims`` (:func:`largest_square`).
    """
    ended = 0
    tip = len(slots.length)
    for i in range(padded_count(count)):
        velocity_x = slots.base_rate[0, i]
        velocity_y = slots.base_rate[1, i]
        for k in range(tip):
            velocity_x -= slots.rate[k, i] * (slots.y[k + 1, i] - slots.y[k, i])
            velocity_y += slots.rate[k, i] * (slots.x[k + 1, i] - slots.x[k, i])
        dx, dy = slots.goal[0, i] - slots.x[tip, i], slots.goal[1, i] - slots.y[tip, i]
        to_goal = dx * dx + dy * dy
        closing = velocity_x * dx + velocity_y * dy
        rim = rims[0] + slots.clearance[i]
        clear = clear_steps(to_goal, rim, closing, slots.slowness[i], slots.bend[i])
        stop = not slots.step[i] < slots.last[i]
        if stop_on_arrival:
            dx, dy = slots.end[0, i] - slots.x[tip, i], slots.end[1, i] - slots.y[tip, i]
            to_end = dx * dx + dy * dy
            stop |= to_end <= squares[1]
            closing = velocity_x * dx + velocity_y * dy
            rim = rims[1] + slots.clearance[i]
            clear = min(clear, clear_steps(to_end, rim, closing, slots.slowness[i], slots.bend[i]))
        status = _MISSED if stop else GOING
        status = _IN_GOAL if to_goal <= squares[0] else status
        # The hand is outside both discs at every step up to step + clear.
        next_step = min(slots.step[i] + 1.0 + np.floor(min(clear, slots.last[i])), slots.last[i])
        slots.step[i] = next_step if status == GOING else slots.step[i]
        slots.status[i] = status
        ended += 0 if (status == GOING) | (i >= count) else 1
    return ended


@shared
def move_slots(batch: Batch, count: int, stop_on_arrival: bool, robot: RobotRecord) -> None:
    """Move the arms in the first ``count`` slots until each movement has ended (:func:`check`).

    The caller loads the slots by :func:`start`; they are free afterwards. In the record of each run
    ``q``, ``hit`` and ``ticks`` are set, and ``evaluations`` grows.
    """
    slots, evaluations, step = batch.slots[0], 0, robot.model.step
    rims = robot.radius, robot.model.arrival_tolerance
    squares = largest_square(rims[0]), largest_square(rims[1])
    small_angles = divide_steps(slots, count, robot.model)
    if stop_on_arrival:
        for j in range(len(slots.q)):
            fill_row(slots.q[j], slots.target[j])
        find_positions(slots, count, small_angles)
        fill_row(slots.end[0], slots.x[-1])
        fill_row(slots.end[1], slots.y[-1])
        evaluations += 1
    while count > 0:
        _place_between(slots, count, step)
        find_positions(slots, count, small_angles)
        evaluations += 1
        ended = check(slots, count, stop_on_arrival, rims, squares)
        if ended == 0:
            continue
        for slot in range(count - 1, -1, -1):
            if slots.status[slot] == GOING:
                continue
            run = batch.runs[slots.run[slot]]
            q, end = run.q, run.end
            at_end = slots.step[slot] == slots.last[slot]
            fraction = 0.0 if at_end else slots.step[slot] * step / slots.distance[slot]
            for j in range(len(q)):
                between = q[j] + fraction * (end[j] - q[j])
                q[j] = end[j] if at_end else between
            run.hit = slots.status[slot] == _IN_GOAL
            run.ticks = int(slots.step[slot]) + 1
            run.evaluations += evaluations
            count -= 1
            compact(batch.moved, slot, count)
            ended -= 1
            if ended == 0:
                break


@inner
def _load_acting(count: int, robot: RobotRecord, batch: Batch) -> int:
    """Load each of the first ``count`` runs that is ``acting`` into a slot, for a movement.

    Return the number of these runs.
    """
    slot = 0
    for i in range(count):
        if batch.runs[i].acting:
            start(batch.slots[0], slot, i, batch.runs[i], robot)
            slot += 1
    return slot


@inlined
def move_acting(count: int, stops: bool, robot: RobotRecord, batch: Batch) -> None:
    """Move each of the first ``count`` runs that is ``acting`` to its ``end``, in place.

    A movement ends on a hit or at its ``end``. If ``stops`` is True, a movement also ends when the
    hand is within ``arrival_tolerance`` of the position that it has at ``end``.
    """
    acting = _load_acting(count, robot, batch)
    if acting > 0:
        move_slots(batch, acting, stops, robot)


@inlined
def move_runs(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Perform the next ``action``, except paths, of the first ``count`` runs.

    The actions are listed at :data:`IDLE`. ``q``, ``hit``, ``ticks``, ``evaluations``, ``acting``
    and ``end`` change in place. After ``IDLE`` and ``CHECK`` the ticks are 0. With noise, ``end``
    of a movement to a target is displaced.
    """
    for i in range(count):
        run = batch.runs[i]
        if robot.model.motor_noise > 0.0 and (run.action == MOVE or run.action == REPEAT):
            miss_target(run, robot)
        else:
            fill_row(run.end, run.target)
    for stops in (True, False):
        for i in range(count):
            run, action = batch.runs[i], batch.runs[i].action
            # CHECK is a movement to the present configuration.
            run.acting = action == MOVE if stops else action in (CHECK, REPEAT)
        move_acting(count, stops, robot, batch)
    for i in range(count):
        if batch.runs[i].action < MOVE:
            batch.runs[i].ticks = 0


# ---- Paths ----


@inner
def _corner(run: RunRecord, waypoints: Any, k: int, j: int, noisy: bool) -> Any:
    """Return entry ``j`` of corner ``k`` of a path.

    Corner -1 is the present configuration of the run, and corner k >= 0 is waypoint k (from 0).
    With noise, ``run.end`` contains the displacement of the last waypoint; an entry of it is NaN if
    no waypoint moves the coordinate.
    """
    if k < 0 or (noisy and math.isnan(run.end[j])):
        return run.q[j]
    if noisy:
        return waypoints[k, j] + (k + 1) / len(waypoints) * run.end[j]
    return waypoints[k, j]


@inner
def _sum_of_squares(
    run: RunRecord, waypoints: Any, k: int, entries: Any, noisy: bool, weight: float
) -> float:
    """Return the squared distance between corners ``k`` - 1 and ``k`` of a path.

    Only the coordinates in ``entries`` count. Differences of base coordinates are multiplied by
    ``weight`` first.
    """
    square = 0.0
    for j in entries:
        delta = _corner(run, waypoints, k, j, noisy) - _corner(run, waypoints, k - 1, j, noisy)
        delta *= weight if j < BASE_DOF else 1.0
        square += delta * delta
    return square


@inner
def _segment_length(run: RunRecord, waypoints: Any, k: int, model: Any) -> float:
    """Return the length of a path from corner ``k`` - 1 to corner ``k``.

    The squares are added in the order of ``numpy.sum``, so that the result is that of
    :func:`coartic.motion.doors.segment_lengths`.
    """
    noisy, weight, dof = model.motor_noise > 0.0, model.base_weight, waypoints.shape[1]
    if model.norm > 0:
        largest = 0.0
        for j in range(dof):
            square = _sum_of_squares(run, waypoints, k, range(j, j + 1), noisy, weight)
            largest = max(largest, square)
        return math.sqrt(largest)
    whole, total = dof - dof % 8, 0.0
    if whole > 0:
        quarters = (0.0, 0.0, 0.0, 0.0)
        for first in range(0, 8, 2):
            pair = 0.0
            for j in range(first, first + 2):
                pair += _sum_of_squares(run, waypoints, k, range(j, whole, 8), noisy, weight)
            quarters = (quarters[1], quarters[2], quarters[3], pair)
        total = (quarters[0] + quarters[1]) + (quarters[2] + quarters[3])
    for j in range(whole, dof):
        total += _sum_of_squares(run, waypoints, k, range(j, j + 1), noisy, weight)
    return math.sqrt(total)


@inner
def follow(run: RunRecord, waypoints: Any, robot: RobotRecord, slots: SlotArrays) -> None:
    """Move a run along a path, until its hand hits or the path ends.

    ``waypoints`` has shape ``(W, dof)``. The path has n = ceil(length / m) steps of length m, the
    model's step. Point k < n lies at arc length k m, and point n is the last waypoint. With noise,
    one displacement is drawn, and waypoint w of W (from 1) is displaced by w / W times this
    displacement. Coordinates that no waypoint changes are not displaced. ``q``, ``hit`` and
    ``ticks`` of the run are set, and ``evaluations`` grows by one for each point up to the end of
    the movement. Slot 0 is work space.
    """
    model, last = robot.model, len(waypoints) - 1
    noisy = model.motor_noise > 0.0
    if noisy:
        fill_row(run.target, waypoints[last])
        displace_path(run, waypoints, robot)
    length = 0.0
    for k in range(last + 1):
        length += _segment_length(run, waypoints, k, model)
    steps = int(np.ceil(length / model.step))
    square = largest_square(robot.radius)
    load(slots, 0, 0, run, arm_of(robot, run.hand))
    tip, first_joint = len(slots.length), slots.first_joint[0]
    # Corner ``segment`` is ``before`` along the path, the next one ``after``.
    segment, before, after = -1, 0.0, _segment_length(run, waypoints, 0, model)
    step, run.hit = 0, False
    while True:
        along = step * model.step
        while step < steps and segment < last - 1 and after <= along:
            segment, before = segment + 1, after
            after += _segment_length(run, waypoints, segment + 1, model)
        for j in range(BASE_DOF + slots.links[0]):
            entry_of = j if j < BASE_DOF else first_joint + j - BASE_DOF
            slots.q[j, 0] = _point(
                run, waypoints, segment, before, after, along, step == steps, entry_of, noisy
            )
        find_positions(slots, 1, have_small_angles(slots, 1))
        run.evaluations += 1
        dx, dy = slots.goal[0, 0] - slots.x[tip, 0], slots.goal[1, 0] - slots.y[tip, 0]
        run.hit = dx * dx + dy * dy <= square
        if run.hit or step == steps:
            break
        step += 1
    for j in range(waypoints.shape[1]):
        run.q[j] = _point(run, waypoints, segment, before, after, along, step == steps, j, noisy)
    run.ticks = step + 1


@inner
def _point(
    run: RunRecord,
    waypoints: Any,
    segment: int,
    before: float,
    after: float,
    along: float,
    at_end: bool,
    j: int,
    noisy: bool,
) -> Any:
    """Return entry ``j`` of the point of a path at arc length ``along``.

    The point is in the segment from corner ``segment``, at arc length ``before``, to the next
    corner, at arc length ``after``. If ``at_end`` is True, it is the last waypoint.
    """
    if at_end:
        return _corner(run, waypoints, len(waypoints) - 1, j, noisy)
    begin = _corner(run, waypoints, segment, j, noisy)
    end = _corner(run, waypoints, segment + 1, j, noisy)
    return (end - begin) / (after - before) * (along - before) + begin


@inlined
def follow_paths(
    count: int, offset: int, movements: Any, waypoints: Any, robot: RobotRecord, batch: Batch
) -> None:
    """Follow the path of each of the first ``count`` runs whose action is :data:`FOLLOW`.

    Row ``offset`` + n of ``movements``, shape ``(N, 3)``, belongs to run n. The row contains the
    action, and the start and the end (exclusive) of the run's range of rows in ``waypoints``.
    """
    for i in range(count):
        run = batch.runs[i]
        if run.action == FOLLOW:
            begin, end = movements[offset + i, 1], movements[offset + i, 2]
            follow(run, waypoints[begin:end], robot, batch.slots[0])


@entry
def path_kernel(robot: NDArray[np.void], waypoints: Any, batch: Batch) -> None:
    """Move the first run of a batch along a path (:func:`follow`)."""
    follow(batch.runs[0], waypoints, robot[0], batch.slots[0])


@entry
def move_kernel(stop_on_arrival: bool, robot: NDArray[np.void], batch: Batch) -> None:
    """Move the first run of a batch to its ``target``, without noise (:func:`move_slots`).

    ``robot`` comes from :func:`robot_parameters`.
    """
    run = batch.runs[0]
    fill_row(run.end, run.target)
    run.acting = True
    move_acting(1, stop_on_arrival, robot[0], batch)
