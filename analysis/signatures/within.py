"""Signatures of one method on one task: means, shares and synergies over its runs.

Most are functions of :class:`~.trajectories.Trajectories` that return a value for each run, shape
``(runs,)``, or for each run and goal, shape ``(runs, goals)``; :func:`over_runs` makes them rows.
Other measures yield rows themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import chain, groupby
from operator import attrgetter

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic import Execution, Trajectory
from coartic.analysis.signatures.manifold import jacobian_of, synergy
from coartic.analysis.signatures.other_arm import preshaping, readiness, readiness_from_base, travel
from coartic.analysis.signatures.paths import reversals_of, smoothness, turning_angles
from coartic.analysis.signatures.rows import (
    NO_INITIAL,
    NO_RUN,
    ONE_HAND,
    Row,
    Rows,
    Signature,
    without,
)
from coartic.analysis.signatures.subtasks import excess, isolated_agreement, sacrifices
from coartic.analysis.statistics.estimates import Interval, student_mean, wilson
from coartic.analysis.trajectories import Trajectories, entropy, postures
from coartic.robot import Array


def measured_within(cell: Trajectories, signatures: Sequence[Signature]) -> Rows:
    """Rows of all signatures of a cell; those with the same measure are measured together."""
    for (measure, two_hands), group in groupby(signatures, attrgetter("measure", "two_hands")):
        alike = list(group)
        if not cell.runs:
            yield from without(alike, NO_RUN)
        elif two_hands and len(cell.task.hands) < 2:
            yield from without(alike, ONE_HAND)
        elif measure is not None:
            yield from measure(cell, *alike)
        else:
            yield from chain.from_iterable(over_runs(cell, signature) for signature in alike)


def over_runs(cell: Trajectories, signature: Signature) -> Rows:
    """The mean over runs of a signature's values, or their share, by goal if it has goals."""
    assert signature.of_runs is not None
    values = signature.of_runs(cell)
    if not len(values):
        yield from without((signature,), NO_INITIAL)
        return
    columns = values.T if signature.by_goal else values[None]
    for number, column in enumerate(columns, 1):
        place = {"goal": number} if signature.by_goal else signature.place
        if signature.share:
            yield share_at(signature, place, column)
        else:
            yield mean_at(signature, place, column)


def first_change(cell: Trajectories) -> Array:
    """Ticks of the first subtask less the corrective process's with the same hands."""
    return np.asarray(cell.against_same_hands[:, 0])


def total_change(cell: Trajectories) -> Array:
    """Ticks of the whole less the corrective process's with the same hands."""
    return np.asarray(cell.against_same_hands.sum(axis=1))


def sacrificed(cell: Trajectories) -> Array:
    """Whether each run sacrifices the first subtask, against its own hands."""
    return np.array([sacrifices(change) for change in cell.against_same_hands])


def of_each_run(measure: Callable[[Trajectory], ArrayLike]) -> Callable[[Trajectories], Array]:
    """The same for all runs of a cell."""
    return lambda cell: np.array([measure(run) for run in cell.runs])


def before_the_last_goal(
    nearer: Callable[[Trajectory, Execution], Array],
) -> Callable[[Trajectories], Array]:
    """A measure against the initial solution at every goal but the last; no row without that."""

    def values(cell: Trajectories) -> Array:
        initial = cell.initial
        if initial is None:
            return np.empty((0, len(cell.task.goals) - 1))
        return np.array([nearer(run, initial)[:-1] for run in cell.runs])

    return values


against_isolated_reach = of_each_run(excess)
as_in_isolation = of_each_run(isolated_agreement)
readiness_of_the_other_hand = before_the_last_goal(readiness)
readiness_seen_from_the_base = before_the_last_goal(readiness_from_base)
preshaping_of_the_other_arm = before_the_last_goal(preshaping)
travel_of_the_other_arm = of_each_run(travel)
turning = of_each_run(
    lambda run: turning_angles(np.vstack([run.task.q0, run.execution.configurations]))
)
spectral_arc_lengths = of_each_run(lambda run: smoothness(run)[0])
log_jerks = of_each_run(lambda run: smoothness(run)[1])


def hand_entropy(cell: Trajectories, signature: Signature) -> Rows:
    """Entropy of the hand sequences."""
    counts = pd.Series(cell.sequences).value_counts()
    yield signature.row(
        {"hands": ", ".join(f"{hands} {count}" for hands, count in counts.items())},
        value=entropy(cell.sequences),
        n=len(cell.runs),
        why_not="" if len(cell.runs) > 1 else "one run: no distribution",
    )


def as_the_best_corrective(cell: Trajectories, signature: Signature) -> Rows:
    """Share of runs with a hand sequence that is best by the corrective process alone."""
    best = cell.best_hands
    if best:
        agrees = [hands in best for hands in cell.sequences]
        yield share_at(signature, {"hands": ", ".join(best)}, agrees)
    else:
        yield from without((signature,), "the folder's table of sequences has no reward")


def base_reversals(cell: Trajectories, signature: Signature) -> Rows:
    """Mean number of reversals of each base coordinate."""
    reversals = [reversals_of(run) for run in cell.runs]
    for k, name in enumerate("xy"):
        place = {"joint": f"base_{name}"}
        if name in cell.task.locked_base:
            yield from without((signature,), "the coordinate is locked", place)
        else:
            yield mean_at(signature, place, [run[k] for run in reversals])


def synergies(cell: Trajectories, *signatures: Signature) -> Rows:
    """Variance over runs by what it does to the hand, over runs with the commonest hands.

    Within the uncontrolled manifold, across it, their ratio ΔV, and its transform z.
    """
    *parts, z = signatures
    runs, n = cell.typical, len(cell.typical)
    if n < 2:
        why = "one run: no variance across runs" if runs else NO_RUN
        yield from without(signatures, why, n=n)
        return
    for number in range(1, len(cell.task.goals) + 1):
        hand = runs[0].hands[number - 1]
        q = postures(runs, number)
        joints, jacobian = jacobian_of(cell.task, hand, q)
        variance = synergy(q[:, joints], jacobian)
        place: Row = {"goal": number, "hand": hand, "hands": runs[0].execution.hands}
        why = "runs do not differ" if math.isnan(variance.z.value) else ""
        for signature, value in zip(parts, variance[:3], strict=True):
            yield signature.row(place, value=value, n=n, why_not=why)
        if not why:
            place["neutral"] = variance.neutral
            if math.isnan(variance.z.p):
                why = "fewer than three runs" if n < 3 else "runs differ along one line"
        yield z.estimated(place, variance.z, n, why_not=why)


def mean_at(signature: Signature, place: Row, values: ArrayLike) -> Row:
    """Mean over the runs that have a value, with Student's interval.

    The signature's ``missing`` says why a run may have none.
    """
    of_runs = np.asarray(values, dtype=np.float64)
    finite = of_runs[np.isfinite(of_runs)]
    if not len(finite):
        return signature.row(place, why_not=signature.missing)
    return signature.estimated(place, student_mean(finite), len(finite))


def share_at(signature: Signature, place: Row, agrees: Sequence[bool]) -> Row:
    """Share of runs, with Wilson's interval."""
    count, total = sum(agrees), len(agrees)
    share = wilson(count, total) if total > 1 else Interval(count / total)
    return signature.estimated(place, share, total)
