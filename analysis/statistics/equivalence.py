"""Whether two means agree within a margin: by inclusion of their interval.

A 95 % interval within ±margin is two one-sided tests at level 2.5 % (TOST; D. J. Schuirmann 1987,
Journal of Pharmacokinetics and Biopharmaceutics 15). The interval of means is Welch's, since of
the paper's runs only mean, SD and number are printed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from coartic.analysis.statistics.estimates import (
    NO_SPREAD,
    Inference,
    centred,
    sample,
    samples_of,
    student,
)
from coartic.robot import Array

MARGIN = 0.01
"""Differences up to this share of the published reward count as equivalent."""


@dataclass(frozen=True, kw_only=True)
class Equivalence(Inference):
    """A difference with its interval, beside a margin above 0.

    ``p`` is of the hypothesis that they differ by the margin or more: the larger p of
    the two one-sided tests.
    """

    margin: float

    @property
    def verdict(self) -> Literal["equivalent", "different", "undecided"]:
        """Equivalent where the interval lies within the margin, different where it
        lies outside, undecided where it does neither."""
        if -self.margin <= self.low and self.high <= self.margin:
            return "equivalent"
        if self.low > self.margin or self.high < -self.margin:
            return "different"
        return "undecided"


def difference(ours: ArrayLike, published: float, sd: float | None, runs: int) -> Equivalence:
    """Our mean less the published one, by the printed SD and number of runs.

    Where no SD is printed (None) the published mean is taken as exact. The margin is
    :data:`MARGIN` of the published mean.
    """
    values, margin = sample(ours), MARGIN * abs(published)
    theirs = [] if sd is None or runs < 2 else [(sd**2, runs)]
    return _welch(float(values.mean()) - published, [_variance(values), *theirs], margin)


def equivalence(first: ArrayLike, second: ArrayLike | float, margin: float) -> Equivalence:
    """Mean of ``first`` less mean of ``second``: independent samples, or one and a number."""
    samples = samples_of(first, second)
    means = [float(values.mean()) for values in samples]
    return _welch(means[0] - sum(means[1:]), list(map(_variance, samples)), margin)


def _variance(values: Array) -> tuple[float, int]:
    """Variance of the values of a sample (n - 1 degrees of freedom), and their number."""
    count = len(values)
    return float(np.var(centred(values), ddof=1)) if count > 1 else math.nan, count


def _welch(value: float, variances: list[tuple[float, int]], margin: float) -> Equivalence:
    """A difference with Welch's interval, or Student's of one sample.

    A sample of one value: no interval. No spread in any: a point.
    """
    n = tuple(count for _, count in variances)
    name = "Welch's interval" if len(n) > 1 else "Student's interval, the other mean as exact"
    inference = Equivalence(value, n, f"difference of means, {name}", margin=margin)
    if min(n) < 2:
        return replace(inference, note="no interval: fewer than 2 values")
    parts = [variance / count for variance, count in variances]
    total = sum(parts)
    if total == 0.0:
        return replace(inference, low=value, high=value, note=NO_SPREAD)
    free = [count - 1 for count in n]
    freedom = total**2 / sum(part**2 / k for part, k in zip(parts, free, strict=True))
    error = math.sqrt(total)
    interval = student(value, error, freedom)
    p = float(special.stdtr(freedom, (abs(value) - margin) / error))
    return replace(inference, low=interval.low, high=interval.high, p=p)
