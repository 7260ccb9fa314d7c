"""Mean and spread of samples, with a spread of exactly 0 where all values are equal.

The mean of equal numbers can differ from them in the last bit, and what then remains of each
looks like a spread: it is divided by, and a test of nothing gives a p. Whatever measures a
spread therefore measures it from :func:`mean`, here or through what is here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from coartic.robot import Array


def mean(values: Array, axis: int = 0, *, keepdims: bool = False) -> Array:
    """Mean along an axis; where values are equal, exactly that value."""
    return within(np.mean(values, axis=axis, keepdims=keepdims), values, axis, keepdims=keepdims)


def within(means: Array, values: Array, axis: int = 0, *, keepdims: bool = False) -> Array:
    """Means of whatever weights, none beyond the least or the greatest of ``values``.

    Only rounding carries a mean there, so that it changes no other one by a bit; and where
    values are equal there is one place left.
    """
    least, greatest = (f(values, axis=axis, keepdims=keepdims) for f in (np.min, np.max))
    return np.asarray(np.clip(means, least, greatest))


def variance(values: Array, axis: int = 0) -> Array:
    """Variance along an axis with n - 1 degrees of freedom, at least two values; ≥ 0."""
    about = mean(values, axis, keepdims=True)
    return np.asarray(np.var(values, axis=axis, ddof=1, mean=about))


def sd(values: ArrayLike) -> float:
    """Standard deviation of values (n,), n - 1 degrees of freedom; NaN of fewer than two."""
    known = np.asarray(values, dtype=np.float64)
    return math.sqrt(variance(known)) if len(known) > 1 else math.nan


def difference(*groups: Array, axis: int = -1) -> Array:
    """Mean of the first less that of the second, if there is one."""
    return mean(groups[0], axis) - (mean(groups[1], axis) if len(groups) > 1 else 0.0)
