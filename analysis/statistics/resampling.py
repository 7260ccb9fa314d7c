"""Bootstrap resamples of runs, the same for all samples of one size, and intervals by them."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from analysis.statistics import spread
from analysis.statistics.estimates import SEED, TAILS
from coartic.robot import Array

RESAMPLES = 2_000
"""For percentiles of many points of a curve, and for shares shown in whole per cent."""


def mean_interval(values: Array) -> tuple[Array, Array, Array]:
    """Mean over n runs and the ends of its 95 % interval, each for itself, of values (n, k).

    Percentile bootstrap intervals over runs (Efron & Tibshirani, 1993); NaN for a single run.
    """
    if len(values) < 2:
        nothing = np.full(values.shape[1], math.nan)
        return values.mean(axis=0), nothing, nothing
    drawn = [np.bincount(draw, minlength=len(values)) for draw in _draws(len(values))]
    weights = np.array(drawn) / len(values)
    means = spread.within(weights @ values, values)
    low, high = np.quantile(means, TAILS, axis=0)
    return spread.mean(values), low, high


def resampled(values: Array) -> Array:
    """Bootstrap resamples of values (n,), shape ``(RESAMPLES, n)``.

    Two samples of one size are drawn at the same places: what was paired stays so.
    """
    resamples: Array = values[_draws(len(values))]
    return resamples


@cache
def _draws(n: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Which of n runs are in each bootstrap resample, shape ``(RESAMPLES, n)``."""
    return np.random.default_rng(SEED).integers(n, size=(RESAMPLES, n))
