"""Locus slopes: how the posture at one goal follows a neighbouring goal that moves.

In speech, a locus equation regresses the onset of a consonant's formant transition on the
vowel that follows; its slope measures how far the vowel is anticipated (Lindblom 1963;
Sussman, McCaffrey & Matthews 1991). Here the posture at goal g is regressed on the position
of goal g + 1 (anticipatory) or g - 1 (carry-over), over tasks that differ in that goal only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import stats

from coartic import Task
from coartic.robot import Array

LEAST = 3
"""Tasks that make a family."""


@dataclass(frozen=True)
class Family:
    """Tasks that differ in exactly one goal."""

    moving: int
    """Number of the goal that differs, from 1."""
    tasks: tuple[str, ...]
    positions: Array
    """Position of that goal along the line it moves on, length unit, from the family's mean.
    The line is the first principal axis, pointing right (or up): the coordinate itself
    where only one changes."""


def families(tasks: Mapping[str, Task]) -> list[Family]:
    """The largest sets of at least three tasks that are the same but for one goal."""
    found = []
    groups: dict[tuple[int, str], list[str]] = {}
    for name, task in tasks.items():
        kept = task.model_dump_json(
            include={"start", "radius", "hands", "locked_base", "robot"},
        )
        for index in range(len(task.goals)):
            others = task.goals[:index] + task.goals[index + 1 :]
            groups.setdefault((index, f"{kept}{others}"), []).append(name)
    for (index, _), names in groups.items():
        goals = np.array([tasks[name].goals[index] for name in names])
        if len(np.unique(goals, axis=0)) >= LEAST:
            found.append(Family(index + 1, tuple(names), _along(goals)))
    return found


def _along(points: Array) -> Array:
    centred = points - points.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    main = axis[np.argmax(np.abs(axis))]
    positions: Array = centred @ (axis if main > 0 else -axis)
    return positions


class Slope(NamedTuple):
    """Regression of one joint on the position of a neighbouring goal."""

    value: float
    """Length unit (base) or rad (joint) per length unit; -∞ to ∞, 0 no dependence."""
    low: float
    """Interval at 95 %."""
    high: float
    p: float
    """Two-sided, of slope 0."""


def locus_slopes(configurations: Array, positions: Sequence[float] | Array) -> list[Slope]:
    """One slope per joint, by least squares (``scipy.stats.linregress``).

    ``configurations`` has shape ``(n, dof)``: postures at goal g, one row a run; ``positions``
    ``(n,)`` those of the neighbouring goal in each run's task. Joints that do not change have
    slope 0 and p 1. Errors are taken as independent and of equal variance, so slopes over
    deterministic runs have an interval that speaks of curvature, not of chance. Raises
    ValueError for fewer than three runs or a goal that does not move.
    """
    x = np.asarray(positions, dtype=np.float64)
    if len(x) < LEAST or np.ptp(x) == 0:
        raise ValueError("a slope needs three runs and a goal that moves")
    reach = float(stats.t.ppf(0.975, len(x) - 2))
    slopes = []
    for joint in configurations.T:
        if np.ptp(joint) < 1e-12:
            slopes.append(Slope(0.0, 0.0, 0.0, 1.0))
            continue
        fit = stats.linregress(x, joint)
        half = reach * float(fit.stderr)
        slopes.append(
            Slope(float(fit.slope), fit.slope - half, fit.slope + half, float(fit.pvalue))
        )
    return slopes
