"""Signs of coarticulation: one number for each run, for claims and for counts over many tasks.

Each takes the solved runs of one method on one task and returns the values of those runs that have
one, shape ``(n,)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from coartic.analysis.signatures.other_arm import preshaping
from coartic.analysis.signatures.subtasks import isolated_agreement, served
from coartic.analysis.trajectories import Trajectories
from coartic.robot import Array


class Sign(NamedTuple):
    """What is measured, in words, and by which function."""

    words: str
    of: Callable[[Trajectories], Array]


def slower_hands(cell: Trajectories) -> Array:
    """Of the goals that others follow, the share hit with a hand that is slower for them alone."""
    if len(cell.task.hands) < 2 or len(cell.task.goals) < 2:
        return np.empty(0)
    quicker = [isolated_agreement(run)[:-1] for run in cell.runs]
    return np.array([1.0 - sum(run) / len(run) for run in quicker])


def next_goal_nearer(cell: Trajectories) -> Array:
    """Ticks that learned postures save on the way to the next goal, mean over goals."""
    return _mean_served(cell)[:, 1]


def this_goal_longer(cell: Trajectories) -> Array:
    """Ticks that the way to this goal takes longer for it, mean over goals."""
    return _mean_served(cell)[:, 0]


def _mean_served(cell: Trajectories) -> Array:
    """Means of :func:`~.subtasks.served` of the runs in which every goal has a value."""
    values = np.array([served(run).mean(axis=0) for run in cell.runs]).reshape(-1, 2)
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def waiting_hand_nearer(cell: Trajectories) -> Array:
    """Preshaping of the waiting arm (:func:`~.other_arm.preshaping`), mean over goals."""
    initial = cell.initial
    if len(cell.task.hands) < 2 or initial is None:
        return np.empty(0)
    values = [preshaping(run, initial) for run in cell.runs]
    return np.array([np.nanmean(run) for run in values if not np.isnan(run).all()])


def first_longer(cell: Trajectories) -> Array:
    """Ticks by which the first movement is longer than with the corrective process alone."""
    return np.asarray(cell.against_same_hands[:, 0], dtype=np.float64)


def whole_shorter(cell: Trajectories) -> Array:
    """Ticks by which the whole is shorter than with the corrective process alone."""
    return -np.asarray(cell.against_same_hands.sum(axis=1), dtype=np.float64)


SIGNS: Mapping[str, Sign] = {
    "hand": Sign(
        "share of the goals that others follow which are hit with the slower hand for them alone",
        slower_hands,
    ),
    "arm": Sign(
        "ticks by which the posture of base and chosen arm leaves the next goal nearer, with the "
        "waiting arm where it was (mean over goals)",
        next_goal_nearer,
    ),
    "cost": Sign("ticks that the way to this goal takes longer", this_goal_longer),
    "other arm": Sign(
        "share of the initial distance to its next goal by which the waiting arm brings its hand "
        "nearer (mean over goals)",
        waiting_hand_nearer,
    ),
    "first": Sign(
        "ticks by which the first movement is longer than the corrective process's with the same "
        "hands",
        first_longer,
    ),
    "whole": Sign(
        "ticks by which the whole is shorter than the corrective process's", whole_shorter
    ),
}
"""Every sign by name."""
