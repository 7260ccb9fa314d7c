"""Means and shares over runs with their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from analysis.statistics import spread
from analysis.statistics.estimates import CONFIDENCE


class Interval(NamedTuple):
    """An estimate with its interval at 95 %; NaN limits where there is none."""

    value: float
    low: float
    high: float


def mean(values: ArrayLike) -> Interval:
    """Mean of values (n,) with Student's interval; without one for a single value.

    Of equal values the interval is that point.
    """
    known = np.asarray(values, dtype=np.float64)
    centre = float(spread.mean(known))
    if len(known) < 2:
        return Interval(centre, math.nan, math.nan)
    error = spread.sd(known) / math.sqrt(len(known))
    half = float(stats.t.ppf(0.5 + CONFIDENCE / 2, len(known) - 1)) * error
    return Interval(centre, centre - half, centre + half)


def share(agrees: Sequence[bool]) -> Interval:
    """Share of runs with Wilson's interval (1927); without one for a single run."""
    n, count = len(agrees), sum(agrees)
    if n < 2:
        return Interval(count / n, math.nan, math.nan)
    low, high = stats.binomtest(count, n).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(count / n, float(low), float(high))
