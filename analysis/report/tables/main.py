"""The tables that a paper has room for: every method on every task, every claim's verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import pandas as pd

from coartic.analysis.claims.register import Judged
from coartic.analysis.comparisons.methods import median
from coartic.analysis.comparisons.reached import ALL_TASKS
from coartic.analysis.figures.ranking import GROUPS, learner, standings
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.report.document import Column, DataTable, Row, Value
from coartic.analysis.report.tables.layout import LAYOUTS, TableLayout, finite, with_interval
from coartic.analysis.study import Study
from coartic.analysis.words import marked, slugs

MAIN = ("main-methods", "published-and-ours", "main-verdicts")
"""Ids of the tables for a paper, in their order; all others are its supplement."""
_METHODS, _VERDICTS = LAYOUTS["main-methods"], LAYOUTS["main-verdicts"]


def main_methods(study: Study) -> DataTable | None:
    """Gaps of every method without its variants: one row a method, one column a task.

    Many instances of families have the one over all tasks together.
    """
    found = standings(study)
    names = {task: slug.replace("-", "_") for task, slug in slugs(study.tasks).items()}
    alone = one_by_one(study)
    shown = [task for task in study.tasks if task in alone and (found.task == task).any()]
    over_all = bool((found.task == ALL_TASKS).any())
    rows = []
    for method, own in sorted(found.groupby("method", sort=False), key=_order):
        if over_all and ALL_TASKS not in set(own.task) and not learner(str(method)):
            continue
        rows.append(_row(study, str(method), own, shown))
    table = _METHODS.plus(_columns(study, shown, names)).table(rows)
    return table and table.only(lambda column: over_all or column.name != "all_tasks")


def _order(item: tuple[object, pd.DataFrame]) -> tuple[int, float]:
    """What is told the most first, the nearest over all tasks; what is not everywhere last."""
    own = item[1]
    whole = own[own.task == ALL_TASKS].gap
    return GROUPS.index(str(own.told.iloc[0])), float(whole.iloc[0]) if len(whole) else math.inf


def _columns(study: Study, tasks: list[str], names: dict[str, str]) -> Iterator[Column]:
    for task in tasks:
        header = marked(study.tasks[task].label, study.tasks[task])
        yield Column(
            *(f"on_{names[task]}", header, "number", "%", 1),
            rests_on=("runs", "optimum"),
        )
    yield Column("trials", "trials", "number", digits=0, rests_on=("runs",))
    yield Column("kinematics", "kinematics", "number", digits=0, rests_on=("runs",))


def _row(study: Study, method: str, own: pd.DataFrame, tasks: list[str]) -> Row:
    gaps = own.set_index("task")
    whole: Value = None
    if ALL_TASKS in gaps.index:
        gap, low, high = (float(gaps[name][ALL_TASKS]) for name in ("gap", "low", "high"))
        whole = with_interval(gap, low, high)
    cells = _cells(study, method, own)
    by_task = {key[0]: key for key in cells}
    values = [float(gaps.gap[task]) if task in gaps.index else None for task in tasks]
    if ALL_TASKS in gaps.index and not any(v is not None for v in values):
        values = [
            100 * study.method_rows[by_task[task]].gap_share if task in by_task else None
            for task in tasks
        ]
    spent = (
        finite(sum(median(study.cells[key].runs[name]) for key in cells) / len(cells))
        for name in ("trials", "forward_kinematics")
    )
    return Row(
        method,
        (method, str(own.told.iloc[0]), whole, *values, *spent),
        cells,
        group=str(own.told.iloc[0]),
    )


def _cells(study: Study, method: str, own: pd.DataFrame) -> tuple[tuple[str, str], ...]:
    """The cells behind a method's row, those of the learner over all tasks from its parts."""
    scores = study.scores
    parts = scores[scores.method == method].drop_duplicates(["task", "label"])
    joint = tuple(zip(map(str, parts.task), map(str, parts.label), strict=True))
    single = tuple((str(task), method) for task in own.task if (task, method) in study.cells)
    return single or joint


def main_verdicts(study: Study) -> DataTable | None:
    """Every claim of the paper in words, with its verdict."""
    judged = [entry for entry in study.judged if entry.claim.place]
    own: list[dict[str, Value]] = [{"number": number} for number in range(1, len(judged) + 1)]
    return _VERDICTS.table(verdict_rows(study, _VERDICTS, judged, own))


def verdict_rows(
    study: Study, layout: TableLayout, judged: Iterable[Judged], own: Iterable[Mapping[str, Value]]
) -> Iterator[Row]:
    """A row a claim, which leads to its section, with what is the table's ``own``."""
    by_run = {run: key for key, runs in study.run_ids.items() for run in runs}
    for entry, values in zip(judged, own, strict=True):
        claim = entry.claim
        cells = dict.fromkeys(by_run[run] for run in entry.run_ids)
        said: dict[str, Value] = {"statement": claim.statement, "verdict": entry.marked}
        row = layout.row(claim.id, entry, cells, **said, **values)
        family = claim.id if math.isnan(entry.p) else claim.correction
        names = {column.name for column in layout.columns}
        origin = {name: kinds for name, kinds in entry.origin.items() if name in names}
        yield replace(row, link=f"#claim-{claim.id}", family=family, rests_on=origin)
