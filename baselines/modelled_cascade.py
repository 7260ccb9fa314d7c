"""The cascade of two quadratic programs as cvxpy states it.

The levels are written here as they are defined; :mod:`baselines.cascade` has the same programs as
numbers, which saves 63 to 95 % of the time (``python -m benchmarks.qp_solvers``).
"""

from __future__ import annotations

import warnings

import cvxpy as cp
import numpy as np

from baselines.cascade import DAMPING, LIMIT, SETTINGS, Cascade, CascadeError, SolverName
from coartic.robot import Array


class ModelledCascade(Cascade):
    """Both levels, parametrised under cvxpy's DPP rules and compiled once."""

    def __init__(self, joints: int, solver: SolverName) -> None:
        super().__init__(joints, solver)
        self._jacobian = cp.Parameter((2, joints))
        self._rate = cp.Parameter(2)
        self._preferred = cp.Parameter(joints)
        self._x = x = cp.Variable(joints)
        limits = [x <= LIMIT, x >= -LIMIT]
        follow = cp.sum_squares(self._jacobian @ x - self._rate)
        self.levels = (
            cp.Problem(cp.Minimize(follow + DAMPING**2 * cp.sum_squares(x)), limits),
            cp.Problem(
                cp.Minimize(cp.sum_squares(x - self._preferred)),
                [self._jacobian @ x == self._rate, *limits],
            ),
        )
        # cvxpy compiles at the first solve.
        self.solve(np.eye(2, joints), np.zeros(2), np.zeros(joints))
        self.iterations = self.solves = 0

    def solve(self, jacobian: Array, rate: Array, preferred: Array | None = None) -> Array:
        """As :meth:`baselines.cascade.Cascade.solve`."""
        self._jacobian.value = jacobian
        self._rate.value = rate
        rates = self._state(1)
        if preferred is not None:
            self._rate.value = jacobian @ rates  # level 1's optimum, now an equality
            self._preferred.value = preferred
            rates = self._state(2)
        return rates

    def _state(self, level: int) -> Array:
        problem = self.levels[level - 1]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of what the status says
                problem.solve(
                    solver=self.solver.upper(),
                    warm_start=False,  # or earlier problems would leave their mark
                    **SETTINGS[self.solver],
                )
        except cp.SolverError as error:
            raise CascadeError(f"level {level}: {self.solver} failed: {error}") from None
        self.solves += 1
        self.iterations += problem.solver_stats.num_iters or 0
        if problem.status != cp.OPTIMAL:
            raise CascadeError(f"level {level}: {self.solver} ended {problem.status}")
        return np.array(self._x.value, dtype=np.float64)
