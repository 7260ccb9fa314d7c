"""Tests of hypotheses on runs, and means over tasks with their intervals.

Tests:

- Two means are compared by exchanging the labels of their values (:func:`exchange_test`).
- A mean is compared with a number by the bootstrap (:func:`bootstrap_test`).
- A share is compared with a number by the exact binomial test (:func:`share_test`).

Samples and seeds are as in :mod:`coartic.estimates`. Sources: B. Efron & R. J. Tibshirani (1993),
An Introduction to the Bootstrap, chapter 16; A. C. Davison & D. V. Hinkley (1997), Bootstrap
Methods and their Application, chapter 4 (p-values that count the observed sample); S. Holm (1979),
Scandinavian Journal of Statistics 6.

Intervals:

- For other runs on the same tasks (:func:`task_mean`), the bootstrap resamples runs within tasks.
  All tasks have the same weight, whatever their number of runs.
- For other tasks (:func:`other_tasks`), the sample has runs within instances within families. The
  bootstrap is hierarchical (Davison & Hinkley 1997, section 3.8): it resamples instances within
  families, then runs within instances. Families are fixed and have the same weight.

A mixed model does not fit: gaps to an optimum are skewed and bounded by 0, and their spread over
runs differs between methods and tasks.
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
    IN_CACHE,
    MIN_TASKS,
    MIN_VALUES,
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
from coartic.internal.limits import MAX_RUNS, brief_value
from coartic.robot import Array

Alternative = Literal["greater", "less", "two-sided"]
_MAX_INDICES = 2_000_000  # largest number of indices of resamples that are cached together
_Count = Annotated[int, Field(ge=0, le=MAX_RUNS)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]


def bootstrap_test(
    values: Numbers,
    bound: float,
    alternative: Alternative = "greater",
    *,
    resamples: Resamples = RESAMPLES,
) -> Estimate:
    """Test the difference of a mean and a number by the bootstrap.

    The sample is shifted to the mean 0 and resampled; the statistic is the mean divided by its
    standard error (Efron & Tibshirani 1993, section 16.4). Unlike in the book, p = (1 + resamples
    at least as extreme) / (1 + resamples), which is never 0 (Davison & Hinkley 1997).

    Parameters
    ----------
    values : array_like, shape (n,)
    bound : float
        The number with which the mean is compared.
    alternative : {"greater", "less", "two-sided"}
        ``"greater"``: the mean of ``values`` is above ``bound``.
    resamples : int
        Number of bootstrap samples; by default 9,999, so that the smallest p is 0.0001.

    Returns
    -------
    Estimate
        ``value`` is the mean less ``bound``; there is no interval.

        - ``least_p`` is the smallest p of the sign test of n values, or of this number of
          resamples, whichever is larger. With few values p can be smaller than ``least_p``.
        - If all values are equal, p is ``least_p``, or 1 if the difference has the other sign than
          a one-tailed alternative.
        - p is NaN with fewer than two values, and if all values are equal to ``bound``.

    Raises
    ------
    ValueError
        The sample is empty, or a number is NaN or infinite.
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
    """Test the difference of two means by exchanging the labels of the values.

    The statistic is the difference of means divided by its standard error. Each sample has its own
    variance, so the test also holds asymptotically for samples of unequal spread (A. Janssen 1997,
    Statistics & Probability Letters 36). If both variances are 0, the statistic is infinite, or 0
    if the means are equal.

    Parameters
    ----------
    first, second : array_like, shapes (n,) and (m,)
    alternative : {"greater", "less", "two-sided"}
        ``"greater"``: the mean of ``first`` is higher. ``"two-sided"`` compares absolute values of
        the statistic.
    resamples : int
        Number of random exchanges. If there are at most this many different exchanges, all are
        made, and p is exact. Otherwise p = (1 + exchanges at least as extreme) / (1 + resamples).

    Returns
    -------
    Estimate
        ``value`` is the mean of ``first`` less the mean of ``second``; there is no interval. p is
        NaN with fewer than five values in a sample, and if all values are equal.

    Raises
    ------
    ValueError
        A sample is empty, or a value is NaN or infinite.
    """
    samples = vector(first), vector(second)
    n, m = map(len, samples)
    value = float(samples[0].mean() - samples[1].mean())
    if min(n, m) < MIN_VALUES or not centred(np.concatenate(samples)).any():
        return Estimate(value, n=(n, m))
    exact = math.comb(n + m, n) <= resamples
    p = _p_of([samples], alternative, resamples, exact=exact)
    least = smallest_p(n, m, resamples, two_tailed=alternative == "two-sided")
    return Estimate(value, p=p, n=(n, m), resamples=0 if exact else resamples, least_p=least)


def smallest_p(n: int, m: int, resamples: int = RESAMPLES, *, two_tailed: bool = True) -> float:
    """Return the smallest p that a permutation test of two samples can give.

    The test is :func:`exchange_test`.

    Parameters
    ----------
    n, m : int
        Numbers of values or runs in the two samples, at least 2.
    resamples : int
        Number of random exchanges.
    two_tailed : bool
        True for a two-tailed test. Swapping samples of equal size then gives an equally extreme
        statistic, so the smallest exact p is doubled.
    """
    ways = math.comb(n + m, n)
    if ways > resamples:  # exchanges are random, and perhaps none is as extreme as the samples
        return 1 / (1 + resamples)
    return (2 if two_tailed and n == m else 1) / ways  # swapping the samples is as extreme


def stratified_test(strata: Sequence[tuple[Array | float, Array | float]]) -> float:
    """Return the two-sided p-value of a difference of means, averaged over strata such as tasks.

    In each stratum, labels are exchanged as in :func:`exchange_test`. A sample that is compared
    with an exact number is resampled as in :func:`bootstrap_test`. The statistic is the sum of the
    differences divided by the root of the sum of their variances. p = (1 + resamples at least as
    extreme) / (1 + resamples).

    Parameters
    ----------
    strata : sequence of pairs
        For each stratum, two samples, shapes (n,) and (m,). A float instead of a sample is an exact
        number.

    Returns
    -------
    float
        p. It is NaN if a sample has fewer than five values, or if there are only exact numbers.

    Examples
    --------
    >>> apart = np.arange(5.0), np.arange(5.0) + 9.0
    >>> stratified_test([apart, apart])
    0.0001
    """
    samples = [sample for pair in strata for sample in pair if not isinstance(sample, float)]
    if not samples or min(map(len, samples)) < MIN_VALUES:
        return math.nan
    return _p_of(strata, "two-sided", RESAMPLES)


def _p_of(
    strata: Sequence[tuple[Array | float, Array | float]],
    alternative: Alternative,
    resamples: int,
    *,
    exact: bool = False,
) -> float:
    """Return the p-value of :func:`stratified_test` for an alternative.

    With ``exact``, all exchanges of labels are made instead of ``resamples`` random ones. There
    must then be one stratum with two samples.
    """
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
        is_cached = len(strata) == 1 and resamples * chosen <= _MAX_INDICES
        chunks = (
            _kept_places(len(pool), chosen, resamples, exact)
            if is_cached
            else places(len(pool), chosen, resamples, exact, rng)
        )
        for part, rows in chunks:
            null[:, part] += _moments(pool, rows, n)
    (statistic,) = _studentised(observed, size)
    extreme = _extreme(_studentised(null, size), statistic, alternative)
    return extreme / resamples if exact else (1 + extreme) / (1 + resamples)


def _moments(pool: Array, rows: NDArray[Any], n: int) -> tuple[Array, Array]:
    """Return the difference of means and its variance for each choice of a sample's values.

    Parameters
    ----------
    pool : ndarray
        The values of both samples, or of the only sample.
    rows : ndarray of int, shape (rows, k)
        For each choice, the indices in ``pool`` of one sample: of the first sample if k = n,
        otherwise of the second. If k is the length of ``pool``, a row draws from the only sample
        with replacement.
    n : int
        Number of values of the first sample.

    Returns
    -------
    (ndarray, ndarray), shapes (rows,)
        Mean of the first sample less that of the second, and the variance of this difference. For
        only one sample, its mean and the variance of the mean.
    """
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
    variances[variances < 1e-12 * size**2] = 0.0  # rounding of sums of squares
    return (mean - other) * (1 if few == n else -1), variances


def _studentised(moments: Array, size: float) -> Array:
    """Return differences divided by the square roots of their variances.

    ``moments`` has the differences in its first row and the variances in its second. ``size`` is
    the size of the values: differences and variances that can be their rounding count as 0. The
    result is 0 if the difference is 0, and otherwise infinite if the variance is 0.
    """
    differences = np.where(np.abs(moments[0]) < NEGLIGIBLE * size, 0.0, moments[0])
    variances = np.where(moments[1] < (NEGLIGIBLE * size) ** 2, 0.0, moments[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(differences == 0, 0.0, differences / np.sqrt(variances))


def _extreme(null: Array, observed: float, alternative: Alternative) -> int:
    """Count the statistics in ``null``, shape ``(n,)``, that are at least as extreme as observed.

    Extreme is high for ``"greater"``, low for ``"less"``, and far from 0 for ``"two-sided"``.
    Statistics that are equal up to rounding count.
    """
    if alternative == "two-sided":
        null, observed = np.abs(null), abs(observed)
    extreme = null <= observed if alternative == "less" else null >= observed
    return int((extreme | np.isclose(null, observed, rtol=NEGLIGIBLE, atol=0.0)).sum())


def drawn_rows(runs: int, chosen: int, size: int, rng: np.random.Generator) -> NDArray[np.int32]:
    """Draw ``chosen`` of the indices 0 to ``runs`` - 1 without replacement, ``size`` times.

    The result has shape ``(size, chosen)``.
    """
    order = rng.random((size, runs)).argpartition(chosen - 1, axis=1)
    return order[:, :chosen].astype(np.int32)  # a view would hold all of order in memory


def places(
    runs: int, chosen: int, resamples: int, exact: bool, rng: np.random.Generator
) -> Iterator[tuple[slice, NDArray[np.int32]]]:
    """Yield resamples in chunks: a slice of the resamples, and their rows of indices.

    A row has ``chosen`` of the indices 0 to ``runs`` - 1:

    - with ``exact``, rows are all choices, one after the other; ``resamples`` must be their number;
    - otherwise they are random, with replacement if ``chosen`` equals ``runs``, and without if it
      is smaller.
    """
    choices = combinations(range(runs), chosen)
    for part in slices(resamples, max(1, IN_CACHE // runs)):
        size = part.stop - part.start
        if exact:
            yield part, np.array([*islice(choices, size)], np.int32)
        elif chosen == runs:
            yield part, rng.integers(runs, size=(size, runs)).astype(np.int32)
        else:
            yield part, drawn_rows(runs, chosen, size, rng)


@lru_cache(maxsize=16)  # many samples have the same numbers of values
def _kept_places(
    runs: int, chosen: int, resamples: int, exact: bool
) -> list[tuple[slice, NDArray[np.int32]]]:
    """Return the pairs of :func:`places` for a new generator as a list.

    The list is cached for other samples of this size: do not change it.
    """
    return [*places(runs, chosen, resamples, exact, np.random.default_rng(SEED))]


def share_test(count: _Count, total: _Count, share: _Share, alternative: Alternative) -> Estimate:
    """Test ``count`` of ``total`` runs against a share (0 to 1) by the exact binomial test.

    The value of the estimate is the difference ``count / total - share``. Raises ValueError if
    ``count`` exceeds ``total``, or ``total`` is 0.
    """
    p = float(scipy.stats.binomtest(count, total, share, alternative).pvalue)
    return Estimate(count / total - share, p=p, n=(total,))


def holm(p_values: Numbers, family: _Count | None = None) -> list[float]:
    """Return the p-values of a family of tests, adjusted by Holm (1979), in the same order.

    If you reject at adjusted p-values up to α, the family-wise error rate is at most α, also for
    dependent tests.

    Parameters
    ----------
    p_values : array_like
        p-values from 0 to 1. NaN stands for a missing test and stays NaN.
    family : int, optional
        Number of planned tests. Missing tests then count as p = 1; by default they do not count.

    Returns
    -------
    list of float

    Raises
    ------
    ValueError
        A number is not a p-value, or there are more tests than ``family``.
    """
    p = np.reshape(p_values, -1)
    tests = int((~np.isnan(p)).sum())
    planned = tests if family is None else family
    if tests > planned or not ((p >= 0) & (p <= 1) | np.isnan(p)).all():
        raise ValueError(
            f"p_values is {brief_value(p.tolist())}; it must have p-values from 0 to 1, or NaN, of "
            f"at most {planned} tests"
        )
    order = np.argsort(p, kind="stable")  # NaN last
    steps = np.maximum.accumulate(p[order] * (planned - np.arange(len(p))))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, steps)
    return list(map(float, adjusted))


Scores = Mapping[str, Sequence[Numbers]]
"""For each family, the scores of the runs on each instance, shape ``(n,)``."""


def task_mean(values: Iterable[ArrayLike]) -> Estimate:
    """Return the mean over tasks of the mean over runs, with its interval for other runs.

    ``values`` has the runs of each task, shape ``(runs,)``. The interval is that of
    :func:`.mean_of_means`. Raises ValueError if there are no tasks, or a task has no runs.
    """
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
        ``value``, ``low`` and ``high`` in the unit of the scores; ``n`` is the number of instances
        of each family. There is no interval (NaN) if a family has fewer than three instances.

    Raises
    ------
    ValueError
        There is no family, a family has no instances, or an instance has no runs.

    Examples
    --------
    >>> gaps = [np.array([0.1, 0.2]), np.array([0.3]), np.array([0.2, 0.4])]
    >>> gap = other_tasks({"field": gaps})
    >>> round(gap.value, 3), gap.n
    (0.25, (3,))

    Notes
    -----
    The ends of the interval are percentiles of bootstrap samples. For the k instances of a family,
    deviations are multiplied by √(k / (k − 1)), because the bootstrap underestimates the spread of
    a mean by this factor. The interval is a little too wide for few runs with much noise, because
    the means of instances already contain this noise. Its ends are limited by the lowest and by the
    highest score of a run, each as a mean over families.
    """
    if not scores or not all(scores.values()):
        sizes = {family: len(instances) for family, instances in scores.items()}
        raise ValueError(
            f"scores has the families {sizes} with these numbers of instances; it must have at "
            "least one family, and at least one instance of each family"
        )
    samples = {family: [*map(vector, instances)] for family, instances in scores.items()}
    values = {
        family: np.array([runs.mean() for runs in instances])
        for family, instances in samples.items()
    }
    mean = float(np.mean([instances.mean() for instances in values.values()]))
    n = tuple(map(len, values.values()))
    if min(n) < MIN_TASKS:
        return Estimate(mean, n=n)
    deviations = np.zeros(FEWER_RESAMPLES)
    for index, (family, instances) in enumerate(samples.items()):
        rng = np.random.default_rng([SEED, index])
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
