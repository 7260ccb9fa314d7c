"""Tables of the tasks, and of the paper's numbers and claims beside ours."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from coartic.analysis.claims.ensemble import held_in_words
from coartic.analysis.claims.judge import judged, test_in_words
from coartic.analysis.comparisons.paper import PaperRow, paper_rows, published_of, sequence_rows
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.methods import CONDITIONS, LEARNER
from coartic.analysis.published import RUNS, Summary, published_cell, published_initial
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.statistics.estimates import (
    interval,
    mean,
    standard_deviation,
)
from coartic.analysis.study import Study, cached
from coartic.analysis.tables.table import Column, Row, Rows, runs_of, table
from coartic.analysis.words import marked


def best_condition(study: Study, task: str) -> str | None:
    """Label of the learner's own condition with the highest mean reward on a task."""
    rewards = {
        label: float(cell.rewards.mean())
        for (name, label), cell in study.cells.items()
        if name == task and label in CONDITIONS and len(cell.good)
    }
    return max(rewards, key=lambda label: rewards[label]) if rewards else None


@table(
    "task, arms, base, initial, condition, learned[], published, optimum, bound",
    initial=Column(digits=1),
    learned=Column(digits=1),
    bound=Column("proven bound"),
)
def tasks(study: Study) -> Rows:
    """One row a task: initial, learned, published and best possible reward."""
    for name in sorted(one_by_one(study), key=list(study.tasks).index):
        task, label = study.tasks[name], best_condition(study, name)
        best = study.optima.get(name)
        row: Row = {
            "task": marked(task.label, task),
            "arms": len(task.hands),
            "base": f"locked in {' and '.join(task.locked_base)}" if task.locked_base else "free",
            "optimum": best.reward if best else None,
            "bound": best.bound if best else None,
        }
        if label is not None:
            cell, condition = study.cells[name, label], label.removeprefix(LEARNER)
            paper = published_cell(name, condition)
            row |= {
                "initial": cell.good.initial_reward.dropna().mean(),
                "condition": condition,
                **interval("learned", mean(cell.rewards)),
                "published": paper.summary.mean if paper and paper.summary else None,
                **runs_of(cell),
            }
        yield name, row


@table(
    "task, condition, published±, ours±, runs, difference[], margin, verdict, published_initial, "
    "ours_initial",
    published=Column("published ± SD", 1),
    ours=Column("ours ± SD", 1),
    difference=Column(digits=1),
    margin=Column(digits=1),
    published_initial=Column("published initial", 1, page=False),
    ours_initial=Column("our initial", 1, page=False),
)
def published(study: Study) -> Rows:
    """Learned rewards of the paper's cells beside ours, and whether they are equivalent."""
    for row in paper_rows(study):
        task, condition = row.cell.task, row.cell.label.removeprefix(LEARNER)
        values: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "condition": condition,
            **printed_mean(row.published),
            "published_initial": getattr(published_initial(task), "number", None),
            **our_mean(row.rewards),
            "ours_initial": row.cell.good.initial_reward.dropna().mean(),
            "verdict": row.verdict,
            **interval("difference", row.difference),
            "margin": row.difference.margin if row.difference else None,
            **runs_of(row.cell),
        }
        yield f"{task} {condition}", values


@table(
    "task, condition, hands, published_runs, runs, of_runs, published±, ours±, difference[]",
    published_runs=Column("published runs"),
    of_runs=Column("of"),
    hands=Column("hands (runs)"),
)
def hands(study: Study) -> Rows:
    """Learned rewards by hand sequence, published and ours, where there are several."""
    for row in sequence_rows(study):
        task, condition = row.cell.task, row.cell.label.removeprefix(LEARNER)
        good = row.cell.good
        values: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "condition": condition,
            "hands": row.hands,
            "published_runs": row.published_runs,
            "of_runs": len(good),
            **printed_mean(row.published),
            **our_mean(row.rewards),
            **interval("difference", row.difference),
            "run_ids": " ".join(map(str, good.run_id[good.hands == row.hands])),
        }
        yield f"{task} {condition} {row.hands}", values


def printed_mean(summary: Summary | None) -> Row:
    """Mean and SD that the paper prints."""
    return {
        "published": summary.mean if summary else None,
        "published_sd": summary.sd if summary else None,
    }


def our_mean(rewards: Any) -> Row:
    """Number, mean and SD of rewards (n,)."""
    average = rewards.mean() if len(rewards) else math.nan
    return {"ours": average, "ours_sd": standard_deviation(rewards), "runs": len(rewards)}


@table(
    "statement, verdict, evidence, test, p_holm, opposite_p_holm, ensemble, place, quote, section",
    statement=Column("claim"),
    evidence=Column(page=False),
    test=Column(page=False),
    opposite_p_holm=Column("p of the opposite", p=True, page=False),
    ensemble=Column("sets of goals in which it holds"),
    place=Column("where"),
    quote=Column(page=False),
    section=Column(page=False),
)
def claims(study: Study) -> Rows:
    """Claims with their verdicts: the paper's, and others, which say so."""
    for entry in judged(study):
        claim = entry.claim
        row: Row = {
            "statement": claim.statement + " †" * claim.fitted,
            "verdict": entry.verdict,
            "evidence": entry.finding.evidence,
            "test": test_in_words(claim),
            "p_holm": entry.adjusted_p,
            "opposite_p_holm": entry.adjusted_opposite_p,
            "ensemble": held_in_words(claim.id) if claim.fitted else "",
            "place": claim.place or "not the paper's",
            "quote": claim.quote,
            "section": claim.section,
            "run_ids": " ".join(entry.run_ids),
        }
        yield claim.id, row


@cached
def published_differences(study: Study) -> pd.DataFrame:
    """Our mean reward less the published one: of cells, then of their hand sequences.

    Of the paper's conditions with the paper's number of trials. Columns ``task``, ``method``,
    ``hands`` (empty for a cell), ``runs`` and ``of_runs``, ``published``, ``published_sd``,
    ``published_runs``, ``pooled`` (whether the printed mean is one over several hand sequences),
    ``margin``, ``difference[]``, ``verdict``.
    """
    shown: list[PaperRow] = []
    parts = sequence_rows(study)
    for row in sorted(paper_rows(study), key=lambda row: CONDITIONS.index(row.cell.label)):
        if row.comparable and len(row.rewards):
            paper = published_of(row.cell)
            several = paper is not None and len(paper.sequences) > 1
            shown += [row, *(part for part in parts if several and part.cell is row.cell)]
    order = list(study.tasks)
    return pd.DataFrame(
        [
            {
                "task": row.cell.task,
                "method": row.cell.label,
                "hands": row.hands,
                "of_runs": len(row.cell.good),
                **our_mean(row.rewards),
                **printed_mean(row.published),
                "published_runs": row.published_runs,
                "pooled": row.published.derived,
                "margin": MARGIN * abs(row.published.mean),
                **interval("difference", row.difference),
                "verdict": row.difference.verdict
                if row.difference and not math.isnan(row.difference.low)
                else "",
            }
            for row in sorted(shown, key=lambda row: order.index(row.cell.task))
            if row.published is not None
        ]
    )


@cached
def hand_shares(study: Study) -> pd.DataFrame:
    """Shares of hand sequences on tasks with two hands, of every cell with a solved run.

    Columns ``task``, ``method``, ``source`` (``ours``, or ``published`` where the paper prints the
    runs of every sequence), ``hands``, ``runs``, ``share``; the commonest sequence first.
    """
    rows: list[tuple[str, str, str, str, int]] = []
    for (task, label), cell in study.cells.items():
        if len(study.tasks[task].hands) > 1 and len(cell.good):
            counts = cell.good.hands.value_counts()
            rows += [(task, label, "ours", str(name), int(n)) for name, n in counts.items()]
            paper = published_of(cell)
            printed = paper.sequences if paper else {}
            if sum(summary.printed_runs or 0 for summary in printed.values()) == RUNS:
                rows += [
                    (task, label, "published", name, summary.runs)
                    for name, summary in printed.items()
                    if summary.printed_runs
                ]
    frame = pd.DataFrame(rows, columns=["task", "method", "source", "hands", "runs"])
    totals = frame.groupby(["task", "method", "source"]).runs.transform("sum")
    return frame.assign(share=frame.runs / totals)
