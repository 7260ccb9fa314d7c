"""Many trials in one call: target configurations in, rewards out.

The rules are those of :func:`coartic.motion.solution.execute` for solutions with at most one
learned movement per goal; the corrective process **A** finishes what they miss. Meant
for methods that make thousands of trials. What moves is :mod:`coartic.motion.reach`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic.internal.limits import brief_value, real_array
from coartic.motion.movement import LARGEST_ENTRY
from coartic.motion.reach import CompiledTask, reach_all
from coartic.motion.solution import Movement, hold_base
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task, check_hands, hands_of

HandSequences = str | Sequence[str]
"""Hand sequences of N trials: one for all (``"RRLR"``), or one each."""


class Trials(NamedTuple):
    """Results of N trials."""

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

    @property
    def rewards(self) -> Array:
        """Total rewards, shape ``(N,)``; -inf where a trial failed."""
        return np.where(self.completed, -self.ticks, -np.inf)


def trials_on(compiled: CompiledTask, hands: NDArray[np.int64], targets: Array) -> Trials:
    """Make N trials of a task that is checked, as nothing else is.

    ``hands`` has shape ``(N, G)``, indices into HANDS, ``targets`` ``(N, G, dof)``, in which joints
    without one are filled in. A trial with a target beyond :data:`LARGEST_ENTRY` fails without a
    movement.
    """
    if (far := are_far(targets)) is not None:
        return trials_but(far, compiled, hands, targets)
    reached = reach_all(compiled, hands, targets[:, :, None])
    if not reached.hit.all():
        reached.q[~reached.hit] = np.nan
    return Trials(
        ticks=np.einsum("ng->n", reached.ticks),  # a sum in a third of the time
        completed=reached.hit[:, -1].copy(),
        corrections=np.einsum("ng->n", reached.corrections),
        iterations=np.einsum("ng->n", reached.iterations),
        evaluations=np.einsum("ng->n", reached.evaluations),
        targets=targets,
        reached=reached.q,
    )


def are_far(targets: Array) -> NDArray[np.bool_] | None:
    """Which trials ``(N,)`` have a target beyond :data:`LARGEST_ENTRY`; None where none has."""
    most, least = (of.reduce(targets, axis=None, initial=0.0) for of in (np.fmax, np.fmin))
    if most <= LARGEST_ENTRY and least >= -LARGEST_ENTRY:  # whatever is NaN
        return None
    return np.asarray((np.abs(targets) > LARGEST_ENTRY).any(axis=(1, 2)))


def trials_but(
    far: NDArray[np.bool_], compiled: CompiledTask, hands: NDArray[np.int64], targets: Array
) -> Trials:
    """Make all trials but those ``far`` ones, which fail without a movement."""
    made = trials_on(compiled, hands[~far], targets[~far])
    blank = (np.zeros((len(far), *each.shape[1:]), each.dtype) for each in made)
    trials = Trials._make(blank)._replace(targets=targets)
    trials.reached[far] = np.nan
    for rows, some in zip(trials, made, strict=True):
        rows[~far] = some
    return trials


def movements_of(hands: str, targets: ArrayLike) -> tuple[Movement, ...]:
    """A solution from hands and target configurations.

    Parameters
    ----------
    hands : str
        The hand for each goal, such as ``"RRLR"``.
    targets : array_like, shape (G, dof)
        The configuration to move to for each goal, length unit (base) and rad (joints). Where a row
        is NaN, the corrective process acts alone.

    Returns
    -------
    tuple of Movement
        A movement for each goal, for :func:`coartic.execute` and :func:`coartic.trajectory`.

    Raises
    ------
    ValueError
        The hands are no text of L and R, or there is not a row for each.
    """
    targets = real_array("targets", targets)
    if targets.ndim != 2 or len(targets) != len(hands):
        raise ValueError(
            f"targets have shape {targets.shape}; needed is a row for each of the "
            f"{len(hands)} hands in {brief_value(hands)}"
        )
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
    several = isinstance(hands, Iterable) and not isinstance(hands, str)
    each: list[Any] = list(hands) if several else [hands]
    for sequence in each:
        if not isinstance(sequence, str):
            check_hands(task, sequence)
    codes = {
        sequence: [HANDS.index(hand) for hand in hands_of(check_hands(task, sequence))]
        for sequence in dict.fromkeys(each)
    }
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
    if are_far(copy) is not None and np.isinf(copy).any():
        raise ValueError("targets have infinite entries; needed are finite ones")
    return hold_base(task, copy)
