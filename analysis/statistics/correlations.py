"""Rank correlations."""

from __future__ import annotations

import numpy as np
from scipy import stats

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
