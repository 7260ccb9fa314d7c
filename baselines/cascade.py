"""A cascade of two prioritised quadratic programs over joint rates.

Level 1 follows the hand: ``min |J x - v|^2 + λ^2 |x|^2``. Level 2 takes, of all rates
that move the hand just so, those nearest to the preferred ones: ``min |x - z|^2``
subject to ``J x = J x_1``. Both keep every joint within ``LIMIT``. Rates ``x`` are in
units of the joint step m per tick, so that a rate of norm 1 is a full step.

Lexicographic quadratic programs: O. Kanoun, F. Lamiraux, P.-B. Wieber (2011), Kinematic
control of redundant manipulators, IEEE Transactions on Robotics. Without limits the
answer is :func:`damped_projection`, which the tests check.
"""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any, Literal

import numpy as np

from coartic.errors import CoarticError
from coartic.robot import Array

SolverName = Literal["clarabel", "daqp", "osqp", "proxqp"]

DAMPING = 0.01
"""λ, length unit per unit rate: 1e-4 of the hand's rate is given up where the smallest
singular value of J is 1, and rates stay bounded where it is 0."""

LIMIT = 2.0
"""Largest rate of any joint. Level 1 is asked for a full step (norm 1) and level 2 adds to
it; only their sum is scaled to the step. With a limit of 1, a hand carried by the base at
full speed would leave level 2 nothing (next goal on ascending: -318 where 2 gives -304)."""

SETTINGS: dict[SolverName, dict[str, Any]] = {
    # Tighter than their defaults, which are seen in the rates (up to 1e-5).
    "clarabel": {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11},
    "daqp": {},
    "osqp": {
        "eps_abs": 1e-9,
        "eps_rel": 1e-9,
        "max_iter": 50_000,
        "adaptive_rho_interval": 50,  # by iterations: by time, results would depend on it
    },
    "proxqp": {"eps_abs": 1e-11, "eps_rel": 0.0},
}


class CascadeError(CoarticError):
    """A solver did not solve a level; the message says which and why."""


class Cascade:
    """Both levels for robots with ``joints`` joints that may move, built once.

    The programs are parametrised under cvxpy's DPP rules: each solve only fills in
    numbers. ``iterations`` and ``solves`` count up; nothing else is kept between solves.
    """

    def __init__(self, joints: int, solver: SolverName) -> None:
        import cvxpy as cp  # slow to import, and no other method needs it

        self.solver = solver
        self.iterations = self.solves = 0
        self.solver_s = 0.0
        """Time that the solvers themselves report, s; ProxQP reports none."""
        self._jacobian = cp.Parameter((2, joints))
        self._rate = cp.Parameter(2)
        self._preferred = cp.Parameter(joints)
        self._x = x = cp.Variable(joints)
        limits = [x <= LIMIT, x >= -LIMIT]
        follow = cp.sum_squares(self._jacobian @ x - self._rate)
        self._levels = (
            cp.Problem(cp.Minimize(follow + DAMPING**2 * cp.sum_squares(x)), limits),
            cp.Problem(
                cp.Minimize(cp.sum_squares(x - self._preferred)),
                [self._jacobian @ x == self._rate, *limits],
            ),
        )
        # cvxpy compiles at the first solve.
        self.solve(np.eye(2, joints), np.zeros(2), np.zeros(joints))
        self.iterations, self.solves, self.solver_s = 0, 0, 0.0

    def solve(self, jacobian: Array, rate: Array, preferred: Array | None = None) -> Array:
        """Joint rates, shape ``(joints,)``.

        ``jacobian`` (2, joints) in length unit per unit rate, ``rate`` (2,) of the hand,
        ``preferred`` (joints,) rates of level 2; None leaves it out, and level 1 alone
        gives the least rates. Raises CascadeError where a solver fails.
        """
        self._jacobian.value = jacobian
        self._rate.value = rate
        rates = self._solve(1)
        if preferred is not None:
            self._rate.value = jacobian @ rates  # level 1's optimum, now an equality
            self._preferred.value = preferred
            rates = self._solve(2)
        return rates

    def _solve(self, level: Literal[1, 2]) -> Array:
        import cvxpy as cp

        problem = self._levels[level - 1]
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
        statistics = problem.solver_stats
        self.iterations += statistics.num_iters or 0
        self.solver_s += statistics.solve_time or 0.0
        if problem.status != cp.OPTIMAL:
            raise CascadeError(f"level {level}: {self.solver} ended {problem.status}")
        return np.array(self._x.value, dtype=np.float64)


@cache
def cascade_for(joints: int, solver: SolverName) -> Cascade:
    """The one cascade of this process for so many joints and this solver."""
    return Cascade(joints, solver)


def damped_projection(
    jacobian: Array, rate: Array, preferred: Array, damping: float = DAMPING
) -> Array:
    """What the cascade gives where no limit is active, in closed form.

    ``J^T (J J^T + λ^2 I)^-1 v + (I - J^+ J) z``; shapes as for :meth:`Cascade.solve`.
    Sources: Liegeois (1977) for the projection, Nakamura & Hanafusa (1986) for the
    damping.
    """
    gram = jacobian @ jacobian.T + damping**2 * np.eye(len(jacobian))
    follow = jacobian.T @ np.linalg.solve(gram, rate)
    rest: Array = follow + preferred - np.linalg.pinv(jacobian) @ (jacobian @ preferred)
    return rest
