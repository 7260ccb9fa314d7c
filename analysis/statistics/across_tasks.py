"""One method over several tasks.

Every task counts the same, however many runs it has, and runs are resampled within their task
(stratified bootstrap). The intervals are about other runs on the same tasks, not about other
tasks.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import (
    RESAMPLES,
    SEED,
    Inference,
    bootstrap_estimate,
    sample,
)
from coartic.robot import Array


def gap_share(rewards: ArrayLike, optimum: float) -> Array:
    """(optimum − reward) / |optimum|: 0 at the optimum; 0.01 is 1 % more ticks than it."""
    return (optimum - np.asarray(rewards, dtype=np.float64)) / abs(optimum)


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
