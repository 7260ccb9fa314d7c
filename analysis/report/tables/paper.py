"""The paper's cells beside ours, and the corrective process alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analysis.comparisons.paper import PaperRow, SequenceRow, paper_rows, sequence_rows
from analysis.published import (
    RUNS,
    TRIALS,
    PublishedCell,
    Summary,
    published_exhaustive,
    published_initial,
)
from analysis.report.document import DataTable, Estimate, Row, Value
from analysis.report.tables.common import counts, marked, mean_of
from analysis.report.tables.layout import LAYOUTS, with_interval
from analysis.statistics.equivalence import MARGIN
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study

_CELLS, _SEQUENCES = LAYOUTS["published-and-ours"], LAYOUTS["by-hand-sequence"]


def beside_paper(study: Study) -> tuple[DataTable | None, ...]:
    """The three tables of this module, as far as there are any."""
    return published_table(study), sequences_table(study), exhaustive_table(study)


def published_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells, published and ours."""
    rows = paper_rows(study)
    derived = dict.fromkeys(
        row.cell.task for row in rows if (published_initial(row.cell.task) or ("", 0, False))[2]
    )
    names = ", ".join(derived)
    said = f"Published initial rewards of {names} are derived from other printed numbers."
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
    return " ".join(_CELLS.read(runs=RUNS))


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
    cell, summary = row.cell, row.paper.summary
    initial = cell.good.initial_reward.dropna()
    published_hands = [f"{s.hands} {s.runs or ''}".strip() for s in row.paper.sequences]
    return _CELLS.row(
        f"{cell.task} {cell.label}",
        row,
        ((cell.task, cell.label),),
        published_runs=summary.runs if summary else None,
        initial=float(initial.iloc[0]) if len(initial) else None,
        published_initial=(published_initial(cell.task) or (None, None))[1],
        hands=counts(cell.good.hands),
        published_hands=", ".join(published_hands) or None,
        **_beside(study, row, summary, row.paper),
    )


def _sequence_row(study: Study, row: SequenceRow) -> Row:
    key = row.cell.task, row.cell.label
    own = _beside(study, row, row.published)
    return _SEQUENCES.row(" ".join((*key, row.hands)), row, (key,), **own)


def _beside(
    study: Study,
    row: PaperRow | SequenceRow,
    published: Summary | None,
    cell: PublishedCell | None = None,
) -> dict[str, Value]:
    """What both tables have: published, ours, and the difference."""
    apart = row.difference
    return {
        "task": marked(study, row.cell.task),
        "method": row.cell.label,
        "published": Estimate(published.mean, published.sd) if published else None,
        "published_as": _published_as(published, cell),
        "ours": mean_of(row.rewards),
        "runs": len(row.rewards),
        "difference": with_interval(apart.estimate, apart.low, apart.high) if apart else None,
    }


def _published_as(summary: Summary | None, cell: PublishedCell | None) -> str | None:
    if summary is None:
        return ", ".join(filter(None, ("not printed", cell.remark))) if cell else None
    if summary.derived:
        return "derived"
    return "printed" if summary.runs_printed else "printed, runs assumed"
