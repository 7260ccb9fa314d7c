"""Tests of means and shares, and Holm's correction for many of them.

A mean is tested against a number or another mean by the bootstrap, paired differences by flips of
their signs, a share by the exact binomial test, counts by Fisher's exact test. Postures have
permutation tests of their own, in :mod:`coartic.analysis.signatures`. Samples, numbers taken as
known, and seeds: as in :mod:`coartic.estimates`.

Sources: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapter 16;
A. C. Davison & D. V. Hinkley (1997), Bootstrap Methods and their Application, chapter 4
(p-values that count the observed sample); S. Holm (1979), Scandinavian Journal of Statistics 6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from coartic.estimates import (
    IN_CACHE,
    NEGLIGIBLE,
    RESAMPLES,
    SEED,
    TAILS,
    Estimate,
    centred,
    samples_of,
    slices,
    vector,
)

Alternative = Literal["greater", "less", "two-sided"]
MARGIN = 0.01
"""Differences up to this share of the published reward count as equivalent."""
Equivalence = Literal["equivalent", "different", "undecided"]


def bootstrap_test(
    first: ArrayLike,
    second: ArrayLike | float,
    alternative: Alternative = "greater",
    *,
    resamples: int = RESAMPLES,
) -> Estimate:
    """Test of equal means by the bootstrap: the paper's own kind of test.

    Efron & Tibshirani (1993), Algorithm 16.2: every sample is shifted to the mean 0 and resampled,
    and the statistic is the difference of means over its standard error, with a variance for each
    sample. Against a plain number it is their one-sample test (section 16.4). The paper cites the
    book without naming the statistic. ``"greater"``: one-tailed, the mean of ``first`` is higher.
    Unlike in the book, the p-value is (1 + resamples at least as extreme) / (1 + resamples), never
    0 (Davison & Hinkley 1997): with the default, 0.0001 is the smallest there is.

    Without spread in any sample p is that of the exact test of so many values, by signs or by
    exchange. NaN with fewer than two values in a sample, or without spread and difference.
    """
    samples = samples_of(first, second)
    difference = float(samples[0].mean() - sum(other.mean() for other in samples[1:]))
    n = tuple(map(len, samples))
    shifted = list(map(centred, samples))
    size = max(np.abs(values).max() for values in shifted)
    # No less is credible than an exact test of so few values could give: by signs, or by exchange.
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
    rng = np.random.default_rng(SEED)
    sums, variances = np.zeros(resamples), np.zeros(resamples)
    for values, sign in zip(shifted, (1, -1), strict=False):
        for part in slices(resamples, max(1, IN_CACHE // len(values))):
            drawn = values[rng.integers(len(values), size=(part.stop - part.start, len(values)))]
            means = drawn.mean(axis=1, keepdims=True)
            sums[part] += sign * means[:, 0]
            variances[part] += drawn.var(axis=1, ddof=1, mean=means) / len(values)
    # What is rounding is none: resamples of equal values have no spread, means can be equal.
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


def sign_flip_test(differences: ArrayLike) -> Estimate:
    """Permutation test of paired differences (n,): each may change its sign.

    Exact in level where the differences are symmetric about 0, as they are if within each
    pair the two are exchangeable. All 2^n signs are enumerated where there are no more than
    :data:`RESAMPLES` (13 pairs), otherwise as many are drawn. NaN with fewer than two pairs.
    """
    values = vector(differences)
    mean, n = float(values.mean()), (len(values),)
    if len(values) < 2:
        return Estimate(mean, n=n)
    from scipy import stats  # as in estimates

    result = stats.permutation_test(
        (values,),
        np.mean,
        permutation_type="samples",
        vectorized=True,
        n_resamples=RESAMPLES,
        batch=max(1, min(1_000, IN_CACHE // len(values))),
        rng=np.random.default_rng(SEED),
    )
    least = 2 / min(2 ** len(values), 1 + RESAMPLES)
    return Estimate(mean, p=float(result.pvalue), n=n, least_p=least)


def share_test(count: int, total: int, share: float, alternative: Alternative) -> Estimate:
    """Exact binomial test of ``count`` of ``total`` runs against a share (0 to 1).

    The estimate is the share seen less that one.
    """
    from scipy import stats  # as in estimates

    p = float(stats.binomtest(count, total, share, alternative).pvalue)
    return Estimate(count / total - share, p=p, n=(total,))


def holm(p_values: Sequence[float], family: int | None = None) -> list[float]:
    """Adjusted p-values of a family of tests (Holm 1979), in the order given.

    Those at or below α are rejected with a family-wise error rate of at most α, whatever
    the dependence. NaN, a test that could not be made, stays NaN and does not count; with a
    ``family``, the number of tests that were planned, those that are missing count as p = 1.
    Raises ValueError for a p-value outside 0 to 1, and for fewer tests planned than made.
    """
    p = np.asarray(p_values, dtype=np.float64)
    if ((p < 0) | (p > 1)).any():
        raise ValueError("a p-value lies between 0 and 1")
    tested = int((~np.isnan(p)).sum())
    planned = tested if family is None else family
    if planned < tested:
        raise ValueError(f"fewer tests planned than made: {planned} of {tested}")
    order = np.argsort(p, kind="stable")  # NaN last
    steps = np.maximum.accumulate(p[order] * (planned - np.arange(len(p))))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, steps)
    return list(map(float, adjusted))


def equivalence(estimate: Estimate, margin: float) -> Equivalence:
    """Compare the interval of a difference with ±margin: two one-sided tests at level 2.5 %
    (TOST; D. J. Schuirmann 1987, Journal of Pharmacokinetics and Biopharmaceutics 15).

    Equivalent where the interval lies within the margin, different where it lies outside,
    undecided where it does neither or there is none.
    """
    if -margin <= estimate.low and estimate.high <= margin:
        return "equivalent"
    if estimate.low > margin or estimate.high < -margin:
        return "different"
    return "undecided"


def difference_to_published(
    ours: ArrayLike, published: float, sd: float | None, runs: int
) -> Estimate:
    """Our mean less the published mean, with Welch's interval by the published SD and number of
    runs.

    Where no SD is published (None) the published mean is taken as exact, and the interval is
    Student's. No interval for a single run; a point where no sample has any spread.
    """
    values = vector(ours)
    n, value = len(values), float(values.mean()) - published
    if n < 2:
        return Estimate(value, n=(n,))
    parts = [(float(np.var(centred(values), ddof=1)) / n, n - 1)]
    if sd is not None and runs > 1:
        parts.append((sd**2 / runs, runs - 1))
    total = sum(part for part, _ in parts)
    sizes = tuple(free + 1 for _, free in parts)
    if total == 0.0:
        return Estimate(value, value, value, n=sizes)
    freedom = total**2 / sum(part**2 / free for part, free in parts)
    from scipy import special  # as in estimates

    half = float(special.stdtrit(freedom, TAILS[1])) * math.sqrt(total)
    return Estimate(value, value - half, value + half, n=sizes)
