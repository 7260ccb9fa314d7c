"""Posture differences at a goal between two contexts, and their tests.

Configurations mix length unit (base) and rad (joints), as the joint-space distance of the model
does. Permutation tests exchange whole runs, which are exchangeable if the context has no effect;
the tests assume no distribution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.analysis.statistics.hypotheses import drawn_rows, places
from coartic.estimates import RESAMPLES, Resamples, centred, slices
from coartic.internal.arguments import Numbers, checked_arguments
from coartic.robot import Array

IN_MEMORY = 500
"""Most permutations or resamples of runs in memory at once."""


def _groups(*groups: Numbers) -> list[Array]:
    """Return groups of runs as arrays of float64. Raises ValueError unless all have shape ``(runs,
    dof)``, with the same ``dof`` and a run at least."""
    shapes = [np.shape(group) for group in groups]
    if any(len(shape) != 2 or shape[1:] != shapes[0][1:] or 0 in shape for shape in shapes):
        raise ValueError(f"runs have shapes {shapes}; needed is (runs, dof) of each")
    return [np.asarray(group, np.float64) for group in groups]


def distance_of_means(first: Array, second: Array) -> float:
    """Return ‖mean(first) − mean(second)‖, the distance of mean configurations of two contexts.

    ``first`` and ``second`` have shape ``(runs, dof)`` (ValueError for others); length unit and rad
    mixed.
    """
    first, second = _groups(first, second)
    return float(np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)))


def standardised_posture_difference(first: Array, second: Array) -> float:
    """Return the distance of the mean configurations of two contexts, ``(runs, dof)`` each, in
    pooled standard deviations within contexts, 0 to ∞.

    d = ‖m₁ − m₂‖ / s, s² = (Σ‖x − m₁‖² + Σ‖x − m₂‖²) / (n₁ + n₂ − 2),

    a multivariate form of Cohen's d (Cohen 1988). Without an effect of the context the expectation
    of d² is about 1/n₁ + 1/n₂, not 0. NaN if no context has two runs, or if s = 0. Raises
    ValueError for other shapes.
    """
    first, second = _groups(first, second)
    freedom = len(first) + len(second) - 2
    if freedom < 1:
        return math.nan
    squares = sum((centred(group) ** 2).sum() for group in (first, second))
    spread = float(np.sqrt(squares / freedom))
    return distance_of_means(first, second) / spread if spread else math.nan


@checked_arguments
def posture_difference_below(
    first: Numbers,
    second: Numbers,
    bound: float,
    rng: np.random.Generator,
    *,
    standardised: bool = True,
    resamples: Resamples = RESAMPLES,
) -> float:
    """Test that the posture difference is below a bound, by the bootstrap.

    ``first`` and ``second`` have shape ``(runs, dof)``. Returns p, the share of bootstrap samples,
    with runs drawn within each context, whose :func:`standardised_posture_difference` is at least
    ``bound`` (in SDs; NaN counts), or if not ``standardised`` whose :func:`distance_of_means` is;
    one such sample is added. Noise adds to distances, so that p is rather too large. NaN if a
    context has a single run. Raises ValueError for other shapes.
    """
    groups = _groups(first, second)
    if min(map(len, groups)) < 2:
        return math.nan
    means, squares = [], np.zeros(resamples)
    for group in groups:
        means.append(np.empty((resamples, group.shape[1])))
        for rows in slices(resamples, IN_MEMORY):
            drawn = group[rng.integers(len(group), size=(rows.stop - rows.start, len(group)))]
            means[-1][rows] = drawn.mean(axis=1)
            squares[rows] += ((drawn - means[-1][rows, None]) ** 2).sum(axis=(1, 2))
    pooled = np.sqrt(squares / (sum(map(len, groups)) - 2)) if standardised else 1.0
    reached = np.linalg.norm(means[0] - means[1], axis=1) >= bound * pooled
    return float(1 + reached.sum()) / (resamples + 1)


def permutation_p(
    first: Array, second: Array, rng: np.random.Generator, *, resamples: Resamples = RESAMPLES
) -> float:
    """Test that the distance of the mean configurations of two contexts exceeds chance, by a
    one-tailed permutation test of runs.

    ``first`` and ``second`` have shape ``(runs, dof)``. Returns p, 0 < p ≤ 1: exact if the runs can
    be divided in no more than ``resamples`` ways, 1 if all runs are equal, NaN if a context has a
    single run. Raises ValueError for other shapes.
    """
    first, second = _groups(first, second)
    if min(len(first), len(second)) < 2:
        return math.nan
    n, m, pool = len(first), len(second), centred(np.concatenate([first, second]))
    ways = math.comb(n + m, n)
    exact = ways <= resamples
    every = places(n + m, n, ways if exact else resamples, exact, rng)
    null = [_distances(*_means_of(pool, rows)) for _, rows in every]
    (observed,) = _distances(*_means_of(pool, np.arange(n)[None]))
    reached = int((np.concatenate(null) >= observed * (1 - 1e-9)).sum())
    # Where divisions are drawn, the observed one counts as one more (Davison & Hinkley 1997).
    return reached / ways if exact else (1 + reached) / (1 + resamples)


@checked_arguments
def beyond_p(
    method: Sequence[Numbers],
    other: Sequence[Numbers],
    rng: np.random.Generator,
    *,
    resamples: Resamples = RESAMPLES,
) -> float:
    """Test that a method's posture difference between contexts exceeds another method's, by
    permutation.

    The posture difference is the distance of the mean configurations in the two contexts. The
    statistic is the difference of the two methods' posture differences. Permutations exchange the
    runs of both methods within each context. Raises ValueError for other numbers of contexts than
    two, and for other shapes.

    Parameters
    ----------
    method, other : sequence of arrays, shape (runs, dof)
        Configurations in each of the two contexts, length unit and rad.
    rng : numpy.random.Generator
        Generator of the permutations.
    resamples : int
        Number of permutations.

    Returns
    -------
    float
        p, 0 < p ≤ 1: twice the upper tail, 1 at most. NaN if a method has a single run in a
        context.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> still = [rng.normal(size=(20, 10)), rng.normal(size=(20, 10))]
    >>> moved = [rng.normal(size=(20, 10)), rng.normal(size=(20, 10)) + 2]
    >>> beyond_p(moved, still, rng) < 0.001 < beyond_p(still, still, rng)
    True
    """
    if len(method) != 2 or len(other) != 2:
        raise ValueError("needed are the runs of each method in two contexts")
    groups = _groups(*method, *other)
    if min(map(len, groups)) < 2:
        return math.nan
    pools = [np.concatenate(runs) for runs in zip(groups[:2], groups[2:], strict=True)]
    sizes = [*map(len, groups[:2])]

    def excess(rows: Sequence[NDArray[np.int32]]) -> Array:
        of_method, of_other = zip(*map(_means_of, pools, rows), strict=True)
        return _distances(*of_method) - _distances(*of_other)

    null = np.empty(resamples)
    for part in slices(resamples, IN_MEMORY):
        count = part.stop - part.start
        null[part] = excess([drawn_rows(len(pool), size, count, rng)
                             for pool, size in zip(pools, sizes, strict=True)])  # fmt: skip
    (observed,) = excess([np.arange(size, dtype=np.int32)[None] for size in sizes])
    return min(1.0, 2 * float(1 + (null >= observed - 1e-12).sum()) / (1 + resamples))


def _means_of(pool: Array, rows: NDArray[Any]) -> tuple[Array, Array]:
    """Return, for each of ``rows`` of indices in ``pool``, the mean of the configurations that the
    row names, and the mean of the others, shapes ``(rows, dof)``."""
    total, chosen = pool[rows].sum(axis=1), rows.shape[1]
    return total / chosen, (pool.sum(axis=0) - total) / (len(pool) - chosen)


def _distances(first: Array, second: Array) -> Array:
    """Return the distances of mean configurations, shape ``(rows,)``."""
    return np.asarray(np.linalg.norm(first - second, axis=1))
