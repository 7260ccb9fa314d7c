"""Reaching for a goal: the one thing that trials and executions are made of.

An arm first moves towards its target, if it has one. Where that misses the goal, the corrective
process **A** looks for a configuration that hits it, and the arm moves there (paper, sections
*Generating Movement for Each Goal* and *The Corrective Process*). Many arms do so side by side;
what one gives depends neither on the others nor on their number.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic.model import PAPER, MotionModel, checked_model
from coartic.motion.compiled import entry, fill_row, inlined, inner
from coartic.motion.corrective import Corrector, correct_lanes
from coartic.motion.lanes import LANES, board, depart, lanes_for, runs_for
from coartic.motion.movement import LARGEST, Goal, checked_goal, move_lanes
from coartic.motion.problem import arm_of
from coartic.robot import HANDS, Array, Hand, Robot


class Reached(NamedTuple):
    """What came of N arms, or of N arms and G goals: then each shape is ``(N, G, ...)``."""

    q: Array
    """Where each ended, shape ``(N, dof)``; NaN for a goal that was not attempted."""
    hit: NDArray[np.bool_]
    """Whether its hand is in the goal, shape ``(N,)``."""
    ticks: NDArray[np.int64]
    """Control ticks of its movements, shape ``(N,)``."""
    found: Array
    """Target of its corrective movement, shape ``(N, dof)``; NaN where none was made."""
    corrections: NDArray[np.int64]
    """Corrective movements made, 0 or 1: 0 also where **A** did not converge."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations made."""


class _Asked(NamedTuple):
    """What the kernel reads: N arms in K groups, each to G goals in turn."""

    starts: Any  # (N, dof)
    hands: Any  # (N, G)
    targets: Any  # (N, G, dof), in which the kernel fills in joints without a target
    stops: Any  # (N, G) whether the movement to the target ends on arrival
    bounds: Any  # (K + 1,) first arm of each group, and the one after the last
    goals: Any  # (K, G, 2)


class _How(NamedTuple):
    """Robot, constants and options."""

    left: Any
    right: Any
    radius: float
    corrector: Corrector
    model: MotionModel
    corrects: bool
    looks: bool


class _Work(NamedTuple):
    """What a lot of arms works on, each now at the same goal."""

    runs: Any  # records: see runs_for
    going: Any  # whether no goal was missed so far
    aims: Any  # whether the arm has a target
    lanes: Any


@inner
def _empty(target: Any) -> bool:
    """Whether no joint has a target."""
    for figure in target:  # noqa: SIM110 (which the compiler does not know)
        if not math.isnan(figure):
            return False
    return True


@inlined
def _aim(first: int, count: int, g: int, asked: Any, work: Any) -> None:
    """Set the targets; an arm without one stays where it is."""
    for i in range(count):
        run, target = work.runs[i], asked.targets[first + i, g]
        run.hit = False
        run.evaluations = 0
        fill_row(run.target, run.q)
        work.aims[i] = work.going[i] and not _empty(target)
        if work.aims[i]:
            for j in range(len(target)):
                if not math.isnan(target[j]):
                    run.target[j] = target[j]
            fill_row(target, run.target)


@inner
def _move_acting(
    first: int, count: int, g: int, goal: Any, stops: bool, asked: Any, how: Any, work: Any
) -> None:
    """Move the acting arms to their targets."""
    lane = 0
    for i in range(count):
        run = work.runs[i]
        if run.acting:
            depart(
                work.lanes.at, lane, i, run.q, run.target, arm_of(how, asked.hands[first + i, g])
            )
            lane += 1
    if lane > 0:
        move_lanes(work.lanes, lane, goal, stops, how.model, work.runs)


@inlined
def _attempt(
    first: int, count: int, g: int, goal: Any, asked: Any, how: Any, made: Any, work: Any
) -> None:
    """Move to the targets; see whether arms without one are in the goal already."""
    for stops in (True, False):
        for i in range(count):
            aims = work.aims[i]
            # A movement to where an arm is tells whether it hits; it needs no other end.
            needed = work.going[i] and (aims or how.looks)
            work.runs[i].acting = needed and (aims and asked.stops[first + i, g]) == stops
        _move_acting(first, count, g, goal, stops, asked, how, work)
        for i in range(count):
            if work.runs[i].acting and work.aims[i]:
                made.ticks[first + i, g] = work.runs[i].ticks


@inlined
def _finish(
    first: int, count: int, g: int, goal: Any, asked: Any, how: Any, made: Any, work: Any
) -> None:
    """Have **A** finish what was missed."""
    lane = 0
    for i in range(count):
        run = work.runs[i]
        run.acting = work.going[i] and not run.hit
        if run.acting:
            fill_row(run.target, run.q)
            board(work.lanes.at, lane, i, run.q, arm_of(how, asked.hands[first + i, g]))
            lane += 1
    correct_lanes(work.lanes, lane, goal, how.corrector, how.model, work.runs)
    for i in range(count):
        run = work.runs[i]
        if run.acting:
            made.iterations[first + i, g] = run.iterations
            run.acting = run.converged
            if run.converged:
                made.corrections[first + i, g] = 1
                fill_row(made.found[first + i, g], run.target)
    _move_acting(first, count, g, goal, how.model.corrective_arrival, asked, how, work)
    for i in range(count):
        if work.runs[i].acting:
            made.ticks[first + i, g] += work.runs[i].ticks


@inlined
def _reach_lot(
    first: int, count: int, group: int, asked: Any, how: Any, made: Any, work: Any
) -> None:
    """Arms of one group, as many as there is room for."""
    for i in range(count):
        fill_row(work.runs[i].q, asked.starts[first + i])
        work.going[i] = True
    for g in range(asked.goals.shape[1]):
        goal = Goal(asked.goals[group, g, 0], asked.goals[group, g, 1], how.radius)
        _aim(first, count, g, asked, work)
        _attempt(first, count, g, goal, asked, how, made, work)
        if how.corrects:
            _finish(first, count, g, goal, asked, how, made, work)
        for i in range(count):
            if work.going[i]:
                fill_row(made.q[first + i, g], work.runs[i].q)
                made.hit[first + i, g] = work.going[i] = work.runs[i].hit
                made.evaluations[first + i, g] = work.runs[i].evaluations


@entry
def _reach_all(asked: Any, how: Any, made: Any, work: Any) -> None:
    """Every arm to its goals, each group of arms in lots."""
    room = len(work.runs)
    for group in range(len(asked.goals)):
        end = asked.bounds[group + 1]
        for first in range(asked.bounds[group], end, room):
            _reach_lot(first, min(room, end - first), group, asked, how, made, work)


def reach_in_turn(
    robot: Robot,
    starts: Array,
    hands: NDArray[np.int64],
    goals: Array,
    radius: float,
    targets: Array,
    stops: NDArray[np.bool_],
    *,
    bounds: Sequence[int],
    corrects: bool = True,
    looks: bool = True,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Reached:
    """Let N arms in K groups reach for G goals each, in turn, until they miss one.

    Nothing is checked: :func:`reach` and the callers do that. ``starts`` has shape ``(N, dof)``;
    ``hands`` ``(N, G)``, indices into HANDS; ``goals`` ``(K, G, 2)``, those of a group, whose arms
    are those from ``bounds[k]`` up to ``bounds[k + 1]``; ``targets`` ``(N, G, dof)`` and ``stops``
    ``(N, G)``, as in :func:`reach`. In ``targets`` joints without one are filled in, for goals that
    were attempted.
    """
    places = np.full((2, *hands.shape, robot.dof), np.nan)
    counts = np.zeros((4, *hands.shape), dtype=np.int64)
    hit = np.zeros(hands.shape, dtype=np.bool_)
    made = Reached(places[0], hit, counts[0], places[1], *counts[1:])
    largest = max((end - first for first, end in pairwise(bounds)), default=1)
    lot = max(min(largest, LANES), 1)
    free = ("x" not in locked_base, "y" not in locked_base)
    flags = np.zeros((2, lot), dtype=np.bool_)
    _reach_all(
        _Asked(starts, hands, targets, stops, np.array(bounds, dtype=np.int64), goals),
        _How(
            robot.arm("left"), robot.arm("right"), radius, Corrector(*free), model, corrects, looks
        ),
        made,
        _Work(runs_for(lot, robot), flags[0], flags[1], lanes_for(robot)),
    )
    return made


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
    """:func:`reach` for arrays that are known to fit; ``hands`` are indices into HANDS."""
    count = len(q)
    order = np.lexsort(goals.T)  # arms of one goal are neighbours, in the order given
    places = goals[order]
    begins = np.ones(count, dtype=np.bool_)
    begins[1:] = (places[1:] != places[:-1]).any(axis=1)
    bounds = np.flatnonzero(begins)
    given = np.full((count, robot.dof), np.nan) if targets is None else targets
    made = reach_in_turn(
        robot,
        q[order],
        hands[order, None],
        places[bounds, None],
        radius,
        given[order, None],
        np.broadcast_to(stops, count)[order, None],
        bounds=[*bounds.tolist(), count],
        corrects=corrects,
        looks=looks,
        locked_base=locked_base,
        model=model,
    )
    back = np.empty_like(order)
    back[order] = np.arange(count)
    return Reached._make(field[back, 0] for field in made)


def reach(
    robot: Robot,
    q: ArrayLike,
    hands: Sequence[Hand],
    goals: ArrayLike,
    radius: float,
    targets: ArrayLike | None = None,
    *,
    stops: bool | Sequence[bool] | NDArray[np.bool_] = True,
    corrects: bool = True,
    looks: bool = True,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Reached:
    """Let N arms reach for a goal each, side by side, from where they are.

    ``q`` has shape ``(N, dof)``, length unit (base) and rad (joints); ``hands`` names the hand
    of each, ``goals`` has shape ``(N, 2)`` and ``radius`` is that of them all, length unit.
    ``targets`` has shape ``(N, dof)``: where a joint's target is NaN, the joint keeps its value,
    and an arm whose row is NaN has none. ``stops``, of each or of all: whether the movement to
    the target ends, too, where the hand has arrived (a learned or planned one), or on a hit alone
    (a corrective one that is made again). ``corrects``: whether **A** finishes what is missed.
    ``looks``: whether an arm without a target may be in its goal already; else **A** begins at
    once. ``locked_base`` holds ``"x"`` and/or ``"y"``; **A** leaves these as they are.

    Raises ValueError for shapes that do not fit, for hands that are neither ``"left"`` nor
    ``"right"``, for figures beyond ``LARGEST`` (or not finite: in targets NaN alone is allowed),
    for other locks, and for a model that no movement can be made with. Source: paper, sections
    *Generating Movement for Each Goal* and *The Corrective Process*.
    """
    checked_goal((0.0, 0.0), radius)
    checked_model(model, radius=radius if corrects else None)
    if not set(locked_base) <= {"x", "y"}:
        raise ValueError(f"locked_base is {locked_base!r}; it may name 'x' and 'y'")
    count, dof = len(hands), robot.dof
    if wrong := set(hands) - set(HANDS):
        raise ValueError(f"a hand is 'left' or 'right', not one of {sorted(map(str, wrong))}")
    flags = np.asarray(stops, dtype=np.bool_)
    if flags.shape not in ((), (count,)):
        raise ValueError(f"stops has shape {flags.shape}; needed is one value or ({count},)")
    return reach_unchecked(
        robot,
        _figures("q", q, (count, dof)),
        np.array([HANDS.index(hand) for hand in hands], dtype=np.int64),
        _figures("goals", goals, (count, 2)),
        float(radius),
        None if targets is None else _figures("targets", targets, (count, dof), gaps=True),
        stops=flags,
        corrects=corrects,
        looks=looks,
        locked_base=locked_base,
        model=model,
    )


def _figures(name: str, given: ArrayLike, shape: tuple[int, int], *, gaps: bool = False) -> Array:
    """An array of this shape; ValueError where it is none, or a figure is no good."""
    array = np.asarray(given, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; needed is {shape}")
    if not ((np.abs(array) <= LARGEST) | (np.isnan(array) & gaps)).all():
        raise ValueError(f"{name} holds a figure that is not finite or beyond {LARGEST:g}")
    return array
