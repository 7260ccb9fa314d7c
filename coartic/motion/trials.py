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

from coartic.model import PAPER, MotionModel, checked_model
from coartic.motion.movement import LARGEST, checked_goal, configuration
from coartic.motion.reach import reach_in_turn
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
    count = len(given)
    starts = np.empty((count, task.robot.dof))
    starts[:] = configuration(task.robot, task.q0)
    goals = [checked_goal(goal, task.radius)[:2] for goal in task.goals]
    made = reach_in_turn(
        task.robot,
        starts,
        _checked_hands(task, hands, count),
        np.array([goals], dtype=np.float64),
        float(task.radius),
        given,
        np.ones(given.shape[:2], dtype=np.bool_),
        bounds=(0, count),
        locked_base=task.locked_base,
        model=model,
    )
    made.q[~made.hit] = np.nan
    return Trials(
        ticks=made.ticks.sum(axis=1),
        completed=made.hit[:, -1].copy(),
        targets=given,
        reached=made.q,
        corrections=int(made.corrections.sum()),
        iterations=int(made.iterations.sum()),
        evaluations=int(made.evaluations.sum()),
    )


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
    rows = np.empty((count, len(task.goals)), dtype=np.int64)
    rows[:] = np.reshape([codes[sequence] for sequence in each], (-1, len(task.goals)))
    return rows


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
