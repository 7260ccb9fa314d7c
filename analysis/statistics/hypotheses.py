"""Tests of means, shares and pairs, and Holm's correction for many of them.

Samples, numbers taken as known, and seeds: as in :mod:`coartic.analysis.statistics.estimates`.

Sources: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapters 15 and
16; A. C. Davison & D. V. Hinkley (1997), Bootstrap Methods and their Application, chapter 4
(p-values that count the observed sample); E. Chung & J. P. Romano (2013), Annals of Statistics
41; S. Holm (1979), Scandinavian Journal of Statistics 6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import (
    RESAMPLES,
    SEED,
    Inference,
    differences,
    sample,
    samples_of,
)
from coartic.robot import Array

Alternative = Literal["greater", "less", "two-sided"]
_TAILS = {
    "greater": "one-tailed (greater)",
    "less": "one-tailed (less)",
    "two-sided": "two-tailed",
}
_IN_MEMORY = 1 << 18  # values that are drawn at once: few enough for the processor's cache
MOST_TABLES = 1_000_000
"""Tables of counts up to which Fisher's test enumerates them."""


def bootstrap_test(
    first: ArrayLike,
    second: ArrayLike | float,
    alternative: Alternative = "greater",
    *,
    seed: int = SEED,
    resamples: int = RESAMPLES,
) -> Inference:
    """Test of equal means by the bootstrap: the paper's own kind of test.

    Efron & Tibshirani (1993), Algorithm 16.2: both samples are shifted to their common mean
    and resampled, and the statistic is the difference of means over its standard error, with
    a variance for each sample. Against a plain number it is their one-sample test (section
    16.4). The paper cites the book without naming the statistic. ``"greater"``: one-tailed,
    the mean of ``first`` is higher. Unlike in the book, the p-value is
    (1 + resamples at least as extreme) / (1 + resamples), never 0 (Davison & Hinkley 1997): with
    the default, 0.0001 is the smallest there is.

    NaN with fewer than two values in a sample, or no spread in any.
    """
    samples = samples_of(first, second)
    estimate = float(spread.difference(*samples))
    found = Inference(
        estimate,
        tuple(map(len, samples)),
        f"{_TAILS[alternative]} {'two' if len(samples) > 1 else 'one'}-sample bootstrap test "
        f"of the mean, studentised, {resamples} resamples",
    )
    if min(found.n) < 2:
        return replace(found, note="no test: a sample has fewer than 2 values")
    if all(np.ptp(values) == 0 for values in samples):
        return replace(found, note="no test: no spread to resample")
    error = standard_error(samples)
    observed = np.asarray(estimate / error)
    null = studentised_null(samples, resamples, np.random.default_rng(seed))
    return replace(found, p=_p_value(null, observed, alternative), seed=seed)


def permutation_test(
    first: ArrayLike,
    second: ArrayLike,
    alternative: Alternative = "greater",
    *,
    seed: int = SEED,
    resamples: int = RESAMPLES,
) -> Inference:
    """Permutation test of two independent samples, by the studentised difference of means.

    Exact in level where both samples come from one distribution. The studentised statistic
    keeps the level in large samples where only the means are equal (Chung & Romano 2013).
    All assignments are enumerated where there are no more than ``resamples`` (8 and 8 runs
    give 12 870, 7 and 7 give 3 432), otherwise as many are drawn and p counts the observed
    one too. NaN with fewer than two values in a sample.
    """
    samples = sample(first), sample(second)
    return _permuted(samples, "permutation test, studentised", alternative, seed, resamples)


def sign_flip_test(
    first: ArrayLike,
    second: ArrayLike | float,
    alternative: Alternative = "greater",
    *,
    seed: int = SEED,
    resamples: int = RESAMPLES,
) -> Inference:
    """Permutation test of pairs: each difference ``first − second`` may change its sign.

    Exact in level where the differences are symmetric about 0, as they are if within each
    pair the two are exchangeable. All 2^n signs are enumerated where there are no more than
    ``resamples`` (13 pairs by default), otherwise as many are drawn. NaN with fewer than two
    pairs. Raises ValueError for samples of different length.
    """
    name = "sign-flip test of paired differences"
    return _permuted((differences(first, second),), name, alternative, seed, resamples)


def _permuted(
    samples: tuple[Array, ...], name: str, alternative: Alternative, seed: int, resamples: int
) -> Inference:
    """Two samples exchange their values; the differences that one sample has, their signs."""
    n, two = tuple(map(len, samples)), len(samples) == 2
    exact = (math.comb(sum(n), n[0]) if two else 2 ** n[0]) <= resamples
    drawn = "exact" if exact else f"Monte Carlo ({resamples} resamples)"
    method = f"{_TAILS[alternative]} {drawn} {name}"
    found = Inference(float(spread.difference(*samples)), n, method)
    if min(n) < 2:
        few = "a sample has fewer than 2 values" if two else "fewer than 2 pairs"
        return replace(found, note=f"no test: {few}")
    result = stats.permutation_test(
        samples,
        _bounded_t if two else spread.difference,
        permutation_type="independent" if two else "samples",
        alternative=alternative,
        vectorized=True,
        n_resamples=resamples,
        batch=1_000,
        rng=np.random.default_rng(seed),
    )
    return replace(found, p=float(result.pvalue), seed=None if exact else seed)


def share_test(count: int, total: int, share: float, alternative: Alternative) -> Inference:
    """Exact binomial test of ``count`` of ``total`` runs against a share (0 to 1).

    The estimate is the share seen less that one.
    """
    return Inference(
        count / total - share,
        (total,),
        f"{_TAILS[alternative]} exact binomial test against {share:.0%}",
        p=float(share_p(count, total, share, alternative)),
    )


def share_p(count: ArrayLike, total: int, share: float, alternative: Alternative) -> Array:
    """p-values of :func:`share_test`, in the shape of ``count``."""
    k = np.asarray(count)
    if alternative == "greater":
        return np.asarray(stats.binom.sf(k - 1, total, share))
    if alternative == "less":
        return np.asarray(stats.binom.cdf(k, total, share))
    return np.asarray(np.vectorize(lambda one: stats.binomtest(one, total, share).pvalue)(k))


def independence_test(
    first: Sequence[int], second: Sequence[int], *, seed: int = SEED
) -> Inference:
    """Fisher's exact test that two rows of counts share one distribution over categories.

    Freeman & Halton (1951), Biometrika 38, 141: p is the probability, given the margins, of all
    tables that are no likelier than the one seen, by enumeration in integers where there are no
    more than :data:`MOST_TABLES`, else of those that are drawn. The estimate is the total
    variation distance of the two shares, 0 to 1. Raises ValueError for rows of different length,
    or one without counts.
    """
    rows = np.array([first, second])
    n, m = rows.sum(axis=1).tolist()
    if min(n, m) < 1:
        raise ValueError("a row has no counts")
    found = Inference(
        float(np.abs(rows[0] / n - rows[1] / m).sum() / 2), (n, m), "Fisher's exact test"
    )
    *columns, (last, own) = sorted(zip(rows.sum(axis=0).tolist(), rows[0].tolist(), strict=True))
    if math.prod(count + 1 for count, _ in columns) > MOST_TABLES:
        method = stats.MonteCarloMethod(rng=np.random.default_rng(seed))
        p = float(stats.fisher_exact(rows, method=method).pvalue)
        return replace(found, method=f"{found.method}, Monte Carlo", p=p, seed=seed)
    # Ways to choose the first row's runs, by how many it has of the columns so far.
    ways, seen = {0: [1]}, math.comb(last, own)
    for count, mine in columns:
        seen *= math.comb(count, mine)
        so_far, ways = ways, {}
        for used, products in so_far.items():
            for k in range(min(count, n - used) + 1):
                factor = math.comb(count, k)
                ways.setdefault(used + k, []).extend(factor * product for product in products)
    extreme = 0
    for used, products in ways.items():
        factor = math.comb(last, n - used)
        extreme += sum(w for w in (factor * product for product in products) if w <= seen)
    return replace(found, p=extreme / math.comb(n + m, n))


def holm(p_values: Sequence[float], family: int | None = None) -> list[float]:
    """Adjusted p-values of a family of tests (Holm 1979), in the order given.

    Those at or below α are rejected with a family-wise error rate of at most α, whatever
    the dependence. NaN, a test that could not be made, stays NaN and does not count; with a
    ``family``, the number of tests that were planned, those that are missing count as p = 1.
    """
    p = np.asarray(p_values, dtype=np.float64)
    if ((p < 0) | (p > 1)).any():
        raise ValueError("a p-value lies between 0 and 1")
    made = int((~np.isnan(p)).sum())
    adjusted: list[float] = holm_rows(p, made if family is None else family).tolist()
    return adjusted


def holm_rows(p: Array, family: int) -> Array:
    """:func:`holm` of every row of p-values (..., tests), each of a family of so many."""
    order = np.argsort(p, axis=-1, kind="stable")  # NaN last
    steps = np.take_along_axis(p, order, axis=-1) * (family - np.arange(p.shape[-1]))
    adjusted = np.empty_like(p)
    np.put_along_axis(adjusted, order, np.maximum.accumulate(steps, axis=-1), axis=-1)
    return np.minimum(1.0, adjusted)


def standard_error(samples: tuple[Array, ...]) -> float:
    """Of the mean of one sample, or of the difference of two; a variance for each."""
    return math.sqrt(sum(float(spread.variance(values)) / len(values) for values in samples))


def studentised_null(samples: tuple[Array, ...], resamples: int, rng: np.random.Generator) -> Array:
    """Studentised mean (or difference of two) of resamples where the true one is 0.

    Shape ``(resamples,)``; ±infinity where a resample differs but has no spread.
    """
    centre = float(np.concatenate(samples).mean())
    difference, variance = np.zeros(resamples), np.zeros(resamples)
    for values, sign in zip(samples, (1, -1), strict=False):
        shifted = values - spread.mean(values) + (centre if len(samples) > 1 else 0.0)
        rows = max(1, _IN_MEMORY // len(values))
        for start in range(0, resamples, rows):
            part = slice(start, min(start + rows, resamples))
            places = rng.integers(len(values), size=(part.stop - start, len(values)))
            means, variances = spread.moments(shifted.take(places))
            difference[part] += sign * means
            variance[part] += variances / len(values)
    return _ratio(difference, variance)


def _ratio(difference: Array, variance: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(difference == 0, 0.0, difference / np.sqrt(variance))


def _bounded_t(first: Array, second: Array, axis: int = -1) -> Array:
    """Welch's t through the arc tangent: the same order, and no infinity to trip scipy."""
    variance = spread.variance(first, axis) / first.shape[axis]
    variance = variance + spread.variance(second, axis) / second.shape[axis]
    return np.asarray(np.arctan(_ratio(spread.difference(first, second, axis=axis), variance)))


def _p_value(null: Array, observed: Array, alternative: Alternative) -> float:
    if alternative == "two-sided":
        null, observed = np.abs(null), np.abs(observed)
    tied = np.isclose(null, observed, rtol=1e-9, atol=0.0)
    extreme = tied | (null <= observed if alternative == "less" else null >= observed)
    return float(1 + extreme.sum()) / (1 + len(null))
