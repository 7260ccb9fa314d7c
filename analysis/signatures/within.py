"""Measures of one method on one task: its runs' values as means, shares and synergies.

A measure takes :class:`~.trajectories.Trajectories`, then the signatures that it measures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic.analysis.signatures.manifold import jacobian_of, synergy
from coartic.analysis.signatures.other_arm import (
    preshaping,
    readiness,
    readiness_from_base,
    travel,
)
from coartic.analysis.signatures.paths import reversals_of, smoothness, turning_angles
from coartic.analysis.signatures.rows import (
    NO_INITIAL,
    NO_RUN,
    ONE_HAND,
    Measure,
    Row,
    Rows,
    Signature,
    without,
)
from coartic.analysis.signatures.subtasks import (
    excess,
    isolated_agreement,
    sacrifices,
)
from coartic.analysis.statistics.estimates import Interval, student_mean, wilson
from coartic.analysis.trajectories import Trajectories, entropy, postures
from coartic.robot import Array


def against_same_hands(cell: Trajectories, first: Signature, total: Signature) -> Rows:
    """Mean change of the first subtask and of the whole, from the corrective process's."""
    changes = cell.against_same_hands
    if not len(changes):
        yield from without((first, total), NO_INITIAL if cell.runs else NO_RUN)
        return
    yield mean_at(first, {"goal": 1}, changes[:, 0])
    yield mean_at(total, {}, changes.sum(axis=1))


def sacrificed(cell: Trajectories, signature: Signature) -> Rows:
    """Share of runs that sacrifice the first subtask, against their own hands."""
    changes = cell.against_same_hands
    if len(changes):
        yield share_at(signature, {}, [*map(sacrifices, changes)])
    else:
        yield from without((signature,), NO_INITIAL if cell.runs else NO_RUN)


def against_isolated_reach(cell: Trajectories, signature: Signature) -> Rows:
    """Mean excess of each subtask over an isolated reach."""
    missing = "the corrective process reaches the goal from the posture before with no hand"
    values = [excess(run) for run in cell.runs]
    yield from by_goal(signature, len(cell.task.goals), values, missing)


def of_two_hands(measure: Measure) -> Measure:
    """Restrict a measure to solved tasks with two hands."""

    def restricted(cell: Trajectories, *signatures: Signature) -> Rows:
        if len(cell.task.hands) < 2 or not cell.runs:
            return without(signatures, ONE_HAND if cell.runs else NO_RUN)
        return measure(cell, *signatures)

    return restricted


@of_two_hands
def hand_entropy(cell: Trajectories, signature: Signature) -> Rows:
    """Entropy of the hand sequences."""
    counts = pd.Series(cell.sequences).value_counts()
    yield signature.row(
        {"hands": ", ".join(f"{hands} {count}" for hands, count in counts.items())},
        value=entropy(cell.sequences),
        n=len(cell.runs),
        why_not="" if len(cell.runs) > 1 else "one run: no distribution",
    )


@of_two_hands
def as_in_isolation(cell: Trajectories, signature: Signature) -> Rows:
    """Share of runs that hit each goal with the hand that is quickest for it by itself."""
    by_run = map(isolated_agreement, cell.runs)
    for number, agrees in enumerate(zip(*by_run, strict=True), 1):
        yield share_at(signature, {"goal": number}, agrees)


@of_two_hands
def as_the_best_corrective(cell: Trajectories, signature: Signature) -> Rows:
    """Share of runs with a hand sequence that is best by the corrective process alone."""
    best = cell.best_hands
    if best:
        agrees = [hands in best for hands in cell.sequences]
        yield share_at(signature, {"hands": ", ".join(best)}, agrees)
    else:
        yield from without((signature,), "the folder's table of sequences has no reward")


@of_two_hands
def readiness_of_the_other_hand(cell: Trajectories, *signatures: Signature) -> Rows:
    """Readiness, that seen from the base, and preshaping; but at the last goal."""
    measures = (readiness, readiness_from_base, preshaping)
    if (initial := cell.initial) is None:
        yield from without(signatures, NO_INITIAL)
        return
    missing = "the other hand hits no later goal"
    for signature, nearer in zip(signatures, measures, strict=True):
        values = [nearer(run, initial) for run in cell.runs]
        yield from by_goal(signature, len(cell.task.goals) - 1, values, missing)


@of_two_hands
def travel_of_the_other_arm(cell: Trajectories, signature: Signature) -> Rows:
    """Mean travel of the arm that is not chosen, by subtask."""
    yield from by_goal(signature, len(cell.task.goals), [travel(run) for run in cell.runs])


def base_reversals(cell: Trajectories, signature: Signature) -> Rows:
    """Mean number of reversals of each base coordinate."""
    reversals = [reversals_of(run) for run in cell.runs]
    for k, name in enumerate("xy"):
        place = {"joint": f"base_{name}"}
        if name in cell.task.locked_base:
            yield from without((signature,), "the coordinate is locked", place)
        else:
            yield mean_at(signature, place, [run[k] for run in reversals])


def turning(cell: Trajectories, signature: Signature) -> Rows:
    """Mean turning angle at every goal but the last."""
    goals = len(cell.task.goals)
    if goals < 2:
        yield from without((signature,), "the task has one goal")
        return
    start = cell.task.q0
    turns = [turning_angles(np.vstack([start, run.execution.configurations])) for run in cell.runs]
    yield from by_goal(signature, goals - 1, turns, "a subtask without displacement")


def smooth(cell: Trajectories, sparc: Signature, jerk: Signature) -> Rows:
    """Smoothness of the chosen hand's path."""
    values = [smoothness(run) for run in cell.runs]
    short = "every subtask is too short, or its path is without jerk"
    for k, signature in enumerate((sparc, jerk)):
        yield mean_at(signature, {"hand": "chosen"}, [run[k] for run in values], short)


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


def by_goal(signature: Signature, goals: int, values: Sequence[Array], missing: str = "") -> Rows:
    """Means at the first ``goals`` goals of ``values``, a row of them a run."""
    for number in range(1, goals + 1):
        at_goal = [run[number - 1] for run in values]
        yield mean_at(signature, {"goal": number}, at_goal, missing)


def mean_at(signature: Signature, place: Row, values: ArrayLike, missing: str = "") -> Row:
    """Mean over the runs that have a value, with Student's interval.

    ``missing`` says why a run may have none.
    """
    of_runs = np.asarray(values, dtype=np.float64)
    finite = of_runs[np.isfinite(of_runs)]
    if not len(finite):
        return signature.row(place, why_not=missing if len(of_runs) else NO_RUN)
    return signature.estimated(place, student_mean(finite), len(finite))


def share_at(signature: Signature, place: Row, agrees: Sequence[bool]) -> Row:
    """Share of runs, with Wilson's interval."""
    count, total = sum(agrees), len(agrees)
    share = wilson(count, total) if total > 1 else Interval(count / total)
    return signature.estimated(place, share, total)
