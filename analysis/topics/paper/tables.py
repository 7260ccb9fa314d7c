"""Tables of the paper's numbers and claims beside ours."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from coartic.analysis.claims.judgements import CLAIMS, judgements
from coartic.analysis.methods import LEARNER, LEARNERS
from coartic.analysis.statistics.equivalence import MARGIN, difference_to_printed, verdict
from coartic.analysis.statistics.estimates import interval, standard_deviation
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.paper.published import (
    RUNS,
    PublishedCell,
    published_cell,
    published_initial,
)
from coartic.analysis.words import marked
from coartic.learner.learning import TRIALS


def published_of(cell: CellRuns) -> PublishedCell | None:
    """What the paper prints about a cell: about its own learner as it stands."""
    if not cell.method.startswith(LEARNER) or cell.variant:
        return None
    return published_cell(cell.task, cell.method.removeprefix(LEARNER))


@cached
def beside_paper(study: Study) -> list[dict[str, Any]]:
    """Every cell that the paper has too, in the order of the plan, and its hand sequences.

    Sequences follow their cell where the paper or our runs tell several apart: those that the paper
    prints come first, then ours by their number of runs. A row has ``cell``, ``hands`` (empty for
    the whole cell), ``published`` and its ``published_sd``, ``published_runs`` (of hands 0 only
    where all others are printed), ``pooled`` (whether the printed mean is one over several hand
    sequences) and the ``margin`` of equivalence, ``ours``, ``ours_sd`` and ``runs`` of our runs
    with a solution, ``of_runs`` of the cell. Where both are there, it has ``difference[]``, ours
    less published, and a ``verdict`` if our runs have as many trials as the paper's.
    """
    rows = []
    for cell in study.cells.values():
        paper, hands = published_of(cell), cell.good.hands
        if paper is None:
            continue
        printed = paper.sequences
        complete = sum(summary.printed_runs or 0 for summary in printed.values()) == RUNS
        ours = map(str, hands.value_counts().index) if printed or len(set(hands)) > 1 else ()
        for name in dict.fromkeys(["", *printed, *ours]):
            rewards = cell.rewards[(hands == name).to_numpy(bool)] if name else cell.rewards
            summary = printed.get(name) if name else paper.summary
            row: dict[str, Any] = {
                "cell": cell,
                "hands": name,
                "published": summary.mean if summary else None,
                "published_sd": summary.sd if summary else None,
                "published_runs": summary.printed_runs if summary else 0 if complete else None,
                "pooled": summary.derived if summary else False,
                "margin": MARGIN * abs(summary.mean) if summary else None,
                "ours": rewards.mean() if len(rewards) else math.nan,
                "ours_sd": standard_deviation(rewards),
                "runs": len(rewards),
                "of_runs": len(cell.good),
                "verdict": None,
            }
            if summary and len(rewards):
                apart = difference_to_printed(rewards, summary.mean, summary.sd, summary.runs)
                row |= interval("difference", apart)
                if (cell.good.trials == TRIALS).all():
                    row["verdict"] = verdict(apart, row["margin"])
            rows.append(row)
    return rows


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
    return {"task": marked(task), "condition": cell.label.removeprefix(LEARNER)}


@table(
    "statement, verdict, evidence, test, p_holm, opposite_p_holm, sets, place, quote",
)
def claims(study: Study) -> Rows:
    """The paper's claims with their verdicts."""
    for name, judged in judgements(study).iterrows():
        claim = CLAIMS[str(name)]
        row: Row = {
            "statement": claim.text + " †" * claim.fitted,
            "sets": claim.sets or "not counted" * claim.fitted,
            "place": claim.place,
            "quote": claim.quote,
        }
        yield claim.id, {**judged, **row}


@cached
def published_differences(study: Study) -> pd.DataFrame:
    """Our mean reward less the published one: of cells, then of their hand sequences.

    Of the paper's conditions with the paper's number of trials: rows of
    :func:`beside_paper` with ``task`` and ``method``.
    """
    shown: list[Row] = []
    for row in beside_paper(study):
        cell, paper = row["cell"], published_of(row["cell"])
        comparable = len(cell.good) and (cell.good.trials == TRIALS).all()
        several = paper is not None and len(paper.sequences) > 1
        if comparable and row["published"] is not None and (several or not row["hands"]):
            shown.append(row | {"task": cell.task, "method": cell.label})
    order = list(study.tasks)
    shown.sort(key=lambda row: (order.index(row["task"]), LEARNERS.index(row["method"])))
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
