"""How many runs a difference of two means needs, and what difference so many runs find.

By the noncentral t distribution with Welch's degrees of freedom. Exact for normal samples
of equal variance (J. Cohen 1988, Statistical Power Analysis for the Behavioral Sciences,
chapter 2), close for unequal ones, a guide for rewards that settle on several levels: take
the SDs from runs that show all of them.
"""

from __future__ import annotations

import math
from bisect import bisect_left

from scipy import special, stats

from coartic.analysis.statistics.estimates import LEVEL

POWER = 0.8


def power(
    difference: float, first_sd: float, second_sd: float, runs: int, level: float = LEVEL
) -> float:
    """P(a t-test with ``runs`` runs of each sample finds a true difference of means).

    One-tailed at ``level``, as the paper tests: the sign of
    ``difference`` is the one expected. For pairs, or one sample against a known value, the SD of
    the differences is ``first_sd`` and ``second_sd`` is 0. Without any spread every difference
    but 0 is found. Raises ValueError for a negative SD or fewer than 2 runs.
    """
    if min(first_sd, second_sd) < 0 or runs < 2:
        raise ValueError("power needs SDs of at least 0 and at least 2 runs")
    variances = first_sd**2, second_sd**2
    total = sum(variances)
    if total == 0:
        return float(difference != 0)
    freedom = (runs - 1) * total**2 / sum(variance**2 for variance in variances)
    shift = abs(difference) * math.sqrt(runs / total)
    return float(stats.nct.sf(special.stdtrit(freedom, 1 - level), freedom, shift))


def runs_needed(difference: float, first_sd: float, second_sd: float) -> int:
    """Fewest runs of each sample with :func:`power` of at least :data:`POWER`; 2 or more.

    Raises ValueError for a difference of 0, which no number of runs finds.
    """
    if difference == 0:
        raise ValueError("runs_needed needs a difference")

    def enough(runs: int) -> bool:
        return power(difference, first_sd, second_sd, runs) >= POWER

    most = 2
    while not enough(most):
        most *= 2
    return bisect_left(range(most), True, lo=max(2, most // 2), key=enough)
