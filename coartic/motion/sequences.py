"""What the corrective process alone gives, for many sets of goals and hand sequences.

The rules are those of :func:`coartic.motion.initial.corrective_trial`. Meant for searches over
where goals may be: what trials begin with, goal and hand by goal and hand, is computed once,
so that sequences of hands and grids of goals cost little more than the movements in which they
differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.movement import LARGEST_ENTRY, configuration
from coartic.motion.reach import reach_unchecked
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task, hands_of


class CorrectiveTrials(NamedTuple):
    """Trials by the corrective process alone: N sets of goals, S hand sequences."""

    rewards: Array
    """Total reward, shape ``(N, S)``; NaN where the corrective process failed."""
    reached: Array
    """Configuration when each goal was hit, shape ``(N, S, G, dof)``; NaN after a failure."""


def corrective_trials(
    task: Task, sequences: Sequence[str], goals: Array, *, model: MotionModel = PAPER
) -> CorrectiveTrials:
    """Trials by the corrective process alone, with each hand sequence, at each set of goals.

    ``goals`` has shape ``(N, G, 2)``, length unit; those of the task itself do not matter, all
    else of it does. Sequences (``"RRLR"``) and sets of goals that begin alike are cheap. Raises
    ValueError for a wrong shape, for figures that are not finite or beyond ``LARGEST_ENTRY``, and
    for hands the robot does not have.
    """
    check_model(model, radius=task.radius)
    places = np.array(goals, dtype=np.float64)
    if places.ndim != 3 or places.shape[2] != 2:
        raise ValueError(f"goals have shape {places.shape}; needed are (N, G, 2)")
    if not (np.abs(places) <= LARGEST_ENTRY).all():
        raise ValueError(f"a goal is not finite or lies beyond {LARGEST_ENTRY:g}")
    for hands in sequences:
        if len(hands) != places.shape[1] or not set(hands_of(hands)) <= set(task.hands):
            raise ValueError(
                f"hands {hands!r} do not fit {places.shape[1]} goals of task {task.name!r}"
            )
    sets, goals_each, _ = places.shape
    codes = np.array([[HANDS.index(hand) for hand in hands_of(hands)] for hands in sequences])
    hand = np.tile(codes.astype(np.int64).reshape(-1, goals_each), (sets, 1))
    goal = np.repeat(places, len(sequences), axis=0)
    reached = np.empty((len(hand), goals_each, task.robot.dof))
    # What the trials have begun with, goal by goal, and which of these beginnings each has.
    q, ticks = configuration(task.robot, task.q0)[None], np.zeros(1)
    whose = np.zeros(len(hand), dtype=np.int64)
    for g in range(goals_each):
        first, longer = first_alike(hand[:, g], goal[:, g, 0], goal[:, g, 1], whose)
        q, ticks = q[whose[first]], ticks[whose[first]]
        going = ~np.isnan(ticks)
        chosen = first[going]
        result = reach_unchecked(
            task.robot,
            q[going],
            hand[chosen, g],
            goal[chosen, g],
            task.radius,
            locked_base=task.locked_base,
            model=model,
        )
        q[going] = np.where(result.hit[:, None], result.q, np.nan)
        ticks[going] += np.where(result.hit, result.ticks, np.nan)
        whose = longer
        reached[:, g] = q[whose]
    shape = (sets, len(sequences))
    return CorrectiveTrials(
        -ticks[whose].reshape(shape), reached.reshape(*shape, *reached.shape[1:])
    )


def first_alike(*keys: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first of those whose keys are all equal, and, of each, which of these it is like."""
    order = np.lexsort(keys)
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = np.any([key[order][1:] != key[order][:-1] for key in keys], axis=0)
    like = np.empty_like(order)
    like[order] = np.cumsum(new) - 1
    return order[new], like
