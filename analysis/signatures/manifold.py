"""Split posture differences into parts that move the hand and parts that do not.

The Jacobian of the hand divides joint space into its nullspace, in which displacements
leave the hand where it is to first order (the uncontrolled manifold, linearised), and the
orthogonal complement, in which they move it. Length unit and rad count alike.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg

from coartic import Hand, Task
from coartic.robot import Array


def movable(task: Task, hand: Hand) -> Array:
    """Indices of the joints that can move a hand: unlocked base coordinates, its arm."""
    base = [k for k, name in enumerate("xy") if name not in task.locked_base]
    return np.array([*base, *np.arange(task.robot.dof)[task.robot.joints(hand)]])


def motor_equivalence(difference: Array, jacobian: Array) -> tuple[float, float]:
    """The motor-equivalent and the other part of a difference between configurations.

    ``difference`` has shape ``(k,)``, length unit and rad mixed; ``jacobian`` ``(2, k)``, of the
    joints that can move. Each part, ≥ 0, is its length
    over the root of the dimension of its space, so that a difference in a random direction has
    equal parts. A difference between contexts is motor-equivalent where the first exceeds the
    second: the same subgoal reached by another posture. Caveat: hits of one disc bound the
    second part, and nothing bounds the first. NaN for a space of dimension 0. Source: Mattos,
    Latash and colleagues, Experimental Brain Research (doi:10.1007/s00221-015-4327-4,
    10.1007/s00221-018-5215-5).
    """
    equivalent, other = (
        float(np.linalg.norm(basis.T @ difference)) / math.sqrt(basis.shape[1] or math.nan)
        for basis in (linalg.null_space(jacobian), linalg.orth(jacobian.T))
    )
    return equivalent, other
