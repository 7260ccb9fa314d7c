"""Signatures of one method on one task: means and shares over its runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from coartic.analysis.signatures.rows import (
    REGISTER,
    WITHIN,
    Row,
    Rows,
    estimated,
    row,
    without,
)
from coartic.analysis.signatures.subtasks import (
    isolated_agreement,
    preshaping,
    travel,
    turning_angles,
)
from coartic.analysis.statistics.estimates import Estimate, student_mean, wilson
from coartic.analysis.trajectories import Trajectories
from coartic.robot import Array


def measured_within(cell: Trajectories) -> Rows:
    """Rows of all signatures of a cell, in the order of the register."""
    runs = cell.runs
    if not runs:
        yield from without(WITHIN, "no run has a solution")
        return
    changes = cell.against_same_hands
    yield from over_runs("first subtask against the same hands", changes[:, 0], {"goal": 1})
    yield from over_runs("total against the same hands", changes.sum(axis=1))
    if len(cell.task.hands) > 1:
        yield from with_two_hands(cell)
    else:
        two_hands = (signature for signature in WITHIN if signature.two_hands)
        yield from without(two_hands, "the task has one hand")
    paths = [np.vstack([run.task.q0, run.execution.configurations]) for run in runs]
    yield from over_runs("turning angle", list(map(turning_angles, paths)))


def with_two_hands(cell: Trajectories) -> Rows:
    """Rows of the signatures of tasks with two hands."""
    runs, initial = cell.runs, cell.initial
    yield from over_runs("hand as in isolation", list(map(isolated_agreement, runs)))
    # At every goal but the last, against the initial solution; empty without that.
    nearer = [] if initial is None else [preshaping(run, initial)[:-1] for run in runs]
    yield from over_runs("preshaping of the other arm", nearer)
    yield from over_runs("travel of the other arm", list(map(travel, runs)))


def over_runs(signature: str, values: ArrayLike, place: Row | None = None) -> Rows:
    """The mean of a value of each run, or their share, by goal if the signature has goals.

    ``values`` has shape ``(runs,)``, or ``(runs, goals)``; none where there is no initial solution.
    """
    of_runs, kind = np.asarray(values), REGISTER[signature]
    if not len(of_runs):
        why = "the corrective process alone does not complete the task"
        yield from without([kind], why)
    elif kind.by_goal:
        for goal, of_goal in enumerate(of_runs.T, 1):
            yield over_some(signature, of_goal, {"goal": goal})
    else:
        yield over_some(signature, of_runs, place or {})


def over_some(signature: str, values: Array, place: Row) -> Row:
    """A mean over the runs that have a value with Student's interval, a share with Wilson's."""
    if REGISTER[signature].share:
        count, total = int(values.sum()), len(values)
        share = wilson(count, total) if total > 1 else Estimate(count / total)
        return estimated(signature, place, share, total)
    finite = values[np.isfinite(values)].astype(np.float64)
    if not len(finite):
        return row(signature, place, why_not=REGISTER[signature].missing)
    return estimated(signature, place, student_mean(finite), len(finite))
