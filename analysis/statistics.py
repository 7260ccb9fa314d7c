"""Tests of hypotheses on runs, and means over tasks with their intervals.

Two means have tests by exchange, a mean against a number the bootstrap, shares exact binomial
tests. Samples and seeds are as in :mod:`coartic.estimates`.

Sources: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapter 16;
A. C. Davison & D. V. Hinkley (1997), Bootstrap Methods and their Application, chapter 4
(p-values that count the observed sample); S. Holm (1979), Scandinavian Journal of Statistics 6.

For other runs on the same tasks, all tasks have the same weight, whatever their number of runs, and
the bootstrap resamples runs within tasks.

For other tasks, the sample has runs within instances within families. The bootstrap is hierarchical
(A. C. Davison & D. V. Hinkley 1997, Bootstrap Methods and their Application, section 3.8): it
resamples instances within families, then runs within instances. Families are fixed and have the
same weight. A mixed model does not fit: gaps to an optimum are skewed and bounded by 0, and their
spread over runs differs between methods and tasks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import combinations, islice
from typing import Annotated, Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from coartic.estimates import (
    FEWER_RESAMPLES,
    FEWEST,
    FEWEST_TASKS,
    IN_CACHE,
    NEGLIGIBLE,
    RESAMPLES,
    SEED,
    TAILS,
    Estimate,
    Resamples,
    centred,
    mean_of_means,
    slices,
    vector,
)
from coartic.internal.arguments import Numbers
from coartic.internal.limits import MOST_RUNS
from coartic.robot import Array

Alternative = Literal["greater", "less", "two-sided"]
_MOST_PLACES = 2_000_000  # places in resamples that are kept at once
_Count = Annotated[int, Field(ge=0, le=MOST_RUNS)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]


def bootstrap_test(
    values: Numbers,
    bound: float,
    alternative: Alternative = "greater",
    *,
    resamples: Resamples = RESAMPLES,
) -> Estimate:
    """Test the difference of a mean and a number by the bootstrap. The value of the estimate, which
    has no interval, is the mean of ``values`` less ``bound``. Raises ValueError for an empty
    sample, and for NaN or infinity.

    Efron & Tibshirani (1993), section 16.4: the sample is shifted to the mean 0 and resampled, and
    the statistic is the mean over its standard error. Unlike in the book, p = (1 + resamples at
    least as extreme) / (1 + resamples), never 0 (Davison & Hinkley 1997): the smallest p is 0.0001
    by default. ``"greater"``: one-tailed, the mean of ``values`` is higher.

    ``least_p`` is the smallest p of the sign test of as many values, or of these resamples if that
    is larger; without spread, p is ``least_p``, or 1 if one-tailed for the other side. The test
    can give a smaller p than ``least_p``, for few values. p is NaN with fewer than two values, or
    without spread and difference.
    """
    sample = vector(values) - vector([bound])[0]
    difference, n = float(sample.mean()), len(sample)
    tails = 2 if alternative == "two-sided" else 1
    least = max(tails / 2**n, 1 / (1 + resamples))
    varies = bool(centred(sample).any())
    differs = abs(difference) > NEGLIGIBLE * np.abs(vector(values)).max()
    if n < 2 or not (varies or differs):
        return Estimate(difference, n=(n,))
    if varies:
        p = _p_of([(sample, 0.0)], alternative, resamples)
    else:
        as_asked = tails == 2 or (difference > 0) == (alternative == "greater")
        p = least if as_asked else 1.0
    return Estimate(difference, p=p, n=(n,), resamples=resamples, least_p=least)


def exchange_test(
    first: Numbers,
    second: Numbers,
    alternative: Alternative = "greater",
    *,
    resamples: Resamples = RESAMPLES,
) -> Estimate:
    """Test the difference of two means by exchange of the values' labels. The value of the
    estimate, which has no interval, is the mean of ``first`` less the mean of ``second``. Raises
    ValueError for an empty sample, and for NaN or infinity.

    The statistic is the difference of means over its standard error, with a variance for each
    sample, so that the test holds for samples of unequal spread, too (A. Janssen 1997, Statistics
    & Probability Letters 36); without spread it is infinite or 0. p is exact where all exchanges
    are no more than ``resamples``, or else (1 + exchanges at least as extreme) / (1 + resamples).
    ``"greater"``: one-tailed, the mean of ``first`` is higher; two-sided by the absolute value.

    p is NaN with fewer than five values in a sample, and if all values are equal.
    """
    samples = vector(first), vector(second)
    n, m = map(len, samples)
    value = float(samples[0].mean() - samples[1].mean())
    if min(n, m) < FEWEST or not centred(np.concatenate(samples)).any():
        return Estimate(value, n=(n, m))
    exact = math.comb(n + m, n) <= resamples
    p = _p_of([samples], alternative, resamples, exact=exact)
    least = smallest_p(n, m, resamples, two_tailed=alternative == "two-sided")
    return Estimate(value, p=p, n=(n, m), resamples=0 if exact else resamples, least_p=least)


def smallest_p(n: int, m: int, resamples: int = RESAMPLES, *, two_tailed: bool = True) -> float:
    """Return the smallest p that a test by exchange can give, for samples of ``n`` and ``m`` values
    or runs, two or more each; ``two_tailed``: if the test does not know which sample is which."""
    ways = math.comb(n + m, n)
    if ways > resamples:  # exchanges are drawn, perhaps none as far apart as the samples
        return 1 / (1 + resamples)
    return (2 if two_tailed and n == m else 1) / ways  # the exchange of both is as far apart


def stratified_test(strata: Sequence[tuple[Array | float, Array | float]]) -> float:
    """Return the p-value, two-sided, of a difference of means that is itself a mean over strata,
    such as tasks. A stratum is a pair of samples, shapes ``(n,)`` and ``(m,)``; an exact number can
    stand for a sample.

    In each stratum labels are exchanged, as in :func:`exchange_test`; a sample that is compared
    with an exact number is resampled, as in :func:`bootstrap_test`. The statistic is the
    sum of the differences over the root of the sum of their variances; p = (1 + resamples at least
    as extreme) / (1 + resamples). p is NaN with fewer than five values in a sample, and without a
    sample.

    Examples
    --------
    >>> apart = np.arange(5.0), np.arange(5.0) + 9.0
    >>> stratified_test([apart, apart])
    0.0001
    """
    samples = [each for pair in strata for each in pair if not isinstance(each, float)]
    if not samples or min(map(len, samples)) < FEWEST:
        return math.nan
    return _p_of(strata, "two-sided", RESAMPLES)


def _p_of(
    strata: Sequence[tuple[Array | float, Array | float]],
    alternative: Alternative,
    resamples: int,
    *,
    exact: bool = False,
) -> float:
    """Return the p-value of :func:`stratified_test` for an alternative, from ``resamples``; with
    ``exact`` from all exchanges of the labels of the only stratum, two samples."""
    if exact:
        resamples = math.comb(sum(map(np.size, strata[0])), np.size(strata[0][0]))
    rng = np.random.default_rng(SEED)
    observed, null, size = np.zeros((2, 1)), np.zeros((2, resamples)), 0.0
    for first, second in strata:
        if isinstance(first, float) and isinstance(second, float):
            observed[0] += first - second
            continue
        if isinstance(first, float) or isinstance(second, float):
            values = np.ravel(first - second)
            pool, n, chosen = centred(values), len(values), len(values)
            observed[0] += values.mean()
            observed[1] += pool.var(ddof=1) / n
        else:
            pool, n = centred(np.concatenate([first, second])), len(first)
            chosen = min(n, len(second))
            observed += _moments(pool, np.arange(n)[None], n)
        size += float(np.abs(pool).max())
        is_kept = len(strata) == 1 and resamples * chosen <= _MOST_PLACES
        every = (
            _kept_places(len(pool), chosen, resamples, exact)
            if is_kept
            else places(len(pool), chosen, resamples, exact, rng)
        )
        for part, rows in every:
            null[:, part] += _moments(pool, rows, n)
    (statistic,) = _studentised(observed, size)
    extreme = _extreme(_studentised(null, size), statistic, alternative)
    return extreme / resamples if exact else (1 + extreme) / (1 + resamples)


def _moments(pool: Array, rows: NDArray[Any], n: int) -> tuple[Array, Array]:
    """Return the difference of means (first less second sample) and the variance of the difference
    for each of ``rows``, shapes ``(rows,)``. A row has the indices, in ``pool`` (the values of both
    samples), of one sample: the first if a row has ``n`` indices, else the second. For a single
    sample, whose values a row draws with replacement, return mean and variance of the mean."""
    few, many = rows.shape[1], len(pool) - rows.shape[1]
    values = pool[rows]
    if not many:
        return values.mean(axis=1), values.var(axis=1, ddof=1) / n
    sums, squares = values.sum(axis=1), (values**2).sum(axis=1)
    mean, other = sums / few, (pool.sum() - sums) / many
    variances = sum(
        (total - count * centre**2).clip(0) / (count * (count - 1))
        for total, count, centre in (
            (squares, few, mean),
            ((pool**2).sum() - squares, many, other),
        )
    )
    size = float(np.abs(pool).max())
    variances[variances < 1e-12 * size**2] = 0.0  # sums of squares round
    return (mean - other) * (1 if few == n else -1), variances


def _studentised(moments: Array, size: float) -> Array:
    """Return differences, the first row of ``moments``, over the square roots of their variances,
    the second, 0 for no difference, and otherwise infinite without variance. Differences and
    variances that are rounding of values of ``size`` count as 0."""
    differences = np.where(np.abs(moments[0]) < NEGLIGIBLE * size, 0.0, moments[0])
    variances = np.where(moments[1] < (NEGLIGIBLE * size) ** 2, 0.0, moments[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(differences == 0, 0.0, differences / np.sqrt(variances))


def _extreme(null: Array, observed: float, alternative: Alternative) -> int:
    """Return how many statistics in ``null``, ``(n,)``, are at least as extreme as ``observed``, up
    to rounding: as high for ``"greater"``, as low for ``"less"``, as far from 0 for
    ``"two-sided"``."""
    if alternative == "two-sided":
        null, observed = np.abs(null), abs(observed)
    extreme = null <= observed if alternative == "less" else null >= observed
    return int((extreme | np.isclose(null, observed, rtol=NEGLIGIBLE, atol=0.0)).sum())


def drawn_rows(runs: int, chosen: int, size: int, rng: np.random.Generator) -> NDArray[np.int32]:
    """Return ``size`` draws of ``chosen`` of the indices 0 to ``runs`` - 1 without replacement,
    shape ``(size, chosen)``."""
    order = rng.random((size, runs)).argpartition(chosen - 1, axis=1)
    return order[:, :chosen].astype(np.int32)  # no view, which would keep all of the order


def places(
    runs: int, chosen: int, resamples: int, exact: bool, rng: np.random.Generator
) -> Iterator[tuple[slice, NDArray[np.int32]]]:
    """Yield pairs that together cover all resamples: a slice of the resamples, and for each of them
    a row of ``chosen`` of the indices 0 to ``runs`` - 1: all choices in turn if ``exact``
    (``resamples`` is their number), or else random ones; with replacement if as many are chosen as
    there are."""
    every = combinations(range(runs), chosen)
    for part in slices(resamples, max(1, IN_CACHE // runs)):
        size = part.stop - part.start
        if exact:
            yield part, np.array([*islice(every, size)], np.int32)
        elif chosen == runs:
            yield part, rng.integers(runs, size=(size, runs)).astype(np.int32)
        else:
            yield part, drawn_rows(runs, chosen, size, rng)


@lru_cache(maxsize=16)  # most samples have as many values as another
def _kept_places(
    runs: int, chosen: int, resamples: int, exact: bool
) -> list[tuple[slice, NDArray[np.int32]]]:
    """Return the pairs of :func:`places` for a new generator as a list, which is cached for further
    samples of this size: do not change it."""
    return [*places(runs, chosen, resamples, exact, np.random.default_rng(SEED))]


def share_test(count: _Count, total: _Count, share: _Share, alternative: Alternative) -> Estimate:
    """Test ``count`` of ``total`` runs against a share (0 to 1) by the exact binomial test.

    The value of the estimate is the difference ``count / total - share``; its ``p`` is one-tailed
    for ``"greater"`` and ``"less"``. Raises ValueError if ``count`` exceeds ``total``, or ``total``
    is 0.
    """
    p = float(scipy.stats.binomtest(count, total, share, alternative).pvalue)
    return Estimate(count / total - share, p=p, n=(total,))


def holm(p_values: Numbers, family: _Count | None = None) -> list[float]:
    """Return the p-values of a family of tests, adjusted by Holm (1979), in the same order.

    Rejecting adjusted p-values at or below α has a family-wise error rate of α at most, whatever
    the dependence. NaN, a missing test, stays NaN and does not count, unless ``family`` says the
    number of planned tests: then missing tests count as p = 1. Raises ValueError for numbers that
    are no p-values, and for more tests than ``family``.
    """
    p = np.reshape(p_values, -1)
    made = int((~np.isnan(p)).sum())
    planned = made if family is None else family
    if made > planned or not ((p >= 0) & (p <= 1) | np.isnan(p)).all():
        raise ValueError(f"needed are p-values, 0 to 1, of {planned} tests at most")
    order = np.argsort(p, kind="stable")  # NaN last
    steps = np.maximum.accumulate(p[order] * (planned - np.arange(len(p))))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, steps)
    return list(map(float, adjusted))


Scores = Mapping[str, Sequence[Numbers]]
"""Scores of the runs on each instance, shape ``(n,)``, by family."""


def task_mean(values: Iterable[ArrayLike]) -> Estimate:
    """Return the mean over tasks of the mean over runs, with the interval of
    :func:`.mean_of_means`, for ``values`` of shape ``(runs,)`` on each task. Raises ValueError
    without tasks, and for a task without runs."""
    strata = [*map(vector, values)]
    return mean_of_means(strata, [1 / len(strata) for _ in strata])


def other_tasks(scores: Scores) -> Estimate:
    """Return the mean over families, instances and runs, with its interval for other tasks.

    Parameters
    ----------
    scores : mapping of str to sequence of arrays, shape (runs,)
        For each family, the scores of the runs on each instance.

    Returns
    -------
    Estimate
        ``value``, ``low`` and ``high`` in the unit of the scores; ``n`` instances of each family.

    Raises
    ------
    ValueError
        There is no family, a family has no instance, or an instance no run.

    Examples
    --------
    >>> gaps = [np.array([0.1, 0.2]), np.array([0.3]), np.array([0.2, 0.4])]
    >>> gap = other_tasks({"field": gaps})
    >>> round(gap.value, 3), gap.n
    (0.25, (3,))

    Notes
    -----
    A percentile interval, widened by √(k / (k − 1)) for the k instances of a family, because the
    bootstrap underestimates the spread of a mean by this factor. The interval is a little too wide
    for few runs with much noise, which the means of instances contain already, and does not exceed
    the means over families of the least and of the greatest score of a run. No interval (NaN) if a
    family has fewer than three instances.
    """
    if not scores or not all(scores.values()):
        raise ValueError("a mean over instances needs one instance of each family")
    samples = {family: [*map(vector, instances)] for family, instances in scores.items()}
    values = {
        family: np.array([runs.mean() for runs in instances])
        for family, instances in samples.items()
    }
    mean = float(np.mean([instances.mean() for instances in values.values()]))
    n = tuple(map(len, values.values()))
    if min(n) < FEWEST_TASKS:
        return Estimate(mean, n=n)
    deviations = np.zeros(FEWER_RESAMPLES)
    for place, (family, instances) in enumerate(samples.items()):
        rng = np.random.default_rng([SEED, place])
        count = len(instances)
        which = rng.integers(count, size=(FEWER_RESAMPLES, count))
        drawn = values[family][which]
        for number, runs in enumerate(instances):
            chosen = which == number
            if np.ptp(runs):
                places = rng.integers(len(runs), size=(int(chosen.sum()), len(runs)))
                drawn[chosen] += runs[places].mean(axis=1) - runs.mean()
        wider = math.sqrt(count / (count - 1))
        deviations += (drawn.mean(axis=1) - values[family].mean()) * wider
    if np.abs(deviations).max() <= NEGLIGIBLE * abs(mean):
        return Estimate(mean, mean, mean, n=n)
    low, high = mean + np.quantile(deviations / len(values), TAILS)
    families = samples.values()
    least = np.mean([min(runs.min() for runs in family) for family in families])
    most = np.mean([max(runs.max() for runs in family) for family in families])
    return Estimate(mean, max(float(low), float(least)), min(float(high), float(most)), n=n)
