"""Many trials in one call: target configurations in, rewards out.

The rules are those of :func:`coartic.solution.execute` for solutions with at most one
learned movement per goal; the corrective process **A** finishes what they miss. Meant
for methods that make thousands of trials.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.compiled import entry, inlined
from coartic.corrective import correct_kernel
from coartic.model import PAPER, MotionModel, checked_model
from coartic.movement import LARGEST, move_kernel, scratch_for
from coartic.problem import arm_of, goal_of, problem_of
from coartic.robot import HANDS, Array
from coartic.task import Task, hands_of


class Trials(NamedTuple):
    """What came of N trials."""

    ticks: NDArray[np.int64]
    """Control ticks of each, shape ``(N,)``."""
    completed: NDArray[np.bool_]
    """Whether every goal was hit, shape ``(N,)``."""
    targets: Array
    """Targets as moved to, shape ``(N, G, dof)``; a row of NaN where **A** alone acted,
    and in the goals after a failure what was given."""
    reached: Array
    """Configuration when each goal was hit, shape ``(N, G, dof)``; NaN after a failure."""
    corrections: int
    """Corrective movements made, in all trials."""
    iterations: int
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: int
    """Forward-kinematics evaluations the kernel made."""


class _Count(NamedTuple):
    """Indices of the counters."""

    corrections: int = 0
    iterations: int = 1
    evaluations: int = 2


_C = _Count()


class _Made(NamedTuple):
    """What the kernel fills; see :class:`Trials`."""

    targets: Any
    reached: Any
    ticks: Any
    completed: Any
    counts: Any


@inlined
def _attempt(
    q: Any, found: Any, target: Any, arm: Any, goal: Any, made: Any, model: Any, scratch: Any
) -> tuple[int, bool]:
    """Move to a goal's target, where it has one; ticks, goal hit."""
    given = False
    for j in range(len(q)):
        given = given or not math.isnan(target[j])
    if given:
        for j in range(len(q)):
            if math.isnan(target[j]):
                target[j] = q[j]
        ticks, hit, evaluations = move_kernel(q, target, arm, goal, True, model, scratch)
    else:  # a movement to where it is tells whether the goal is hit
        found[:] = q
        _, hit, evaluations = move_kernel(q, found, arm, goal, False, model, scratch)
        ticks = 0
    made.counts[_C.evaluations] += evaluations
    return ticks, hit


@inlined
def _finish(
    q: Any, found: Any, arm: Any, goal: Any, problem: Any, made: Any, scratch: Any
) -> tuple[int, bool]:
    """Have **A** finish what was missed; ticks, goal hit."""
    found[:] = q
    converged, iterations = correct_kernel(
        found, arm, goal, problem.corrector, problem.model, scratch
    )
    made.counts[_C.iterations] += iterations
    made.counts[_C.evaluations] += iterations + 1
    ticks, hit = 0, False
    if converged:
        ticks, hit, evaluations = move_kernel(q, found, arm, goal, False, problem.model, scratch)
        made.counts[_C.corrections] += 1
        made.counts[_C.evaluations] += evaluations
    return ticks, hit


@entry
def _make(hands: Any, problem: Any, made: Any, scratch: Any) -> None:
    """Make every trial of ``made.targets``, and fill the rest."""
    q = np.empty_like(problem.start)
    found = np.empty_like(problem.start)
    for trial in range(len(made.targets)):
        q[:] = problem.start
        for number in range(len(problem.goals)):
            arm, goal = arm_of(problem, hands[number]), goal_of(problem, number)
            target = made.targets[trial, number]
            ticks, hit = _attempt(q, found, target, arm, goal, made, problem.model, scratch)
            made.ticks[trial] += ticks
            if not hit:
                ticks, hit = _finish(q, found, arm, goal, problem, made, scratch)
                made.ticks[trial] += ticks
            if not hit:
                break
            made.reached[trial, number] = q
            made.completed[trial] = number == len(problem.goals) - 1


def make_trials(task: Task, hands: str, targets: Array, *, model: MotionModel = PAPER) -> Trials:
    """Make N trials with the hand sequence ``hands`` (``"RRLR"``), each from the start.

    ``targets`` has shape ``(N, G, dof)``, length unit (base) and rad (joints). A joint
    whose target is NaN keeps its value; for a goal without any target **A** acts alone.
    Raises ValueError for a wrong shape, for targets that are infinite or beyond
    ``LARGEST``, for ones that move a locked base, and for hands the robot does not have.
    """
    checked_model(model, radius=task.radius)
    names = hands_of(hands)
    if len(names) != len(task.goals) or not set(names) <= set(task.hands):
        raise ValueError(f"hands {hands!r} do not fit task {task.name!r}")
    given = _checked_targets(task, targets)
    made = _Made(
        targets=given,
        reached=np.full_like(given, np.nan),
        ticks=np.zeros(len(given), dtype=np.int64),
        completed=np.zeros(len(given), dtype=np.bool_),
        counts=np.zeros(len(_C), dtype=np.int64),
    )
    codes = np.array([HANDS.index(hand) for hand in names], dtype=np.int64)
    _make(codes, problem_of(task, model), made, scratch_for(task.robot))
    return Trials(made.ticks, made.completed, given, made.reached, *map(int, made.counts))


def _checked_targets(task: Task, targets: Array) -> Array:
    """A copy of the targets; ValueError where they do not fit the task."""
    copy = np.array(targets, dtype=np.float64)
    if copy.ndim != 3 or copy.shape[1:] != (len(task.goals), task.robot.dof):
        raise ValueError(
            f"targets have shape {copy.shape}; needed are (N, {len(task.goals)}, {task.robot.dof})"
        )
    if np.any(np.abs(copy) > LARGEST):
        raise ValueError(f"a target has a figure beyond {LARGEST:g}")
    for coordinate in task.locked_base:
        column = copy[..., "xy".index(coordinate)]
        if np.any(~np.isnan(column) & (column != task.q0["xy".index(coordinate)])):
            raise ValueError(f"a target moves the base in {coordinate}, which is locked")
    return copy
