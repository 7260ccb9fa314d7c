"""Estimates with their intervals: means and differences.

Samples are rewards (or any score) of independent runs; a plain number in the place of a sample is
taken as known without error. Intervals are of the BCa bootstrap, and the edge cases of that are
all in :func:`bootstrap_estimate`. Resampling has one seed, :data:`SEED`, which has nothing to do
with the seeds of the runs.

scipy imports its modules where they are first used: scipy.stats takes longer than a figure.

Source: B. Efron & R. J. Tibshirani (1993), An Introduction to the Bootstrap, chapter 14.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import real_array
from coartic.robot import Array

CONFIDENCE = 0.95
"""Nominal coverage of every interval."""
TAILS = (1 - CONFIDENCE) / 2, 1 - (1 - CONFIDENCE) / 2
"""The quantiles that such an interval lies between."""
LEVEL = 0.05
"""Level of a test."""
Resamples = Annotated[int, 1, 10_000_000]
"""Number of resamples."""
RESAMPLES = 9_999
"""With 9 999 resamples the levels 0.05 and 0.01 fall on whole numbers of resamples."""
SEED = 0
"""Seed of every resampling."""
FEWEST = 3
"""Fewer values than this give no bootstrap interval: there is next to nothing to resample."""
FEWER_RESAMPLES = 1_999
"""Number of resamples for intervals of many values and over instances, of which each resample takes
long."""
LARGE = 500
"""Beyond so many values an interval is the percentiles of :data:`FEWER_RESAMPLES`: BCa takes time
in the square of the number of values, and corrects nothing there."""
IN_CACHE = 1 << 18
"""Values that are drawn at once: few enough for the processor's cache."""
NEGLIGIBLE = 1e-9
"""Values that differ by less than this share of their size do not differ: it is rounding."""


@dataclass(frozen=True)
class Estimate:
    """A number and how sure it is. NaN where there is no interval or no test."""

    value: float
    low: float = math.nan
    """Lower end of the interval, of coverage :data:`CONFIDENCE`."""
    high: float = math.nan
    p: float = math.nan
    n: tuple[int, ...] = ()
    """Values in each sample; a number taken as known is no sample."""
    resamples: int = 0
    """Resamples that p was counted in; 0 for an exact test."""
    least_p: float = math.nan
    """Smallest p that the test can give for so many values: above 5 % it cannot reject."""

    def columns(self, name: str) -> dict[str, float]:
        """Three columns of a table: the number and both ends of its interval."""
        return {name: self.value, f"{name}_low": self.low, f"{name}_high": self.high}


def vector(values: ArrayLike) -> Array:
    """A sample as a vector (n,). Raises ValueError where it is empty or holds NaN, infinity or
    masked values.

    Runs without a solution have no reward: the caller decides what becomes of them.
    """
    sample = real_array("a sample", values)
    if sample.ndim != 1 or sample.size == 0 or not np.isfinite(sample).all():
        raise ValueError("a sample is a vector of at least one value, all of them finite")
    return sample


def slices(count: int, most: int) -> Iterator[slice]:
    """Slices of at most ``most`` places that cover ``count`` places, in their order."""
    for start in range(0, count, most):
        yield slice(start, min(start + most, count))


def varies(values: Array) -> Array:
    """Return whether values differ along the first axis by more than rounding
    (:data:`NEGLIGIBLE`)."""
    return np.asarray(np.ptp(values, 0) > NEGLIGIBLE * np.abs(values).max(0))


def centred(values: Array) -> Array:
    """Values less their mean over the first axis; 0 where they do not differ."""
    return np.where(varies(values), values - values.mean(axis=0), 0.0)


@checked_arguments
def mean(values: ArrayLike, *, resamples: Resamples = RESAMPLES) -> Estimate:
    """Mean with its interval, as :func:`bootstrap_estimate` makes it."""
    return _mean_of(tuple(vector(values).tolist()), resamples)


@lru_cache(maxsize=500)  # claims state the same means
def _mean_of(values: tuple[float, ...], resamples: int) -> Estimate:
    return bootstrap_estimate((np.array(values),), np.mean, resamples)


@checked_arguments
def difference_of_means(
    first: ArrayLike, second: ArrayLike, *, resamples: Resamples = RESAMPLES
) -> Estimate:
    """Return the mean of ``first`` less the mean of ``second``, two independent samples."""

    def difference(a: Array, b: Array, axis: int) -> Array:
        return np.asarray(a.mean(axis) - b.mean(axis))

    return bootstrap_estimate((vector(first), vector(second)), difference, resamples)


@checked_arguments
def bootstrap_estimate(
    samples: tuple[Array, ...],
    statistic: Callable[..., Any],
    resamples: Resamples = RESAMPLES,
) -> Estimate:
    """A statistic of one or more independent samples with its BCa interval.

    ``statistic(*samples, axis)`` is vectorised over leading axes. Each sample is resampled
    within itself, so samples that are strata stay so. The edge cases:

    - a sample of fewer than :data:`FEWEST` values: no interval;
    - no spread in any sample: the interval is that point, which says that the samples have no
      spread, not that the populations have none;
    - a sample of more than :data:`LARGE` values, or one for which BCa is not defined: the
      percentile interval.
    """
    if not samples:
        raise ValueError("needed is a sample at least")
    samples = tuple(map(vector, samples))
    value, n = float(statistic(*samples, axis=-1)), tuple(map(len, samples))
    if min(n) < FEWEST:
        return Estimate(value, n=n)
    if not any(map(varies, samples)):
        return Estimate(value, value, value, n=n)
    large = max(n) > LARGE
    resamples = min(resamples, FEWER_RESAMPLES) if large else resamples
    with warnings.catch_warnings():
        # scipy warns where BCa is undefined; that case is dealt with below.
        warnings.simplefilter("ignore", scipy.stats.DegenerateDataWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        result = scipy.stats.bootstrap(
            samples,
            statistic,
            n_resamples=resamples,
            batch=max(1, min(100, 1_000_000 // max(n))) if large else 1_000,
            vectorized=True,
            confidence_level=CONFIDENCE,
            method="percentile" if large else "BCa",
            rng=np.random.default_rng(SEED),
        )
    low, high = map(float, result.confidence_interval)
    if large or not (math.isfinite(low) and math.isfinite(high)):
        low, high = map(float, np.quantile(result.bootstrap_distribution, TAILS))
    return Estimate(value, low, high, n=n)


def standard_deviation(values: Array) -> float:
    """SD of values (n,), n - 1 degrees of freedom; 0 without spread, NaN of fewer than two."""
    return float(np.std(centred(values), ddof=1)) if len(values) > 1 else math.nan
