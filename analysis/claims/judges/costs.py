"""What methods get for their trials, and how much they evaluate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from analysis.claims.data import BEST, UNINFORMED, Data, MissingError
from analysis.claims.evidence import by_optimum, measured, of_either_optimum
from analysis.claims.register import Finding
from analysis.comparisons.methods import TOLD
from analysis.methods import LEARNER
from analysis.report.document import Column, RestsOn, Row, Value
from analysis.words import NONE, short
from coartic.method import Information
from coartic.record import SEARCH

_TASKS = tuple(task for task, _ in BEST)
NEAR = 0.05
"""Share of the optimum within which a run has come near it."""


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


class Beside(NamedTuple):
    """What one method gets on one task, beside others."""

    task: str
    label: str
    told: str
    values: tuple[Value, ...]
    words: str

    @property
    def row(self) -> Row:
        """As a row of a table with the columns :data:`_BESIDE` and those of the values."""
        key = (self.task, self.label)
        values = (self.label, self.task, self.told, *self.values)
        return Row(f"{self.label} on {self.task}", values, (key,))


_BESIDE = (
    Column("method", "method"),
    Column("task", "task"),
    Column("told", "told", rests_on=("text",)),
)


def _beside(
    data: Data,
    labels: Iterable[str],
    values: Callable[[str, str], tuple[tuple[Value, ...], str] | None],
) -> list[Beside]:
    """Each method on each task where it can be judged and has values."""
    found = []
    for label, task in itertools.product(labels, _TASKS):
        try:
            data.runs(task, label)
        except MissingError:
            continue
        own = values(task, label)
        if own is not None:
            found.append(Beside(task, label, data.study.method_rows[task, label].told, *own))
    return found


def _in_words(beside: Iterable[Beside]) -> list[str]:
    """A line a method: what it is told, and its values by task, a dash where it has none."""
    lines = []
    for label, own in itertools.groupby(beside, key=lambda entry: entry.label):
        by_task = {entry.task: entry for entry in own}
        told = next(reversed(by_task.values())).told
        shown = (f"{t} {by_task[t].words if t in by_task else NONE}" for t in _TASKS)
        lines.append(", ".join((f"method {label}", f"told {told}", *shown)))
    return lines


def experience(data: Data) -> Finding:
    """Trials until methods that are told no more than the learner come near the optimum."""
    targets = data.study.targets
    near = targets[(targets.spend == "trials") & (targets.share == NEAR)]
    rows: Iterator[Any] = near.itertuples()
    # Methods that keep the other arm still, to the optimum with it still: their last row.
    reached = {(row.task, row.method): row for row in rows}

    def values(task: str, label: str) -> tuple[tuple[Value, ...], str] | None:
        row = reached.get((task, label))
        if row is None:
            return None
        reward = data.study.method_rows[task, label].reward
        median = None if math.isinf(row.median) else float(row.median)
        said = "never" if median is None else f"{median:.0f}"
        found = by_optimum(row.other_arm, int(row.reached), median)
        return (
            (reward, int(row.runs), *found),
            f"{row.reached}/{row.runs}, {said} ({reward:.1f})",
        )

    _learners_runs(data)
    beside = _beside(data, _labels(data, _uninformed), values)
    near_it = f"within {NEAR:.0%} of the optimum"
    rests: tuple[RestsOn, ...] = ("runs", "optimum")
    return measured(
        "reward-by-experience",
        f"runs {near_it} (of that with the other arm still, for methods "
        "that keep it so), median trials until then, and in brackets the mean reward at the end; "
        "every method that is told no more than the learner",
        f"Runs that come {near_it}, and median trials until then, over all runs",
        (
            *_BESIDE,
            Column("reward", "mean reward", "number", digits=1, rests_on=("runs",)),
            Column("runs", "runs", "number", rests_on=("runs",)),
            *of_either_optimum(
                Column("reached", f"within {NEAR:.0%}", "number", rests_on=rests),
                Column("median_trials", "median trials", "number", digits=0, rests_on=rests),
            ),
        ),
        [entry.row for entry in beside],
        _in_words(beside),
    )


def computation(data: Data) -> Finding:
    """Kinematics that uninformed methods evaluate, and informed ones in their default form."""
    _learners_runs(data)

    def values(task: str, label: str) -> tuple[tuple[Value, ...], str]:
        row = data.study.method_rows[task, label]
        spent = row.evaluations
        trial = spent / row.trials if row.trials > 1 else None
        each = "" if trial is None else f", {short(trial)} a trial"
        return (row.reward, spent, trial), f"{short(spent)}{each} ({row.reward:.1f})"

    uninformed = _labels(data, _uninformed)
    informed = [
        label
        for label in _labels(data, lambda told: not _uninformed(told))
        if " " not in label and not label.startswith(LEARNER)
    ]
    beside = _beside(data, [*uninformed, *informed], values)
    return measured(
        "computation",
        "evaluations of forward kinematics and Jacobian in a run (median), and per trial; in "
        "brackets the mean reward they buy; letters of what is told: docs/methods.md. First "
        "methods that are told no more than the learner, then informed search in its default form",
        "Evaluations of forward kinematics and Jacobian in a run (median)",
        (
            *_BESIDE,
            Column("reward", "mean reward", "number", digits=1, rests_on=("runs",)),
            Column("evaluations", "evaluations", "number", digits=0, rests_on=("runs",)),
            Column("evaluations_a_trial", "a trial", "number", rests_on=("runs",)),
        ),
        [entry.row for entry in beside],
        _in_words(beside),
    )
