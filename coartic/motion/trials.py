"""Many trials in one call: target configurations in, rewards out.

The rules are those of :func:`coartic.motion.solution.execute` for solutions with at most one
learned movement per goal; the corrective process **A** finishes what they miss. Meant
for methods that make thousands of trials.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, MotionModel, checked_model
from coartic.motion.compiled import entry, fill_row, inlined, inner
from coartic.motion.corrective import correct_lanes
from coartic.motion.lanes import LANES, Lanes, board, depart, lanes_for, runs_for
from coartic.motion.movement import LARGEST, move_lanes
from coartic.motion.problem import arm_of, goal_of, problem_of
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task, hands_of, letters_of


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


class _Made(NamedTuple):
    """What the kernel reads and fills; see :class:`Trials`."""

    hands: Any  # (N, G)
    targets: Any
    reached: Any
    ticks: Any
    completed: Any
    corrections: Any  # (1,)
    iterations: Any  # (1,)


class _Work(NamedTuple):
    """What a lot of trials works on, each now at the same goal."""

    runs: Any  # (N,) records: see runs_for
    going: Any  # (N,) whether no goal was missed so far
    lanes: Lanes


@inner
def _empty(target: Any) -> bool:
    """Whether no joint has a target."""
    for figure in target:  # noqa: SIM110 (which the compiler does not know)
        if not math.isnan(figure):
            return False
    return True


@inner
def _depart(first: int, number: int, problem: Any, made: Any, work: Any) -> int:
    """Put the acting trials on their way; how many."""
    count = 0
    for trial in range(len(work.runs)):
        run = work.runs[trial]
        if run.acting:
            arm = arm_of(problem, made.hands[first + trial, number])
            depart(work.lanes.at, count, trial, run.q, run.target, arm)
            count += 1
    return count


@inlined
def _attempt(first: int, number: int, problem: Any, made: Any, work: Any) -> None:
    """Move to the targets; a trial without one moves to where it is."""
    goal = goal_of(problem, number)
    for given in (True, False):
        for trial in range(len(work.runs)):
            run = work.runs[trial]
            run.acting = work.going[trial]
            if not run.acting:
                continue
            target = made.targets[first + trial, number]
            run.acting = given != _empty(target)
            if run.acting:
                for j in range(len(target)):
                    run.target[j] = run.q[j] if math.isnan(target[j]) else target[j]
                if given:
                    fill_row(target, run.target)
        count = _depart(first, number, problem, made, work)
        move_lanes(work.lanes, count, goal, given, problem.model, work.runs)
        for trial in range(len(work.runs)):
            if work.runs[trial].acting and given:
                made.ticks[first + trial] += work.runs[trial].ticks


@inlined
def _finish(first: int, number: int, problem: Any, made: Any, work: Any) -> None:
    """Have **A** finish what was missed."""
    goal, lanes = goal_of(problem, number), work.lanes
    count = 0
    for trial in range(len(work.runs)):
        run = work.runs[trial]
        run.acting = work.going[trial] and not run.hit
        if run.acting:
            fill_row(run.target, run.q)
            arm = arm_of(problem, made.hands[first + trial, number])
            board(lanes.at, count, trial, run.q, arm)
            count += 1
    correct_lanes(lanes, count, goal, problem.corrector, problem.model, work.runs)
    for trial in range(len(work.runs)):
        run = work.runs[trial]
        if run.acting:
            made.iterations[0] += run.iterations
            made.corrections[0] += run.converged
            run.acting = run.converged
    count = _depart(first, number, problem, made, work)
    stops = problem.model.corrective_arrival
    move_lanes(lanes, count, goal, stops, problem.model, work.runs)
    for trial in range(len(work.runs)):
        if work.runs[trial].acting:
            made.ticks[first + trial] += work.runs[trial].ticks


@inlined
def _make_lot(first: int, problem: Any, made: Any, work: Any) -> None:
    """Make the trials from ``first`` on, as many as there is room for."""
    goals = len(problem.goals)
    for trial in range(len(work.runs)):
        fill_row(work.runs[trial].q, problem.start)
        work.going[trial] = first + trial < len(made.targets)
    for number in range(goals):
        _attempt(first, number, problem, made, work)
        _finish(first, number, problem, made, work)
        for trial in range(len(work.runs)):
            work.going[trial] = work.going[trial] and work.runs[trial].hit
            if work.going[trial]:
                fill_row(made.reached[first + trial, number], work.runs[trial].q)
                made.completed[first + trial] = number == goals - 1


@entry
def _make(problem: Any, made: Any, work: Any) -> None:
    """Make every trial of ``made.hands`` and ``made.targets``, and fill the rest."""
    for first in range(0, len(made.targets), len(work.runs)):
        _make_lot(first, problem, made, work)


def make_trials(
    task: Task, hands: str | Sequence[str], targets: Array, *, model: MotionModel = PAPER
) -> Trials:
    """Make N trials, each from the start, with one hand sequence (``"RRLR"``) or each its own.

    ``targets`` has shape ``(N, G, dof)``, length unit (base) and rad (joints). A joint
    whose target is NaN keeps its value; for a goal without any target **A** acts alone.
    Raises ValueError for a wrong shape, for targets that are infinite or beyond
    ``LARGEST``, for ones that move a locked base, and for hands the robot does not have.
    """
    checked_model(model, radius=task.radius)
    given = _checked_targets(task, targets)
    made = _Made(
        hands=_checked_hands(task, hands, len(given)),
        targets=given,
        reached=np.full_like(given, np.nan),
        ticks=np.zeros(len(given), dtype=np.int64),
        completed=np.zeros(len(given), dtype=np.bool_),
        corrections=np.zeros(1, dtype=np.int64),
        iterations=np.zeros(1, dtype=np.int64),
    )
    work = _work_for(max(min(len(given), LANES), 1), task)
    _make(problem_of(task, model), made, work)
    counts = (made.corrections[0], made.iterations[0], work.runs["evaluations"].sum())
    return Trials(made.ticks, made.completed, given, made.reached, *map(int, counts))


def _work_for(trials: int, task: Task) -> _Work:
    runs = runs_for(trials, task.robot)
    return _Work(runs, np.zeros(trials, dtype=np.bool_), lanes_for(task.robot))


def _checked_hands(task: Task, hands: str | Sequence[str], count: int) -> NDArray[np.int64]:
    """The hand of every trial and goal; ValueError where they do not fit the task."""
    several = isinstance(hands, Iterable) and not isinstance(hands, str)
    each: list[Any] = list(hands) if several else [hands]
    letters = set(letters_of(task.hands))
    codes: dict[str, list[int]] = {}
    no_texts = [sequence for sequence in each if not isinstance(sequence, str)]
    for sequence in no_texts or dict.fromkeys(each):
        if no_texts or len(sequence) != len(task.goals) or not set(sequence) <= letters:
            raise ValueError(f"hands {sequence!r} do not fit task {task.name!r}")
        codes[sequence] = [HANDS.index(hand) for hand in hands_of(sequence)]
    if several and len(each) != count:
        raise ValueError(f"{len(each)} hand sequences for {count} trials")
    rows = [codes[sequence] for sequence in (each if several else each * count)]
    return np.array(rows, dtype=np.int64).reshape(count, len(task.goals))


def _checked_targets(task: Task, targets: Array) -> Array:
    """A copy of the targets; ValueError where they do not fit the task."""
    copy = np.array(targets, dtype=np.float64)
    if copy.ndim != 3 or copy.shape[1:] != (len(task.goals), task.robot.dof):
        raise ValueError(
            f"targets have shape {copy.shape}; needed are (N, {len(task.goals)}, {task.robot.dof})"
        )
    if np.any(np.abs(copy) > LARGEST):
        raise ValueError(f"a target has a number beyond {LARGEST:g}")
    for coordinate in task.locked_base:
        column = copy[..., "xy".index(coordinate)]
        if np.any(~np.isnan(column) & (column != task.q0["xy".index(coordinate)])):
            raise ValueError(f"a target moves the base in {coordinate}, which is locked")
    return copy
