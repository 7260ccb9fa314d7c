"""Movement of joints that cost more than others: path lengths with a weight for each joint."""

from __future__ import annotations

from typing import Literal

import numpy as np

from coartic.robot import BASE_DOF, Array, Robot

CostlyJoints = Literal["none", "base", "arms", "left-arm", "right-arm"]


def joint_costs(robot: Robot, costly: CostlyJoints, factor: float) -> Array:
    """What each entry of ``q`` costs, shape ``(dof,)``: ``factor`` for those that are costly,
    1 for the others."""
    costs = np.ones(robot.dof)
    if costly == "base":
        costs[:BASE_DOF] = factor
    elif costly == "arms":
        costs[BASE_DOF:] = factor
    elif costly != "none":
        costs[robot.joints("left" if costly == "left-arm" else "right")] = factor
    return costs


def segment_lengths(configurations: Array, costs: Array | float = 1.0) -> Array:
    """Weighted distances from each configuration ``(k, dof)`` to the next, shape ``(k - 1,)``.

    Euclidean in joint space, where a joint that costs 3 counts as if it had moved three times
    as far. Over all rows of a :class:`~coartic.motion.ticks.Trajectory` they add up to the
    weighted path length of what was executed.
    """
    changes = np.diff(configurations, axis=0) * costs
    return np.asarray(np.sqrt((changes**2).sum(axis=1)))
