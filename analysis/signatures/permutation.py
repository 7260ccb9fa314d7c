"""Permutation tests: how far a statistic of runs or of tasks exceeds what chance gives it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from coartic.analysis.statistics.estimates import RESAMPLES
from coartic.robot import Array

_AT_ONCE = 500  # divisions in memory


def divisions(
    first: int, second: int, rng: np.random.Generator, resamples: int = RESAMPLES
) -> tuple[Iterator[Array], bool]:
    """Ways to divide runs into two groups, and whether these are all there are.

    Blocks of shape ``(m, first + second)``: weights that give the first group's mean less the
    second's. All where they are no more than ``resamples``, else as many drawn at random.
    Together they would fill the memory with thousands of runs.
    """
    runs = first + second
    exact = math.comb(runs, first) <= resamples
    every = np.array(list(combinations(range(runs), first))) if exact else None

    def blocks() -> Iterator[Array]:
        count = resamples if every is None else len(every)
        for start in range(0, count, _AT_ONCE):
            size = min(_AT_ONCE, count - start)
            if every is None:
                chosen = rng.random((size, runs)).argpartition(first - 1, axis=1)[:, :first]
            else:
                chosen = every[start : start + size]
            weights = np.full((size, runs), -1 / second)
            np.put_along_axis(weights, chosen, 1 / first, axis=1)
            yield weights

    return blocks(), exact


def orders(size: int, rng: np.random.Generator) -> tuple[NDArray[np.int64], bool]:
    """Orders of so many things, shape ``(m, size)``, and whether these are all there are."""
    exact = math.factorial(size) <= RESAMPLES
    if exact:
        return np.array(list(permutations(range(size)))), True
    return rng.permuted(np.tile(np.arange(size), (RESAMPLES, 1)), axis=1), False


def p_values(null: Array, observed: Array, *, exact: bool) -> Array:
    """Share of permutations with so large a statistic or a larger one, 0 < p ≤ 1.

    ``null`` has shape ``(m, ...)``, ``observed`` the rest of it. Where permutations are
    drawn, the observed one counts as one more (Davison & Hinkley 1997).
    """
    reached = (null >= observed * (1 - 1e-9)).sum(axis=0)
    share: Array = reached / len(null) if exact else (1 + reached) / (1 + len(null))
    return share
