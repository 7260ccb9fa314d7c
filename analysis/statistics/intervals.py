"""Values with their intervals: of means, shares, curves over runs, and times to an event."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special, stats

from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import CONFIDENCE, SEED, TAILS
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


def mean_interval(values: Array) -> tuple[Array, Array, Array]:
    """Mean over n runs and the ends of its 95 % interval, each for itself, of values (n, k).

    Percentile bootstrap intervals over runs (Efron & Tibshirani, 1993); NaN for a single run.
    """
    if len(values) < 2:
        nothing = np.full(values.shape[1], math.nan)
        return values.mean(axis=0), nothing, nothing
    means = spread.within(_weights(len(values)) @ values, values)
    low, high = np.quantile(means, TAILS, axis=0)
    return spread.mean(values), low, high


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


def kaplan_meier_median(times: ArrayLike, reached: ArrayLike) -> Interval:
    """Median of the product-limit estimate S(t) (Kaplan & Meier, 1958) of the times (n,).

    ``reached`` is False for runs that are right-censored at their time, which is infinite
    for those known never to reach it. The median is the first time at which S ≤ 0.5, infinite
    where so few reached it that there is none. Its interval (Brookmeyer & Crowley, 1982) holds the
    times at which the pointwise interval of S holds 0.5: by Greenwood's variance on the
    complementary log-log scale. Where that variance is not defined, the exact binomial limits
    (Clopper & Pearson, 1934) stand in: before the first event, for all of n; where S is 0, for
    none of as many as reached it. ``low`` may thus be 0 and ``high`` infinite. Of 2000 simulated
    samples (exponential, the last 30 % censored) the interval held the median in 96 to 98 %, for
    6, 10 and 20 runs. Censoring has to be independent of the time to the event. Raises ValueError
    without a time.
    """
    times = np.asarray(times, dtype=np.float64)
    reached = np.asarray(reached, dtype=bool)
    if not len(times):
        raise ValueError("no times")
    if not reached.any():
        return Interval(math.inf, _none_before(len(times)), math.inf)
    times = np.where(np.isinf(times), times[np.isfinite(times)].max(), times)
    estimate = stats.ecdf(stats.CensoredData.right_censored(times, ~reached)).sf
    at, survival = estimate.quantiles, estimate.probabilities
    with warnings.catch_warnings():
        # Where the interval is not defined it is NaN, and seen to below.
        warnings.filterwarnings("ignore", "The confidence interval is undefined", RuntimeWarning)
        interval = estimate.confidence_interval(CONFIDENCE, method="log-log")
    lower, upper = interval.low.probabilities, interval.high.probabilities
    lower = np.where(survival <= 0, 0.0, np.where(survival >= 1, 1.0, lower))
    none_left = 1 - TAILS[0] ** (1 / reached.sum())
    upper = np.where(survival <= 0, none_left, np.where(survival >= 1, 1.0, upper))
    low = min(_first(at, lower), _none_before(len(times)))
    return Interval(_first(at, survival), low, _first(at, upper))


def _first(times: Array, curve: ArrayLike) -> float:
    """First time at which a curve is at most 0.5, up to rounding."""
    below = np.flatnonzero(np.asarray(curve) <= 0.5 + 1e-12)
    return float(times[below[0]]) if len(below) else math.inf


def _none_before(n: int) -> float:
    """0 where n runs, none of which reached it, do not show that the median is later."""
    return 0.0 if TAILS[0] ** (1 / n) <= 0.5 else math.inf
