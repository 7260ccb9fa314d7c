"""What methods get for their trials, and how much they evaluate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import Any

from coartic.analysis.claims.data import BEST, UNINFORMED, Data, MissingError
from coartic.analysis.claims.evidence import by_optimum, layout, measured
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import MARGINS, decides
from coartic.analysis.comparisons.methods import TOLD, MethodRow
from coartic.analysis.methods import LEARNER
from coartic.analysis.report.document import Row, Value
from coartic.method import Information
from coartic.record import SEARCH

_TASKS = tuple(task for task, _ in BEST)
NEAR = MARGINS["near"]


def _labels(data: Data, wanted: Callable[[str], bool]) -> list[str]:
    """Labels whose row of the methods' table on any task is wanted, in the order of the plan."""
    return list(
        dict.fromkeys(
            label
            for task, label in data.study.cells
            if task in _TASKS
            and not label.startswith(SEARCH)
            and wanted(data.study.method_rows[task, label].told)
        )
    )


def _uninformed(told: str) -> bool:
    return TOLD[Information.REWARD_BY_TRIAL] in told and set(told) <= UNINFORMED


def _learners_runs(data: Data) -> None:
    """Read the learner's best conditions; raises MissingError where one cannot be judged."""
    for task, condition in BEST:
        data.runs(task, LEARNER + condition)


def _beside(
    data: Data,
    claim: str,
    labels: Iterable[str],
    values: Callable[[MethodRow], dict[str, Value]],
) -> list[Row]:
    """Each method on each task where it can be judged and has values."""
    found = []
    for label, task in itertools.product(labels, _TASKS):
        with suppress(MissingError):
            row = data.row(task, label)
            own = {"method": label, **values(row)}
            found.append(layout(claim).row(f"{label} on {task}", row, [(task, label)], **own))
    return found


@decides("reward-by-experience")
def _experience(data: Data) -> Finding:
    """Trials until methods that are told no more than the learner come near the optimum."""
    targets = data.study.targets
    near = targets[(targets.spend == "trials") & (targets.share == NEAR)]
    rows: Iterator[Any] = near.itertuples()
    # Methods that keep the other arm still, to the optimum with it still: their last row.
    reached = {(row.task, row.method): row for row in rows}

    def values(of: MethodRow) -> dict[str, Value]:
        row = reached.get((of.task, of.label))
        if row is None:
            raise MissingError(f"no run of {of.label} on {of.task} has steps")
        median = None if math.isinf(row.median) else float(row.median)
        arm, reached_it = row.other_arm, int(row.reached)
        return {"runs": int(row.runs)} | by_optimum(arm, reached=reached_it, median_trials=median)

    _learners_runs(data)
    found = _beside(data, "reward-by-experience", _labels(data, _uninformed), values)
    return measured(
        "reward-by-experience",
        f"runs within {NEAR:.0%} of the optimum (of that with the other arm still, for methods "
        "that keep it so), median trials until then, and the mean reward at the end; "
        "every method that is told no more than the learner",
        found,
        near=NEAR,
    )


@decides("computation")
def _computation(data: Data) -> Finding:
    """Kinematics that uninformed methods evaluate, and informed ones in their default form."""
    _learners_runs(data)

    def values(row: MethodRow) -> dict[str, Value]:
        a_trial = row.evaluations / row.trials if row.trials > 1 else None
        return {"evaluations": row.evaluations, "evaluations_a_trial": a_trial}

    uninformed = _labels(data, _uninformed)
    informed = [
        label
        for label in _labels(data, lambda told: not _uninformed(told))
        if " " not in label and not label.startswith(LEARNER)
    ]
    return measured(
        "computation",
        "evaluations of forward kinematics and Jacobian in a run (median), and per trial, beside "
        "the mean reward they buy; letters of what is told: docs/methods.md. First "
        "methods that are told no more than the learner, then informed search in its default form",
        _beside(data, "computation", [*uninformed, *informed], values),
    )
