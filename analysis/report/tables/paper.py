"""The paper's cells beside ours, and the corrective process alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from analysis.comparisons.paper import PaperRow, SequenceRow, paper_rows, sequence_rows
from analysis.published import (
    RUNS,
    TRIALS,
    Summary,
    published_exhaustive,
    published_initial,
)
from analysis.report.document import Column, DataTable, RestsOn, Row, Value
from analysis.report.tables.common import (
    counts,
    estimate_as_printed,
    marked,
    mean_of,
    row_of,
    table,
    with_interval,
)
from analysis.statistics.equivalence import MARGIN
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study


_of_paper = partial(Column, rests_on=("paper",), printed=False)
_of_runs = partial(Column, rests_on=("runs",), printed=False)
_PUBLISHED = Column("published", "paper", "number", "ticks", 1, rests_on=("paper",))
_PUBLISHED_RUNS = _of_paper("published_runs", "published runs", "number")
_PUBLISHED_AS = _of_paper("published_as", "published as")
_OURS = Column("ours", "ours", "number", "ticks", 1, rests_on=("runs",))
_RUNS = _of_runs("runs", "runs", "number")
_DIFFERENCE = Column(
    "difference", "difference", "number", "ticks", 1, rests_on=("runs", "paper"), leading=True
)
_CELLS = (
    Column("task", "task"),
    Column("method", "method"),
    *(_PUBLISHED, _PUBLISHED_RUNS, _PUBLISHED_AS, _OURS, _RUNS, _DIFFERENCE),
    Column("verdict", "verdict", rests_on=("runs", "paper"), leading=True),
    _of_paper("margin", "margin", "number", "ticks", 1, rests_on=("ours", "paper")),
    _of_paper("margin_of_gain", "of the gain", "share", "", 0, rests_on=("ours", "paper")),
    _of_paper("initial", "initial", "number", "ticks", 0, rests_on=("simulation",)),
    _of_paper("published_initial", "initial, published", "number", "ticks", 0),
    _of_runs("hands", "hands: runs"),
    _of_paper("published_hands", "hands, published"),
)
_SEQUENCES = (
    Column("task", "task"),
    Column("method", "method"),
    Column("hands", "hands", rests_on=("runs", "paper")),
    _PUBLISHED,
    replace(_PUBLISHED_RUNS, printed=True),
    _PUBLISHED_AS,
    _OURS,
    replace(_RUNS, printed=True),
    _DIFFERENCE,
)
_PAPER = (
    "Published: Shah, Barto & Fagg (2013), mean ± SD, with the digits printed there. *derived*: "
    "pooled from what is printed by hand sequence; *runs assumed*: no number of runs stands "
    f"beside it, {RUNS} is that of every experiment, and that they are all of them is our "
    "assumption. The difference, ours less published, has Welch's "
    "interval from the printed mean, SD and runs; where no SD is printed the printed mean is "
    "taken as exact. "
    "Each interval is for its row alone. Rewards are not normally distributed, as the paper says "
    "of its own: the intervals are approximate, most of all where runs settle on several hand "
    "sequences."
)


def beside_paper(study: Study) -> tuple[DataTable | None, ...]:
    """The three tables of this module, as far as there are any."""
    return published_table(study), sequences_table(study), exhaustive_table(study)


def published_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells, published and ours."""
    rows = paper_rows(study)
    derived = dict.fromkeys(
        row.cell.task for row in rows if (published_initial(row.cell.task) or ("", 0, False))[2]
    )
    notes = [
        _PAPER,
        "Ours: mean ± SD with its BCa interval; learned reward of a run is the best of its noisy "
        "trials, as in the paper as we read it, −1 for every control tick.",
        f"*Equivalent*: the interval of the difference lies within {MARGIN:.0%} of the published "
        "reward, the margin, which is ours; *different*: outside; *undecided*: neither. Of the "
        "gain: the margin as a share of what learning gained in the paper. Runs with another "
        f"number of trials than the paper's {TRIALS} are not comparable and get no verdict.",
    ]
    if derived:
        notes.append(
            f"Published initial rewards of {', '.join(derived)} are derived from other printed "
            "numbers."
        )
    return table(
        "published-and-ours",
        "Learned reward in the paper's cells, published and ours.",
        _CELLS,
        [_published_row(study, row) for row in rows],
        tuple(notes),
    )


def sequences_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells by hand sequence, published and ours."""
    return table(
        "by-hand-sequence",
        "Learned reward by hand sequence, where the paper or our runs tell several apart.",
        _SEQUENCES,
        [_sequence_row(study, row) for row in sequence_rows(study)],
        (
            _PAPER,
            "The rows of a cell add up to all its runs that have a solution, ours and those of "
            "the paper; where it prints no hand sequences, its runs are left out.",
        ),
    )


def exhaustive_table(study: Study) -> DataTable | None:
    """The best hand sequences of the corrective process alone."""
    rows = []
    for task in study.tasks:
        trials = study.results.sequences[study.results.sequences.task == task]
        if len(trials) < 2:
            continue
        paper, best = published_exhaustive(task), trials.dropna(subset=["reward"]).head(4)
        shown = (
            f"{hands} {typographic(str(reward))}"
            for hands, reward in zip(best.hands, best.reward, strict=True)
        )
        values = (
            marked(study, task),
            f"{paper[0]} {typographic(str(paper[1]))}" if paper else None,
            ", ".join(shown),
            len(trials),
            int(trials.reward.isna().sum()),
        )
        rows.append(Row(task, values))
    return table(
        "exhaustive",
        "The corrective process alone with every hand sequence.",
        (
            Column("task", "task"),
            Column("published", "best, published", rests_on=("paper",)),
            Column("best", "best four, ours", rests_on=("simulation",)),
            Column("sequences", "sequences", "number", rests_on=("simulation",)),
            Column("failed", "failed", "number", rests_on=("simulation",)),
        ),
        rows,
    )


def _published_row(study: Study, row: PaperRow) -> Row:
    cell, remark = row.cell, row.paper.remark
    initial = cell.good.initial_reward.dropna()
    published_hands = [f"{s.hands} {s.runs or ''}".strip() for s in row.paper.sequences]
    printed_initial = published_initial(cell.task) or (None, None, False)
    return _beside(
        study,
        _CELLS,
        row,
        row.paper.summary,
        {"published_initial": ("derived",)} if printed_initial[2] else {},
        published_as=", ".join(filter(None, (_published_as(row.paper.summary), remark))),
        initial=float(initial.iloc[0]) if len(initial) else None,
        published_initial=printed_initial[1],
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
    columns: tuple[Column, ...],
    row: PaperRow | SequenceRow,
    published: Summary | None,
    rests_on: Mapping[str, tuple[RestsOn, ...]] = MappingProxyType({}),
    **own: Value,
) -> Row:
    """A row of either table: published, ours, the difference, and what is the table's own."""
    cell, apart = row.cell, row.difference
    both: dict[str, Value] = {
        "task": marked(study, cell.task),
        "method": cell.label,
        "published": estimate_as_printed(published),
        "published_runs": published.runs if published else None,
        "published_as": _published_as(published),
        "ours": mean_of(row.rewards),
        "runs": len(row.rewards),
        "difference": with_interval(apart.estimate, apart.low, apart.high) if apart else None,
    }
    name = (cell.task, cell.label, *([row.hands] if isinstance(row, SequenceRow) else []))
    made = row_of(columns, " ".join(name), row, ((cell.task, cell.label),), **both | own)
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
