"""Movements: straight lines in joint space, and paths.

The robot moves on a straight line in joint space, one step per control tick, and each tick costs a
reward of 1 (paper, section *Generating Movement for Each Goal*). Point k of a movement from q to
q^t is ::

    q + k m (q^t - q) / |q^t - q|   for k < n
    q^t                             for k = n = ceil(|q^t - q| / m)

where m is the length of a step. Before each step the stopping rule is evaluated. A movement ends if

- the chosen hand is within the goal's radius, or
- the movement is towards a learned or planned target, and the hand is within θ^a of the position to
  which the target would bring it.

A movement of k steps takes k + 1 ticks; the last tick detects arrival (inferred: it gives the
published initial rewards exactly).

The kernels move many arms side by side. They give the same results as a loop that evaluates the
rule at every step, although they do not visit every step (:func:`clear_steps`).
"""

from __future__ import annotations

import math
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
    arm_of,
    batch_for,
    compact,
    find_positions,
    padded_count,
    robot_parameters,
    start,
    winding,
)
from coartic.motion.compile import entry, fill_row, inner, shared
from coartic.robot import BASE_DOF, HANDS, Array, Hand, Robot

# Each bound has a clearance against rounding: a constant, and per joint a share (_ROUNDING) of the
# size of positions and angles.
_CLEARANCE, _ROUNDING = 1e-9, 1e-15
# The bounds are in single precision. These numbers outweigh its rounding (6e-8) and underflow.
_single = np.float32
_LESS, _FEWER, _UNDERFLOW = _single(1.0 - 6e-7), _single(1.0 - 1e-5), _single(1e-18)
_NOTHING, _OVERFLOW = _single(0.0), _single(math.inf)
_IN_GOAL, _MISSED = 1.0, 2.0  # status of a slot whose movement has ended
LARGEST_ENTRY = 1e5  # of any entry of a configuration or goal, in length units or rad


class MoveResult(NamedTuple):
    """Result of one movement (:func:`move`)."""

    q: Array
    """Configuration in which the movement stopped, shape ``(dof,)``, in length units and rad."""
    ticks: int
    """Control ticks spent. The reward of the movement is ``-ticks``."""
    hit: bool
    """True if the hand is within the goal's radius."""
    evaluations: int
    """Forward-kinematics evaluations; on a path (:func:`follow`) one per tick."""


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
    """Return a number of steps for which the hand certainly stays out of a disc.

    The number is usually not an integer. It is 0 if the hand may be in the disc.

    Parameters
    ----------
    square : float
        d²: squared distance of the hand from the centre of the disc.
    rim : float
        r: radius of the disc.
    closing : float
        d u, where u is the closing speed, in length units per step.
    slowness : float
        1 / s, where s is a bound on the hand's path per step.
    bend : float
        c: bound on the change of the hand's velocity per step.

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
def divide_steps(slots: SlotArrays, count: int, step: float) -> bool:
    """Divide the movements in the first ``count`` slots into steps, in place.

    This sets rates, bounds and numbers of steps of length ``step`` in joint space; ``distance``,
    which :func:`start` has filled with its square, becomes the distance. Return whether all link
    angles certainly stay below 1e5 rad in size (:func:`winding`).
    """
    large = 0
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
        large += 0 if angle < trigonometry.LARGEST else 1
        size = reach * (1.0 + angle) + step
        for j in range(BASE_DOF):
            size += abs(slots.start[j, i]) + abs(slots.target[j, i]) + abs(slots.shoulder[j, i])
        slots.clearance[i] = _CLEARANCE + _ROUNDING * len(slots.x) * size
    return large == 0


@inner
def _place_between(slots: SlotArrays, count: int, step: float) -> None:
    """Set ``q`` in the first ``count`` slots to the movement's point at its present step.

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

    This sets ``status`` and, where a movement goes on, ``step``, which becomes the next step that
    can end the movement. Return how many movements have ended. A movement ends

    - at its last step;
    - with the hand within ``rims[0]`` (in length units) of the goal's centre; or
    - with ``stop_on_arrival``, also within ``rims[1]`` of where the target brings the hand.

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

    The slots are loaded by :func:`start`, and free afterwards. In the record of each run ``q``,
    ``hit`` and ``ticks`` are set, and ``evaluations`` grows.
    """
    slots, evaluations, step = batch.slots[0], 0, robot.model.step
    rims = robot.radius, robot.model.arrival_tolerance
    squares = largest_square(rims[0]), largest_square(rims[1])
    small_angles = divide_steps(slots, count, step)
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
            q, target = run.q, run.target
            at_end = slots.step[slot] == slots.last[slot]
            fraction = 0.0 if at_end else slots.step[slot] * step / slots.distance[slot]
            for j in range(len(q)):
                between = q[j] + fraction * (target[j] - q[j])
                q[j] = target[j] if at_end else between
            run.hit = slots.status[slot] == _IN_GOAL
            run.ticks = int(slots.step[slot]) + 1
            run.evaluations += evaluations
            count -= 1
            compact(batch.moved, slot, count)
            ended -= 1
            if ended == 0:
                break


@entry
def _move_kernel(stop_on_arrival: bool, robot: NDArray[np.void], batch: Batch) -> None:
    """Move the first run of a batch towards its target.

    ``robot`` comes from :func:`robot_parameters`; :func:`move_slots` says what is set in the run's
    record.
    """
    run = batch.runs[0]
    start(batch.slots[0], 0, 0, run, arm_of(robot[0], run.hand))
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
    """Move straight in joint space until the hand hits the goal or arrives.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : ndarray, shape (dof,)
        Configuration in which the robot stands, in length units (base) and rad (joints).
    target : ndarray, shape (dof,)
        Target configuration, in the same units.
    hand : {"left", "right"}
        The hand that is to hit the goal.
    goal : tuple of float
        Centre of the goal, x and y in length units.
    radius : float
        Radius of the goal (in length units).
    stop_on_arrival : bool
        If True, the movement also ends when the hand is near the position to which the target
        brings it. If False, as in a corrective movement, it ends only on a hit or at its target.
    model : MotionModel
        The constants; only ``step`` and ``arrival_tolerance`` are used.

    Returns
    -------
    MoveResult
        Where the robot stopped, the control ticks of the movement, and whether the goal is hit.

    Raises
    ------
    ValueError
        An argument cannot be used:

        - a shape is wrong;
        - a number is not finite, or beyond 100,000;
        - the radius is below 0;
        - the hand is unknown;
        - a constant of the model is out of bounds.
    TypeError
        ``robot``, ``model`` or ``stop_on_arrival`` has another type.

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    if not isinstance(stop_on_arrival, bool | np.bool_):
        raise TypeError(f"stop_on_arrival is {brief_value(stop_on_arrival)}; it must be a bool")
    batch = one_run(robot, q, hand, goal, radius)
    run, entries = batch.runs[0], slice(robot.dof)
    run["target"][entries] = configuration(robot, target)
    parameters = robot_parameters(robot, radius, model=check_model(model))
    _move_kernel(stop_on_arrival, parameters, batch)
    return MoveResult(
        run["q"][entries].copy(), int(run["ticks"]), bool(run["hit"]), int(run["evaluations"])
    )


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
    """Move along a path through waypoints until the hand hits the goal.

    Without a hit the movement ends at the last waypoint. A movement of k steps takes k + 1 ticks.

    Parameters
    ----------
    robot : Robot
    q : ndarray, shape (dof,)
        Configuration in which the robot stands, in length units (base) and rad (joints).
    waypoints : ndarray, shape (W, dof)
        At least one configuration to pass through (:func:`path_points`).
    hand : {"left", "right"}
    goal : tuple of float
        Centre of the goal, x and y in length units.
    radius : float
        Radius of the goal (in length units).
    model : MotionModel

    Returns
    -------
    MoveResult
        Result of the movement, which stops at the first point of the path at which the hand is in
        the goal, or else at the last waypoint.

    Raises
    ------
    ValueError
        A shape is wrong, the hand is unknown, or a number is not finite or out of bounds.
    TypeError
        ``model`` is not a MotionModel.
    """
    check_goal(goal, radius), check_model(model)
    points = path_points(robot, q, waypoints, model)
    end = len(points) - 1
    misses = robot.forward_kinematics(points, hand) - np.asarray(goal, dtype=np.float64)
    inside = np.flatnonzero(np.hypot(*misses.T) <= radius)
    k = int(inside[0]) if inside.size else end
    return MoveResult(np.array(points[k]), k + 1, bool(inside.size), k + 1)


def line_points(q: Array, target: Array, model: MotionModel = PAPER) -> Array:
    """Return the configurations at the n steps of a straight movement, with both ends.

    ``q`` and ``target`` have shape ``(dof,)``, the result ``(n + 1, dof)``, in length units and
    rad. The results are rounded as in the kernels.
    """
    difference, square = target - q, 0.0
    for value in difference.tolist():
        square += value * value
    distance = math.sqrt(square)
    k = np.arange(math.ceil(distance / model.step))[:, None]
    return np.vstack([q + k * model.step / (distance or 1.0) * difference, target])


def segment_lengths(configurations: ArrayLike) -> Array:
    """Return the joint-space distance from each configuration to the next.

    ``configurations`` has shape ``(k, dof)``, the result ``(k - 1,)``, in a mix of length units and
    rad.
    """
    return np.asarray(np.sqrt((np.diff(configurations, axis=0) ** 2).sum(axis=1)))


def path_points(robot: Robot, q: Array, waypoints: Array, model: MotionModel = PAPER) -> Array:
    """Return the points of the n steps of a path through waypoints in joint space.

    The path goes from ``q``, shape ``(dof,)``, straight to each of the W > 0 ``waypoints`` in turn,
    shape ``(W, dof)``. The result has shape ``(n + 1, dof)``, in length units and rad. Point k < n
    lies k times ``model.step`` along the path; point n is the last waypoint. Raises ValueError for
    a wrong shape, and for a number that is not finite or beyond 100,000.
    """
    shape = (len(waypoints), robot.dof)
    corners = np.vstack([configuration(robot, q), finite_array("waypoints", waypoints, shape)])
    ends = np.concatenate([[0.0], np.cumsum(segment_lengths(corners))])
    lengths = np.append(np.arange(math.ceil(ends[-1] / model.step)) * model.step, ends[-1])
    points = np.stack([np.interp(lengths, ends, joint) for joint in corners.T], axis=1)
    points[-1] = corners[-1]
    return points


def configuration(robot: Robot, q: Any) -> Array:
    """Return one configuration as a new contiguous array, shape ``(dof,)``.

    Raises ValueError for a wrong shape, and for an entry that is not finite or beyond ±100,000.
    """
    return finite_array("configuration", q, (robot.dof,))


def finite_array(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return numbers as a new contiguous array of float64.

    Raises ValueError for a shape other than ``shape``, and for a number that is not finite or
    beyond ±100,000. ``name`` is what the error calls the value.
    """
    array = np.array(real_array(name, value), order="C")
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; it must be {shape}")
    if not (np.abs(array) <= LARGEST_ENTRY).all():
        problem = (
            f"has a number beyond ±{LARGEST_ENTRY:g}"
            if np.isfinite(array).all()
            else "is not finite"
        )
        raise ValueError(f"{name} {brief_value(array.tolist())} {problem}")
    return array


def one_run(robot: Any, q: Any, hand: Any, goal: Any, radius: float = 0.0) -> Batch:
    """Return a batch of one run whose configuration and target are ``q``.

    ``radius`` is only checked. Raises TypeError if ``robot`` is not a Robot, and ValueError for any
    other argument that does not fit.
    """
    if not isinstance(robot, Robot):
        raise TypeError(f"robot is {brief_value(robot)}; it must be a Robot")
    robot.arm(hand)
    batch = batch_for(robot, 1)
    run = batch.runs[0]
    run["q"][: robot.dof] = run["target"][: robot.dof] = configuration(robot, q)
    run["hand"], run["goal"] = HANDS.index(hand), check_goal(goal, radius)
    return batch


def check_goal(centre: Any, radius: float = 0.0) -> tuple[float, float]:
    """Return the centre of a goal, x and y, as two floats.

    Raises ValueError if ``centre`` is not two finite numbers within ±100,000, or if ``radius`` is
    not from 0 to 100,000 (in length units).
    """
    x, y = finite_array("goal", centre, (2,)).tolist()
    check_limits("radius", radius, 0.0, LARGEST_ENTRY)
    return x, y
