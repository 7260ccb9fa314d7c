"""Test hypotheses about runs, and compute means over tasks with their intervals.

Tests:

- :func:`exchange_test` compares two means by a permutation test, which exchanges the labels of the
  values.
- :func:`bootstrap_test` compares a mean with a number by the studentised bootstrap (bootstrap-t).
- :func:`stratified_test` compares means over strata, such as tasks, by both of these methods.
- :func:`share_test` compares a proportion with a number by the exact binomial test.
- :func:`holm` adjusts the p-values of several tests.

A sample consists of the scores of independent runs, as in :mod:`coartic.estimates`. Resampling uses
the seed :data:`.SEED`. Sources: B. Efron & R. J. Tibshirani (1993), An Introduction to the
Bootstrap, chapter 16; A. C. Davison & D. V. Hinkley (1997), Bootstrap Methods and their
Application, chapter 4 (p-values that count the observed sample); S. Holm (1979), Scandinavian
Journal of Statistics 6.

Intervals:

- The interval of :func:`task_mean` is for other runs on the same tasks. The bootstrap resamples
  runs within tasks. All tasks have the same weight, even if their numbers of runs differ.
- The interval of :func:`other_tasks` is for other tasks of the same families. The bootstrap is
  hierarchical (Davison & Hinkley 1997, section 3.8): it resamples instances within families, and
  then runs within instances. Families are fixed and have the same weight.
- The intervals of :func:`place_intervals` are for other tasks (:func:`means_on_other_tasks`) or for
  other runs on the same tasks (:func:`means_of_other_runs`).

A mixed-effects model is not used, because its assumptions do not hold: gaps to an optimum are
skewed and bounded by 0, and their spread over runs differs between methods and tasks.
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
    """Test whether a mean differs from a number, by the studentised bootstrap (bootstrap-t).

    The test statistic is (mean − ``bound``) / standard error. To estimate its distribution under
    the null hypothesis, the sample is shifted to the mean ``bound`` and resampled (Efron &
    Tibshirani 1993, section 16.4). Unlike in the book, p = (1 + number of bootstrap samples at
    least as extreme) / (1 + number of bootstrap samples), which is never 0 (Davison & Hinkley
    1997).

    Parameters
    ----------
    values : array_like, shape (n,)
        The sample: independent values.
    bound : float
        The number with which the mean is compared, in the unit of ``values``.
    alternative : {"greater", "less", "two-sided"}
        The alternative hypothesis: the mean of ``values`` is above ``bound`` (``"greater"``), below
        it (``"less"``), or different from it (``"two-sided"``).
    resamples : int
        Number of bootstrap samples; by default 9,999, so that the smallest p is 0.0001.

    Returns
    -------
    Estimate
        ``value`` is the mean minus ``bound``; there is no interval.

        - ``least_p`` is the larger of two numbers: the smallest p that the sign test of n values
          can give, and 1 / (1 + ``resamples``). With few values, ``p`` can be smaller than
          ``least_p``.
        - If all values are equal, ``p`` is ``least_p``, or 1 if the difference does not have the
          sign of a one-sided alternative.
        - ``p`` and ``least_p`` are NaN with fewer than two values, and if all values are equal to
          ``bound``.

    Raises
    ------
    ValueError
        ``values`` is empty or not a vector of real numbers, or a number cannot be used: ``bound``
        or one of the values is NaN, infinite, above 1e100 in size, or below 1e-100 in size but not
        0.

    Examples
    --------
    >>> test = bootstrap_test([0.9, 1.2, 1.1, 0.8, 1.0], 0.0)
    >>> round(test.value, 3), test.p < 0.05
    (1.0, True)
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
    """Test whether two means differ, by a permutation test that exchanges the labels of values.

    The test statistic is the difference of the means divided by its standard error. The variances
    of the two samples are estimated separately. Therefore, for large samples, the test is also
    valid if the spreads of the samples differ (A. Janssen 1997, Statistics & Probability Letters
    36). If both variances are 0, the statistic is infinite, or 0 if the means are equal.

    Parameters
    ----------
    first, second : array_like, shapes (n,) and (m,)
        The two samples: independent values, in the same unit.
    alternative : {"greater", "less", "two-sided"}
        The alternative hypothesis: the mean of ``first`` is above that of ``second``
        (``"greater"``), below it (``"less"``), or different from it (``"two-sided"``). The
        two-sided test compares absolute values of the statistic.
    resamples : int
        Number of random permutations. If there are at most this many ways to divide all values into
        two samples of these sizes, all ways are used, and p is exact. Otherwise p = (1 + number of
        permutations at least as extreme) / (1 + ``resamples``).

    Returns
    -------
    Estimate
        ``value`` is the mean of ``first`` minus the mean of ``second``; there is no interval.
        ``least_p`` is the smallest p that the test can give (:func:`smallest_p`). ``p`` and
        ``least_p`` are NaN with fewer than five values in a sample, and if all values are equal.

    Raises
    ------
    ValueError
        A sample is empty or not a vector of real numbers, or one of the values is NaN, infinite,
        above 1e100 in size, or below 1e-100 in size but not 0.

    Examples
    --------
    >>> exchange_test([5, 6, 7, 8, 9], [0, 1, 2, 3, 4]).p  # one of 252 ways
    0.003968253968253968
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
    """Return the smallest p that :func:`exchange_test` can give for two samples.

    Parameters
    ----------
    n, m : int
        Numbers of values in the two samples, at least five.
    resamples : int
        Number of random permutations, which are used if there are more than ``resamples`` ways to
        divide the values.
    two_tailed : bool
        True for the two-sided test. If both samples have the same size, swapping them gives a
        statistic of the same absolute value. The smallest exact p is then twice that of a one-sided
        test.

    Returns
    -------
    float
        The smallest p.

    Examples
    --------
    >>> smallest_p(5, 5, two_tailed=False)  # 1 / 252
    0.003968253968253968
    """
    ways = math.comb(n + m, n)
    if ways > resamples:  # exchanges are random, and perhaps none is as extreme as the samples
        return 1 / (1 + resamples)
    return (2 if two_tailed and n == m else 1) / ways  # swapping the samples is as extreme


def stratified_test(strata: Sequence[tuple[Array | float, Array | float]]) -> float:
    """Test the sum over strata, such as tasks, of the differences between two means.

    In each stratum, the labels of the values are exchanged as in :func:`exchange_test`. If a
    stratum compares a sample with an exact number, the sample is resampled as in
    :func:`bootstrap_test`. The test statistic is the sum of the differences over strata, divided by
    the square root of the sum of their variances. The test is two-sided, with 9,999 resamples: p =
    (1 + number of resamples at least as extreme) / (1 + number of resamples).

    Parameters
    ----------
    strata : sequence of pairs
        Two samples for each stratum, arrays of shapes (n,) and (m,). A float instead of an array is
        an exact number, such as the gap of a deterministic method.

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
    """Return the p-value of :func:`stratified_test` for a one-sided or two-sided alternative.

    If ``exact`` is True, all ways to exchange labels are used instead of ``resamples`` random
    exchanges. There must then be only one stratum, with two samples.
    """
    if exact:
        resamples = math.comb(sum(map(np.size, strata[0])), np.size(strata[0][0]))
    sampled = [pair for pair in strata if not all(isinstance(part, float) for part in pair)]
    sizes = tuple(map(_sizes_of, sampled))
    is_cached = resamples * sum(chosen for _, chosen in sizes) <= _MAX_INDICES
    drawn = iter((_kept_places if is_cached else _places_by_stratum)(sizes, resamples, exact))
    observed, null, size = np.zeros((2, 1)), np.zeros((2, resamples)), 0.0
    for first, second in strata:
        if isinstance(first, float) and isinstance(second, float):
            observed[0] += first - second
            continue
        if isinstance(first, float) or isinstance(second, float):
            values = np.ravel(first - second)
            pool, n = centred(values), len(values)
            observed[0] += values.mean()
            observed[1] += pool.var(ddof=1) / n
        else:
            pool, n = centred(np.concatenate([first, second])), len(first)
            observed += _moments(pool, np.arange(n)[None], n)
        size += float(np.abs(pool).max())
        for part, rows in next(drawn):
            null[:, part] += _moments(pool, rows, n)
    (statistic,) = _studentised(observed, size)
    extreme = _extreme(_studentised(null, size), statistic, alternative)
    return extreme / resamples if exact else (1 + extreme) / (1 + resamples)


def _moments(pool: Array, rows: NDArray[Any], n: int) -> tuple[Array, Array]:
    """Return the difference of means and its variance for each resample of two samples.

    Parameters
    ----------
    pool : ndarray, shape (N,)
        The values of both samples together, or of the only sample.
    rows : ndarray of int, shape (rows, k)
        A row for each resample. It contains the indices in ``pool`` of the values of one of the two
        samples: of the first sample if k = n, otherwise of the second sample. If k = N, there is
        only one sample, and the row contains indices that were drawn with replacement.
    n : int
        Number of values of the first sample.

    Returns
    -------
    (ndarray, ndarray), shapes (rows,)
        The mean of the first sample minus the mean of the second, and the variance of this
        difference. If there is only one sample: its mean, and the variance of the mean.
    """
    few, many = rows.shape[1], len(pool) - rows.shape[1]
    values = pool[rows]
    if not many:
        means = values.mean(axis=1)
        values -= means[:, None]
        values *= values
        return means, values.sum(axis=1) / (few - 1) / n
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
    """Return differences divided by the square roots of their variances, shape ``(rows,)``.

    ``moments``, shape ``(2, rows)``, contains the differences in the first row and the variances in
    the second row. ``size`` is a bound on the absolute values from which they were computed. A
    difference or a variance is replaced by 0 if it is so small, relative to ``size``, that it can
    be due to rounding (:data:`.NEGLIGIBLE`). The result is 0 if the difference is 0, and infinite
    if only the variance is 0.
    """
    differences = np.where(np.abs(moments[0]) < NEGLIGIBLE * size, 0.0, moments[0])
    variances = np.where(moments[1] < (NEGLIGIBLE * size) ** 2, 0.0, moments[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(differences == 0, 0.0, differences / np.sqrt(variances))


def _extreme(null: Array, observed: float, alternative: Alternative) -> int:
    """Count the statistics of resamples that are at least as extreme as the observed statistic.

    ``null`` contains the statistics of the resamples, shape ``(n,)``. A statistic is extreme if it
    is high (alternative ``"greater"``), low (``"less"``), or far from 0 (``"two-sided"``). A
    statistic that equals the observed statistic, up to relative rounding, is counted as well.
    """
    if alternative == "two-sided":
        null, observed = np.abs(null), abs(observed)
    extreme = null <= observed if alternative == "less" else null >= observed
    return int((extreme | np.isclose(null, observed, rtol=NEGLIGIBLE, atol=0.0)).sum())


def drawn_rows(runs: int, chosen: int, size: int, rng: np.random.Generator) -> NDArray[np.int32]:
    """Draw ``size`` random subsets of the indices 0 to ``runs`` - 1.

    The result has shape ``(size, chosen)``. Each row contains ``chosen`` indices, drawn without
    replacement.
    """
    order = rng.random((size, runs)).argpartition(chosen - 1, axis=1)
    return order[:, :chosen].astype(np.int32)  # a view would hold all of order in memory


def places(
    runs: int, chosen: int, resamples: int, exact: bool, rng: np.random.Generator
) -> Iterator[tuple[slice, NDArray[np.int32]]]:
    """Yield the indices of resamples in chunks that fit into the processor's cache.

    Each chunk is a pair: a slice of ``range(resamples)``, and an array with a row for each resample
    in this slice. The row contains ``chosen`` of the indices 0 to ``runs`` - 1.

    - If ``exact`` is True, the rows are all combinations of ``chosen`` indices, and ``resamples``
      must be the number of combinations.
    - Otherwise the indices are drawn at random: with replacement if ``chosen`` equals ``runs``, and
      without replacement if ``chosen`` is smaller.
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


def _sizes_of(stratum: tuple[Array | float, Array | float]) -> tuple[int, int]:
    """Return the number of values in a stratum, and the number of indices in a resample of it.

    If the stratum has only one sample (and an exact number), the two numbers are equal. If it has
    two samples, the second number is the size of the smaller sample.
    """
    sizes = [np.size(sample) for sample in stratum if not isinstance(sample, float)]
    return sum(sizes), min(sizes)


def _places_by_stratum(
    sizes: tuple[tuple[int, int], ...], resamples: int, exact: bool
) -> Iterator[Iterator[tuple[slice, NDArray[np.int32]]]]:
    """Yield, for each stratum, an iterator of the chunks of :func:`places`.

    All strata are drawn by one generator with :data:`.SEED`, so the chunks of a stratum must be
    used before those of the next. ``sizes`` contains a pair of :func:`_sizes_of` for each stratum.
    """
    rng = np.random.default_rng(SEED)
    for runs, chosen in sizes:
        yield places(runs, chosen, resamples, exact, rng)


@lru_cache(maxsize=16)  # many samples have the same numbers of values
def _kept_places(
    sizes: tuple[tuple[int, int], ...], resamples: int, exact: bool
) -> list[list[tuple[slice, NDArray[np.int32]]]]:
    """Return a list of the chunks of each stratum (:func:`_places_by_stratum`).

    The lists are cached: do not change them.
    """
    return [[*chunks] for chunks in _places_by_stratum(sizes, resamples, exact)]


def share_test(count: _Count, total: _Count, share: _Share, alternative: Alternative) -> Estimate:
    """Test whether a proportion of runs differs from a share, by the exact binomial test.

    Parameters
    ----------
    count : int
        Number of runs with the property of interest.
    total : int
        Number of all runs.
    share : float
        The share with which ``count / total`` is compared, from 0 to 1.
    alternative : {"greater", "less", "two-sided"}
        The alternative hypothesis: the proportion is above ``share``, below it, or different from
        it.

    Returns
    -------
    Estimate
        ``value`` is ``count / total - share``, and ``p`` is exact; there is no interval.

    Raises
    ------
    ValueError
        ``count`` is not from 0 to ``total``, ``total`` is below 1, or ``share`` is not from 0 to 1.

    Examples
    --------
    >>> round(share_test(9, 10, 0.5, "greater").p, 4)
    0.0107
    """
    p = float(scipy.stats.binomtest(count, total, share, alternative).pvalue)
    return Estimate(count / total - share, p=p, n=(total,))


def holm(p_values: Numbers, family: _Count | None = None) -> list[float]:
    """Return the Holm-adjusted p-values of a family of tests, in the order of the tests.

    If each null hypothesis with an adjusted p-value of at most α is rejected, the family-wise error
    rate is at most α. The tests may depend on each other.

    Parameters
    ----------
    p_values : array_like
        A p-value from 0 to 1 for each test, or NaN for a test that could not be made.
    family : int, optional
        Number of planned tests. If it is passed, planned tests without a p-value are treated as
        tests with p = 1. By default, tests without a p-value are left out.

    Returns
    -------
    list of float
        The adjusted p-value of each test; NaN for a test without a p-value.

    Raises
    ------
    ValueError
        A number is neither NaN nor from 0 to 1, or more than ``family`` numbers are not NaN.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
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
"""A dict that maps each family to a list with an array for each instance: the scores of the runs on
this instance, shape ``(runs,)``."""


def task_mean(values: Iterable[ArrayLike]) -> Estimate:
    """Return the mean over tasks of the mean over runs, with its interval for other runs.

    All tasks have the same weight.

    Parameters
    ----------
    values : iterable of array_like, shape (runs,)
        For each task, the scores of the runs on the task.

    Returns
    -------
    Estimate
        The mean and the ends of its interval (:func:`.mean_of_means`), in the unit of the scores.
        The ends are NaN if a task has fewer than five runs.

    Raises
    ------
    ValueError
        There are no tasks, or the scores of a task cannot be used (:func:`.vector`), for example
        because one of them is NaN.
    """
    strata = [*map(vector, values)]
    return mean_of_means(strata, [1 / len(strata) for _ in strata])


def other_tasks(scores: Scores) -> Estimate:
    """Return the mean over families, instances and runs, with its interval for other tasks.

    Parameters
    ----------
    scores : mapping of str to sequence of arrays, shape (runs,)
        Maps each family to a list with an array for each of its instances (random tasks): the
        scores of the runs on this instance.

    Returns
    -------
    Estimate
        ``value`` is the mean over families of the mean over instances of the mean over runs. Its
        95 % interval, ``low`` to ``high``, is for other tasks of the same families. All three
        numbers are in the unit of the scores. ``n`` is a tuple of the numbers of instances of the
        families. The ends of the interval are NaN if a family has fewer than three instances.

    Raises
    ------
    ValueError
        There is no family, a family has no instances, or the scores on an instance cannot be used
        (:func:`.vector`), for example because one of them is NaN.

    Examples
    --------
    >>> gaps = [np.array([0.1, 0.2]), np.array([0.3]), np.array([0.2, 0.4])]
    >>> gap = other_tasks({"field": gaps})
    >>> round(gap.value, 3), gap.n
    (0.25, (3,))

    Notes
    -----
    The interval is the percentile interval of 1,999 bootstrap samples. In a family with k
    instances, the deviations of bootstrap means from the mean are multiplied by √(k / (k − 1)),
    because the bootstrap underestimates the standard deviation of a mean by this factor. If there
    are few runs that vary much, the interval is a little too wide, because the means of instances
    already contain the variation over runs. The interval is cut off at two limits: the mean over
    families of the lowest score of a run, and the mean over families of the highest score of a run.
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
        drawn = values[family][which].ravel()
        # Where each instance was drawn, in the order of the bootstrap samples.
        order = which.astype(np.min_scalar_type(count)).argsort(None, "stable")
        ends = np.cumsum(np.bincount(which.ravel(), minlength=count))[:-1]
        for runs, at in zip(instances, np.split(order, ends), strict=True):
            if np.ptp(runs):
                places = rng.integers(len(runs), size=(len(at), len(runs)))
                drawn[at] += runs.take(places).mean(axis=1) - runs.mean()
        wider = math.sqrt(count / (count - 1))
        means = drawn.reshape(which.shape).mean(axis=1)
        deviations += (means - values[family].mean()) * wider
    if np.abs(deviations).max() <= NEGLIGIBLE * abs(mean):
        return Estimate(mean, mean, mean, n=n)
    low, high = mean + np.quantile(deviations / len(values), TAILS)
    families = samples.values()
    least = np.mean([min(runs.min() for runs in family) for family in families])
    most = np.mean([max(runs.max() for runs in family) for family in families])
    return Estimate(mean, max(float(low), float(least)), min(float(high), float(most)), n=n)


def means_on_other_tasks(strata: Sequence[Array]) -> Array:
    """Return bootstrap means of several methods over tasks, which are resampled within strata.

    All methods have the same resampled tasks, and all tasks have the same weight.

    Parameters
    ----------
    strata : sequence of ndarray, shapes (tasks, methods)
        For each stratum, such as a family, the mean score of each method on each task. A stratum of
        one task is the same in all resamples.

    Returns
    -------
    ndarray, shape (resamples, methods)
        The mean of each method over the tasks of each resample.
    """
    sums = sum(
        len(scores) * means for scores, means in zip(strata, _resampled_means(strata), strict=True)
    )
    return np.asarray(sums / sum(map(len, strata)))


def means_of_other_runs(samples: Sequence[Sequence[Array]]) -> Array:
    """Return bootstrap means of several methods over tasks and runs.

    Runs are resampled within tasks, for each method by itself.

    Parameters
    ----------
    samples : sequence of sequences of ndarray, shapes (runs,)
        For each method, the scores of its runs on each task. All methods have the same tasks.

    Returns
    -------
    ndarray, shape (resamples, methods)
        The mean over tasks of the mean over the runs of each resample.
    """
    cells = [runs[:, None] for method in samples for runs in method]
    means = np.concatenate([*_resampled_means(cells)], axis=1)
    return np.asarray(means.reshape(len(means), len(samples), -1).mean(axis=2))


def _resampled_means(strata: Sequence[Array]) -> Iterator[Array]:
    """Yield the means of 1,999 resamples of each stratum, an array of shape (n, columns)."""
    sizes = tuple((len(values), len(values)) for values in strata)
    drawn = _places_by_stratum(sizes, FEWER_RESAMPLES, exact=False)
    for values, chunks in zip(strata, drawn, strict=True):
        means = np.empty((FEWER_RESAMPLES, values.shape[1]))
        for part, rows in chunks:
            for column, scores in enumerate(values.T):
                means[part, column] = scores[rows].mean(axis=1)
        yield means


def place_intervals(means: Array) -> list[tuple[int, int]]:
    """Return the 95 % interval of the place of each method, the lowest mean first.

    In a resample the places of a method are 1 + the number of methods with a lower mean, up to the
    number of methods with a lower or equal mean. The interval is from the 2.5 % quantile of the
    former to the 97.5 % quantile of the latter.

    Parameters
    ----------
    means : ndarray, shape (resamples, methods)
        The mean of each method in each resample. Means that differ by rounding are equal.

    Returns
    -------
    list of pairs of int
        The lowest and the highest place of each method.

    Examples
    --------
    >>> place_intervals(np.array([[0.1, 0.3, 0.3]]))
    [(1, 1), (2, 3), (2, 3)]
    """
    least, most, rounding = [], [], _rounding_of(means)
    for row in means:
        ordered = np.sort(row)
        least.append(1 + np.searchsorted(ordered, row - rounding))
        most.append(np.searchsorted(ordered, row + rounding, side="right"))
    low = np.quantile(least, TAILS[0], axis=0, method="lower")
    high = np.quantile(most, TAILS[1], axis=0, method="higher")
    return [*zip(map(int, low), map(int, high), strict=True)]


def are_separated(means: Array) -> list[bool]:
    """Return whether each method is separated from the next one.

    Two methods are separated if the 95 % interval of the difference of their means over resamples
    leaves out 0.

    Parameters
    ----------
    means : ndarray, shape (resamples, methods)
        The mean of each method in each resample, in the order of the ranking.

    Returns
    -------
    list of bool
        An entry for each method except the last.

    Examples
    --------
    >>> are_separated(np.array([[0.1, 0.3, 0.3]]))
    [True, False]
    """
    low, high = np.quantile(np.diff(means, axis=1), TAILS, axis=0)
    rounding = _rounding_of(means)
    return [*map(bool, (low > rounding) | (high < -rounding))]


def _rounding_of(means: Array) -> float:
    """Return the largest difference between means that counts as a rounding error."""
    return float(NEGLIGIBLE * np.abs(means).max())
