"""Estimates with their intervals: means and differences.

Samples are rewards (or any score) of independent runs. Intervals are of the BCa bootstrap, except
in the cases that :func:`mean_of_means` names. All resampling here has the same seed, :data:`SEED`.

Source: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapter 14.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from coartic.internal.limits import real_array
from coartic.robot import Array

CONFIDENCE = 0.95
"""Nominal coverage of intervals."""
TAILS = (1 - CONFIDENCE) / 2, 1 - (1 - CONFIDENCE) / 2
"""Quantiles at the ends of such intervals."""
LEVEL = 0.05
"""Level of a test."""
Resamples = Annotated[int, Field(ge=1, le=10_000_000)]
"""Number of resamples."""
RESAMPLES = 9_999
"""Number of resamples unless stated otherwise: 0.05 and 0.01 of 9,999 + 1 are whole numbers."""
SEED = 0
"""Seed of resampling."""
FEWEST = 5
"""Least number of values, such as runs, in each sample for an interval or a test."""
FEWEST_TASKS = 3
"""Least number of random tasks of a family for an interval or a test over tasks."""
FEWER_RESAMPLES = 1_999
"""Number of resamples for intervals of many values and over instances, which take long."""
LARGE = 500
"""Size of a sample beyond which an interval is the percentiles of at most :data:`FEWER_RESAMPLES`
resamples: BCa corrects next to nothing there."""
HUGE = 50_000
"""Size of a sample beyond which an interval is of a normal distribution."""
IN_CACHE = 1 << 18
"""Number of values that are drawn at once: few enough for the processor's cache."""
NEGLIGIBLE = 1e-9
"""Share of the largest value up to which a difference of values counts as rounding."""


@dataclass(frozen=True)
class Estimate:
    """Estimated number with its interval and p-value, which are NaN where they are not computed."""

    value: float
    """The mean, the difference or another number that is estimated."""
    low: float = math.nan
    """Lower end of the interval, mostly of coverage :data:`CONFIDENCE`."""
    high: float = math.nan
    """Upper end of the interval."""
    p: float = math.nan
    """P-value of the test of this number."""
    n: tuple[int, ...] = ()
    """Number of values in each sample."""
    resamples: int = 0
    """Number of resamples in which p was counted; 0 for an exact test or none."""
    least_p: float = math.nan
    """Smallest p that the test can give for so many values; of a bootstrap test mostly the smallest
    p of the sign test, below which its own p can fall."""

    def columns(self, name: str) -> dict[str, float]:
        """Return three entries of a table's row: ``name``, the value, and ``name_low`` and
        ``name_high``, the ends of its interval."""
        return {name: self.value, f"{name}_low": self.low, f"{name}_high": self.high}


def vector(values: ArrayLike) -> Array:
    """Return a sample of real numbers as a float vector ``(n,)``. Raises ValueError if it is no
    vector or empty, or holds NaN, masked values, or numbers that are neither 0 nor from 1e-100 to
    1e100 in size."""
    sample = real_array("a sample", values)
    size = np.abs(sample)
    usable = (size <= 1e100) & ((size >= 1e-100) | (size == 0))
    if sample.ndim != 1 or sample.size == 0 or not usable.all():
        words = "all of them finite, and 0 or from 1e-100 to 1e100 in size"
        raise ValueError(f"a sample is a vector of at least one value, {words}")
    return sample


def slices(count: int, most: int) -> Iterator[slice]:
    """Yield slices of at most ``most`` indices, which in this order cover 0 to ``count`` - 1."""
    for start in range(0, count, most):
        yield slice(start, min(start + most, count))


def varies(values: Array) -> Array:
    """Return whether values differ along the first axis by more than rounding (:data:`NEGLIGIBLE`),
    a bool for each entry of the other axes; False with NaN or infinity."""
    return np.asarray(np.ptp(values, 0) > NEGLIGIBLE * np.abs(values).max(0))


def centred(values: Array) -> Array:
    """Return values less their mean over the first axis; 0 without spread (:func:`varies`) and with
    NaN or infinity."""
    return np.where(varies(values), values - np.mean(values, axis=0), 0.0)


def mean(values: ArrayLike) -> Estimate:
    """Return the mean of a sample ``(n,)`` with its 95 % interval (:func:`mean_of_means`), whose
    ends are NaN for fewer than five values. Raises ValueError for a sample that is no vector,
    empty or not finite, or has values, other than 0, that are not from 1e-100 to 1e100 in size."""
    return _mean_of(tuple(vector(values).tolist()))


@lru_cache(maxsize=500)  # claims state the same means
def _mean_of(values: tuple[float, ...]) -> Estimate:
    return mean_of_means([np.array(values)], [1.0])


def difference_of_means(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Return the mean of ``first`` less the mean of ``second``, two independent samples ``(n,)``
    and ``(m,)``, with its 95 % interval (:func:`mean_of_means`), whose ends are NaN for fewer than
    five values in a sample. Raises ValueError for samples that :func:`mean` refuses."""
    return mean_of_means([first, second], [1.0, -1.0])


def mean_of_means(
    samples: Sequence[ArrayLike], weights: Sequence[float], resamples: Resamples = RESAMPLES
) -> Estimate:
    """Return the weighted sum of the means of independent samples, with its 95 % BCa interval.

    Samples have shapes ``(n,)``; ``weights`` has a factor for each. Each sample is resampled within
    itself. Raises ValueError without a sample, without a weight for each, and for a sample that is
    empty or not finite. The edge cases, in this order:

    - a sample of fewer than :data:`FEWEST` values: no interval;
    - no spread in any sample: the interval is that point, which says that the samples have no
      spread, not that the populations have none;
    - a sample of more than :data:`HUGE` values: the normal interval;
    - a sample of more than :data:`LARGE` values, or BCa is not defined: the percentile interval.
    """
    if not samples:
        raise ValueError("needed is a sample at least")
    vectors = [*map(vector, samples)]
    parts = [*zip(vectors, weights, strict=True)]
    value = float(sum(weight * sample.mean() for sample, weight in parts))
    n = tuple(map(len, vectors))
    if min(n) < FEWEST:
        return Estimate(value, n=n)
    if not any(map(varies, vectors)):
        return Estimate(value, value, value, n=n)
    if max(n) > HUGE:
        variances = (weight**2 * sample.var(ddof=1) / len(sample) for sample, weight in parts)
        width = scipy.special.ndtri(TAILS[1]) * math.sqrt(sum(variances))
        return Estimate(value, value - width, value + width, n=n)
    large = max(n) > LARGE
    resamples = min(resamples, FEWER_RESAMPLES) if large else resamples
    kept = sum(n) <= LARGE
    batches: Iterable[list[Any]] = (_drawn_once if kept else drawn)(n, resamples)
    resampled = np.concatenate([
        sum(weight * sample.take(places).mean(axis=1)
            for (sample, weight), places in zip(parts, batch, strict=True))
        for batch in batches
    ])  # fmt: skip
    ends = np.array(TAILS)
    if not large:
        # How much each value moves the sum: of a mean the jackknife is known.
        moves = [weight * (sample - sample.mean()) / len(sample) for sample, weight in parts]
        cubes, squares = (sum((each**power).sum() for each in moves) for power in (3, 2))
        acceleration = cubes / squares**1.5 / 6
        below = ((resampled < value).sum() + (resampled <= value).sum()) / 2 / resamples
        bias = scipy.special.ndtri(below)
        away = bias + scipy.special.ndtri(ends)
        corrected = scipy.special.ndtr(bias + away / (1 - acceleration * away))
        ends = corrected if np.isfinite(corrected).all() else ends
    low, high = map(float, np.quantile(resampled, ends))
    return Estimate(value, low, high, n=n)


def drawn(sizes: Sequence[int], resamples: int) -> Iterator[list[NDArray[np.int64]]]:
    """Yield batches of at most 1,000 resamples, each a list with an array for each of ``sizes``,
    the numbers of values in the samples: the indices of the values drawn, shape ``(batch, size)``.
    Equal arguments give equal indices."""
    rng, batch = np.random.default_rng(SEED), 1_000
    if max(sizes) > LARGE:
        batch = max(1, min(100, 1_000_000 // max(sizes)))
    for part in slices(resamples, batch):
        yield [rng.integers(size, size=(part.stop - part.start, size)) for size in sizes]


@lru_cache(maxsize=8)  # most samples have as many values as another
def _drawn_once(sizes: tuple[int, ...], resamples: int) -> list[list[NDArray[np.uint16]]]:
    """Return a list of all batches of :func:`drawn`, in a quarter of the memory. The list is
    cached: do not change it."""
    return [[places.astype(np.uint16) for places in batch] for batch in drawn(sizes, resamples)]


def standard_deviation(values: Array) -> float:
    """Return the SD of values ``(n,)``, with n - 1 degrees of freedom: NaN for fewer than two
    values; 0 for two or more without spread, or with NaN or infinity among them."""
    return float(np.std(centred(values), ddof=1)) if len(values) > 1 else math.nan
