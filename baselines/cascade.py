"""A cascade of two prioritised quadratic programs over changes of the joints.

Level 1 is an inequality task: ``rows @ x >= least`` as nearly as it can be had, ``min s^2 +
λ^2 |x|^2`` subject to ``rows @ x + s >= least``. Level 2 takes, of all changes that fall
short of it no more than that, the one nearest to the preferred: ``min |x - z|^2`` subject to
``rows @ x >= least - s``. Both keep every joint within ``LIMIT``.

Inequality tasks in lexicographic quadratic programs: O. Kanoun, F. Lamiraux, P.-B. Wieber
(2011), Kinematic control of redundant manipulators: generalizing the task-priority framework
to inequality tasks, IEEE Transactions on Robotics.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import sparse

from coartic.errors import CoarticError
from coartic.robot import Array

SolverName = Literal["clarabel", "daqp"]

DAMPING = 0.01
"""λ, length unit per unit of change: 1e-4 of what level 1 asks is given up where the singular
value is 1, and changes stay bounded where it is 0."""

LIMIT = 2.0
"""Largest change of any joint; where it binds, level 1 falls short."""

SETTINGS: dict[SolverName, dict[str, Any]] = {
    # Tighter than their defaults, which are seen in the changes (up to 1e-5).
    "clarabel": {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11},
    "daqp": {},
}

SLACK = 1e-6
"""Length unit, added to level 1's shortfall: where limits bind, level 2 has more than a point."""


class CascadeError(CoarticError):
    """A solver did not solve a level; the message says which and why."""


class Program(NamedTuple):
    """A quadratic program: min ½ x'Px + g'x subject to Ax <= upper."""

    hessian: Array
    """P, diagonal, shape ``(n, n)``."""
    gradient: Array
    rows: Array
    """A, shape ``(m, n)``: the task's, then the limits of the changes."""
    upper: Array

    @classmethod
    def of(cls, slacks: int, weight: float, task: int, joints: int) -> Program:
        """Of ``slacks`` (0 or 1), which come first, and changes of a ``weight``."""
        size = slacks + joints
        rows = np.zeros((task + 2 * joints, size))
        rows[:task, :slacks] = -1.0
        rows[task:, slacks:] = np.vstack([np.eye(joints), -np.eye(joints)])
        return cls(
            hessian=np.diag([2.0] * slacks + [2.0 * weight] * joints),
            gradient=np.zeros(size),
            rows=rows,
            upper=np.full(len(rows), LIMIT),
        )

    def demand(self, rows: Array, least: Array) -> None:
        """Fill in the task: ``rows @ x`` is at least this, less the slack."""
        task, joints = rows.shape
        self.rows[:task, -joints:] = -rows
        self.upper[:task] = -least


Solved = tuple[Array, int, str]
"""What a solver says: variables, iterations, and why they are no optimum; empty where they are."""


class Cascade:
    """Both levels for so many ``rows`` of a task and ``joints`` that may move, built once.

    Each solve only fills in numbers. ``iterations`` and ``solves`` count up; nothing else is
    kept between solves.
    """

    def __init__(self, rows: int, joints: int, solver: SolverName) -> None:
        self.solver = solver
        self.iterations = self.solves = 0
        self._reach = Program.of(1, DAMPING**2, rows, joints)
        self._prefer = Program.of(0, 1.0, rows, joints)

    def solve(self, rows: Array, least: Array, preferred: Array) -> Array:
        """Changes of the joints, shape ``(joints,)``.

        ``rows`` (rows, joints) in length unit per unit of change, ``least`` (rows,) what they
        are to add up to, ``preferred`` (joints,) the changes of level 2. Raises CascadeError
        where a solver fails.
        """
        self._reach.demand(rows, least)
        short = max(0.0, float(self.solve_level(1, self._reach)[0])) + SLACK
        self._prefer.demand(rows, least - short)
        self._prefer.gradient[:] = -2.0 * preferred
        return self.solve_level(2, self._prefer)

    def solve_level(self, level: Literal[1, 2], program: Program) -> Array:
        """The variables of a level. Raises CascadeError where the solver fails."""
        try:
            x, iterations, failure = _SOLVERS[self.solver](program, SETTINGS[self.solver])
        except ValueError as error:  # of what is no number
            raise CascadeError(f"level {level}: {self.solver} failed: {error}") from None
        self.solves += 1
        self.iterations += iterations
        if failure:
            raise CascadeError(f"level {level}: {self.solver} ended {failure}")
        return np.array(x, dtype=np.float64)


def solve_by_daqp(program: Program, settings: dict[str, Any]) -> Solved:
    """A program solved by DAQP."""
    import daqp

    hessian, gradient, rows, upper = program
    free = np.full(len(gradient), np.inf)
    x, _, flag, info = daqp.solve(
        hessian,
        gradient,
        rows,
        np.concatenate([free, upper]),
        np.full(len(free) + len(upper), -np.inf),
        np.zeros(len(free) + len(upper), dtype=np.intc),
        **settings,
    )
    return x, info["iterations"], "" if flag == 1 else f"with exit flag {flag}"


def solve_by_clarabel(program: Program, settings: dict[str, Any]) -> Solved:
    """A program solved by Clarabel."""
    import clarabel

    hessian, gradient, rows, upper = program
    chosen = clarabel.DefaultSettings()
    for name, value in {"verbose": False, **settings}.items():
        setattr(chosen, name, value)
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(hessian),
        gradient,
        sparse.csc_matrix(rows),
        upper,
        [clarabel.NonnegativeConeT(len(rows))],
        chosen,
    ).solve()
    status = str(solution.status)
    return np.array(solution.x), solution.iterations, "" if status == "Solved" else status


_SOLVERS: dict[SolverName, Callable[[Program, dict[str, Any]], Solved]] = {
    "clarabel": solve_by_clarabel,
    "daqp": solve_by_daqp,
}
