"""Permutation tests: how far a statistic of runs or of tasks exceeds what chance gives it."""

from __future__ import annotations

import math
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from coartic.analysis.statistics.estimates import RESAMPLES
from coartic.robot import Array


def divisions(
    first: int, second: int, rng: np.random.Generator, resamples: int = RESAMPLES
) -> tuple[Array, bool]:
    """Ways to divide runs into two groups, and whether these are all there are.

    Shape ``(m, first + second)``: weights that give the first group's mean less the second's.
    All where they are no more than ``resamples``, else as many drawn at random.
    """
    runs = first + second
    exact = math.comb(runs, first) <= resamples
    if exact:
        chosen = np.array(list(combinations(range(runs), first)))
    else:
        chosen = rng.random((resamples, runs)).argpartition(first - 1, axis=1)[:, :first]
    weights = np.full((len(chosen), runs), -1 / second)
    np.put_along_axis(weights, chosen, 1 / first, axis=1)
    return weights, exact


def orders(
    size: int, rng: np.random.Generator, resamples: int = RESAMPLES
) -> tuple[NDArray[np.int64], bool]:
    """Orders of so many things, shape ``(m, size)``, and whether these are all there are."""
    exact = math.factorial(size) <= resamples
    if exact:
        return np.array(list(permutations(range(size)))), True
    return rng.permuted(np.tile(np.arange(size), (resamples, 1)), axis=1), False


def p_values(null: Array, observed: Array, *, exact: bool) -> Array:
    """Share of permutations with so large a statistic or a larger one, 0 < p ≤ 1.

    ``null`` has shape ``(m, ...)``, ``observed`` the rest of it. Where permutations are
    drawn, the observed one counts as one more (Davison & Hinkley 1997).
    """
    reached = (null >= observed * (1 - 1e-9)).sum(axis=0)
    share: Array = reached / len(null) if exact else (1 + reached) / (1 + len(null))
    return share
