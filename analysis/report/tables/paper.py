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
from analysis.report.document import Column, DataTable, Estimate, Row, Value
from analysis.report.tables.common import counts, marked, mean_of, table, with_interval
from analysis.statistics.equivalence import MARGIN, Equivalence
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study

_PUBLISHED_AS = Column("published_as", "published as", rests_on=("paper",), printed=False)
_OURS = Column("ours", "ours", "number", "ticks", 1, rests_on=("runs",))
_RUNS = Column("runs", "runs", "number", rests_on=("runs",), printed=False)
_DIFFERENCE = Column("difference", "difference", "number", "ticks", 1, rests_on=("runs", "paper"))
_PAPER = (
    "Published: Shah, Barto & Fagg (2013), mean ± SD, rounded as there. *derived*: pooled from "
    "what is printed by hand sequence; *runs assumed*: no number of runs stands beside it, "
    f"{RUNS} is that of every experiment. The difference, ours less published, has Welch's "
    "interval from the printed mean, SD and runs; where no SD is printed the printed mean is "
    "taken as exact. "
    "Each interval is for its row alone. Rewards are not normally distributed, as the paper says "
    "of its own: the intervals are approximate, most of all where runs settle on several hand "
    "sequences."
)


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
        "reward, the margin; *different*: outside; *undecided*: neither. Of the gain: the margin "
        "as a share of what learning gained in the paper. Runs with another number of trials "
        f"than the paper's {TRIALS} are not comparable and get no verdict.",
    ]
    if derived:
        notes.append(
            f"Published initial rewards of {', '.join(derived)} are derived from other printed "
            "numbers."
        )
    return table(
        "published-and-ours",
        "Learned reward in the paper's cells, published and ours.",
        (
            Column("task", "task"),
            Column("method", "method"),
            Column("published", "paper", "number", "ticks", 1, rests_on=("paper",)),
            Column(
                "published_runs", "published runs", "number", rests_on=("paper",), printed=False
            ),
            _PUBLISHED_AS,
            _OURS,
            _RUNS,
            _DIFFERENCE,
            Column("verdict", "verdict", rests_on=("runs", "paper")),
            Column("margin", "margin", "number", "ticks", 1, rests_on=("paper",), printed=False),
            Column(
                "margin_of_gain",
                "of the gain",
                "share",
                digits=0,
                rests_on=("paper",),
                printed=False,
            ),
            Column("initial", "initial", "number", "ticks", 0, rests_on=("runs",), printed=False),
            Column(
                "published_initial",
                "initial, published",
                "number",
                "ticks",
                0,
                rests_on=("paper",),
                printed=False,
            ),
            Column("hands", "hands: runs", rests_on=("runs",), printed=False),
            Column("published_hands", "hands, published", rests_on=("paper",), printed=False),
        ),
        [_published_row(study, row) for row in rows],
        tuple(notes),
    )


def sequences_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells by hand sequence, published and ours."""
    return table(
        "by-hand-sequence",
        "Learned reward by hand sequence, where the paper or our runs tell several apart.",
        (
            Column("task", "task"),
            Column("method", "method"),
            Column("hands", "hands", rests_on=("runs", "paper")),
            Column("published", "paper", "number", "ticks", 1, rests_on=("paper",)),
            Column("published_runs", "published runs", "number", rests_on=("paper",)),
            _PUBLISHED_AS,
            _OURS,
            Column("runs", "runs", "number", rests_on=("runs",)),
            _DIFFERENCE,
        ),
        [_sequence_row(study, row) for row in sequence_rows(study)],
        (_PAPER,),
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
    cell, summary = row.cell, row.paper.summary
    initial = cell.good.initial_reward.dropna()
    published_hands = [f"{s.hands} {s.runs or ''}".strip() for s in row.paper.sequences]
    values = (
        marked(study, cell.task),
        cell.label,
        _estimate(summary),
        summary.runs if summary else None,
        _published_as(summary, row.paper),
        mean_of(row.rewards),
        len(row.rewards),
        _difference(row.difference),
        row.verdict,
        row.margin,
        row.margin_of_gain,
        float(initial.iloc[0]) if len(initial) else None,
        (published_initial(cell.task) or (None, None))[1],
        counts(cell.good.hands),
        ", ".join(published_hands) or None,
    )
    return Row(f"{cell.task} {cell.label}", values, ((cell.task, cell.label),))


def _sequence_row(study: Study, row: SequenceRow) -> Row:
    task, label = row.cell.task, row.cell.label
    values = (
        marked(study, task),
        label,
        row.hands,
        _estimate(row.published),
        row.published_runs,
        _published_as(row.published),
        mean_of(row.rewards),
        len(row.rewards),
        _difference(row.difference),
    )
    return Row(f"{task} {label} {row.hands}", values, ((task, label),))


def _published_as(summary: Summary | None, cell: PublishedCell | None = None) -> str | None:
    if summary is None:
        return ", ".join(filter(None, ("not printed", cell.remark))) if cell else None
    if summary.derived:
        return "derived"
    return "printed" if summary.runs_printed else "printed, runs assumed"


def _estimate(summary: Summary | None) -> Estimate | None:
    return None if summary is None else Estimate(summary.mean, summary.sd)


def _difference(found: Equivalence | None) -> Value:
    return None if found is None else with_interval(found.estimate, found.low, found.high)
