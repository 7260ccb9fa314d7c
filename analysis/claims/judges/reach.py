"""The shortest way, in joint space, to bring a hand to one goal."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy import optimize

from analysis.signatures.manifold import movable
from coartic import Hand, Task
from coartic.robot import Array, Robot

STARTS = 8
"""Random starts of the search beside the given one."""
SPREAD = 0.3
"""SD of the random starts about the given one: length unit, rad."""


def shortest_reach(task: Task, q: Array, hand: Hand, goal: int, guess: Array, seed: int) -> float:
    """Least joint-space distance from ``q`` to a configuration that hits a goal.

    ``goal`` counts from 1; ``guess`` is a configuration near one that hits it, shape
    ``(dof,)``. Sequential quadratic programming (Kraft 1988, scipy's SLSQP) on the joints
    that can move the hand, from ``guess`` and random starts about it: the best local minimum,
    so at least as long as the global one. Infinite where none is found. Length unit and rad
    mixed.
    """
    joints = tuple(np.arange(task.robot.dof)[movable(task, hand)].tolist())
    given = tuple(q.tolist()), tuple(guess.tolist())
    return _shortest(task.robot, task.radius, task.goals[goal - 1], hand, joints, *given, seed)


@lru_cache(256)  # the same for every folder with the task
def _shortest(
    robot: Robot,
    radius: float,
    centre: tuple[float, float],
    hand: Hand,
    movable_joints: tuple[int, ...],
    before: tuple[float, ...],
    guess: tuple[float, ...],
    seed: int,
) -> float:
    joints, q = list(movable_joints), np.array(before)

    def moved(change: Array) -> Array:
        result = q.copy()
        result[joints] += change
        return result

    def miss(change: Array) -> Array:
        return np.asarray(robot.forward_kinematics(moved(change), hand) - centre)

    def inside(change: Array) -> float:
        off = miss(change)
        return float(radius**2 - off @ off)

    def inside_gradient(change: Array) -> Array:
        jacobian = robot.jacobian(moved(change), hand)[:, joints]
        return np.asarray(-2 * miss(change) @ jacobian)

    first = (np.array(guess) - q)[joints]
    rng = np.random.default_rng(seed)
    best = math.inf
    for start in (first, *(first + rng.normal(0, SPREAD, (STARTS, len(joints))))):
        found = optimize.minimize(
            lambda change: (change @ change, 2 * change),
            start,
            jac=True,
            method="SLSQP",
            constraints=[{"type": "ineq", "fun": inside, "jac": inside_gradient}],
            options={"ftol": 1e-12, "maxiter": 300},
        )
        if inside(found.x) >= -1e-8:
            best = min(best, float(np.linalg.norm(found.x)))
    return best
