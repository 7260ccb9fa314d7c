"""Tests of means and shares, and Holm's correction for several tests.

Means have bootstrap tests, shares exact binomial tests; permutation tests of postures are in
:mod:`coartic.analysis.signatures`. Samples, exact numbers and seeds are as in
:mod:`coartic.estimates`.

Sources: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapter 16;
A. C. Davison & D. V. Hinkley (1997), Bootstrap Methods and their Application, chapter 4
(p-values that count the observed sample); S. Holm (1979), Scandinavian Journal of Statistics 6.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from coartic.estimates import (
    IN_CACHE,
    NEGLIGIBLE,
    RESAMPLES,
    SEED,
    Estimate,
    Resamples,
    centred,
    slices,
    vector,
)
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import MOST_RUNS, real_array
from coartic.robot import Array

Alternative = Literal["greater", "less", "two-sided"]
_MOST_PLACES = 2_000_000  # places in resamples that are kept at once
_Count = Annotated[int, 0, MOST_RUNS]
_Share = Annotated[float, 0.0, 1.0]


@checked_arguments
def bootstrap_test(
    first: ArrayLike,
    second: ArrayLike | float,
    alternative: Alternative = "greater",
    *,
    resamples: Resamples = RESAMPLES,
) -> Estimate:
    """Test the difference of two means, or of a mean and a number, by the bootstrap. The value of
    the estimate, which has no interval, is the mean of ``first`` less the mean of ``second`` (or
    less the number). Raises ValueError for an empty sample, and for NaN or infinity.

    Algorithm 16.2 of Efron & Tibshirani (1993), the book that the paper cites: every sample is
    shifted to the mean 0 and resampled, and the statistic is the difference of means over its
    standard error, with a variance for each sample. Against a number, their one-sample test
    (section 16.4). Unlike in the book, p = (1 + resamples at least as extreme) / (1 + resamples),
    never 0 (Davison & Hinkley 1997): the smallest p is 0.0001 by default. ``"greater"``:
    one-tailed, the mean of ``first`` is higher.

    Without spread in any sample, p is the p-value of the exact test of as many values, by signs or
    by exchange. p is NaN with fewer than two values in a sample, or without spread and difference.
    """
    samples: tuple[Array, ...] = vector(first), vector(np.atleast_1d(second))
    if np.ndim(second) == 0:  # a number without error
        samples = (samples[0] - samples[1],)
    difference = float(samples[0].mean() - sum(other.mean() for other in samples[1:]))
    n = tuple(map(len, samples))
    shifted = list(map(centred, samples))
    size = max(np.abs(values).max() for values in shifted)
    # The smallest p of an exact test of as many values, by signs or by exchange, is a bound.
    tails = 2 if alternative == "two-sided" else 1
    ways = math.comb(sum(n), n[0]) if len(n) > 1 else 2 ** n[0]
    least = max(tails / ways, 1 / (1 + resamples))
    differs = abs(difference) > NEGLIGIBLE * np.abs(first).max()
    if min(n) < 2 or not (size or differs):
        return Estimate(difference, n=n)
    if not size:
        as_asked = tails == 2 or (difference > 0) == (alternative == "greater")
        p = least if as_asked else 1.0
        return Estimate(difference, p=p, n=n, resamples=resamples, least_p=least)
    observed = difference / math.sqrt(sum(values.var(ddof=1) / len(values) for values in shifted))
    sums, variances = np.zeros(resamples), np.zeros(resamples)
    batches = (_kept_places if sum(n) * resamples <= _MOST_PLACES else _places)(n, resamples)
    for sample, part, places in batches:
        drawn = shifted[sample][places]
        means = drawn.mean(axis=0, keepdims=True)
        sums[part] += (1, -1)[sample] * means[0]
        variances[part] += drawn.var(axis=0, ddof=1, mean=means) / n[sample]
    # Rounding is neither spread nor difference: resamples of equal values, equal means.
    sums[np.abs(sums) < NEGLIGIBLE * size] = 0.0
    variances[variances < (NEGLIGIBLE * size) ** 2] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        null = np.where(sums == 0, 0.0, sums / np.sqrt(variances))
    if alternative == "two-sided":
        null, observed = np.abs(null), abs(observed)
    extreme = null <= observed if alternative == "less" else null >= observed
    extreme |= np.isclose(null, observed, rtol=NEGLIGIBLE, atol=0.0)
    p = float(1 + extreme.sum()) / (1 + resamples)
    return Estimate(difference, p=p, n=n, resamples=resamples, least_p=least)


def _places(
    sizes: tuple[int, ...], resamples: int
) -> Iterator[tuple[int, slice, NDArray[np.int64]]]:
    """Yield the number of a sample, a slice of the resamples, and the places of the values that
    these draw, shape ``(size, length of the slice)``. Equal arguments give equal places."""
    rng = np.random.default_rng(SEED)
    for sample, size in enumerate(sizes):
        for part in slices(resamples, max(1, IN_CACHE // size)):
            places = rng.integers(size, size=(part.stop - part.start, size))
            yield sample, part, np.ascontiguousarray(places.T)


@lru_cache(maxsize=16)  # most samples have as many values as another
def _kept_places(
    sizes: tuple[int, ...], resamples: int
) -> list[tuple[int, slice, NDArray[np.int64]]]:
    """Return all of :func:`_places`, kept for further samples of these sizes: do not change it."""
    return [*_places(sizes, resamples)]


@checked_arguments
def share_test(count: _Count, total: _Count, share: _Share, alternative: Alternative) -> Estimate:
    """Test ``count`` of ``total`` runs against a share (0 to 1) by the exact binomial test.

    The value of the estimate is the difference ``count / total - share``.
    """
    p = float(scipy.stats.binomtest(count, total, share, alternative).pvalue)
    return Estimate(count / total - share, p=p, n=(total,))


@checked_arguments
def holm(p_values: ArrayLike, family: int | None = None) -> list[float]:
    """Return the p-values of a family of tests, adjusted by Holm (1979), in the same order.

    Rejecting adjusted p-values at or below α has a family-wise error rate of α at most, whatever
    the dependence. NaN, a missing test, stays NaN and does not count, unless ``family`` says the
    number of planned tests: then missing tests count as p = 1.
    """
    p = real_array("p_values", p_values).reshape(-1)
    planned = int((~np.isnan(p)).sum()) if family is None else family
    order = np.argsort(p, kind="stable")  # NaN last
    steps = np.maximum.accumulate(p[order] * (planned - np.arange(len(p))))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, steps)
    return list(map(float, adjusted))
