"""What differs and varies in joint space, by whether the hand feels it.

The Jacobian of the hand divides joint space into its nullspace, in which displacements
leave the hand where it is to first order (the uncontrolled manifold, linearised), and the
orthogonal complement, in which they move it. Length unit and rad count alike.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg, stats

from coartic import Hand, Task
from coartic.analysis.statistics.estimates import Interval, standard_deviation, student
from coartic.robot import Array

_PROJECTED = 1e-24
"""Sum of squares that rounding alone leaves of a projection."""


def movable(task: Task, hand: Hand) -> Array:
    """Indices of the joints that can move a hand: unlocked base coordinates, its arm."""
    base = [k for k, name in enumerate("xy") if name not in task.locked_base]
    return np.array([*base, *np.arange(task.robot.dof)[task.robot.joints(hand)]])


def jacobian_of(task: Task, hand: Hand, configurations: Array) -> tuple[Array, Array]:
    """Joints that can move a hand, and its Jacobian in these, ``(2, k)``, at the mean posture."""
    joints = movable(task, hand)
    return joints, task.robot.jacobian(configurations.mean(axis=0), hand)[:, joints]


def subspaces(jacobian: Array) -> tuple[Array, Array]:
    """Orthonormal bases of nullspace and of its complement, ``(k, d)`` each.

    ``jacobian`` has shape ``(2, k)``: the columns of the joints that can move.
    """
    return linalg.null_space(jacobian), linalg.orth(jacobian.T)


def motor_equivalence(difference: Array, jacobian: Array) -> tuple[float, float]:
    """Of a difference between configurations, the motor-equivalent and the other part.

    ``difference`` has shape ``(k,)``, length unit and rad mixed. Each part, ≥ 0, is its length
    over the root of the dimension of its space, so that a difference in a random direction has
    equal parts. A difference between contexts is motor-equivalent where the first exceeds the
    second: the same subgoal reached by another posture. Caveat: hits of one disc bound the
    second part, and nothing bounds the first. NaN for a space of dimension 0. Source: Mattos,
    Latash and colleagues, Experimental Brain Research (doi:10.1007/s00221-015-4327-4,
    10.1007/s00221-018-5215-5).
    """
    equivalent, other = (
        float(np.linalg.norm(basis.T @ difference)) / math.sqrt(basis.shape[1] or math.nan)
        for basis in subspaces(jacobian)
    )
    return equivalent, other


class Synergy(NamedTuple):
    """Variance across runs within and orthogonal to the uncontrolled manifold."""

    within: float
    """V_ucm: variance in the nullspace per dimension, ≥ 0, squared units."""
    orthogonal: float
    """V_ort: variance in its complement per dimension."""
    delta: float
    """ΔV = (V_ucm - V_ort) / V_tot, from -n/d_ort to n/d_ucm."""
    neutral: float
    """z where both variances are equal, ½ ln(d_ucm/d_ort)."""
    z: Interval
    """Fisher-like transform of ΔV, -∞ to ∞, with its jackknife interval where that has anything
    to go by, and the two-sided test of ``neutral``."""


def synergy(configurations: Array, jacobian: Array) -> Synergy:
    """Uncontrolled-manifold variance ratio at one moment, over runs.

    ``configurations`` has shape ``(runs, k)``, ``jacobian`` ``(2, k)``, taken at their
    mean; V_tot is the variance per dimension of all n = d_ucm + d_ort. ΔV > 0 (z above
    ``neutral``): runs vary more in directions that do not move the hand (Scholz & Schöner
    1999). ΔV is bounded and skewed, so z = ½ ln[(n/d_ort + ΔV) / (n/d_ucm - ΔV)] is used for
    inference (Verrel 2010); it equals ½ ln(V_ucm/V_ort) + ½ ln(d_ucm/d_ort). Its interval and
    test are the jackknife's, with Student's t and runs - 1 degrees of freedom (Miller 1974):
    they allow correlated joints and unequal variances within either space; with markedly
    skewed scatter about 7 % of nulls are rejected at 5 %.

    All NaN below two runs, for a space of dimension 0 and where runs do not differ, or differ
    in one of the spaces only. No interval and no test where they differ along one line (as any
    two do): without whichever run, z is the same. Caveat: a hit confines the hand to the goal's
    disc, so some ΔV > 0 comes from the task's geometry alone; compare methods, and less so with
    zero.
    """
    null, complement = subspaces(jacobian)
    free, bound = null.shape[1], complement.shape[1]
    n = len(configurations)
    parts = [configurations @ basis for basis in (null, complement)]
    sums = [float(((part - part.mean(axis=0)) ** 2).sum()) for part in parts]
    if min(sums) <= _PROJECTED:
        return Synergy(math.nan, math.nan, math.nan, math.nan, Interval(math.nan))
    within, orthogonal = sums[0] / (n - 1) / free, sums[1] / (n - 1) / bound
    delta = (within - orthogonal) * (free + bound) / (free * within + bound * orthogonal)
    z = 0.5 * math.log(sums[0] / sums[1])
    neutral = 0.5 * math.log(free / bound)
    untested = Synergy(within, orthogonal, delta, neutral, Interval(z))
    # From a run, not from the mean, which rounding takes off the line that two postures make.
    lines = np.linalg.matrix_rank(configurations - configurations[0])
    left = [_leave_one_out(part, total) for part, total in zip(parts, sums, strict=True)]
    if lines < 2 or min(map(np.min, left)) <= _PROJECTED:
        return untested
    pseudo = n * z - (n - 1) * 0.5 * np.log(left[0] / left[1])
    # About the full sample's z, not the pseudo-values' mean, so that the interval holds it.
    error = standard_deviation(pseudo) / math.sqrt(n)
    if not error:
        return untested
    p = 2.0 * float(stats.t.sf(abs(z - neutral) / error, n - 1))
    return untested._replace(z=student(z, error, n - 1, p))


def _leave_one_out(part: Array, total: float) -> Array:
    """Sum of squares about the mean without each of the runs in turn; 0 for its rounding."""
    n = len(part)
    squares = ((part - part.mean(axis=0)) ** 2).sum(axis=1)
    rest: Array = total - squares * n / (n - 1)
    return np.where(rest > n * np.finfo(np.float64).eps * total, rest, 0.0)
