"""A cascade of two prioritised quadratic programmes over changes x of the joints.

Level 1 finds the change x that violates an inequality task least, up to damping::

    min  s² + λ² |x|²     subject to   A x + s >= b,       |x_i| <= L
    s, x

Level 2 finds the change x that is nearest to the preferred change z. It may violate the task by at
most ε more than the solution of level 1 does::

    min  |x - z|²         subject to   A x >= b - s⁺ - ε,  |x_i| <= L
     x

Here A x >= b is the task, s is a slack variable that all rows of the task share, s⁺ = max(s, 0), λ
is ``DAMPING``, L is ``LIMIT`` and ε is ``SLACK``. The caller chooses the unit of length of A and b,
and the unit of x.

Inequality tasks in lexicographic quadratic programmes come from O. Kanoun, F. Lamiraux, P.-B.
Wieber (2011), Kinematic control of redundant manipulators: generalizing the task-priority framework
to inequality tasks, IEEE Transactions on Robotics. The solver is DAQP, which gets the matrices
directly. The tests state the same programmes in cvxpy, which takes far longer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coartic.method import MethodError
from coartic.robot import Array

DAMPING = 0.01
"""λ, in the caller's unit of length per unit of change. In directions in which the singular value
of A is 1, damping leaves about 1e-4 of the task undone. In directions in which the singular value
is near 0, damping keeps changes small."""

LIMIT = 2.0
"""L, the largest absolute change of a joint, in the caller's unit of change."""

SLACK = 1e-6
"""ε, in the caller's unit of length. Without this slack, the feasible set of level 2 could be a
single point when the limits of the changes bind."""


class Solution(NamedTuple):
    """Solutions of both levels of the cascade."""

    changes: Array
    """Changes of the joints that solve level 2, shape ``(joints,)``."""
    level_1: Array
    """Changes of the joints that solve level 1, shape ``(joints,)``."""
    iterations: int
    """Total number of iterations of the solver in both levels."""


def solve_cascade(rows: Array, least: Array, preferred: Array) -> Solution:
    """Solve both levels of the cascade of quadratic programmes.

    Parameters
    ----------
    rows : ndarray, shape (m, joints)
        Matrix A of the task.
    least : ndarray, shape (m,)
        Vector b of the task: lower bounds of A x.
    preferred : ndarray, shape (joints,)
        Preferred change z.

    Returns
    -------
    Solution

    Raises
    ------
    MethodError
        The solver fails.
    """
    joints = rows.shape[1]
    weights = np.diag([2.0] + [2.0 * DAMPING**2] * joints)
    level_1, iterations_1 = _solve_level(1, weights, np.zeros(1 + joints), rows, least)
    slack = max(0.0, float(level_1[0])) + SLACK
    weights = np.diag([2.0] * joints)
    changes, iterations_2 = _solve_level(2, weights, -2.0 * preferred, rows, least - slack)
    return Solution(changes, level_1[1:], iterations_1 + iterations_2)


def _solve_level(
    level: int, hessian: Array, gradient: Array, rows: Array, least: Array
) -> tuple[Array, int]:
    """Minimise ½ vᵀ H v + gᵀ v under the constraints of a level.

    H is ``hessian`` and g is ``gradient``; v is (s, x) at level 1 and x at level 2. ``least``
    contains the right-hand sides of the task's constraints. Return v and the number of iterations.
    Raises MethodError if the solver fails.
    """
    import daqp  # results are read without solvers

    task, joints = rows.shape
    matrix = np.zeros((task + 2 * joints, len(gradient)))
    matrix[:task, :-joints] = -1.0
    matrix[:task, -joints:] = -rows
    matrix[task:, -joints:] = np.vstack([np.eye(joints), -np.eye(joints)])
    free = np.full(len(gradient), np.inf)
    upper = np.concatenate([free, -least, np.full(2 * joints, LIMIT)])
    equal = np.zeros(len(upper), dtype=np.intc)
    lower = np.full(len(upper), -np.inf)
    x, _, flag, info = daqp.solve(hessian, gradient, matrix, upper, lower, equal)
    if flag != 1:
        raise MethodError("solver-failed", f"level {level}: DAQP ended with exit flag {flag}")
    return np.array(x, dtype=np.float64), info["iterations"]
