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

from coartic.compiled import entry, inner, joint_chain
from coartic.model import PAPER, MotionModel, checked_model
from coartic.robot import Array, Hand, Robot

# Distance kept clear beyond what the bounds ask for: far above the rounding of
# positions (1e-14 for the paper's robot, 1e-11 at coordinates of 10 000), far below any
# step. It holds for figures up to LARGEST, so larger ones are refused.
_CLEARANCE = 1e-9
LARGEST = 1e5  # of any entry of a configuration or goal, length unit or rad


class Goal(NamedTuple):
    """A goal as the kernels read it, length unit."""

    x: float
    y: float
    radius: float


class Scratch(NamedTuple):
    """Work space of the kernels: joint positions, link rates, start of a movement."""

    xs: Any
    ys: Any
    rates: Any
    start: Any


class MoveResult(NamedTuple):
    """Outcome of one movement."""

    q: Array
    """Configuration in which the movement stopped, shape ``(dof,)``."""
    ticks: int
    """Control ticks spent; the reward of the movement is ``-ticks``."""
    hit: bool
    """Whether the hand is within the goal's radius."""
    evaluations: int
    """Forward-kinematics evaluations the kernel made."""


def scratch_for(robot: Robot) -> Scratch:
    """Work space large enough for either arm of ``robot``."""
    longest = max(len(robot.left_links), len(robot.right_links))
    return Scratch(
        np.empty(longest + 1), np.empty(longest + 1), np.empty(longest), np.empty(robot.dof)
    )


@inner
def clear_steps(gap: float, closing: float, speed: float, bend: float) -> float:
    """Number of steps during which a gap provably stays open.

    ``gap`` > 0 is the distance to a disc's rim, ``closing`` the rate at which it
    shrinks now, ``speed`` the bound s and ``bend`` the bound c of the module's text.
    """
    gap -= _CLEARANCE
    if gap <= 0.0:
        return 0.0
    steps = gap / speed if speed > 0.0 else math.inf
    root = math.sqrt(closing * closing + 2.0 * bend * gap)
    if closing > 0.0:
        steps = max(steps, 2.0 * gap / (closing + root))
    elif bend > 0.0:
        steps = max(steps, (root - closing) / bend)
    else:
        steps = math.inf
    return steps * (1.0 - 1e-9)


def _move(
    q: Any, target: Any, arm: Any, goal: Any, stop_on_arrival: bool, model: Any, scratch: Any
) -> tuple[int, bool, int]:
    """Move ``q`` in place; ticks, goal hit, forward-kinematics evaluations."""
    xs, ys, rates, start = scratch
    tip = len(arm.links)
    evaluations = 0

    square = 0.0
    for j in range(len(q)):
        start[j] = q[j]
        delta = target[j] - q[j]
        square += delta * delta
    distance = math.sqrt(square)
    last = math.ceil(distance / model.step)

    end_x = 0.0
    end_y = 0.0
    if stop_on_arrival:
        joint_chain(target, arm, xs, ys)
        evaluations += 1
        end_x = xs[tip]
        end_y = ys[tip]

    per_step = model.step / distance if distance > 0.0 else 0.0
    base_x = (target[0] - start[0]) * per_step
    base_y = (target[1] - start[1]) * per_step
    speed = math.sqrt(base_x * base_x + base_y * base_y)
    bend = 0.0
    rate = 0.0
    for link in range(tip):
        joint = arm.first + link
        rate += (target[joint] - start[joint]) * per_step
        rates[link] = rate
        speed += arm.links[link] * abs(rate)
        bend += arm.links[link] * rate * rate

    k = 0
    while True:
        if k >= last:
            k = last
            for j in range(len(q)):
                q[j] = target[j]
        else:
            fraction = k * model.step / distance
            for j in range(len(q)):
                q[j] = start[j] + fraction * (target[j] - start[j])
        joint_chain(q, arm, xs, ys)
        evaluations += 1

        goal_dx = goal.x - xs[tip]
        goal_dy = goal.y - ys[tip]
        goal_distance = math.sqrt(goal_dx * goal_dx + goal_dy * goal_dy)
        if goal_distance <= goal.radius:
            return k + 1, True, evaluations
        if k == last:
            return k + 1, False, evaluations

        velocity_x = base_x
        velocity_y = base_y
        for link in range(tip):
            velocity_x -= rates[link] * (ys[link + 1] - ys[link])
            velocity_y += rates[link] * (xs[link + 1] - xs[link])

        closing = (velocity_x * goal_dx + velocity_y * goal_dy) / goal_distance
        clear = clear_steps(goal_distance - goal.radius, closing, speed, bend)
        if stop_on_arrival:
            end_dx = end_x - xs[tip]
            end_dy = end_y - ys[tip]
            end_distance = math.sqrt(end_dx * end_dx + end_dy * end_dy)
            if end_distance <= model.arrival_tolerance:
                return k + 1, False, evaluations
            closing = (velocity_x * end_dx + velocity_y * end_dy) / end_distance
            gap = end_distance - model.arrival_tolerance
            clear = min(clear, clear_steps(gap, closing, speed, bend))
        # Every step up to k + clear is clear of both discs.
        k += 1 + int(min(clear, float(last)))


move_kernel = inner(_move)
_compiled_move = entry(_move)


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
    """Move from ``q`` towards ``target`` until the hand hits the goal or arrives.

    ``q`` and ``target`` have shape ``(dof,)``. ``stop_on_arrival=False`` is a
    corrective movement, which ends only on hitting the goal (or at its target).
    Raises ValueError for a wrong shape and for figures that are not finite or beyond
    ``LARGEST``. Source: paper, *Generating Movement for
    Each Goal*.
    """
    position = configuration(robot, q)
    end = configuration(robot, target)
    ticks, hit, evaluations = _compiled_move(
        position,
        end,
        robot.arm(hand),
        checked_goal(goal, radius),
        stop_on_arrival,
        checked_model(model),
        scratch_for(robot),
    )
    return MoveResult(position, int(ticks), bool(hit), int(evaluations))


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
    checked_goal(goal, radius), checked_model(model)
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
    array = np.array(q, dtype=np.float64)
    if array.shape != (robot.dof,):
        raise ValueError(f"configuration has shape {array.shape}; this robot needs ({robot.dof},)")
    if not (np.abs(array) <= LARGEST).all():
        what = f"has a figure beyond {LARGEST:g}" if np.isfinite(array).all() else "is not finite"
        raise ValueError(f"configuration {array.tolist()} {what}")
    return array


def checked_goal(centre: Any, radius: float = 0.0) -> Goal:
    """A goal for the kernels; ValueError where it is not finite or beyond ``LARGEST``."""
    x, y = float(centre[0]), float(centre[1])
    if not (abs(x) <= LARGEST and abs(y) <= LARGEST):
        raise ValueError(f"goal ({x}, {y}) is not finite or lies beyond {LARGEST:g}")
    if not 0.0 <= radius <= LARGEST:
        raise ValueError(f"radius is {radius}; it must be a number from 0 to {LARGEST:g}")
    return Goal(x, y, float(radius))
