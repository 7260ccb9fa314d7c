"""Rank correlations.

Source of the interval: E. C. Fieller, H. O. Hartley & E. S. Pearson (1957), Biometrika 44, 470.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special, stats

from coartic.analysis.statistics.estimates import TAILS, Estimate
from coartic.robot import Array


def rank_correlation(first: Array, second: Array) -> Array:
    """Spearman's correlation along the last axis, of many samples at once; NaN where one does not
    vary."""
    ranks = [np.asarray(stats.rankdata(each, axis=-1), np.float64) for each in (first, second)]
    one, two = (each - each.mean(axis=-1, keepdims=True) for each in ranks)
    lengths = np.prod([np.linalg.norm(each, axis=-1) for each in (one, two)], axis=0)
    rho: Array = np.full_like(lengths, np.nan)
    np.divide((one * two).sum(axis=-1), lengths, out=rho, where=lengths > 0)
    return rho


def rank_correlation_estimate(first: Array, second: Array) -> Estimate:
    """That of two samples ``(n,)`` with its interval by Fisher's transform, n > 3.

    Its variance there is 1.06 / (n - 3).
    """
    value = float(stats.spearmanr(first, second).statistic)
    half = special.ndtri(TAILS[1]) * math.sqrt(1.06 / (len(first) - 3))
    low, high = np.tanh(np.arctanh(value) + np.array([-half, half]))
    return Estimate(value, float(low), float(high), n=(len(first),))
