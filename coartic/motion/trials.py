"""Many trials in one call: target configurations in, rewards out.

The rules are those of :func:`coartic.motion.solution.execute` for solutions with at most one
learned movement per goal; the corrective process **A** finishes what they miss. Meant
for methods that make thousands of trials. What moves is :mod:`coartic.motion.reach`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.movement import LARGEST_ENTRY, check_goal, configuration
from coartic.motion.outside import note_trials
from coartic.motion.penalty import penalties
from coartic.motion.reach import reach_in_turn
from coartic.motion.solution import Movement
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task, hands_misfit, hands_of, letters_of

HandSequences = str | Sequence[str] | NDArray[np.integer[Any]]
"""Hand sequences of N trials: one for all (``"RRLR"``), one each, or an array of shape ``(N, G)``
of indices into HANDS (0 left, 1 right)."""


class Trials(NamedTuple):
    """What came of N trials."""

    ticks: NDArray[np.int64]
    """Control ticks of each, shape ``(N,)``."""
    completed: NDArray[np.bool_]
    """Whether every goal was hit, shape ``(N,)``."""
    corrections: NDArray[np.int64]
    """Corrective movements made, shape ``(N,)``."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each, shape ``(N,)``."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations the kernel made, shape ``(N,)``."""
    targets: Array
    """Targets as moved to, shape ``(N, G, dof)``; a row of NaN where **A** alone acted,
    and in the goals after a failure what was given."""
    reached: Array
    """Configuration when each goal was hit, shape ``(N, G, dof)``; NaN after a failure."""
    penalties: NDArray[np.int64]
    """What each loses beside its ticks, shape ``(N,)``; 0 where the task has no penalty."""

    @property
    def rewards(self) -> Array:
        """Total rewards, shape ``(N,)``; -inf where a trial failed."""
        return np.where(self.completed, -(self.ticks + self.penalties), -np.inf)


def make_trials(
    task: Task, hands: HandSequences, targets: Array, *, model: MotionModel = PAPER
) -> Trials:
    """Make N trials, each from the start.

    ``targets`` has shape ``(N, G, dof)``, length unit (base) and rad (joints). A joint
    whose target is NaN keeps its value; for a goal without any target **A** acts alone.
    Raises ValueError for a wrong shape, for targets that are infinite or beyond
    ``LARGEST_ENTRY``, for ones that move a locked base, and for hands the robot does not have.
    """
    check_model(model, radius=task.radius)
    given = check_targets(task, targets)
    count = len(given)
    note_trials(count)
    starts = np.empty((count, task.robot.dof))
    starts[:] = configuration(task.robot, task.q0)
    goals = [check_goal(goal, task.radius)[:2] for goal in task.goals]
    codes = hand_codes(task, hands, count)
    reached = reach_in_turn(
        task.robot,
        starts,
        codes,
        np.array([goals], dtype=np.float64),
        float(task.radius),
        given,
        np.ones(given.shape[:2], dtype=np.bool_),
        bounds=(0, count),
        locked_base=task.locked_base,
        model=model,
    )
    reached.q[~reached.hit] = np.nan
    return Trials(
        ticks=reached.ticks.sum(axis=1),
        completed=reached.hit[:, -1].copy(),
        corrections=reached.corrections.sum(axis=1),
        iterations=reached.iterations.sum(axis=1),
        evaluations=reached.evaluations.sum(axis=1),
        targets=given,
        reached=reached.q,
        penalties=penalties(task, codes, reached.q).sum(axis=1),
    )


def movements_of(hands: str, targets: Array) -> tuple[Movement, ...]:
    """A trial as a solution: ``targets`` has shape ``(G, dof)``, NaN where **A** acts alone."""
    return tuple(
        Movement(number, hand, "corrective")
        if np.isnan(target).all()
        else Movement(number, hand, "learned", target)
        for number, (hand, target) in enumerate(zip(hands_of(hands), targets, strict=True), 1)
    )


def hand_codes(task: Task, hands: HandSequences, count: int) -> NDArray[np.int64]:
    """The hand of every trial and goal, shape ``(count, G)``, as indices into HANDS.

    Raises ValueError where they do not fit the task.
    """
    if isinstance(hands, np.ndarray) and hands.dtype.kind in "iu":
        allowed = [HANDS.index(hand) for hand in task.hands]
        fits = (hands >= min(allowed)) & (hands <= max(allowed))
        if hands.shape != (count, len(task.goals)) or not fits.all():
            raise ValueError(
                f"hands of shape {hands.shape} do not fit task {task.name!r}: needed is shape "
                f"({count}, {len(task.goals)}) of numbers among {allowed}"
            )
        return hands.astype(np.int64)
    several = isinstance(hands, Iterable) and not isinstance(hands, str)
    each: list[Any] = list(hands) if several else [hands]
    letters = set(letters_of(task.hands))
    codes: dict[str, list[int]] = {}
    no_texts = [sequence for sequence in each if not isinstance(sequence, str)]
    for sequence in no_texts or dict.fromkeys(each):
        if no_texts or len(sequence) != len(task.goals) or not set(sequence) <= letters:
            raise ValueError(hands_misfit(task, sequence))
        codes[sequence] = [HANDS.index(hand) for hand in hands_of(sequence)]
    if several and len(each) != count:
        raise ValueError(f"{len(each)} hand sequences for {count} trials")
    rows = np.empty((count, len(task.goals)), dtype=np.int64)
    rows[:] = np.reshape([codes[sequence] for sequence in each], (-1, len(task.goals)))
    return rows


def check_targets(task: Task, targets: Array) -> Array:
    """A copy of the targets; ValueError where they do not fit the task."""
    copy = np.array(targets, dtype=np.float64)
    if copy.ndim != 3 or copy.shape[1:] != (len(task.goals), task.robot.dof):
        raise ValueError(
            f"targets have shape {copy.shape}; needed are (N, {len(task.goals)}, {task.robot.dof})"
        )
    if np.any(np.abs(copy) > LARGEST_ENTRY):
        raise ValueError(f"a target has a number beyond {LARGEST_ENTRY:g}")
    for coordinate in task.locked_base:
        column = copy[..., "xy".index(coordinate)]
        if np.any(~np.isnan(column) & (column != task.q0["xy".index(coordinate)])):
            raise ValueError(f"a target moves the base in {coordinate}, which is locked")
    return copy
