"""How what a method computes, and how far it stays behind, grow with the size of a task."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coartic import Task
from coartic.analysis.comparisons.methods import solve_times
from coartic.analysis.generality.sample import Sample
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import regression

GROWING = {
    "kinematics": "evaluations of kinematics and Jacobian, exponent",
    "solve_s": "seconds, exponent",
    "gap": "gap, points of per cent for one more",
}
"""What is explained, by name."""


class Growth(NamedTuple):
    """Of one method, over all instances that it solved."""

    label: str
    what: str
    """A name of :data:`GROWING`."""
    goals: Inference
    """Exponent of the number of goals, or gap for one more; NaN where that does not vary."""
    joints: Inference
    """The same of :func:`size`'s joints."""
    instances: int
    explained: float
    """R² of the regression, within families."""


def size(task: Task) -> tuple[int, int]:
    """Number of goals, and of joints that move one hand: its links and the base's directions."""
    return len(task.goals), len(task.robot.right_links) + 2 - len(task.locked_base)


def scaling(sample: Sample) -> list[Growth]:
    """Of every method on enough instances, in the order of :data:`GROWING`, then of the plan.

    Of searches for the optimum the costs alone.

    Costs as a product of powers, by least squares on logarithms; gaps as a sum. Within families:
    what sets them apart is no growth. What was given a budget of trials grows as a trial does.
    """
    found = []
    for what in GROWING:
        for label in (*sample.labels, *(sample.searches if what != "gap" else ())):
            growth = _growth(sample, label, what)
            if growth is not None:
                found.append(growth)
    return found


def _growth(sample: Sample, label: str, what: str) -> Growth | None:
    names = [name for name in sample.references if (name, label) in sample.study.cells]
    names = [name for name in names if len(sample.study.cells[name, label].good)]
    values = np.array([_mean(sample, name, label, what) for name in names])
    sizes = np.array([size(sample.tasks[name]) for name in names], dtype=float)
    if not len(names) or (what != "gap" and not (values > 0).all()):
        return None
    if what != "gap":
        values, sizes = np.log(values), np.log(sizes)
    groups = [str(sample.tasks[name].family) for name in names]
    try:
        (goals, joints), explained = regression(values, sizes, groups)
    except ValueError:  # too few
        return None
    return Growth(label, what, goals, joints, len(names), explained)


def _mean(sample: Sample, name: str, label: str, what: str) -> float:
    """Over the solved runs of a method on an instance."""
    good = sample.study.cells[name, label].good
    if what == "kinematics":
        return float((good.forward_kinematics + good.jacobians).mean())
    if what == "solve_s":
        return float(solve_times(good).mean())
    gap = sample.gap(name, label)
    assert gap is not None  # of an instance with a reference, in some solved run
    return float(np.mean(gap))
