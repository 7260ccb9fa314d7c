"""Signs of coarticulation: one number for each run of a method on a task.

Claims compare them, and families of random tasks count them. In formulas, run i hits goal g at
configuration q(i, g) after t(i, g) ticks since the goal before; q(i, 0) is the start; c(i, g) are
the ticks of the corrective process alone with the hands of run i; G is the number of goals. A sign
has shape ``(n,)``, and is NaN where a run has none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from coartic.analysis.signatures.subtasks import gain_at_next, preshaping, ticks_slower
from coartic.analysis.solutions import Solutions
from coartic.robot import Array


@dataclass(frozen=True)
class Sign:
    """A sign of coarticulation and its words."""

    each: Callable[[Solutions], Array]
    """The sign of each run, shape ``(n,)``; NaN where a run has none."""
    words: str
    in_short: str
    """The same for tables."""

    def of(self, runs: Solutions) -> Array:
        """The sign of each run that has one, shape ``(k,)``."""
        signs = self.each(runs)
        return signs[np.isfinite(signs)]


def first(runs: Solutions) -> Array:
    """t(i, 1) - c(i, 1); NaN where the corrective process fails with the hands of the run."""
    return np.asarray(runs.against_same_hands[:, 0])


def whole(runs: Solutions) -> Array:
    """Σ_g c(i, g) - t(i, g); NaN where the corrective process fails with the hands of the run."""
    return np.asarray(-runs.against_same_hands.sum(axis=1))


def hand(runs: Solutions) -> Array:
    """Share of the goals g < G at which the hand is not as in isolation."""
    alike = as_in_isolation(runs)[:, :-1]
    return np.asarray(1.0 - alike.mean(axis=1)) if alike.size else np.full(len(alike), np.nan)


def as_in_isolation(runs: Solutions) -> Array:
    """a(i, g) = [r(h) = min over hands of r], for the ticks r of a reach to g from q(i, g - 1).

    Shape ``(n, G)``; NaN on a task for one hand.
    """
    if not runs.runs or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals)), np.nan)
    return np.asarray(ticks_slower(runs) == 0, dtype=np.float64)


def other_arm(runs: Solutions) -> Array:
    """The mean of :func:`preshaping_of_the_other_arm` over the goals that have it."""
    values = preshaping_of_the_other_arm(runs)
    means, some = np.full(len(values), np.nan), ~np.isnan(values).all(axis=1)
    # The last goal counts as a missing value: the order of summation decides the last bit.
    padded = np.pad(values[some], ((0, 0), (0, 1)), constant_values=np.nan)
    means[some] = np.nanmean(padded, axis=1)
    return means


def preshaping_of_the_other_arm(runs: Solutions) -> Array:
    """(d_held(i, g) - d(i, g)) / d_initial(g), g < G, as :func:`~.subtasks.preshaping` says.

    Shape ``(n, G - 1)``; NaN on a task for one hand, and without an initial solution.
    """
    if not runs.runs or runs.initial is None or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals) - 1), np.nan)
    return np.array([preshaping(runs.task, run, runs.initial)[:-1] for run in runs.runs])


def arm(runs: Solutions) -> Array:
    """r(i, g + 1) - r'(i, g + 1), mean over g < G, as :func:`~.subtasks.gain_at_next` says."""
    if not runs.runs or len(runs.task.goals) < 2:
        return np.full(len(runs.runs), np.nan)
    return np.asarray(gain_at_next(runs).mean(axis=1))


SIGNS = {
    "hand": Sign(
        hand,
        "share of the goals that others follow which are hit with the slower hand for them alone",
        "share of goals hit with the slower hand for them",
    ),
    "arm": Sign(
        arm,
        "ticks by which the posture of base and chosen arm leaves the next goal nearer, with the "
        "waiting arm where it was (mean over goals)",
        "ticks by which the next goal is nearer",
    ),
    "other arm": Sign(
        other_arm,
        "share of the initial distance to its next goal by which the waiting arm brings its hand "
        "nearer (mean over goals)",
        "share of its way that the waiting hand makes",
    ),
    "first": Sign(
        first,
        "ticks by which the first movement is longer than the corrective process's with the same "
        "hands",
        "ticks by which the first movement is slower",
    ),
    "whole": Sign(
        whole,
        "ticks by which the whole is shorter than the corrective process's",
        "ticks by which the whole task is faster",
    ),
}
"""Every sign by its name in claims, in the order of the tables."""
