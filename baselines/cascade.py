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

from collections.abc import Callable
from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import sparse

from coartic.errors import CoarticError
from coartic.robot import Array

SolverName = Literal["clarabel", "daqp", "osqp", "proxqp"]
Modelling = Literal["cvxpy", "none"]

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


class Program(NamedTuple):
    """A quadratic program: min ½ x'Px subject to lower <= Ax <= upper.

    The variables are what is to be least (the error of the hand, or of the rates) and then
    the rates. So a problem changes only A and the bounds of its first rows, the equalities,
    as when a modelling language states it.
    """

    hessian: Array
    """P, diagonal, shape ``(n, n)``."""
    rows: Array
    """A, shape ``(m, n)``."""
    lower: Array
    upper: Array
    equalities: int
    """Rows of equalities; the others keep the rates within ``LIMIT``."""

    @classmethod
    def of(cls, errors: Array, weight: float, joints: int) -> Program:
        """A program of ``errors`` (rows, errors), and rates with a ``weight``."""
        equalities, size = errors.shape
        limits = np.vstack([np.eye(joints), -np.eye(joints)])
        rows = np.zeros((equalities + 2 * joints, size + joints))
        rows[:equalities, :size] = errors
        rows[equalities:, size:] = limits
        return cls(
            hessian=np.diag([2.0] * size + [2.0 * weight] * joints),
            rows=rows,
            lower=np.repeat([0.0, -np.inf], [equalities, 2 * joints]),
            upper=np.repeat([0.0, LIMIT], [equalities, 2 * joints]),
            equalities=equalities,
        )

    def demand(self, first: int, rates: Array, value: Array) -> None:
        """Fill in equalities from row ``first``: what the rates add up to, less the errors."""
        rows = slice(first, first + len(value))
        self.rows[rows, -rates.shape[1] :] = rates
        self.lower[rows] = self.upper[rows] = value


class Solved(NamedTuple):
    """What a solver says."""

    optimal: bool
    status: str
    variables: Array
    iterations: int


class Cascade:
    """Both levels for robots with ``joints`` joints that may move, built once.

    Each solve only fills in numbers. ``iterations`` and ``solves`` count up; nothing else is
    kept between solves.
    """

    def __init__(self, joints: int, solver: SolverName) -> None:
        self.solver = solver
        self.iterations = self.solves = 0
        self._unit = np.eye(joints)
        self._follow = Program.of(-np.eye(2), DAMPING**2, joints)
        self._prefer = Program.of(-np.eye(joints + 2, joints), 0.0, joints)

    def solve(self, jacobian: Array, rate: Array, preferred: Array | None = None) -> Array:
        """Joint rates, shape ``(joints,)``.

        ``jacobian`` (2, joints) in length unit per unit rate, ``rate`` (2,) of the hand,
        ``preferred`` (joints,) rates of level 2; None leaves it out, and level 1 alone
        gives the least rates. Raises CascadeError where a solver fails.
        """
        self._follow.demand(0, jacobian, rate)
        rates = self._solve(1, self._follow)
        if preferred is not None:
            self._prefer.demand(0, self._unit, preferred)
            self._prefer.demand(len(preferred), jacobian, jacobian @ rates)  # as level 1 has it
            rates = self._solve(2, self._prefer)
        return rates

    def _solve(self, level: Literal[1, 2], program: Program) -> Array:
        try:
            found = _SOLVERS[self.solver](program, SETTINGS[self.solver])
        except ValueError as error:  # of what is no number
            raise CascadeError(f"level {level}: {self.solver} failed: {error}") from None
        self.solves += 1
        self.iterations += found.iterations
        if not found.optimal:
            raise CascadeError(f"level {level}: {self.solver} ended {found.status}")
        return np.array(found.variables[-len(self._unit) :], dtype=np.float64)


def _daqp(program: Program, settings: dict[str, Any]) -> Solved:
    import daqp

    hessian, rows, lower, upper, equalities = program
    free = np.full(len(hessian), np.inf)
    sense = np.zeros(len(free) + len(rows), dtype=np.intc)
    sense[len(free) : len(free) + equalities] = 5  # an equality
    proximal = 0.0 if hessian.diagonal().all() else 1e-5  # steps, where P is singular
    x, _, flag, info = daqp.solve(
        hessian,
        np.zeros(len(free)),
        rows,
        np.concatenate([free, upper]),
        np.concatenate([-free, lower]),
        sense,
        **{"eps_prox": proximal, **settings},
    )
    return Solved(flag == 1, f"with exit flag {flag}", x, info["iterations"])


def _clarabel(program: Program, settings: dict[str, Any]) -> Solved:
    import clarabel

    hessian, rows, _, upper, equalities = program
    chosen = clarabel.DefaultSettings()
    for name, value in {"verbose": False, **settings}.items():
        setattr(chosen, name, value)
    limits = len(rows) - equalities
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(hessian),
        np.zeros(len(hessian)),
        sparse.csc_matrix(rows),
        upper,
        [clarabel.ZeroConeT(equalities), clarabel.NonnegativeConeT(limits)],
        chosen,
    ).solve()
    status = str(solution.status)
    return Solved(status == "Solved", status, np.array(solution.x), solution.iterations)


def _osqp(program: Program, settings: dict[str, Any]) -> Solved:
    import osqp

    hessian, rows, lower, upper, _ = program
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(hessian),
        np.zeros(len(hessian)),
        sparse.csc_matrix(rows),
        lower,
        upper,
        **{"verbose": False, "polishing": True, **settings},
    )
    found = solver.solve(raise_error=False)
    optimal = found.info.status_val == osqp.SolverStatus.OSQP_SOLVED
    return Solved(optimal, found.info.status, found.x, found.info.iter)


def _proxqp(program: Program, settings: dict[str, Any]) -> Solved:
    from proxsuite import proxqp

    hessian, rows, lower, upper, equalities = program
    solver = proxqp.dense.QP(len(hessian), equalities, len(rows) - equalities)
    for name, value in settings.items():
        setattr(solver.settings, name, value)
    solver.init(
        hessian,
        np.zeros(len(hessian)),
        rows[:equalities],
        upper[:equalities],
        rows[equalities:],
        lower[equalities:],
        upper[equalities:],
    )
    solver.solve()
    found = solver.results
    optimal = found.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
    return Solved(optimal, found.info.status.name, found.x, int(found.info.iter))


_SOLVERS: dict[SolverName, Callable[[Program, dict[str, Any]], Solved]] = {
    "clarabel": _clarabel,
    "daqp": _daqp,
    "osqp": _osqp,
    "proxqp": _proxqp,
}


@cache
def cascade_for(joints: int, solver: SolverName, modelling: Modelling = "none") -> Cascade:
    """The one cascade of this process for so many joints, this solver and statement."""
    if modelling == "none":
        return Cascade(joints, solver)
    from baselines.modelled_cascade import ModelledCascade  # cvxpy is slow to import

    return ModelledCascade(joints, solver)


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
