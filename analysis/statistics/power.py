"""How many runs a difference of two means needs, and what difference so many runs find.

By the noncentral t distribution with Welch's degrees of freedom. Exact for normal samples
of equal variance (J. Cohen 1988, Statistical Power Analysis for the Behavioral Sciences,
chapter 2), close for unequal ones, a guide for rewards that settle on several levels: take
the SDs from runs that show all of them.
"""

from __future__ import annotations

import math
from bisect import bisect_left

from scipy import optimize, special, stats

from analysis.statistics.estimates import LEVEL

POWER = 0.8


def power(
    difference: float,
    first_sd: float,
    second_sd: float,
    runs: int,
    *,
    level: float = LEVEL,
    tails: int = 1,
) -> float:
    """P(a t-test with ``runs`` runs of each sample finds a true difference of means).

    ``tails`` is 1, as the paper tests (the sign of ``difference`` is the one expected), or
    2. For pairs, or one sample against a known value, the SD of the differences is
    ``first_sd`` and ``second_sd`` is 0. Without any spread every difference but 0 is found.
    Raises ValueError for a negative SD, fewer than 2 runs, or other tails.
    """
    if min(first_sd, second_sd) < 0 or runs < 2 or tails not in (1, 2):
        raise ValueError("power needs SDs of at least 0, at least 2 runs, and 1 or 2 tails")
    variances = first_sd**2, second_sd**2
    total = sum(variances)
    if total == 0:
        return float(difference != 0)
    freedom = (runs - 1) * total**2 / sum(variance**2 for variance in variances)
    shift = abs(difference) * math.sqrt(runs / total)
    critical = float(special.stdtrit(freedom, 1 - level / tails))
    found = float(stats.nct.sf(critical, freedom, shift))
    if tails == 2:
        # The lower tail, mirrored: scipy's cdf is NaN far out.
        found += float(stats.nct.sf(critical, freedom, -shift))
    return found


def runs_needed(
    difference: float,
    first_sd: float,
    second_sd: float,
    *,
    target: float = POWER,
    level: float = LEVEL,
    tails: int = 1,
) -> int:
    """Fewest runs of each sample with :func:`power` of at least ``target``; 2 or more.

    Raises ValueError for a difference of 0, which no number of runs finds, and for a
    target that does not lie between ``level`` and 1.
    """
    if difference == 0 or not level < target < 1:
        raise ValueError("runs_needed needs a difference, and a power between the level and 1")

    def enough(runs: int) -> bool:
        return power(difference, first_sd, second_sd, runs, level=level, tails=tails) >= target

    most = 2
    while not enough(most):
        most *= 2
    return bisect_left(range(most), True, lo=max(2, most // 2), key=enough)


def smallest_difference(
    first_sd: float,
    second_sd: float,
    runs: int,
    *,
    target: float = POWER,
    level: float = LEVEL,
    tails: int = 1,
) -> float:
    """Smallest true difference of means that :func:`power` finds with ``target``, > 0.

    In the unit of the SDs; 0 without any spread, where every difference is found. Raises
    ValueError as :func:`power`, and for a target that does not lie between ``level`` and 1.
    """
    if not level < target < 1:
        raise ValueError("smallest_difference needs a power between the level and 1")

    def excess(difference: float) -> float:
        found = power(difference, first_sd, second_sd, runs, level=level, tails=tails)
        return found - target

    scale = math.hypot(first_sd, second_sd)
    if scale == 0:
        return 0.0
    most = scale
    while excess(most) < 0:
        most *= 2
    return float(optimize.brentq(excess, 0.0, most, xtol=1e-9 * scale))
