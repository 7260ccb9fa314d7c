"""One method over several tasks: normalised scores, interquartile mean, profiles.

Every task counts the same, however many runs it has, and runs are resampled within their
task (stratified bootstrap). The intervals are about other runs on the same tasks, not about
other tasks.

Sources: R. Agarwal et al. (2021), Deep Reinforcement Learning at the Edge of the Statistical
Precipice, NeurIPS 34 (interquartile mean, score profiles);
E. D. Dolan & J. J. Moré (2002), Mathematical Programming 91 (performance profiles).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import (
    RESAMPLES,
    SEED,
    TAILS,
    Inference,
    bootstrap_estimate,
    middle_mean,
    sample,
)
from coartic.robot import Array

PROFILE_RESAMPLES = 1_999
"""A profile takes percentiles of many thresholds, to be drawn: fewer do for a line's width."""
Reached = Literal["above", "at most"]
"""Which side of a threshold counts."""


def normalised(rewards: ArrayLike, initial: float, optimum: float) -> Array:
    """(reward − initial) / (optimum − initial): 0 the initial solution, 1 the optimum.

    Negative below the initial solution. Raises ValueError where the optimum is not above it.
    """
    if not optimum > initial:
        raise ValueError(f"optimum {optimum} is not above the initial reward {initial}")
    return (np.asarray(rewards, dtype=np.float64) - initial) / (optimum - initial)


def gap_share(rewards: ArrayLike, optimum: float) -> Array:
    """(optimum − reward) / |optimum|: 0 at the optimum; 0.01 is 1 % more ticks than it."""
    return (optimum - np.asarray(rewards, dtype=np.float64)) / abs(optimum)


def interquartile_mean(
    scores: Mapping[str, ArrayLike], *, seed: int = SEED, resamples: int = RESAMPLES
) -> Inference:
    """Mean of the middle half of all tasks' runs (Agarwal et al. 2021), with BCa interval.

    Tasks with fewer runs count as much as the others; for equal numbers it is the common
    definition. Raises ValueError for scores that are not finite: runs without a solution
    have no score, and a profile shows them. A task with fewer than three runs leaves no
    interval (NaN).
    """
    samples = tuple(sample(values) for values in scores.values())

    def statistic(*strata: Array, axis: int = -1) -> Array:
        # Of the runs at hand: scipy's jackknife leaves one out of a stratum.
        shares = np.concatenate([np.full(v.shape[-1], 1 / v.shape[-1]) for v in strata])
        shape = np.broadcast_shapes(*(values.shape[:-1] for values in strata))
        together = [np.broadcast_to(v, (*shape, v.shape[-1])) for v in strata]
        return middle_mean(np.concatenate(together, axis=-1), shares)

    name = f"interquartile mean over {len(samples)} tasks, stratified"
    return bootstrap_estimate(name, samples, statistic, seed, resamples)


def task_mean(
    values: Mapping[str, ArrayLike], *, seed: int = SEED, resamples: int = RESAMPLES
) -> Inference:
    """Mean over tasks of the mean over runs, with stratified BCa interval.

    Raises ValueError for values that are not finite. A task with fewer than three runs
    leaves no interval (NaN).
    """

    def statistic(*strata: Array, axis: int = -1) -> Array:
        return np.asarray(sum(spread.mean(runs, axis) for runs in strata) / len(strata))

    samples = tuple(sample(runs) for runs in values.values())
    name = f"mean over {len(values)} tasks, stratified"
    return bootstrap_estimate(name, samples, statistic, seed, resamples)


@dataclass(frozen=True)
class Profile:
    """Share of runs that reach each threshold, from 0 to 1, with pointwise intervals."""

    thresholds: Array
    share: Array
    low: Array
    high: Array
    n: tuple[int, ...]
    """Runs of each task."""


def profile(
    values: Mapping[str, ArrayLike],
    thresholds: ArrayLike,
    reached: Reached,
    *,
    seed: int = SEED,
    resamples: int = PROFILE_RESAMPLES,
) -> Profile:
    """Share of runs, each task counting the same, that reach each threshold.

    ``"above"`` with normalised scores is the score profile of Agarwal et al. (2021).
    ``"at most"`` with gaps to the optimum is the performance profile of Dolan & Moré (2002)
    with the optimum in the place of the best solver, so that it does not change with the
    methods it is drawn beside. NaN, a run without a solution, reaches no threshold.

    Percentile intervals of the stratified bootstrap, for each threshold alone; where all
    runs of a task reach it or none does, that task adds no width.
    """
    levels, beyond = sample(thresholds), np.greater if reached == "above" else np.less_equal
    each = [np.asarray(runs, dtype=np.float64) for runs in values.values()]
    if not each or any(runs.ndim != 1 or not runs.size for runs in each):
        raise ValueError("a profile needs a vector of at least one run for every task")
    reaches = [beyond.outer(runs, levels).astype(np.float64) for runs in each]
    share = np.mean([runs.mean(axis=0) for runs in reaches], axis=0)
    low, high = band(reaches, seed=seed, resamples=resamples)
    return Profile(levels, share, low, high, tuple(map(len, reaches)))


def band(strata: Sequence[Array], *, seed: int = SEED, resamples: int) -> tuple[Array, Array]:
    """Ends (k,) of the pointwise intervals of the mean over strata of the mean over runs (n, k).

    Percentiles of the stratified bootstrap.
    """
    rng = np.random.default_rng(seed)
    drawn = np.zeros((resamples, strata[0].shape[1]))
    for runs in strata:
        # How often each run is drawn, times what it reaches.
        counts = rng.multinomial(len(runs), np.full(len(runs), 1 / len(runs)), size=resamples)
        drawn += counts @ runs / len(runs)
    low, high = np.quantile(drawn / len(strata), TAILS, axis=0)
    return low, high
