"""The paper's cells beside ours, and the corrective process alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.comparisons.paper import published_of
from analysis.published import TRIALS, Summary, published_exhaustive, published_initial
from analysis.report.document import Column, DataTable, Estimate, Row
from analysis.report.tables.common import counts, marked, mean_of, table, with_interval
from analysis.statistics.equivalence import MARGIN, difference
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study


def published_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells, published and ours."""
    rows = []
    for cell in study.results.cells:
        paper = published_of(cell)
        rewards = cell.good.reward.to_numpy(dtype=np.float64)
        if paper is None:
            continue
        found = None
        if paper.summary is not None and len(rewards):
            found = difference(rewards, paper.summary)
        comparable = (cell.good.trials == TRIALS).all()
        initial = cell.good.initial_reward.dropna()
        rows.append(
            Row(
                f"{cell.task} {cell.label}",
                (
                    marked(study, cell.task),
                    cell.label,
                    _summary(paper.summary),
                    paper.summary.runs if paper.summary else None,
                    mean_of(rewards),
                    len(rewards),
                    None
                    if found is None
                    else with_interval(found.estimate, found.low, found.high),
                    found.verdict if found is not None and comparable else None,
                    float(initial.iloc[0]) if len(initial) else None,
                    (published_initial(cell.task) or (None, None))[1],
                    counts(cell.good.hands),
                    ", ".join(f"{s.hands} {s.runs or ''}".strip() for s in paper.sequences)
                    or None,
                ),
                ((cell.task, cell.label),),
            )
        )
    return table(
        "published-and-ours",
        "Learned reward in the paper's cells, published and ours.",
        (
            Column("task", "task"),
            Column("method", "method"),
            Column("published", "paper", "number", "ticks", 1),
            Column("published_runs", "published runs", "number", printed=False),
            Column("ours", "ours", "number", "ticks", 1),
            Column("runs", "runs", "number", printed=False),
            Column("difference", "difference", "number", "ticks", 1),
            Column("verdict", "verdict"),
            Column("initial", "initial", "number", "ticks", 0, printed=False),
            Column("published_initial", "initial, published", "number", "ticks", 0, printed=False),
            Column("hands", "hands: runs", printed=False),
            Column("published_hands", "hands, published", printed=False),
        ),
        rows,
        (
            "Paper: mean ± SD as printed. Ours: mean ± SD with its BCa interval. The difference "
            "has Welch's interval from the printed mean, SD and runs; where no SD is printed the "
            f"printed mean is taken as exact. *Equivalent*: the interval lies within {MARGIN:.0%} "
            "of the published reward; *different*: outside; *undecided*: neither. The "
            "published mean of EC2 is pooled from what is printed by hand sequence. Learned "
            "reward: the best of a run's noisy trials, as in the paper as we read it.",
        ),
    )


def exhaustive_table(study: Study) -> DataTable | None:
    """The best hand sequences of the corrective process alone."""
    rows = []
    for task in study.results.tasks:
        trials = study.results.sequences[study.results.sequences.task == task]
        if len(trials) < 2:
            continue
        paper, best = published_exhaustive(task), trials.dropna(subset=["reward"])
        rows.append(
            Row(
                task,
                (
                    marked(study, task),
                    f"{paper[0]} {typographic(str(paper[1]))}" if paper else None,
                    ", ".join(
                        f"{row.hands} {typographic(str(row.reward))}"
                        for row in best.head(4).itertuples()
                    ),
                    len(trials),
                    int(trials.reward.isna().sum()),
                ),
            )
        )
    return table(
        "exhaustive",
        "The corrective process alone with every hand sequence.",
        (
            Column("task", "task"),
            Column("published", "best, published"),
            Column("best", "best four, ours"),
            Column("sequences", "sequences", "number"),
            Column("failed", "failed", "number"),
        ),
        rows,
    )


def _summary(summary: Summary | None) -> Estimate | None:
    return None if summary is None else Estimate(summary.mean, summary.sd)
