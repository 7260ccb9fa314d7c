"""Signs of coarticulation: one number for each run, for claims and for counts over many tasks.

Each takes the solved runs of one method on one task and returns the values of those runs that have
one, shape ``(n,)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from coartic.analysis.signatures.subtasks import isolated_agreement, preshaping, served
from coartic.analysis.trajectories import Trajectories
from coartic.robot import Array


class Sign(NamedTuple):
    """What is measured, in words, and by which function."""

    words: str
    of: Callable[[Trajectories], Array]
    in_short: str = ""
    """For tables."""


def slower_hands(cell: Trajectories) -> Array:
    """Share of goals before the last hit with a hand slower for them alone, ``(runs,)``."""
    if len(cell.task.hands) < 2 or len(cell.task.goals) < 2:
        return np.empty(0)
    return np.array([1.0 - np.mean(isolated_agreement(run)[:-1]) for run in cell.runs])


def mean_served(cell: Trajectories) -> Array:
    """Means of :func:`~.subtasks.served` of the runs in which every goal has a value, (n, 2)."""
    values = np.array([served(run).mean(axis=0) for run in cell.runs]).reshape(-1, 2)
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def waiting_hand_nearer(cell: Trajectories) -> Array:
    """Preshaping of the waiting arm (:func:`~.subtasks.preshaping`), mean over goals."""
    initial = cell.initial
    if len(cell.task.hands) < 2 or initial is None:
        return np.empty(0)
    values = [preshaping(run, initial) for run in cell.runs]
    return np.array([np.nanmean(run) for run in values if not np.isnan(run).all()])


SIGNS: Mapping[str, Sign] = {
    "hand": Sign(
        "share of the goals that others follow which are hit with the slower hand for them alone",
        slower_hands,
        "share of goals hit with the slower hand for them",
    ),
    "arm": Sign(
        "ticks by which the posture of base and chosen arm leaves the next goal nearer, with the "
        "waiting arm where it was (mean over goals)",
        lambda cell: mean_served(cell)[:, 1],
        "ticks by which the next goal is nearer",
    ),
    "cost": Sign(
        "ticks that the way to this goal takes longer", lambda cell: mean_served(cell)[:, 0]
    ),
    "other arm": Sign(
        "share of the initial distance to its next goal by which the waiting arm brings its hand "
        "nearer (mean over goals)",
        waiting_hand_nearer,
        "share of its way that the waiting hand makes",
    ),
    "first": Sign(
        "ticks by which the first movement is longer than the corrective process's with the same "
        "hands",
        lambda cell: cell.against_same_hands[:, 0].astype(np.float64),
        "ticks by which the first movement is slower",
    ),
    "whole": Sign(
        "ticks by which the whole is shorter than the corrective process's",
        lambda cell: -cell.against_same_hands.sum(axis=1).astype(np.float64),
        "ticks by which the whole task is faster",
    ),
}
"""Every sign by name."""
