"""Means and differences of means, with confidence intervals.

A sample consists of independent values, such as the rewards of runs. The confidence intervals are
those of the BCa bootstrap (bias-corrected and accelerated); :func:`mean_of_means` lists the
exceptions. All resampling in this module uses the same seed, :data:`SEED`.

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
"""Probabilities of the quantiles at the two ends of an interval of coverage :data:`CONFIDENCE`."""
LEVEL = 0.05
"""Significance level of tests."""
Resamples = Annotated[int, Field(ge=1, le=10_000_000)]
"""Type of a parameter: number of bootstrap resamples."""
RESAMPLES = 9_999
"""Default number of resamples: 10,000 - 1, because 5 % and 1 % of 10,000 are integers."""
SEED = 0
"""Seed of resampling."""
MIN_VALUES = 5
"""Smallest number of values, such as runs, in each sample for an interval or a permutation test."""
MIN_TASKS = 3
"""Smallest number of random tasks of a family for an interval or a test over tasks."""
FEWER_RESAMPLES = 1_999
"""Number of resamples where resampling is slow: for large samples, and over instances of
families."""
LARGE = 500
"""Largest size of a sample for which a BCa interval is computed. A larger sample, up to
:data:`HUGE`, has a percentile interval of at most :data:`FEWER_RESAMPLES` resamples, which BCa
would hardly change."""
HUGE = 50_000
"""Largest size of a sample that is resampled. A larger sample has a normal interval."""
IN_CACHE = 1 << 18
"""Largest number of values that are resampled at a time, so that they fit into the processor's
cache."""
NEGLIGIBLE = 1e-9
"""Differences of at most this fraction of the largest absolute value count as rounding errors."""


@dataclass(frozen=True)
class Estimate:
    """An estimate with its confidence interval and p-value, which are NaN if not computed."""

    value: float
    """The estimate: a mean, a difference or another number."""
    low: float = math.nan
    """Lower end of the interval, usually of coverage :data:`CONFIDENCE`."""
    high: float = math.nan
    """Upper end of the interval."""
    p: float = math.nan
    """P-value of a test of the estimated quantity."""
    n: tuple[int, ...] = ()
    """Number of values in each sample."""
    resamples: int = 0
    """Number of resamples of the test; 0 for an exact test or no test."""
    least_p: float = math.nan
    """Smallest p that a permutation test can give for these numbers of values. For a bootstrap
    test, which can give a smaller p, it is usually the smallest p of the sign test."""

    def columns(self, name: str) -> dict[str, float]:
        """Return the estimate as a dict of three table columns.

        The keys are ``name`` (the value), ``name_low`` and ``name_high`` (the ends of the
        interval).
        """
        return {name: self.value, f"{name}_low": self.low, f"{name}_high": self.high}


def vector(values: ArrayLike) -> Array:
    """Convert a sample of real numbers to a vector of floats, shape ``(n,)``.

    Raises ValueError if ``values``

    - is not a vector of real numbers, or is empty;
    - contains NaN, infinite or masked entries;
    - has an entry other than 0 whose absolute value is not from 1e-100 to 1e100.
    """
    sample = real_array("the sample", values)
    if sample.size == 0:
        raise ValueError("the sample is empty; it must have at least one value")
    size = np.abs(sample)
    usable = (size <= 1e100) & ((size >= 1e-100) | (size == 0))
    if sample.ndim != 1 or not usable.all():
        raise ValueError(
            f"the sample has shape {sample.shape} and values of sizes {size.min():g} to "
            f"{size.max():g}; it must be a vector, each value 0 or of a size from 1e-100 to 1e100"
        )
    return sample


def slices(count: int, size: int) -> Iterator[slice]:
    """Yield consecutive slices of at most ``size`` indices that cover ``range(count)``."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def varies(values: Array) -> Array:
    """Return whether values differ along the first axis by more than rounding errors.

    The result is an array of bool with the shape of the other axes. An entry is False if the values
    along the first axis include NaN or infinity. Rounding errors are differences of at most
    :data:`NEGLIGIBLE` times the largest absolute value.
    """
    return np.asarray(np.ptp(values, 0) > NEGLIGIBLE * np.abs(values).max(0))


def centred(values: Array) -> Array:
    """Subtract the mean over the first axis from values.

    The result has the shape of ``values``. An entry is 0 if the values along the first axis do not
    vary (:func:`varies`), or include NaN or infinity.
    """
    return np.where(varies(values), values - np.mean(values, axis=0), 0.0)


def mean(values: ArrayLike) -> Estimate:
    """Compute the mean of a sample with its 95 % interval.

    Parameters
    ----------
    values : array_like, shape (n,)

    Returns
    -------
    Estimate
        The mean with the interval of :func:`mean_of_means`. The ends of the interval are NaN for
        fewer than :data:`MIN_VALUES` values.

    Raises
    ------
    ValueError
        The sample cannot be used (:func:`vector`).

    Examples
    --------
    >>> rewards = [-319, -305, -311, -298, -307, -316]
    >>> estimate = mean(rewards)
    >>> estimate.value, estimate.low < estimate.value < estimate.high
    (-309.3333333333333, True)
    """
    return _mean_of(tuple(vector(values).tolist()))


@lru_cache(maxsize=500)  # claims ask for the same means
def _mean_of(values: tuple[float, ...]) -> Estimate:
    return mean_of_means([np.array(values)], [1.0])


def difference_of_means(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Compute the difference between the means of two independent samples, with its 95 % interval.

    Parameters
    ----------
    first : array_like, shape (n,)
    second : array_like, shape (m,)
        The sample whose mean is subtracted.

    Returns
    -------
    Estimate
        The difference with the interval of :func:`mean_of_means`. The ends of the interval are NaN
        if a sample has fewer than :data:`MIN_VALUES` values.

    Raises
    ------
    ValueError
        A sample cannot be used (:func:`vector`).
    """
    return mean_of_means([first, second], [1.0, -1.0])


def mean_of_means(
    samples: Sequence[ArrayLike], weights: Sequence[float], resamples: Resamples = RESAMPLES
) -> Estimate:
    """Compute a weighted sum of means of independent samples, with its 95 % interval.

    Parameters
    ----------
    samples : sequence of array_like, shapes (n,)
        The samples; each is resampled separately.
    weights : sequence of float
        Factor by which the mean of each sample is multiplied.
    resamples : int
        Number of bootstrap resamples. If a sample has more than :data:`LARGE` values, at most
        :data:`FEWER_RESAMPLES` resamples are drawn.

    Returns
    -------
    Estimate
        The sum with its interval. The interval is chosen by the first rule that applies:

        - no interval, if a sample has fewer than :data:`MIN_VALUES` values;
        - the value itself, if no sample varies (although the populations may vary);
        - the normal interval, if a sample has more than :data:`HUGE` values;
        - the percentile interval, if a sample has more than :data:`LARGE` values or BCa is not
          defined;
        - otherwise the BCa interval.

    Raises
    ------
    ValueError
        There is no sample, the number of weights differs from the number of samples, or a sample
        cannot be used (:func:`vector`).
    """
    if not samples:
        raise ValueError("samples is empty; it must have at least one sample")
    vectors = [*map(vector, samples)]
    parts = [*zip(vectors, weights, strict=True)]
    value = float(sum(weight * sample.mean() for sample, weight in parts))
    n = tuple(map(len, vectors))
    if min(n) < MIN_VALUES:
        return Estimate(value, n=n)
    if not any(map(varies, vectors)):
        return Estimate(value, value, value, n=n)
    if max(n) > HUGE:
        variances = (weight**2 * sample.var(ddof=1) / len(sample) for sample, weight in parts)
        width = scipy.special.ndtri(TAILS[1]) * math.sqrt(sum(variances))
        return Estimate(value, value - width, value + width, n=n)
    large = max(n) > LARGE
    resamples = min(resamples, FEWER_RESAMPLES) if large else resamples
    indices_for = _cached_indices if sum(n) <= LARGE else resample_indices
    batches: Iterable[list[Any]] = indices_for(n, resamples)
    resampled = np.concatenate([
        sum(weight * sample.take(indices).mean(axis=1)
            for (sample, weight), indices in zip(parts, batch, strict=True))
        for batch in batches
    ])  # fmt: skip
    ends = np.array(TAILS)
    if not large:
        # How much each value moves the sum: the jackknife of a mean has a closed form.
        moves = [weight * (sample - sample.mean()) / len(sample) for sample, weight in parts]
        cubes, squares = (sum((move**power).sum() for move in moves) for power in (3, 2))
        acceleration = cubes / squares**1.5 / 6
        below = ((resampled < value).sum() + (resampled <= value).sum()) / 2 / resamples
        bias = scipy.special.ndtri(below)
        shifted = bias + scipy.special.ndtri(ends)
        corrected = scipy.special.ndtr(bias + shifted / (1 - acceleration * shifted))
        ends = corrected if np.isfinite(corrected).all() else ends
    low, high = map(float, np.quantile(resampled, ends))
    return Estimate(value, low, high, n=n)


def resample_indices(sizes: Sequence[int], resamples: int) -> Iterator[list[NDArray[np.int64]]]:
    """Yield bootstrap indices in batches of at most 1,000 resamples.

    Batches are smaller if a sample has more than 500 values (:data:`LARGE`). Equal arguments give
    equal indices.

    Parameters
    ----------
    sizes : sequence of int
        Number of values in each sample.
    resamples : int
        Number of resamples in all batches together.

    Yields
    ------
    list of ndarray of int
        An array of indices for each sample, shape ``(b, size)``, where b is the number of resamples
        in the batch.
    """
    rng, batch = np.random.default_rng(SEED), 1_000
    if max(sizes) > LARGE:
        batch = max(1, min(100, 1_000_000 // max(sizes)))
    for part in slices(resamples, batch):
        yield [rng.integers(size, size=(part.stop - part.start, size)) for size in sizes]


@lru_cache(maxsize=8)  # samples often have equal sizes
def _cached_indices(sizes: tuple[int, ...], resamples: int) -> list[list[NDArray[np.uint16]]]:
    """Return a list of all batches of :func:`resample_indices`, and cache the list.

    Do not change the list. The indices are stored in 16 bits, a quarter of their usual memory.
    """
    return [
        [indices.astype(np.uint16) for indices in batch]
        for batch in resample_indices(sizes, resamples)
    ]


def standard_deviation(values: Array) -> float:
    """Compute the standard deviation of values, with n - 1 degrees of freedom.

    ``values`` has shape ``(n,)``. The result is NaN for fewer than two values. For two or more
    values, the result is 0 if the values do not vary (:func:`varies`) or include NaN or infinity.
    """
    return float(np.std(centred(values), ddof=1)) if len(values) > 1 else math.nan
