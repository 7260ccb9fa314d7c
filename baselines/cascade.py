"""A cascade of two prioritised quadratic programmes over changes x of the joints.

Level 1, an inequality task, as nearly as damping allows::

    min  s² + λ² |x|²     subject to   A x + s >= b,       |x_i| <= L
    s, x

Level 2, the change nearest to the preferred z among the changes that meet level 1 as nearly, to ε::

    min  |x - z|²         subject to   A x >= b - s⁺ - ε,  |x_i| <= L
     x

with λ = ``DAMPING``, L = ``LIMIT``, ε = ``SLACK`` and s⁺ = max(s, 0).

Inequality tasks in lexicographic quadratic programmes: O. Kanoun, F. Lamiraux, P.-B. Wieber (2011),
Kinematic control of redundant manipulators: generalizing the task-priority framework to inequality
tasks, IEEE Transactions on Robotics. The matrices go to the solver, DAQP, as they are: cvxpy, in
which the tests state the same programmes, takes far longer.
"""

from __future__ import annotations

from typing import NamedTuple

import daqp
import numpy as np

from coartic.method import MethodError
from coartic.robot import Array

DAMPING = 0.01
"""λ, length unit per unit of change: some 1e-4 of the task is given up where the singular value is
1, and changes stay small where it is 0."""

LIMIT = 2.0
"""L, largest absolute change of any joint."""

SLACK = 1e-6
"""ε, length unit: without it level 2 could be left with a single point where limits bind."""


class Solution(NamedTuple):
    """Solution of both levels."""

    changes: Array
    """Changes of the joints by both levels, shape ``(joints,)``."""
    first: Array
    """Changes that level 1 alone would make, shape ``(joints,)``."""
    iterations: int
    """Iterations of the solver in both levels."""


def solve_cascade(rows: Array, least: Array, preferred: Array) -> Solution:
    """Find changes x of the joints with A x >= b as nearly as damping allows, at most 2 in absolute
    value (level 1), then the x nearest to z that is as good for level 1, to 1e-6 (level 2); return
    both, with the iterations.

    ``rows`` is A, shape ``(m, joints)``, length unit per unit of change; ``least`` is b, shape
    ``(m,)``, length unit; ``preferred`` is z, shape ``(joints,)``. Raises MethodError if the solver
    fails.
    """
    joints = rows.shape[1]
    weights = np.diag([2.0] + [2.0 * DAMPING**2] * joints)
    first, count = _solve_level(1, weights, np.zeros(1 + joints), rows, least)
    short = max(0.0, float(first[0])) + SLACK
    weights = np.diag([2.0] * joints)
    changes, further = _solve_level(2, weights, -2.0 * preferred, rows, least - short)
    return Solution(changes, first[1:], count + further)


def _solve_level(
    level: int, hessian: Array, gradient: Array, rows: Array, least: Array
) -> tuple[Array, int]:
    """Minimise ½ vᵀ H v + gᵀ v (``hessian`` H, ``gradient`` g), v = (s, x) at level 1 and x at
    level 2, with A x + s >= b (``rows`` A, ``least`` b; s = 0 at level 2) and |x_i| <= 2; return v
    and the number of iterations. Raises MethodError, which names ``level``, if the solver fails."""
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
