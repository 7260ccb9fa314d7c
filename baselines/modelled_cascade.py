"""The cascade of two quadratic programs as cvxpy states it.

The levels are written here as they are defined; :mod:`coartic.baselines.cascade` has the same
programs as
numbers, which saves 94 to 99 % of the time.
"""

from __future__ import annotations

import warnings

import cvxpy as cp
import numpy as np

from coartic.baselines.cascade import DAMPING, LIMIT, SLACK, Cascade, CascadeError
from coartic.robot import Array


class ModelledCascade(Cascade):
    """Both levels, parametrised under cvxpy's DPP rules and compiled once."""

    def __init__(self, rows: int, joints: int) -> None:
        super().__init__(rows, joints)
        self._rows = cp.Parameter((rows, joints))
        self._least = cp.Parameter(rows)
        self._preferred = cp.Parameter(joints)
        self._s = s = cp.Variable()
        self._x = x = cp.Variable(joints)
        limits = [x <= LIMIT, x >= -LIMIT]
        done = self._rows @ x
        self.levels = (
            cp.Problem(
                cp.Minimize(cp.square(s) + DAMPING**2 * cp.sum_squares(x)),
                [done + s >= self._least, *limits],
            ),
            cp.Problem(  # |x - z|^2 without its constant
                cp.Minimize(cp.sum_squares(x) - 2 * self._preferred @ x),
                [done >= self._least, *limits],
            ),
        )
        # cvxpy compiles at the first solve.
        self.solve(np.eye(rows, joints), np.zeros(rows), np.zeros(joints))
        self.iterations = self.solves = 0

    def solve(self, rows: Array, least: Array, preferred: Array) -> Array:
        """As :meth:`coartic.baselines.cascade.Cascade.solve`."""
        self._rows.value = rows
        self._least.value = least
        self.solve_stated(1)
        self._least.value = least - (max(0.0, float(self._s.value)) + SLACK)
        self._preferred.value = preferred
        self.solve_stated(2)
        return np.array(self._x.value, dtype=np.float64)

    def solve_stated(self, level: int) -> None:
        """Solve a level as cvxpy states it. Raises CascadeError."""
        problem = self.levels[level - 1]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of what the status says
                problem.solve(
                    solver=cp.DAQP,
                    warm_start=False,  # or earlier problems would leave their mark
                )
        except cp.SolverError as error:
            raise CascadeError(f"level {level}: DAQP failed: {error}") from None
        self.solves += 1
        self.iterations += problem.solver_stats.num_iters or 0
        if problem.status != cp.OPTIMAL:
            raise CascadeError(f"level {level}: DAQP ended {problem.status}")
