"""CMA-ES that draws the same points as the package ``cma``, bit for bit, but faster.

The algorithm is that of N. Hansen (2016), The CMA evolution strategy: a tutorial
(arXiv:1604.00772), with negative weights. Symbols are those of the tutorial; numbers in round
brackets are the numbers of its equations. Constants, stopping criteria and the order of operations
are those of the package ``cma`` 4.5 with its default options, so that the points agree to the last
bit. There are two differences:

- In a generation with fewer than six points, the package mirrors some of the points. This strategy
  does not.
- The package rescales the coordinates when the ratio of two variances exceeds 1e8 or the condition
  number of the covariance exceeds 1e12. This strategy stops instead.

Weights are added from left to right, as the function ``sum`` does in Python 3.11 and earlier. In
later versions of Python ``sum`` compensates rounding errors, and gives other bits.
"""

from __future__ import annotations

import math
from collections import deque
from functools import reduce
from operator import add

import numpy as np
from numpy import exp

from coartic.robot import Array

# Tolerances of the stopping criteria, with the names of the package.
_TOL_X = 1e-11  # least standard deviation of a coordinate
_TOL_FUN = 1e-11  # least range of costs, within a generation and between generations
_TOL_FUN_HIST = 1e-12  # least range of the best costs of ten or more generations
_TOL_STAGNATION = 1e-9  # least shift of the mean that counts as a shift
_TOL_FACUPX = 1e3  # largest standard deviation, as a multiple of the first step size
_TOL_VARIANCES = 1e8  # largest ratio of the variances of two coordinates
_TOL_CONDITION = 1e12  # largest condition number of the covariance matrix
_HISTORY_STEP = 5  # generations from one entry of the long histories to the next
_HISTORY_LENGTH = 20_000  # entries of the long histories


def _sum(weights: list[float]) -> float:
    """Return the sum of weights, added from left to right."""
    return reduce(add, weights, 0.0)


class EvolutionStrategy:
    """CMA-ES (covariance matrix adaptation evolution strategy) with an ask-and-tell interface.

    In each generation, get points from :meth:`ask`, compute their costs, and pass points and costs
    to :meth:`tell`. Stop when :meth:`has_ended` returns True.

    Parameters
    ----------
    mean : ndarray, shape (dim,)
        Mean of the first generation.
    sigma : float
        Standard deviation of each coordinate in the first generation. (As in the package ``cma``,
        the actual standard deviation is up to 0.005 % larger in some coordinates.)
    size : int
        Number λ of points in a generation, at least 2.
    rng : numpy.random.Generator
        Generator of all random numbers.

    Examples
    --------
    >>> strategy = EvolutionStrategy(np.ones(3), 0.5, 8, np.random.default_rng(0))
    >>> while not strategy.has_ended():
    ...     points = strategy.ask()
    ...     strategy.tell(points, (points**2).sum(axis=1))
    >>> bool(np.abs(strategy.mean).max() < 1e-4)
    True
    """

    def __init__(self, mean: Array, sigma: float, size: int, rng: np.random.Generator) -> None:
        dim = len(mean)
        self.size = size
        """Number λ of points in a generation."""
        # Weights before they are scaled (49). The points with positive weights are recombined.
        weights_prime = [math.log((size + 1) / 2) - math.log(rank) for rank in range(1, size + 1)]
        self._mu = mu = sum(weight > 0 for weight in weights_prime)
        total = _sum(weights_prime[:mu])
        positive = [weight / total for weight in weights_prime[:mu]]
        mu_eff = 1 / _sum([weight**2 for weight in positive])
        c_1 = min(1, size / 6) * 2 / ((dim + 1.3) ** 2 + mu_eff)  # (57)

        def scaled(weights: list[float], to: float) -> list[float]:
            factor = abs(to / (_sum(weights) or 1))
            return [weight * factor for weight in weights]

        # Negative weights make up for the positive ones, but cannot make a variance negative
        # (50 to 53). As in the package they are scaled twice, with values of c_mu that differ in
        # the last bit.
        negative = [weight / total for weight in weights_prime[mu:]]
        negative = [weight / -_sum(negative) for weight in negative]
        for mass in (0.25 + mu_eff + 1 / mu_eff - 2, 0.25 + mu_eff - 2 + 1 / mu_eff):
            c_mu = min(1 - c_1, 2 * mass / ((dim + 2) ** 2 + mu_eff))  # (58)
            negative = scaled(negative, 1 + c_1 / c_mu)
            squares = _sum([weight**2 for weight in negative])
            mu_eff_minus = _sum(negative) ** 2 / (squares or 1)
            for limit in ((1 - c_1 - c_mu) / c_mu / dim, 1 + 2 * mu_eff_minus / (mu_eff + 2)):
                if _sum(negative) < -limit:
                    negative = scaled(negative, limit)
        self._weights = np.array(positive)  # weights of the mean; their sum is 1
        self._mu_eff = mu_eff  # variance effective selection mass
        self._c_1 = c_1  # learning rate of the rank-one update
        self._c_c = (4 + mu_eff / dim) / (dim + (4 + 2 * mu_eff / dim))  # (56)
        self._c_sigma = min(0.5, (mu_eff + 2) / (dim + (mu_eff + 3)))  # (55)
        excess = max(1, 3 * (1 - 0.5 ** (dim / 9))) * ((mu_eff - 1) / (dim + 1)) ** 0.5 - 1
        self._d_sigma = 1 + 2 * max(0, excess) + self._c_sigma  # damping of the step size (55)
        # Weights of p_c and of all points in the update of the covariance: if h_sigma is 1, and if
        # it is 0.
        of_points = [c_mu * weight for weight in (*positive, *negative)]
        self._update_weights = np.array([c_1, *of_points])
        self._stalled_weights = np.array([c_1 * (1 - self._c_c * (2 - self._c_c)), *of_points])
        # Expected length of a standard normal vector, approximately if ``dim`` is above 100.
        if dim > 100:
            self._chi_n = dim**0.5 * (1 - 1 / (4 * dim) + 1 / (32 * dim**2))
        else:
            from scipy.special import gamma  # slow to import, and most commands do not need it

            self._chi_n = float(2**0.5 * gamma((dim + 1) / 2) / gamma(dim / 2))
        self._lazy_gap = 1 / (c_1 + c_mu) / dim / 10  # least generations between decompositions
        self._patience = int(100 + 100 * dim**1.5 / size)  # generations without improvement
        self._max_generations = 100 + 150 * (dim + 3) ** 2 // size**0.5

        self._rng = rng
        self._mean = mean.copy()
        self._first_sigma = self._sigma = float(sigma)
        # The covariance matrix C = B D² Bᵀ. It begins as almost the identity, with eigenvalues
        # that differ.
        self._C = np.diag(exp(1e-4 / dim * np.arange(dim)))
        self._D, self._B = np.diag(self._C) ** 0.5, np.eye(dim)
        self._p_c, self._p_sigma = np.zeros(dim), np.zeros(dim)  # evolution paths
        self._generation, self._decomposed_at = 0, 0
        self._moved_to, self._moved_at = self._mean, 0  # last shift of the mean, and its generation
        self._costs: Array = np.empty(0)  # of the last generation, lowest first
        # Histories with the newest entry first: best costs of the last generations, and best and
        # median costs of every fifth generation.
        self._best_costs: deque[float] = deque(maxlen=int(10 + 30 * dim / size))
        self._long_best: deque[float] = deque(maxlen=_HISTORY_LENGTH)
        self._long_median: deque[float] = deque(maxlen=_HISTORY_LENGTH)
        self._best, self._best_point = math.inf, 0  # least cost, and the number of its point
        # Length of the present series of generations whose best cost equals the upper quartile.
        self._flat_generations = 0

    @property
    def mean(self) -> Array:
        """Mean of the next generation, shape ``(dim,)``."""
        return self._mean.copy()

    @property
    def costs(self) -> Array:
        """Costs of the last generation, the lowest first, shape ``(size,)``.

        The array is empty before the first :meth:`tell`.
        """
        return self._costs

    def ask(self) -> Array:
        """Draw the points of the next generation.

        Returns
        -------
        ndarray, shape (size, dim)
            The points, one in each row.
        """
        if self._generation >= self._decomposed_at + self._lazy_gap:
            self._C = (self._C + self._C.T) / 2
            variances, axes = np.linalg.eigh(self._C)
            self._B = np.asfortranarray(axes)
            self._D = variances**0.5
            self._decomposed_at = self._generation
        z = self._rng.standard_normal((self.size, len(self._mean)))
        y: Array = np.dot(self._B, (self._D * z).T).T  # (38 to 40)
        return self._mean + self._sigma * y

    def tell(self, points: Array, costs: Array) -> None:
        """Update the mean, the covariance and the step size from the costs of a generation.

        Parameters
        ----------
        points : ndarray, shape (size, dim)
            The points of the last :meth:`ask`.
        costs : ndarray, shape (size,)
            Costs of the points, all finite. The strategy minimises the cost.
        """
        self._generation += 1
        self._note_costs(costs)
        points = points[np.argsort(costs)]
        old_mean, self._mean = self._mean, np.dot(self._weights, points[: self._mu])  # (41, 42)
        shift = self._mean - old_mean
        n = len(shift)

        # Path of the step size (43), in coordinates in which the points are standard normal.
        whitened = np.dot(self._B, np.dot(self._B.T, shift) / self._D)
        normalised = whitened * (self._mu_eff**0.5 / self._sigma)
        self._p_sigma *= 1 - self._c_sigma
        self._p_sigma += math.sqrt(self._c_sigma * (2 - self._c_sigma)) * normalised
        square = np.sum(self._p_sigma**2) / (1 - (1 - self._c_sigma) ** (2 * self._generation))
        h_sigma = square / n - 1 < 1 + 4 / (n + 1)

        # Path of the covariance (45). It stalls while the path of the step size is long.
        self._p_c = (1 - self._c_c) * self._p_c
        if h_sigma:
            factor = (self._c_c * (2 - self._c_c) * self._mu_eff) ** 0.5 / self._sigma
            self._p_c += factor * shift
            weights, path = self._update_weights, self._p_c
        else:
            weights = self._stalled_weights
            path = (self._c_1 / weights[0]) ** 0.5 * self._p_c
        # Points with negative weights count as if they had the expected length (46, 47).
        weights, rejected = weights.copy(), slice(1 + self._mu, None)
        vectors = np.vstack([path, (points - old_mean) / self._sigma])
        self._C *= 1 - weights.cumsum()[-1]
        scaled = np.matmul(self._B.T, vectors[rejected, :, None])[..., 0] / self._D
        squares = (scaled**2).cumsum(axis=1)[:, -1]  # added one by one, as the package does
        weights[rejected] *= [n / (square**0.5 + 1e-9) ** 2 for square in squares.tolist()]
        self._C += np.dot(weights * vectors.T, vectors)

        # Step size (44).
        length = np.sqrt(np.sum(np.square(self._p_sigma)))
        change = (length / self._chi_n - 1) * (self._c_sigma / self._d_sigma)
        self._sigma *= float(exp(min(max(change, -1), 1)))

        threshold = 20 + 0.1 * self._generation
        delta = _TOL_STAGNATION * max(1, (self._generation - self._moved_at) / threshold) ** 0.5
        if np.sum((self._moved_to - self._mean) ** 2) ** 0.5 > delta:
            self._moved_to, self._moved_at = self._mean, self._generation

    def _note_costs(self, costs: Array) -> None:
        """Add the costs of a generation to the histories that the stopping criteria use.

        ``costs`` has shape ``(size,)``, in the order in which the points were drawn.
        """
        least = int(np.argmin(costs))
        if costs[least] < self._best:
            self._best, self._best_point = float(costs[least]), self._generation * self.size
            self._best_point += least + 1 - self.size
        self._costs = ranked = np.sort(costs)
        self._best_costs.appendleft(float(ranked[0]))
        if self._generation % _HISTORY_STEP == 0:
            self._long_best.appendleft(ranked[0])
            self._long_median.appendleft(np.median(ranked))
        is_flat = not ranked[0] < ranked[int(0.75 * self.size)]
        self._flat_generations = self._flat_generations + 1 if is_flat else 0

    def has_ended(self) -> bool:
        """Return whether a stopping criterion is met; False before the first :meth:`tell`."""
        if not self._generation:
            return False
        deviations = self._sigma * np.sqrt(np.diag(self._C))
        smallest, largest = deviations.min(), deviations.max()
        cost_range = max(self._best_costs) - min(self._best_costs)
        axis = self._generation % len(self._mean)
        axis_step = 0.1 * self._sigma * self._D[axis] * self._B[:, axis]
        return bool(
            # Neither best nor median costs have improved for many generations.
            self._stagnates()
            # The best cost equalled the upper quartile in two generations in a row.
            or self._flat_generations > 1
            # Costs of this generation, and best costs of the last generations, hardly differ.
            or (self._costs[-1] - self._costs[0] < _TOL_FUN and cost_range < _TOL_FUN)
            # Best costs of ten or more generations hardly differ.
            or (len(self._best_costs) > 9 and cost_range < _TOL_FUN_HIST)
            # Standard deviations and the evolution path are too small.
            or (largest < _TOL_X and (self._sigma * self._p_c).max() < _TOL_X)
            # The mean has not moved for many generations.
            or self._generation - self._moved_at > 20 + 0.1 * self._generation
            # A fifth of a standard deviation does not change some coordinate of the mean.
            or (self._mean == self._mean + 0.2 * deviations).any()
            # A tenth of a standard deviation along a principal axis does not change the mean.
            or (self._mean == self._mean + axis_step).all()
            # Standard deviations have grown far beyond the first step size.
            or largest > self._first_sigma * _TOL_FACUPX
            # The variances of two coordinates are too far apart.
            or (largest / smallest) ** 2 >= _TOL_VARIANCES
            # The covariance matrix is ill-conditioned.
            or (self._D[-1] / self._D[0]) ** 2 >= _TOL_CONDITION
            # The number of generations has reached its limit.
            or self._generation >= self._max_generations
        )

    def _stagnates(self) -> bool:
        """Return whether best and median costs have not improved for many generations."""
        entries = len(self._long_best)
        recent = int(max(self._patience / 10, entries / 10))
        evaluations = self._generation * self.size
        if (
            self._generation <= len(self._mean) * (5 + 100 / self.size)
            or (evaluations - self._best_point) / self.size <= self._patience / 2
            or entries <= max(100, 2 * recent)
        ):
            return False
        return all(
            np.median(history[:recent]) >= np.median(history[recent : 2 * recent])
            for history in (list(self._long_median), list(self._long_best))
        )
