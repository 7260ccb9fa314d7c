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

_BLOCK = 128
"""Numbers up to which NumPy adds without halving them first (pairwise summation)."""


def mean(values: Array, axis: int = 0, *, keepdims: bool = False) -> Array:
    """Mean along an axis; where values are equal, exactly that value."""
    if _short_rows(values, axis) and not keepdims:
        return _means(np.ascontiguousarray(values.T))
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


def moments(rows: Array) -> tuple[Array, Array]:
    """:func:`mean` and :func:`variance` of every row of values (k, n), n at least two, in less
    time than one after the other: shape (k,) each.
    """
    if not _short_rows(rows, 1):
        return mean(rows, 1), variance(rows, 1)
    columns = np.ascontiguousarray(rows.T)
    means = _means(columns)
    return means, _sums(np.square(columns - means)) / (len(columns) - 1)


def _short_rows(values: Array, axis: int) -> bool:
    """Whether rows are many and short: NumPy walks along them one by one, in ten times the time
    that it takes with all of them at once. The bits are the same.
    """
    return (
        values.ndim == 2
        and axis in (1, -1)
        and 0 < values.shape[1] <= min(_BLOCK, len(values))
        and values.flags.c_contiguous
    )


def _means(columns: Array) -> Array:
    return within(_sums(columns) / len(columns), columns)


def _sums(columns: Array) -> Array:
    """Sums of columns (n, k) of a block at most, in the order in which NumPy adds along a row."""
    whole = len(columns) - len(columns) % 8
    if not whole:
        return np.asarray(np.add.reduce(columns))
    lanes = np.add.reduce(columns[:whole].reshape(whole // 8, 8, -1))
    pairs = lanes[::2] + lanes[1::2]
    total: Array = (pairs[0] + pairs[1]) + (pairs[2] + pairs[3])
    for row in columns[whole:]:
        total += row
    return total


def sd(values: ArrayLike) -> float:
    """Standard deviation of values (n,), n - 1 degrees of freedom; NaN of fewer than two."""
    known = np.asarray(values, dtype=np.float64)
    return math.sqrt(variance(known)) if len(known) > 1 else math.nan


def difference(*groups: Array, axis: int = -1) -> Array:
    """Mean of the first less that of the second, if there is one."""
    return mean(groups[0], axis) - (mean(groups[1], axis) if len(groups) > 1 else 0.0)
