"""Values with their intervals: of means, shares, curves over runs, and times to an event."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special, stats

from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import CONFIDENCE, SEED
from coartic.robot import Array

RESAMPLES = 2_000
"""For percentiles of many points of a curve, and for shares shown in whole per cent."""


class Interval(NamedTuple):
    """A value with its interval at 95 % and the p of its test; NaN where there is none."""

    value: float
    low: float = math.nan
    high: float = math.nan
    p: float = math.nan


def student(value: float, error: float, freedom: float, p: float = math.nan) -> Interval:
    """A value with Student's interval, by its standard error and degrees of freedom."""
    half = float(special.stdtrit(freedom, 0.5 + CONFIDENCE / 2)) * error
    return Interval(value, value - half, value + half, p)


def mean(values: ArrayLike) -> Interval:
    """Mean of values (n,) with Student's interval; without one for a single value.

    Of equal values the interval is that point.
    """
    known = np.asarray(values, dtype=np.float64)
    centre = float(spread.mean(known))
    if len(known) < 2:
        return Interval(centre)
    return student(centre, spread.sd(known) / math.sqrt(len(known)), len(known) - 1)


def share(agrees: Sequence[bool]) -> Interval:
    """Share of runs with Wilson's interval (1927); without one for a single run."""
    n, count = len(agrees), sum(agrees)
    return wilson(count, n) if n > 1 else Interval(count / n)


@cache
def wilson(count: int, total: int, confidence: float = CONFIDENCE) -> Interval:
    """``count`` of ``total`` runs as a share, with Wilson's interval."""
    low, high = stats.binomtest(count, total).proportion_ci(confidence, method="wilson")
    return Interval(count / total, float(low), float(high))


def resampled(values: Array) -> Array:
    """Bootstrap resamples of values (n,), shape ``(RESAMPLES, n)``.

    Two samples of one size are drawn at the same places: what was paired stays so.
    """
    resamples: Array = values[_draws(len(values))]
    return resamples


@cache
def _draws(n: int) -> NDArray[np.int64]:
    """Which of n runs are in each bootstrap resample, shape ``(RESAMPLES, n)``."""
    return np.random.default_rng(SEED).integers(n, size=(RESAMPLES, n))


@lru_cache(8)
def _weights(n: int) -> Array:
    """Share of each of n runs in each bootstrap resample, shape ``(RESAMPLES, n)``."""
    counts = [np.bincount(draw, minlength=n) for draw in _draws(n)]
    shares: Array = np.array(counts) / n
    return shares
