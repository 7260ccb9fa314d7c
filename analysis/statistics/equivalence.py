"""Whether two means agree within a margin: by inclusion of their interval.

A 95 % interval within ±margin is two one-sided tests at level 2.5 % (TOST; D. J. Schuirmann 1987,
Journal of Pharmacokinetics and Biopharmaceutics 15). The interval of means is Welch's, since of
the paper's runs only mean, SD and number are printed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from coartic.analysis.statistics.estimates import Estimate, centred, samples_of, student, vector
from coartic.robot import Array

MARGIN = 0.01
"""Differences up to this share of the published reward count as equivalent."""
Equivalence = Literal["equivalent", "different", "undecided"]


def verdict(estimate: Estimate, margin: float) -> Equivalence:
    """Compare the interval of a difference with ±margin.

    Equivalent where the interval lies within the margin, different where it lies outside,
    undecided where it does neither or there is none.
    """
    if -margin <= estimate.low and estimate.high <= margin:
        return "equivalent"
    if estimate.low > margin or estimate.high < -margin:
        return "different"
    return "undecided"


def difference_to_printed(
    ours: ArrayLike, published: float, sd: float | None, runs: int
) -> Estimate:
    """Our mean less the published mean, by the printed SD and number of runs.

    Where no SD is printed (None) the published mean is taken as exact.
    """
    values = vector(ours)
    theirs = [] if sd is None or runs < 2 else [(sd**2, runs)]
    return _welch(float(values.mean()) - published, [_variance(values), *theirs])


def welch(first: ArrayLike, second: ArrayLike | float) -> Estimate:
    """Mean of ``first`` less mean of ``second``: independent samples, or a sample and a number."""
    samples = samples_of(first, second)
    means = [float(values.mean()) for values in samples]
    return _welch(means[0] - sum(means[1:]), list(map(_variance, samples)))


def _variance(values: Array) -> tuple[float, int]:
    """Variance of a sample (n - 1 degrees of freedom), and the number of its values."""
    count = len(values)
    return float(np.var(centred(values), ddof=1)) if count > 1 else math.nan, count


def _welch(value: float, variances: list[tuple[float, int]]) -> Estimate:
    """A difference with Welch's interval, or with Student's for one sample.

    No interval for a sample of one value; a point where no sample has any spread.
    """
    n = tuple(count for _, count in variances)
    if min(n) < 2:
        return Estimate(value, n=n)
    parts = [variance / count for variance, count in variances]
    total = sum(parts)
    if total == 0.0:
        return Estimate(value, value, value, n=n)
    free = [count - 1 for count in n]
    freedom = total**2 / sum(part**2 / k for part, k in zip(parts, free, strict=True))
    return replace(student(value, math.sqrt(total), freedom), n=n)
