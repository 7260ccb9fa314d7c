"""Estimates with intervals: means, differences, effect sizes.

Samples are rewards (or any score) of independent runs. Where a function compares a sample
with a plain number, the number is taken as known without error: the reward of a
deterministic method, say. Every function that resamples gives the same result for the same seed,
:data:`SEED` by default; the seed belongs to the resampling, not to the runs.

Sources: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapter 14;
R. Agarwal et al. (2021), NeurIPS 34 (probability of improvement); R. G. Newcombe (2006),
Statistics in Medicine 25.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import optimize, special, stats

from coartic.analysis.statistics import spread
from coartic.robot import Array

CONFIDENCE = 0.95
"""Nominal coverage of every interval."""
TAILS = (1 - CONFIDENCE) / 2, 1 - (1 - CONFIDENCE) / 2
"""The quantiles that such an interval lies between."""
LEVEL = 0.05
"""Of a test."""
RESAMPLES = 9_999
"""With 9 999 resamples the levels 0.05 and 0.01 fall on whole numbers of resamples."""
SEED = 0
"""Of every resampling; it has nothing to do with the seeds of the runs."""
FEWEST = 3
"""Fewer values than this give no bootstrap interval: there is next to nothing to resample."""
MOST_DRAWN = 500
"""Values of a sample up to which a resample draws as many as there are."""
_ZERO = np.zeros(1)
NO_SPREAD = "the interval is a point: no spread"


@dataclass(frozen=True)
class Inference:
    """A number, how sure it is, and how it was obtained. NaN means that there is none."""

    estimate: float
    n: tuple[int, ...]
    """Values in each sample; a number taken as known is no sample."""
    method: str
    """The interval or test, in words."""
    low: float = math.nan
    """Of the interval, of coverage :data:`CONFIDENCE`."""
    high: float = math.nan
    p: float = math.nan
    seed: int | None = None
    """Seed of the resampling; None where nothing was drawn."""
    note: str = ""
    """Why there is no interval or p-value, or why it is a special one."""


def sample(values: ArrayLike) -> Array:
    """Values as a vector. Raises ValueError where it is empty or holds NaN or infinity.

    Runs without a solution have no reward: the caller decides what becomes of them.
    """
    vector = np.asarray(values, dtype=np.float64)
    if vector.ndim != 1 or vector.size == 0:
        raise ValueError(f"a sample is a vector of at least one value, not of shape {vector.shape}")
    if not np.isfinite(vector).all():
        raise ValueError("a sample has values that are not finite")
    return vector


def paired_by_seed(first: pd.DataFrame, second: pd.DataFrame) -> tuple[Array, Array]:
    """Rewards of two frames of runs, for the values of ``seed`` where both have one.

    Raises ValueError where a seed occurs twice in one of them.
    """
    a, b = (runs.seed.to_numpy() for runs in (first, second))
    if len(np.unique(a)) < len(a) or len(np.unique(b)) < len(b):
        raise ValueError("seeds are not one-to-one: one occurs twice")
    _, *places = np.intersect1d(a, b, assume_unique=True, return_indices=True)
    order = np.argsort(places[0])
    x, y = (
        runs.reward.to_numpy(dtype=np.float64, na_value=np.nan)[own[order]]
        for runs, own in zip((first, second), places, strict=True)
    )
    known = ~(np.isnan(x) | np.isnan(y))
    return x[known], y[known]


def samples_of(first: ArrayLike, second: ArrayLike | float) -> tuple[Array, ...]:
    """Two samples, or where ``second`` is a number one sample of differences to it."""
    if np.ndim(second) == 0:
        return (differences(first, second),)
    return sample(first), sample(second)


def mean(values: ArrayLike, *, seed: int = SEED, resamples: int = RESAMPLES) -> Inference:
    """Mean with its BCa interval (Efron & Tibshirani 1993, section 14.3).

    Fewer than three values: no interval (NaN). All values equal: the interval is that
    point, which says that the sample has no spread, not that the population has none; the
    note says which. Below some ten values the interval is too short.
    """
    return bootstrap_estimate("mean", (sample(values),), spread.mean, seed, resamples)


def difference_of_means(
    first: ArrayLike, second: ArrayLike | float, *, seed: int = SEED, resamples: int = RESAMPLES
) -> Inference:
    """Mean of ``first`` less mean of ``second``, independent samples; see :func:`mean`."""
    samples = samples_of(first, second)
    name = "difference of means" if len(samples) > 1 else "difference to a known value"
    return bootstrap_estimate(name, samples, spread.difference, seed, resamples)


def paired_difference(
    first: ArrayLike, second: ArrayLike, *, seed: int = SEED, resamples: int = RESAMPLES
) -> Inference:
    """Mean of ``first − second``, pair by pair; see :func:`mean`.

    Raises ValueError for samples of different length.
    """
    samples = (differences(first, second),)
    return bootstrap_estimate("mean of paired differences", samples, spread.mean, seed, resamples)


def probability_of_improvement(
    first: ArrayLike, second: ArrayLike | float, *, seed: int = SEED, resamples: int = RESAMPLES
) -> Inference:
    """P(a run of ``first`` is higher than one of ``second``), a tie counting half.

    From 0 to 1; 0.5 where neither is higher (Agarwal et al. 2021; the Mann-Whitney
    statistic over its maximum). BCa interval. Where every run of one sample is higher than
    every run of the other, no resample differs and the bootstrap is silent: the interval
    then is Newcombe's (2006, method 5), with the estimate as one of its ends. Fewer than
    three values in a sample give no interval here either.
    """
    samples = samples_of(first, second)
    found = bootstrap_estimate("probability of improvement", samples, higher, seed, resamples)
    if found.estimate not in (0.0, 1.0) or min(found.n) < FEWEST:
        return found
    far = _separated(found.n, found.estimate)
    return replace(
        found,
        method="probability of improvement, score interval (Newcombe 2006, method 5)",
        low=min(far, found.estimate),
        high=max(far, found.estimate),
        seed=None,
        note="the samples do not overlap",
    )


def bootstrap_estimate(
    name: str,
    samples: tuple[Array, ...],
    statistic: Callable[..., Any],
    seed: int,
    resamples: int,
) -> Inference:
    """A statistic of one or more independent samples with its BCa interval.

    ``statistic(*samples, axis)`` is vectorised over leading axes. Each sample is resampled
    within itself, so samples that are strata stay so. :func:`mean` says what happens to
    samples that are too small or all equal. Where samples have a spread but resamples never
    differ there is no interval; where they differ but BCa is not defined, the percentile
    interval stands in, and the note says so. Of samples beyond :data:`MOST_DRAWN` values that
    many are drawn: BCa would take time in the square of their number, and corrects nothing there.
    """
    estimate, n = float(statistic(*samples, axis=-1)), tuple(map(len, samples))
    found = Inference(estimate, n, f"{name}, BCa bootstrap, {resamples} resamples")
    if min(n) < FEWEST:
        return replace(found, note=f"no interval: a sample has fewer than {FEWEST} values")
    if all(np.ptp(values) == 0 for values in samples):
        return replace(found, low=estimate, high=estimate, note=NO_SPREAD)
    if max(n) > MOST_DRAWN:
        return _of_large_samples(found, name, samples, statistic, seed, resamples)
    with warnings.catch_warnings():
        # scipy warns where BCa is undefined; that case is dealt with below.
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        result = stats.bootstrap(
            samples,
            statistic,
            n_resamples=resamples,
            batch=1_000,
            vectorized=True,
            confidence_level=CONFIDENCE,
            method="BCa",
            rng=np.random.default_rng(seed),
        )
    drawn = result.bootstrap_distribution
    if np.ptp(drawn) == 0:
        return replace(found, note="no interval: no resample differs from the sample")
    low, high = map(float, result.confidence_interval)
    if math.isfinite(low) and math.isfinite(high):
        return replace(found, low=low, high=high, seed=seed)
    low, high = map(float, np.quantile(drawn, TAILS))
    method = f"{name}, percentile bootstrap, {resamples} resamples"
    note = "BCa is not defined for this sample"
    return replace(found, method=method, low=low, high=high, seed=seed, note=note)


def _of_large_samples(
    found: Inference,
    name: str,
    samples: tuple[Array, ...],
    statistic: Callable[..., Any],
    seed: int,
    resamples: int,
) -> Inference:
    """The percentile interval of resamples of m out of n values, narrower by the root of m/n.

    Source: P. J. Bickel, F. Götze & W. R. van Zwet (1997), Statistica Sinica 7. Where samples
    are of unlike sizes the largest of their m/n counts, which makes the interval too wide, if
    anything.
    """
    rng = np.random.default_rng(seed)
    sizes = [min(len(values), MOST_DRAWN) for values in samples]
    drawn = np.concatenate(
        [
            statistic(
                *(
                    values[rng.integers(len(values), size=(count, size))]
                    for values, size in zip(samples, sizes, strict=True)
                ),
                axis=-1,
            )
            for count in _batches(resamples)
        ]
    )
    share = max(size / len(values) for values, size in zip(samples, sizes, strict=True))
    reach = math.sqrt(share) * (np.quantile(drawn, TAILS) - found.estimate)
    method = f"{name}, bootstrap of at most {MOST_DRAWN} values, {resamples} resamples"
    low, high = (float(found.estimate + side) for side in reach)
    return replace(found, method=method, low=low, high=high, seed=seed)


def _batches(resamples: int, size: int = 500) -> list[int]:
    """Numbers of resamples that are in memory at once."""
    return [min(size, resamples - start) for start in range(0, resamples, size)]


def higher(first: Array, second: Array = _ZERO, axis: int = -1) -> Array:
    """Share of pairs over the last axes in which ``first`` is higher, ties counting half.

    Shapes ``(..., n)`` and ``(..., m)``; takes no more room than one of them. Of one sample
    alone, differences to a number, those that are positive.
    """
    shape = np.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    above, tied = np.zeros(shape), np.zeros(shape)
    for place in range(second.shape[-1]):
        other = second[..., place, None]
        above += (first > other).sum(axis=-1)
        tied += (first == other).sum(axis=-1)
    pairs = first.shape[-1] * second.shape[-1]
    return np.asarray(above / pairs + 0.5 * (tied / pairs))


def _separated(n: tuple[int, ...], estimate: float) -> float:
    """Far end of Newcombe's interval (method 5) where the estimate is 0 or 1.

    A number taken as known counts as a sample so large that it adds no variance: what
    remains is Wilson's interval of a proportion.
    """
    z2 = float(special.ndtri(TAILS[1])) ** 2

    def excess(theta: float) -> float:
        """Distance to the estimate 1, squared, less z² variances, over 1 − θ."""
        if len(n) == 1:
            return (1 - theta) - z2 * theta / n[0]
        spread = (sum(n) / 2 - 1) * ((1 - theta) / (2 - theta) + theta / (1 + theta))
        return (1 - theta) - z2 * theta * (1 + spread) / (n[0] * n[1])

    far = float(optimize.brentq(excess, 0.0, 1.0))
    return far if estimate == 1.0 else 1 - far


def differences(first: ArrayLike, second: ArrayLike | float) -> Array:
    """``first − second``, pair by pair or to a number. Raises ValueError for unequal lengths."""
    a, b = sample(first), np.asarray(second, dtype=np.float64)
    if b.ndim and a.shape != b.shape:
        raise ValueError(f"pairs need samples of one length, not {len(a)} and {len(b)}")
    return sample(a - b)
