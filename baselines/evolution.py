"""CMA-ES as in the package ``cma``, bit for bit, but in less time and without its slow import.

N. Hansen (2016), The CMA evolution strategy: a tutorial (arXiv 1604.00772), whose equations have
their numbers in brackets here; with negative weights. Constants, stopping criteria and the order of
operations come from the package ``cma`` 4.5 with its defaults, so that the points are the same to
the last bit, except in generations of less than six points, as in one dimension: the package
mirrors some of them. Where the package begins to rescale the coordinates, at variances 1e8 apart or
a condition number of 1e12, this strategy ends. Weights are added from left to right, as the package
does up to Python 3.11; later versions round ``sum`` otherwise.
"""

from __future__ import annotations

import math
from collections import deque
from functools import reduce
from operator import add

import numpy as np
from numpy import exp

from coartic.robot import Array

_LEAST = 1e-11  # change of coordinates, and of costs within and between generations
_LEAST_OVER_TEN = 1e-12  # of the best costs of ten or more generations
_STILL = 1e-9  # a shift of the mean that is none
_WIDER = 1e3  # standard deviations, in those of the start
_APART = 1e8  # variances of coordinates
_ILL = 1e12  # condition number of the covariance matrix
_NOTED_EACH = 5  # generations: how often best and median are noted
_MOST_NOTED = 20_000


def _added(weights: list[float]) -> float:
    """Return the sum of weights, added from left to right; 0 for none."""
    return reduce(add, weights, 0.0)


class EvolutionStrategy:
    """Evolution strategy: :meth:`ask` for ``size`` points, :meth:`tell` their costs, until
    :meth:`has_ended`. It begins at ``mean``, shape ``(dim,)``, with SD ``step_size`` (to 0.01 %) in
    each coordinate."""

    def __init__(self, mean: Array, step_size: float, size: int, rng: np.random.Generator) -> None:
        dim = len(mean)
        self.size = size
        """Points in a generation, λ."""
        raw = [math.log((size + 1) / 2) - math.log(rank) for rank in range(1, size + 1)]  # (49)
        self._parents = sum(weight > 0 for weight in raw)  # points that are recombined, μ
        total = _added(raw[: self._parents])
        positive = [weight / total for weight in raw[: self._parents]]
        selected = 1 / _added([weight**2 for weight in positive])
        c_1 = min(1, size / 6) * 2 / ((dim + 1.3) ** 2 + selected)  # (57)

        def scaled(weights: list[float], to: float) -> list[float]:
            factor = abs(to / (_added(weights) or 1))
            return [weight * factor for weight in weights]

        # Negative weights make up for the positive ones, but cannot make a variance negative
        # (50 to 53). They are scaled twice, with a rate that differs in its last bit, as in the
        # package.
        negative = [weight / total for weight in raw[self._parents :]]
        negative = [weight / -_added(negative) for weight in negative]
        for mass in (0.25 + selected + 1 / selected - 2, 0.25 + selected - 2 + 1 / selected):
            rate = min(1 - c_1, 2 * mass / ((dim + 2) ** 2 + selected))  # c_μ (58)
            negative = scaled(negative, 1 + c_1 / rate)
            square = _added([weight**2 for weight in negative])
            rejected = _added(negative) ** 2 / (square or 1)
            for most in ((1 - c_1 - rate) / rate / dim, 1 + 2 * rejected / (selected + 2)):
                if _added(negative) < -most:
                    negative = scaled(negative, most)
        self._recombined = np.array(positive)  # weights of the best points, which sum to 1
        self._selected = selected  # variance effective selection mass, μ_eff
        # Learning rates: of the covariance from its path, of this path, of the step size's path.
        self._c_1 = c_1
        self._c_path = (4 + selected / dim) / (dim + (4 + 2 * selected / dim))  # c_c (56)
        self._c_step = min(0.5, (selected + 2) / (dim + (selected + 3)))  # c_σ (55)
        # Weights of the evolution path and of all points in the covariance matrix, also while the
        # path is stalled.
        of_points = [rate * weight for weight in (*positive, *negative)]
        self._learned = np.array([c_1, *of_points])
        self._stalled = np.array([c_1 * (1 - self._c_path * (2 - self._c_path)), *of_points])
        narrow = max(1, 3 * (1 - 0.5 ** (dim / 9))) * ((selected - 1) / (dim + 1)) ** 0.5 - 1
        self._damping = 1 + 2 * max(0, narrow) + self._c_step  # of the step size, d_σ (55)
        if dim > 100:  # expected length of a standard normal vector
            self._length = dim**0.5 * (1 - 1 / (4 * dim) + 1 / (32 * dim**2))
        else:
            from scipy.special import gamma  # slow, and a command that names methods needs none

            self._length = float(2**0.5 * gamma((dim + 1) / 2) / gamma(dim / 2))
        self._gap = 1 / (c_1 + rate) / dim / 10  # generations between decompositions, at least
        self._patience = int(100 + 100 * dim**1.5 / size)  # generations that it may stagnate
        self._most_generations = 100 + 150 * (dim + 3) ** 2 // size**0.5

        self._rng = rng
        self._mean = mean.copy()
        self._first_step_size = self._step_size = float(step_size)
        # Almost the identity: its eigenvalues differ.
        self._covariance = np.diag(exp(1e-4 / dim * np.arange(dim)))
        self._lengths, self._axes = np.diag(self._covariance) ** 0.5, np.eye(dim)
        self._path, self._step_path = np.zeros(dim), np.zeros(dim)
        self._generation, self._decomposed = 0, 0
        self._still_at, self._still_since = self._mean, 0
        self._costs: Array = np.empty(0)  # of the last generation, sorted
        self._bests: deque[float] = deque(maxlen=int(10 + 30 * dim / size))
        self._noted_bests: deque[float] = deque(maxlen=_MOST_NOTED)
        self._noted_medians: deque[float] = deque(maxlen=_MOST_NOTED)
        self._best, self._best_point = math.inf, 0
        self._flat = 0

    @property
    def mean(self) -> Array:
        """Mean of the next generation, shape ``(dim,)``."""
        return self._mean.copy()

    @property
    def costs(self) -> Array:
        """Costs of the last generation that was told, sorted, shape ``(size,)``; empty before."""
        return self._costs

    def ask(self) -> Array:
        """Draw and return the points of the next generation, shape ``(size, dim)``."""
        if self._generation >= self._decomposed + self._gap:
            self._covariance = (self._covariance + self._covariance.T) / 2
            variances, axes = np.linalg.eigh(self._covariance)
            self._axes = np.asfortranarray(axes)
            self._lengths = variances**0.5
            self._decomposed = self._generation
        noise = self._rng.standard_normal((self.size, len(self._mean)))
        drawn: Array = np.dot(self._axes, (self._lengths * noise).T).T  # (38 to 40)
        return self._mean + self._step_size * drawn

    def tell(self, points: Array, costs: Array) -> None:
        """Update mean, covariance and step size of the strategy from the points ``(size, dim)`` of
        the last :meth:`ask` and their finite costs ``(size,)``; the least cost is best."""
        self._generation += 1
        least = int(np.argmin(costs))
        if costs[least] < self._best:
            self._best, self._best_point = float(costs[least]), self._generation * self.size
            self._best_point += least + 1 - self.size
        self._costs = ranked = np.sort(costs)
        self._bests.appendleft(ranked[0])
        if self._generation % _NOTED_EACH == 0:
            self._noted_bests.appendleft(ranked[0])
            self._noted_medians.appendleft(np.median(ranked))
        self._flat = 0 if ranked[0] < ranked[int(0.75 * self.size)] else self._flat + 1

        points = points[np.argsort(costs)]
        # The mean (41, 42), then the path of the step size (43).
        before, self._mean = self._mean, np.dot(self._recombined, points[: self._parents])
        shift = self._mean - before

        # In coordinates in which the points are normal with unit variance.
        whitened = np.dot(self._axes, np.dot(self._axes.T, shift) / self._lengths)
        normalised = whitened * (self._selected**0.5 / self._step_size)
        self._step_path *= 1 - self._c_step
        self._step_path += math.sqrt(self._c_step * (2 - self._c_step)) * normalised
        square = np.sum(self._step_path**2) / (1 - (1 - self._c_step) ** (2 * self._generation))
        is_stalled = not square / len(shift) - 1 < 1 + 4 / (len(shift) + 1)

        self._path = (1 - self._c_path) * self._path  # (45)
        weights, path = self._stalled, (self._c_1 / self._stalled[0]) ** 0.5 * self._path
        if not is_stalled:
            factor = (self._c_path * (2 - self._c_path) * self._selected) ** 0.5 / self._step_size
            self._path += factor * shift
            weights, path = self._learned, self._path
        # Points with negative weights count as if they had the expected length (46, 47).
        weights, rejected = weights.copy(), slice(1 + self._parents, None)
        vectors = np.vstack([path, (points - before) / self._step_size])
        self._covariance *= 1 - weights.cumsum()[-1]
        scaled = np.matmul(self._axes.T, vectors[rejected, :, None])[..., 0] / self._lengths
        squares = (scaled**2).cumsum(axis=1)[:, -1]  # term by term, as the package sums
        weights[rejected] *= [len(shift) / (square**0.5 + 1e-9) ** 2 for square in squares.tolist()]
        self._covariance += np.dot(weights * vectors.T, vectors)

        length = np.sqrt(np.sum(np.square(self._step_path)))
        change = (length / self._length - 1) * (self._c_step / self._damping)  # (44)
        self._step_size *= float(exp(min(max(change, -1), 1)))
        threshold = 20 + 0.1 * self._generation
        delta = _STILL * max(1, (self._generation - self._still_since) / threshold) ** 0.5
        if np.sum((self._still_at - self._mean) ** 2) ** 0.5 > delta:
            self._still_at, self._still_since = self._mean, self._generation

    def has_ended(self) -> bool:
        """Return whether a criterion to stop is met, False before the first :meth:`tell`: points or
        costs change too little or costs do not improve, steps have become too long, the covariance
        is ill-conditioned, or there were too many generations."""
        if not self._generation:
            return False
        deviations = self._step_size * np.sqrt(np.diag(self._covariance))
        least, most = deviations.min(), deviations.max()
        between = max(self._bests) - min(self._bests)
        axis = self._generation % len(self._mean)
        longest = 0.1 * self._step_size * self._lengths[axis] * self._axes[:, axis]
        return bool(
            self._stagnates()
            # Costs hardly differ within the generation, or the best ones between generations.
            or self._flat > 1
            or (self._costs[-1] - self._costs[0] < _LEAST and between < _LEAST)
            or (len(self._bests) > 9 and between < _LEAST_OVER_TEN)
            or (most < _LEAST and (self._step_size * self._path).max() < _LEAST)
            or self._generation - self._still_since > 20 + 0.1 * self._generation
            or (self._mean == self._mean + 0.2 * deviations).any()
            or (self._mean == self._mean + longest).all()
            or most > self._first_step_size * _WIDER
            or (most / least) ** 2 >= _APART
            or (self._lengths[-1] / self._lengths[0]) ** 2 >= _ILL
            or self._generation >= self._most_generations
        )

    def _stagnates(self) -> bool:
        """Return whether neither the best nor the median cost has improved for many generations."""
        noted = len(self._noted_bests)
        recent = int(max(self._patience / 10, noted / 10))
        evaluated = self._generation * self.size
        if (
            self._generation <= len(self._mean) * (5 + 100 / self.size)
            or (evaluated - self._best_point) / self.size <= self._patience / 2
            or noted <= max(100, 2 * recent)
        ):
            return False
        return all(
            np.median(history[:recent]) >= np.median(history[recent : 2 * recent])
            for history in (list(self._noted_medians), list(self._noted_bests))
        )
