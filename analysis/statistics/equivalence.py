"""Whether two means agree within a margin: by inclusion of their interval.

A 95 % interval within ±margin is two one-sided tests at level 2.5 % (TOST; D. J. Schuirmann 1987,
Journal of Pharmacokinetics and Biopharmaceutics 15). The interval of means is Welch's, since of
the paper's runs only mean, SD and number are printed.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from coartic.analysis.statistics.estimates import TAILS, Estimate, centred, vector

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
    """Our mean less the published mean, with Welch's interval by the printed SD and number of runs.

    Where no SD is printed (None) the published mean is taken as exact, and the interval is
    Student's. No interval for a single run; a point where no sample has any spread.
    """
    values = vector(ours)
    n, value = len(values), float(values.mean()) - published
    if n < 2:
        return Estimate(value, n=(n,))
    parts = [(float(np.var(centred(values), ddof=1)) / n, n - 1)]
    if sd is not None and runs > 1:
        parts.append((sd**2 / runs, runs - 1))
    total = sum(part for part, _ in parts)
    sizes = tuple(free + 1 for _, free in parts)
    if total == 0.0:
        return Estimate(value, value, value, n=sizes)
    freedom = total**2 / sum(part**2 / free for part, free in parts)
    from scipy import special  # as in estimates

    half = float(special.stdtrit(freedom, TAILS[1])) * math.sqrt(total)
    return Estimate(value, value - half, value + half, n=sizes)
