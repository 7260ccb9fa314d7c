"""Locus slopes: how the posture at one goal follows a neighbouring goal that moves.

In speech, a locus equation regresses the onset of a consonant's formant transition on the
vowel that follows; its slope is taken to measure how far the vowel is anticipated (Lindblom 1963;
Sussman, McCaffrey & Matthews 1991). Here the posture at goal g is regressed on the position
of goal g + 1 (anticipatory) or g - 1 (carry-over), over tasks that differ in that goal only.

What is regressed is the mean posture at each position, whatever number of runs is behind it:
runs of one task share its posture's departure from a straight line, so that they are no
independent evidence of the slope.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.cluster.hierarchy import DisjointSet

from coartic import Task
from coartic.analysis.signatures.context import p_value
from coartic.analysis.statistics.estimates import RESAMPLES, Estimate, centred, student, varies
from coartic.robot import Array
from coartic.tasks.optima import KEPT

LEAST = 3
"""Positions of a goal that make it a moved one."""


class MovedGoal(NamedTuple):
    """Tasks that differ in one goal alone."""

    goal: int
    """Its number, from 1."""
    positions: dict[str, float]
    """Its position in each task, by name, along the line that it moves on, length unit, from the
    tasks' mean. The line is the first principal axis, pointing right (or up): the coordinate itself
    where only one changes."""


def moved_goals(tasks: Mapping[str, Task]) -> list[MovedGoal]:
    """The largest sets of at least three tasks that are the same but for one goal."""
    moved = []
    groups: dict[tuple[int, str], list[str]] = {}
    for name, task in tasks.items():
        shared = task.model_dump_json(include={*KEPT})
        for index in range(len(task.goals)):
            others = task.goals[:index] + task.goals[index + 1 :]
            groups.setdefault((index, f"{shared}{others}"), []).append(name)
    for (index, _), names in groups.items():
        goals = np.array([tasks[name].goals[index] for name in names])
        if len(np.unique(goals, axis=0)) >= LEAST:
            positions = dict(zip(names, _along(goals).tolist(), strict=True))
            moved.append(MovedGoal(index + 1, positions))
    return moved


def joined_tasks(moved: Sequence[MovedGoal]) -> list[set[str]]:
    """Tasks that moved goals join, directly or through tasks that they share."""
    joined = DisjointSet(name for each in moved for name in each.positions)
    for each in moved:
        for name in each.positions:
            joined.merge(next(iter(each.positions)), name)
    sets: list[set[str]] = joined.subsets()
    return sets


def _along(points: Array) -> Array:
    """Positions of points (n, 2) along their first principal axis, from their mean, (n,)."""
    offsets = points - points.mean(axis=0)
    axis = np.linalg.svd(offsets, full_matrices=False)[2][0]
    main = axis[np.argmax(np.abs(axis))]
    # Rounded, so that tasks that are the same have one position.
    positions: Array = np.round(offsets @ (axis if main > 0 else -axis), 9)
    return positions


def locus_slopes(configurations: Array, positions: Sequence[float] | Array) -> list[Estimate]:
    """One slope per joint, by least squares over the mean posture at each position.

    Length unit (base) or rad (joint) per length unit, with the two-sided test of 0.
    ``configurations`` ``(n, dof)``: postures at a goal, a row a run; ``positions`` ``(n,)``: those
    of the neighbouring goal. Estimate and test have positions - 2 degrees of freedom, whether
    methods are run once or often, and take departures from the line as independent and of equal
    variance: curvature widens the interval. Joints that do not change have slope 0 and p 1.
    """
    x, means = _by_position(configurations, positions)
    slopes = []
    for joint in means.T:
        slope = Estimate(0.0, 0.0, 0.0, 1.0)
        if varies(joint):
            fit = stats.linregress(x, joint)
            value, error, p = map(float, (fit.slope, fit.stderr, fit.pvalue))
            slope = student(value, error, len(x) - 2, p)
        slopes.append(slope)
    return slopes


def slope_length(
    configurations: Array,
    positions: Sequence[float] | Array,
    rng: np.random.Generator,
    *,
    resamples: int = RESAMPLES,
) -> Estimate:
    """Length of the vector of all joints' slopes (:func:`locus_slopes`), without interval.

    Length unit and rad mixed, per length unit; ≥ 0 and so biased upwards. Permutation test: the
    mean postures are put in every order along the line (up to seven positions, else ``resamples``
    orders drawn), so that with k positions p is at least 2/k!. It takes the means as exchangeable
    where nothing depends on the position.
    """
    x, means = _by_position(configurations, positions)
    means, x = centred(means), centred(x)
    weights = x / (x**2).sum()
    exact = math.factorial(len(x)) <= resamples
    if exact:
        ways = np.array(list(permutations(range(len(x)))))
    else:
        ways = rng.permuted(np.tile(np.arange(len(x)), (resamples, 1)), axis=1)
    observed = float(np.linalg.norm(weights @ means))
    null = np.linalg.norm(weights[ways] @ means, axis=1)
    return Estimate(observed, p=p_value(null, observed, exact=exact))


def _by_position(configurations: Array, positions: Sequence[float] | Array) -> tuple[Array, Array]:
    """Positions, each once, shape ``(k,)``, and the mean configuration at each."""
    places, of_run = np.unique(np.asarray(positions, dtype=np.float64), return_inverse=True)
    return places, np.array([configurations[of_run == k].mean(axis=0) for k in range(len(places))])
