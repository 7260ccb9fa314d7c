"""The paper's cells beside ours, and the corrective process alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from coartic.analysis.comparisons.paper import PaperRow, SequenceRow, paper_rows, sequence_rows
from coartic.analysis.published import (
    RUNS,
    TRIALS,
    Summary,
    published_exhaustive,
    published_initial,
)
from coartic.analysis.report.document import DataTable, RestsOn, Row, Value
from coartic.analysis.report.tables.common import counts, estimate_as_printed, marked, mean_of
from coartic.analysis.report.tables.layout import LAYOUTS, TableLayout, estimated
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.study import Study
from coartic.analysis.words import typographic

_CELLS, _SEQUENCES = LAYOUTS["published-and-ours"], LAYOUTS["by-hand-sequence"]


def beside_paper(study: Study) -> tuple[DataTable | None, ...]:
    """The three tables of this module, as far as there are any."""
    return published_table(study), sequences_table(study), exhaustive_table(study)


def published_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells, published and ours."""
    rows = paper_rows(study)
    initial = {row.cell.task: published_initial(row.cell.task) for row in rows}
    derived = ", ".join(task for task, printed in initial.items() if printed and printed.derived)
    said = f"Published initial rewards of {derived} are derived from other printed numbers."
    return _CELLS.table(
        (_published_row(study, row) for row in rows),
        notes=(said,) if derived else (),
        of_paper=_of_paper(),
        margin=MARGIN,
        trials=TRIALS,
    )


def sequences_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells by hand sequence, published and ours."""
    rows = (_sequence_row(study, row) for row in sequence_rows(study))
    return _SEQUENCES.table(rows, of_paper=_of_paper())


def _of_paper() -> str:
    """What both tables say of published rewards."""
    return " ".join(_CELLS.reading_with(runs=RUNS))


def exhaustive_table(study: Study) -> DataTable | None:
    """The best hand sequences of the corrective process alone."""
    layout, rows = LAYOUTS["exhaustive"], []
    for task in study.tasks:
        trials = study.results.sequences[study.results.sequences.task == task]
        if len(trials) < 2:
            continue
        paper, best = published_exhaustive(task), trials.dropna(subset=["reward"]).head(4)
        shown = (
            f"{hands} {typographic(str(reward))}"
            for hands, reward in zip(best.hands, best.reward, strict=True)
        )
        row = layout.row(
            task,
            task=marked(study, task),
            published=f"{paper[0]} {typographic(str(paper[1]))}" if paper else None,
            best=", ".join(shown),
            sequences=len(trials),
            failed=int(trials.reward.isna().sum()),
        )
        rows.append(row)
    return layout.table(rows)


def _published_row(study: Study, row: PaperRow) -> Row:
    cell, remark = row.cell, row.paper.remark
    initial = cell.good.initial_reward.dropna()
    published_hands = [f"{s.hands} {s.runs or ''}".strip() for s in row.paper.sequences]
    printed = published_initial(cell.task)
    return _beside(
        study,
        _CELLS,
        row,
        row.paper.summary,
        {"published_initial": ("derived",)} if printed and printed.derived else {},
        published_as=", ".join(filter(None, (_published_as(row.paper.summary), remark))),
        initial=float(initial.iloc[0]) if len(initial) else None,
        published_initial=printed.reward if printed else None,
        hands=counts(cell.good.hands),
        published_hands=", ".join(published_hands) or None,
    )


def _sequence_row(study: Study, row: SequenceRow) -> Row:
    if row.published_runs != 0:
        return _beside(study, _SEQUENCES, row, row.published)
    none: dict[str, Value] = {"published_runs": 0, "published_as": "no run"}
    return _beside(study, _SEQUENCES, row, None, {"published_runs": ("derived",)}, **none)


def _beside(
    study: Study,
    layout: TableLayout,
    row: PaperRow | SequenceRow,
    published: Summary | None,
    rests_on: Mapping[str, tuple[RestsOn, ...]] = MappingProxyType({}),
    **own: Value,
) -> Row:
    """A row of either table: published, ours, the difference, and what is the table's own."""
    cell = row.cell
    both: dict[str, Value] = {
        "task": marked(study, cell.task),
        "method": cell.label,
        "published": estimate_as_printed(published),
        "published_runs": published.runs if published else None,
        "published_as": _published_as(published),
        "ours": mean_of(row.rewards),
        "runs": len(row.rewards),
        "difference": estimated(row.difference),
    }
    name = (cell.task, cell.label, *([row.hands] if isinstance(row, SequenceRow) else []))
    made = layout.row(" ".join(name), row, ((cell.task, cell.label),), **both | own)
    sources = dict(rests_on)
    if published is not None:
        sources["published"] = (published.source,)
        sources["published_runs"] = (published.source_of_runs,)
    return replace(made, rests_on=sources)


def _published_as(summary: Summary | None) -> str:
    if summary is None:
        return "not printed"
    if summary.derived:
        return "derived"
    return "printed" if summary.runs_printed else "printed, runs assumed"
