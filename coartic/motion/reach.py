"""Reaching for a goal: the one thing that trials and executions are reached of.

An arm first moves towards its target, if it has one. Where that misses the goal, the corrective
process **A** looks for a configuration that hits it, and the arm moves there (paper, sections
*Generating Movement for Each Goal* and *The Corrective Process*). Many arms do so side by side;
what one gives depends neither on the others nor on their number.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, MotionModel
from coartic.motion.compiled import entry, fill_row, inlined, inner
from coartic.motion.corrective import Corrector, correct_lanes
from coartic.motion.lanes import LANES, board, depart, lanes_for, runs_for
from coartic.motion.movement import Goal, move_lanes
from coartic.motion.problem import arm_of
from coartic.robot import Array, Robot
from coartic.threads import in_parts


class Reached(NamedTuple):
    """What came of N arms, or of N arms and G goals: then each shape is ``(N, G, ...)``."""

    q: Array
    """Where each ended, shape ``(N, dof)``; NaN for a goal that was not attempted."""
    hit: NDArray[np.bool_]
    """Whether its hand is in the goal, shape ``(N,)``."""
    ticks: NDArray[np.int64]
    """Control ticks of its movements, shape ``(N,)``."""
    correcting: NDArray[np.int64]
    """Control ticks of the corrective movement among them."""
    corrected: Array
    """Target of its corrective movement, shape ``(N, dof)``; NaN where none was reached."""
    corrections: NDArray[np.int64]
    """Corrective movements reached, 0 or 1: 0 also where **A** did not converge."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations reached."""


class Requests(NamedTuple):
    """What the kernel reads: N arms in K groups, each to G goals in turn."""

    starts: Any  # (N, dof)
    hands: Any  # (N, G)
    targets: Any  # (N, G, dof), in which the kernel fills in joints without a target
    stops: Any  # (N, G) whether the movement to the target ends on arrival
    bounds: Any  # (K + 1,) first arm of each group, and the one after the last
    goals: Any  # (K, G, 2)


class Setup(NamedTuple):
    """Robot, constants and options."""

    left: Any
    right: Any
    radius: float
    corrector: Corrector
    model: MotionModel
    corrects: bool
    looks: bool


class Batch(NamedTuple):
    """What a lot of arms works on, each now at the same goal."""

    runs: Any  # records: see runs_for
    going: Any  # whether no goal was missed so far
    aims: Any  # whether the arm has a target
    lanes: Any


@inner
def is_empty(target: Any) -> bool:
    """Whether no joint has a target."""
    for figure in target:  # noqa: SIM110 (which the compiler does not know)
        if not math.isnan(figure):
            return False
    return True


@inlined
def set_targets(first: int, count: int, g: int, arms: Any, batch: Any) -> None:
    """Set the targets; an arm without one stays where it is."""
    for i in range(count):
        run, target = batch.runs[i], arms.targets[first + i, g]
        run.hit = False
        run.evaluations = 0
        fill_row(run.target, run.q)
        batch.aims[i] = batch.going[i] and not is_empty(target)
        if batch.aims[i]:
            for j in range(len(target)):
                if not math.isnan(target[j]):
                    run.target[j] = target[j]
            fill_row(target, run.target)


@inner
def move_acting(
    first: int, count: int, g: int, goal: Any, stops: bool, arms: Any, setup: Any, batch: Any
) -> None:
    """Move the acting arms to their targets."""
    lane = 0
    for i in range(count):
        run = batch.runs[i]
        if run.acting:
            depart(
                batch.lanes.at, lane, i, run.q, run.target, arm_of(setup, arms.hands[first + i, g])
            )
            lane += 1
    if lane > 0:
        move_lanes(batch.lanes, lane, goal, stops, setup.model, batch.runs)


@inlined
def attempt(
    first: int, count: int, g: int, goal: Any, arms: Any, setup: Any, reached: Any, batch: Any
) -> None:
    """Move to the targets; see whether arms without one are in the goal already."""
    for stops in (True, False):
        for i in range(count):
            aims = batch.aims[i]
            # A movement to where an arm is tells whether it hits; it needs no other end.
            needed = batch.going[i] and (aims or setup.looks)
            batch.runs[i].acting = needed and (aims and arms.stops[first + i, g]) == stops
        move_acting(first, count, g, goal, stops, arms, setup, batch)
        for i in range(count):
            if batch.runs[i].acting and batch.aims[i]:
                reached.ticks[first + i, g] = batch.runs[i].ticks


@inlined
def correct_missed(
    first: int, count: int, g: int, goal: Any, arms: Any, setup: Any, reached: Any, batch: Any
) -> None:
    """Have **A** finish what was missed."""
    lane = 0
    for i in range(count):
        run = batch.runs[i]
        run.acting = batch.going[i] and not run.hit
        if run.acting:
            fill_row(run.target, run.q)
            board(batch.lanes.at, lane, i, run.q, arm_of(setup, arms.hands[first + i, g]))
            lane += 1
    correct_lanes(batch.lanes, lane, goal, setup.corrector, setup.model, batch.runs)
    for i in range(count):
        run = batch.runs[i]
        if run.acting:
            reached.iterations[first + i, g] = run.iterations
            run.acting = run.converged
            if run.converged:
                reached.corrections[first + i, g] = 1
                fill_row(reached.corrected[first + i, g], run.target)
    move_acting(first, count, g, goal, False, arms, setup, batch)
    for i in range(count):
        if batch.runs[i].acting:
            reached.correcting[first + i, g] = batch.runs[i].ticks
            reached.ticks[first + i, g] += batch.runs[i].ticks


@inlined
def clear(n: int, reached: Any) -> None:
    """Note that an arm has not done anything yet."""
    for g in range(reached.hit.shape[1]):
        reached.hit[n, g] = False
        reached.ticks[n, g] = reached.correcting[n, g] = reached.corrections[n, g] = 0
        reached.iterations[n, g] = reached.evaluations[n, g] = 0
        for j in range(reached.q.shape[2]):
            reached.q[n, g, j] = reached.corrected[n, g, j] = math.nan


@inlined
def reach_lot(
    first: int, count: int, group: int, arms: Any, setup: Any, reached: Any, batch: Any
) -> None:
    """Requests of one group, as many as there is room for."""
    for i in range(count):
        clear(first + i, reached)
        fill_row(batch.runs[i].q, arms.starts[first + i])
        batch.going[i] = True
    for g in range(arms.goals.shape[1]):
        goal = Goal(arms.goals[group, g, 0], arms.goals[group, g, 1], setup.radius)
        set_targets(first, count, g, arms, batch)
        attempt(first, count, g, goal, arms, setup, reached, batch)
        if setup.corrects:
            correct_missed(first, count, g, goal, arms, setup, reached, batch)
        for i in range(count):
            if batch.going[i]:
                fill_row(reached.q[first + i, g], batch.runs[i].q)
                reached.hit[first + i, g] = batch.going[i] = batch.runs[i].hit
                reached.evaluations[first + i, g] = batch.runs[i].evaluations


@entry
def reach_goals(arms: Any, setup: Any, reached: Any, batch: Any) -> None:
    """Every arm to its goals, each group of arms in lots."""
    room = len(batch.runs)
    for group in range(len(arms.goals)):
        end = arms.bounds[group + 1]
        for first in range(arms.bounds[group], end, room):
            reach_lot(first, min(room, end - first), group, arms, setup, reached, batch)


SHARE = 14 * LANES
"""Arms for a thread, at least: to begin one takes as long as a hundred trials."""
_IDLE: dict[int, list[Batch]] = {}
_ONLY = np.zeros(1, dtype=np.int64)


def blank(arms: Requests) -> Reached:
    """Arrays for what comes of arms, to be filled."""
    count, goals, dof = arms.targets.shape
    places, counts = np.empty((2, count, goals, dof)), np.empty((5, count, goals), dtype=np.int64)
    hit = np.empty((count, goals), dtype=np.bool_)
    ticks, correcting, *others = counts
    return Reached(places[0], hit, ticks, correcting, places[1], *others)


def batch_for(robot: Robot) -> Batch:
    """Arrays for the kernel to work on: some that are idle, or new ones."""
    try:
        return _IDLE.setdefault(robot.most_links, []).pop()  # no other thread gets it
    except IndexError:
        flags = np.zeros((2, LANES), dtype=np.bool_)
        return Batch(runs_for(LANES, robot), flags[0], flags[1], lanes_for(robot))


def reach_with(robot: Robot, arms: Requests, setup: Setup) -> Reached:
    """Let N arms in K groups reach for G goals each, in turn, until they miss one.

    Nothing is checked. In ``arms.targets`` joints without a target are filled in, for goals that
    were attempted. Many arms of one group are shared among threads.
    """
    count, reached = len(arms.targets), blank(arms)

    def work(part: slice) -> None:
        some, own, rows = arms, reached, part.stop - part.start
        if rows < count:
            each = [field[part] for field in arms[:4]]
            some = Requests._make([*each, np.array([0, rows]), arms.goals])
            own = Reached._make(field[part] for field in reached)
        batch = batch_for(robot)
        reach_goals(some, setup, own, batch)
        _IDLE[robot.most_links].append(batch)

    if len(arms.goals) == 1 and count >= 2 * SHARE:
        in_parts(work, count, SHARE)
    else:
        work(slice(0, count))
    return reached


def setup_for(
    robot: Robot,
    radius: float,
    *,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
    corrects: bool = True,
    looks: bool = True,
) -> Setup:
    """Robot, constants and options for the kernel; see :func:`reach_unchecked`."""
    free = Corrector("x" not in locked_base, "y" not in locked_base)
    return Setup(robot.arm("left"), robot.arm("right"), radius, free, model, corrects, looks)


def reach_unchecked(
    robot: Robot,
    q: Array,
    hands: NDArray[np.int64],
    goals: Array,
    radius: float,
    targets: Array | None = None,
    *,
    stops: bool | NDArray[np.bool_] = True,
    corrects: bool = True,
    looks: bool = True,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Reached:
    """Let N arms reach for a goal each, side by side, from where they are.

    Nothing is checked. ``q`` has shape ``(N, dof)``, length unit (base) and rad (joints); ``hands``
    ``(N,)``, indices into HANDS; ``goals`` ``(N, 2)`` and ``radius`` is that of them all, length
    unit. ``targets`` has shape ``(N, dof)``: where a joint's target is NaN, the joint keeps its
    value, and an arm whose row is NaN has none. ``stops``, of each or of all: whether the movement
    to the target ends, too, where the hand has arrived (a learned or planned one), or on a hit
    alone (a corrective one that is reached again). ``corrects``: whether **A** finishes what is
    missed. ``looks``: whether an arm without a target may be in its goal already; else **A** begins
    at once. ``locked_base`` holds ``"x"`` and/or ``"y"``; **A** leaves these as they are. Source:
    paper, sections *Generating Movement for Each Goal* and *The Corrective Process*.
    """
    count = len(q)
    order = back = bounds = _ONLY
    if count != 1:  # arms of one goal are neighbours, in the order given
        order = np.lexsort(goals.T)
        places = goals[order]
        begins = np.ones(count, dtype=np.bool_)
        begins[1:] = (places[1:] != places[:-1]).any(axis=1)
        bounds = np.flatnonzero(begins)
        back = np.empty_like(order)
        back[order] = np.arange(count)
    given = np.full((count, robot.dof), np.nan) if targets is None else targets
    requests = Requests(
        starts=q[order],
        hands=hands[order, None],
        targets=given[order, None],
        stops=np.broadcast_to(stops, count)[order, None],
        bounds=np.append(bounds, count),
        goals=goals[order[bounds], None],
    )
    setup = setup_for(
        robot, radius, locked_base=locked_base, model=model, corrects=corrects, looks=looks
    )
    reached = reach_with(robot, requests, setup)
    return Reached._make(field[back, 0] for field in reached)
