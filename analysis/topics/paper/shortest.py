"""The shortest path in joint space to a goal."""

from __future__ import annotations

import math

import numpy as np
from scipy import optimize

from coartic import Hand, Task
from coartic.analysis.signatures.manifold import movable
from coartic.analysis.statistics.estimates import SEED
from coartic.robot import Array


def shortest_reach(task: Task, q: Array, hand: Hand, goal: int, guess: Array) -> float:
    """Least joint-space distance from ``q`` to a configuration that hits a goal.

    ``goal`` counts from 1; ``guess`` is a configuration near one that hits it, shape
    ``(dof,)``. Sequential quadratic programming (Kraft 1988, scipy's SLSQP) on the joints
    that can move the hand, from ``guess`` and eight random starts about it: the best local minimum,
    so at least as long as the global one. Infinite where none is found. Length unit and rad
    mixed.
    """
    joints, centre = movable(task, hand), np.array(task.goals[goal - 1])

    def moved(change: Array) -> Array:
        result = q.copy()
        result[joints] += change
        return result

    def miss(change: Array) -> Array:
        return np.asarray(task.robot.forward_kinematics(moved(change), hand) - centre)

    def inside(change: Array) -> float:
        off = miss(change)
        return float(task.radius**2 - off @ off)

    def inside_gradient(change: Array) -> Array:
        jacobian = task.robot.jacobian(moved(change), hand)[:, joints]
        return np.asarray(-2 * miss(change) @ jacobian)

    first = (guess - q)[joints]
    rng = np.random.default_rng(SEED)
    best = math.inf
    for start in (first, *(first + rng.normal(0, 0.3, (8, len(joints))))):
        reach = optimize.minimize(
            lambda change: (change @ change, 2 * change),
            start,
            jac=True,
            method="SLSQP",
            constraints=[{"type": "ineq", "fun": inside, "jac": inside_gradient}],
            options={"ftol": 1e-12, "maxiter": 300},
        )
        if inside(reach.x) >= -1e-8:
            best = min(best, float(np.linalg.norm(reach.x)))
    return best
