"""Tables of the tasks, and of the paper's numbers and claims beside ours."""

from __future__ import annotations

import pandas as pd

from coartic.analysis.claims.ensemble import held_in_words
from coartic.analysis.claims.judge import judged, test_in_words
from coartic.analysis.methods import CONDITIONS, LEARNER
from coartic.analysis.statistics.estimates import interval, mean
from coartic.analysis.study import CellRuns, Study, cached, one_by_one
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.paper.published import RUNS, TRIALS, published_cell, published_initial
from coartic.analysis.topics.paper.rewards import beside_paper, published_of
from coartic.analysis.words import marked


def best_condition(study: Study, task: str) -> str | None:
    """Label of the learner's own condition with the highest mean reward on a task."""
    rewards = {
        label: float(cell.rewards.mean())
        for (name, label), cell in study.cells.items()
        if name == task and label in CONDITIONS and len(cell.good)
    }
    return max(rewards, key=lambda label: rewards[label]) if rewards else None


@table("task, arms, base, initial, condition, learned[], published, optimum, bound")
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
)
def published(study: Study) -> Rows:
    """Learned rewards of the paper's cells beside ours, and whether they are equivalent."""
    for row in beside_paper(study):
        cell, name = row["cell"], named(study, row["cell"])
        if not row["hands"]:
            initial = {
                "published_initial": getattr(published_initial(cell.task), "number", None),
                "ours_initial": cell.good.initial_reward.dropna().mean(),
            }
            yield f"{cell.task} {name['condition']}", row | name | initial | runs_of(cell)


@table("task, condition, hands, published_runs, runs, of_runs, published±, ours±, difference[]")
def hands(study: Study) -> Rows:
    """Learned rewards by hand sequence, published and ours, where there are several."""
    for row in beside_paper(study):
        cell, name = row["cell"], named(study, row["cell"])
        if row["hands"]:
            ids = cell.good.run_id[cell.good.hands == row["hands"]]
            behind = {"run_ids": " ".join(map(str, ids))}
            yield f"{cell.task} {name['condition']} {row['hands']}", row | name | behind


def named(study: Study, cell: CellRuns) -> Row:
    """The task of a cell by its title, and its condition."""
    task = study.tasks[cell.task]
    return {"task": marked(task.label, task), "condition": cell.label.removeprefix(LEARNER)}


@table(
    "statement, verdict, uncounted, evidence, test, p_holm, opposite_p_holm, ensemble, place, "
    "quote, section",
)
def claims(study: Study) -> Rows:
    """Claims with their verdicts: the paper's, and others, which say so."""
    for entry in judged(study):
        claim = entry.claim
        row: Row = {
            "statement": claim.statement + " †" * claim.fitted,
            "verdict": entry.verdict,
            "uncounted": claim.uncounted,
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

    Of the paper's conditions with the paper's number of trials: rows of
    :func:`~coartic.analysis.topics.paper.rewards.beside_paper` with ``task`` and ``method``.
    """
    shown: list[Row] = []
    for row in beside_paper(study):
        cell, paper = row["cell"], published_of(row["cell"])
        comparable = len(cell.good) and (cell.good.trials == TRIALS).all()
        several = paper is not None and len(paper.sequences) > 1
        if comparable and row["published"] is not None and (several or not row["hands"]):
            shown.append(row | {"task": cell.task, "method": cell.label})
    order = list(study.tasks)
    shown.sort(key=lambda row: (order.index(row["task"]), CONDITIONS.index(row["method"])))
    return pd.DataFrame(shown)


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
