"""The paper's claims about the one-armed tasks (exploration condition 1)."""

from __future__ import annotations

import numpy as np

from analysis.claims.data import ASCENDING, DESCENDING, Data, MissingError
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.methods import LEARNER
from analysis.signatures.subtasks import ROUNDING, change_from, sacrifices
from analysis.statistics.estimates import SEED, Inference, mean
from analysis.statistics.hypotheses import bootstrap_test
from analysis.words import interval

CONTROLS = ("posture-based/one-goal", "corrective-alone/given")
"""Methods that do not look beyond the current goal."""
_EC1 = f"{LEARNER}EC1"


@decides(
    "first-movement-sacrificed",
    "one-tailed bootstrap tests against the initial solution: the first movement is longer by "
    f"more than {ROUNDING} tick (rounding), the whole shorter. Controls that do not look "
    "beyond the current goal stand beside it",
)
def _first_movement_sacrificed(data: Data) -> Finding:
    tests, parts = [], []
    for task in (ASCENDING, DESCENDING):
        cell, initial = data.cell(task, _EC1), data.initial(task)
        before = initial.ticks_by_goal()[0]
        first = np.array([float(run.execution.ticks_by_goal()[0]) for run in cell.runs])
        total = np.array([float(run.execution.ticks) for run in cell.runs])
        tests += [
            bootstrap_test(first, float(before + ROUNDING), seed=SEED),
            bootstrap_test(-total, -float(initial.ticks), seed=SEED),
        ]
        both = sum(sacrifices(change_from(run.execution, initial)) for run in cell.runs)
        parts.append(
            f"{task}: first movement {before} to {interval(mean(first, seed=SEED))} ticks, "
            f"all {initial.ticks} to {total.mean():.1f}, both in {both} of {len(cell.runs)} runs"
        )
    parts += [
        f"{method}: first {first:+.1f}, all {total:+.1f} on ascending"
        for method in CONTROLS
        if (found := sacrifice(data, method)) is not None
        for first, total in (found,)
    ]
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def sacrifice(data: Data, method: str) -> tuple[float, float] | None:
    """Ticks of the first movement and of all, less the corrective process's, on ascending.

    Of the corrective process alone with the same hands. None where the folder lacks the runs.
    """
    try:
        first = data.signature(ASCENDING, method, "first subtask against the same hands")
        total = data.signature(ASCENDING, method, "total against the same hands")
    except MissingError:
        return None
    return float(first.value), float(total.value)


@decides(
    "context",
    "permutation test of context dependence at goal 1; seen where it exceeds 1 pooled SD. "
    "Controls that do not look beyond the current goal stand beside it",
)
def _context_matters(data: Data) -> Finding:
    data.runs(DESCENDING, _EC1)
    distance = data.signature(ASCENDING, _EC1, "context distance", 1).value
    row = data.signature(ASCENDING, _EC1, "context dependence", 1)
    equivalent = data.signature(ASCENDING, _EC1, "motor-equivalent part", 1).value
    other = data.signature(ASCENDING, _EC1, "non-motor-equivalent part", 1).value
    apart = row.value
    test = Inference(apart, (int(row.n),), "permutation test over runs", p=row.p, seed=SEED)
    parts = [
        f"postures at goal 1 lie {distance:.2f} apart, {apart:.1f} pooled SDs; per dimension "
        f"{equivalent:.3f} leave the hand in place and {other:.3f} move it"
    ]
    parts += [
        f"{method}: {own:.2f} apart"
        for method in CONTROLS
        if (own := context_distance(data, method)) is not None
    ]
    # A permutation test has no contrary side: too small a difference leaves it open.
    return Finding(True if row.value > 1 else None, "; ".join(parts), (test,), ())


def context_distance(data: Data, method: str) -> float | None:
    """Distance of mean postures at goal 1, ascending and descending; None without runs."""
    try:
        data.runs(DESCENDING, method)
        return float(data.signature(ASCENDING, method, "context distance", 1).value)
    except MissingError:
        return None
