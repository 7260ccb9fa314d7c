"""Movement: straight lines in joint space, one step at a time, -1 a tick.

The paper's **Move** (section *Generating Movement for Each Goal*). The k-th point
of a movement from q to q^t is ``q + k m (q^t - q) / |q^t - q|`` for k < n and q^t
for k = n = ceil(|q^t - q| / m). Before each step the stopping rule is evaluated: the
chosen hand is within the goal's radius, or, for a movement towards a learned or
planned target, within θ^a of where the target would put it. A movement of k steps
takes k + 1 ticks, the last one being the tick that detects arrival (inferred: it
gives the published initial rewards exactly).

The kernel gives the result of that loop without visiting every step. Along the
line every absolute link angle turns at a constant rate, so per step the hand moves
by at most ``s = |Δbase| + Σ length |Δangle|``, its velocity changes by at most
``c = Σ length Δangle²``, and, since a norm lies above its tangents, its distance to
a fixed point after τ steps is at least ``d - uτ - cτ²/2`` with u its closing speed
now. Steps that either bound keeps clear of both stopping discs are skipped.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from coartic.internal.limits import real_array
from coartic.internal.text import short_repr
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion import trigonometry
from coartic.motion.compiled import entry, fill_row, inner, shared
from coartic.motion.robot_parameters import arm_of, robot_parameters_for
from coartic.motion.slots import (
    GOING,
    compact,
    padded_count,
    place,
    runs_for,
    slots_for,
    start,
    winding,
)
from coartic.robot import BASE_DOF, HANDS, Array, Hand, Robot

# Distance kept clear beyond what the bounds ask for, which is more where positions are rounded by
# more: a joint's share of how far from 0 they, and the angles of the arm times its length, can be.
_CLEARANCE, _ROUNDING = 1e-9, 1e-15
# The bounds are in single precision: these outweigh its rounding (6e-8) and what it takes for 0.
_single = np.float32
_LESS, _FEWER, _UNDERFLOW = _single(1.0 - 6e-7), _single(1.0 - 1e-5), _single(1e-18)
_NOTHING, _OVERFLOW = _single(0.0), _single(math.inf)
_IN_GOAL, _MISSED = 1.0, 2.0  # statuses of a slot
LARGEST_ENTRY = 1e5  # of any entry of a configuration or goal, length unit or rad


class MoveResult(NamedTuple):
    """Result of one movement (:func:`move`)."""

    q: Array
    """Configuration in which the movement stopped, shape ``(dof,)``, length unit (base) and rad
    (joints)."""
    ticks: int
    """Control ticks spent; the reward of the movement is ``-ticks``."""
    hit: bool
    """Whether the hand is within the goal's radius."""
    evaluations: int
    """Forward-kinematics evaluations the kernel made."""

    def __repr__(self) -> str:
        return short_repr(self, ticks=self.ticks, hit=self.hit, q=self.q)


@inner
def largest_square(length: float) -> float:
    """The largest number whose square root, as it is rounded, does not exceed a length."""
    square = length * length
    while math.sqrt(square) > length:
        square = np.nextafter(square, 0.0)
    while math.sqrt(np.nextafter(square, math.inf)) <= length:
        square = np.nextafter(square, math.inf)
    return square


@inner
def clear_steps(square: float, rim: float, closing: float, slowness: float, bend: float) -> Any:
    """Number of steps during which the hand provably stays out of a disc.

    ``square`` is that of the distance d to its centre, of which ``rim`` is too near, ``closing``
    d times the closing speed u; ``slowness`` is 1 / s, and ``bend`` c of the module's text. In
    single precision, in which roots and quotients, most of the work, cost a third.
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
def set_off(at: Any, count: int, step: float) -> bool:
    """Set rates, bounds and number of steps of every slot.

    Returns True if all angles stay in the range of the fast cosine.
    """
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
        at.step[i], at.last[i] = 0.0, last
        # No joint turns farther than at the farther end, and, where it passes it, a step.
        most = winding(at.start, i) + winding(at.target, i) + step * len(at.length)
        far += 0 if most < trigonometry.LARGEST else 1
        away = reach * (1.0 + most) + step
        for j in range(BASE_DOF):
            away += abs(at.start[j, i]) + abs(at.target[j, i]) + abs(at.shoulder[j, i])
        at.clearance[i] = _CLEARANCE + _ROUNDING * len(at.x) * away
    return far == 0


@inner
def place_between(at: Any, count: int, step: float) -> None:
    """The point at which each slot is now."""
    for i in range(padded_count(count)):
        fraction = at.step[i] * step / at.distance[i]
        for j in range(len(at.q)):
            begin, end = at.start[j, i], at.target[j, i]
            between = begin + fraction * (end - begin)
            at.q[j, i] = end if at.step[i] == at.last[i] else between


@inner
def look(
    at: Any,
    count: int,
    radius: float,
    stop_on_arrival: bool,
    near: float,
    hit: float,
    arrived: float,
) -> int:
    """Evaluate the stopping rule, or skip the steps that are clear; slots that have ended.

    A movement on arrival stops ``near`` the end. ``hit`` and ``arrived`` are the largest squares of
    distances to the goal and to the end at which a movement stops.
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
        rim = radius + at.clearance[i]
        clear = clear_steps(to_goal, rim, closing, at.slowness[i], at.bend[i])
        stop = at.step[i] == at.last[i]
        if stop_on_arrival:
            dx, dy = at.end[0, i] - at.x[tip, i], at.end[1, i] - at.y[tip, i]
            to_end = dx * dx + dy * dy
            stop |= to_end <= arrived
            closing = velocity_x * dx + velocity_y * dy
            rim = near + at.clearance[i]
            clear = min(clear, clear_steps(to_end, rim, closing, at.slowness[i], at.bend[i]))
        status = _MISSED if stop else GOING
        status = _IN_GOAL if to_goal <= hit else status
        # Every step up to step + clear is clear of both discs.
        after = min(at.step[i] + 1.0 + np.floor(min(clear, at.last[i])), at.last[i])
        at.step[i] = after if status == GOING else at.step[i]
        at.status[i] = status
        ended += 0 if (status == GOING) | (i >= count) else 1
    return ended


@shared
def move_slots(
    slots: Any, count: int, stop_on_arrival: bool, robot_parameters: Any, runs: Any
) -> None:
    """Move the first ``count`` slots until each has ended.

    Each run's ``q``, from which it started to its ``target``, becomes the configuration in
    which it stopped; the rest of its record says how.
    """
    at, evaluations = slots.at[0], 0
    step, near = robot_parameters.model.step, robot_parameters.model.arrival_tolerance
    radius = robot_parameters.radius
    hit, arrived = largest_square(radius), largest_square(near)
    is_near = set_off(at, count, step)
    if stop_on_arrival:
        for j in range(len(at.q)):
            fill_row(at.q[j], at.target[j])
        place(at, count, is_near)
        fill_row(at.end[0], at.x[-1])
        fill_row(at.end[1], at.y[-1])
        evaluations += 1
    while count > 0:
        place_between(at, count, step)
        place(at, count, is_near)
        evaluations += 1
        ended = look(at, count, radius, stop_on_arrival, near, hit, arrived)
        if ended == 0:
            continue
        for slot in range(count - 1, -1, -1):
            if at.status[slot] == GOING:
                continue
            run = runs[at.run[slot]]
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
            compact(slots.moved, slot, count)
            ended -= 1
            if ended == 0:
                break


@entry
def move_kernel(stop_on_arrival: bool, robot_parameters: Any, slots: Any, runs: Any) -> None:
    """Move the only run."""
    run = runs[0]
    start(slots.at[0], 0, 0, run.q, run.target, arm_of(robot_parameters[0], run.hand), run.goal)
    move_slots(slots, 1, stop_on_arrival, robot_parameters[0], runs)


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
        Where it stands, length unit (base) and rad (joints).
    target : ndarray, shape (dof,)
        Target configuration, likewise.
    hand : {"left", "right"}
        The hand that is to hit the goal.
    goal : tuple of float
        Centre of the goal, x and y, length unit.
    radius : float
        Radius of the goal, length unit.
    stop_on_arrival : bool
        Whether the movement also ends where the hand is near the place to which the target brings
        it. A corrective movement does not: it ends on hitting the goal, or at its target.
    model : MotionModel
        The constants.

    Returns
    -------
    MoveResult
        Where the robot stopped, the control ticks it took, and whether the goal is hit.

    Raises
    ------
    ValueError
        A shape is wrong, a figure is not finite or beyond 100,000, or there is no such hand.

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    robot.arm(hand)  # refuses what is no hand
    runs = runs_for(1, robot)
    run, figures = runs[0], slice(robot.dof)
    run["q"][figures] = configuration(robot, q)
    run["target"][figures] = configuration(robot, target)
    run["hand"], run["goal"] = HANDS.index(hand), check_goal(goal, radius)
    robot_parameters = robot_parameters_for(robot, radius, model=check_model(model))
    move_kernel(stop_on_arrival, robot_parameters, slots_for(robot), runs)
    return MoveResult(
        run["q"][figures].copy(), int(run["ticks"]), bool(run["hit"]), int(run["evaluations"])
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
    """Follow a joint-space path through ``waypoints`` (k, dof) until the goal is hit.

    The k-th point lies at arc length ``k m`` of the polyline from ``q`` through the
    waypoints, the last point at its end. The movement stops at the first point with
    the hand within ``radius`` of the goal, or at the end; k steps take k + 1 ticks, as
    for :func:`move`. Raises ValueError for a wrong shape.
    """
    check_goal(goal, radius), check_model(model)
    points = path_points(robot, q, waypoints, model)
    last = len(points) - 1
    misses = robot.forward_kinematics(points, hand) - np.asarray(goal, dtype=np.float64)
    inside = np.flatnonzero(np.hypot(*misses.T) <= radius)
    k = int(inside[0]) if inside.size else last
    return MoveResult(np.array(points[k]), k + 1, bool(inside.size), k + 1)


def path_points(robot: Robot, q: Array, waypoints: Array, model: MotionModel = PAPER) -> Array:
    """The points of a path, ``(n + 1, dof)``: its steps of length m and its end.

    Point k lies at arc length ``k m`` of the polyline from ``q`` through ``waypoints``
    (k, dof). Raises ValueError for a wrong shape.
    """
    corners = np.vstack([configuration(robot, q), *(configuration(robot, w) for w in waypoints)])
    lengths = np.sqrt((np.diff(corners, axis=0) ** 2).sum(axis=1))
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    at = np.append(np.arange(math.ceil(ends[-1] / model.step)) * model.step, ends[-1])
    points = np.stack([np.interp(at, ends, joint) for joint in corners.T], axis=1)
    points[-1] = corners[-1]
    return points


def configuration(robot: Robot, q: Any) -> Array:
    """A contiguous copy of one configuration; ValueError where the shape is wrong."""
    array = np.array(real_array("configuration", q), order="C")
    if array.shape != (robot.dof,):
        raise ValueError(f"configuration has shape {array.shape}; this robot needs ({robot.dof},)")
    if not (np.abs(array) <= LARGEST_ENTRY).all():
        what = (
            f"has a figure beyond {LARGEST_ENTRY:g}"
            if np.isfinite(array).all()
            else "is not finite"
        )
        raise ValueError(f"configuration {array.tolist()} {what}")
    return array


def check_goal(centre: Any, radius: float = 0.0) -> tuple[float, float]:
    """The centre of a goal; ValueError where it is not finite or beyond ``LARGEST_ENTRY``."""
    x, y = float(centre[0]), float(centre[1])
    if not (abs(x) <= LARGEST_ENTRY and abs(y) <= LARGEST_ENTRY):
        raise ValueError(f"goal ({x}, {y}) is not finite or lies beyond {LARGEST_ENTRY:g}")
    if not 0.0 <= radius <= LARGEST_ENTRY:
        raise ValueError(f"radius is {radius}; it must be a number from 0 to {LARGEST_ENTRY:g}")
    return x, y
