"""Published against ours: learned rewards of the paper's cells, whole and by hand sequence."""

from __future__ import annotations

import math
from typing import Any

from coartic.analysis.methods import LEARNER
from coartic.analysis.statistics.equivalence import MARGIN, difference_to_printed, verdict
from coartic.analysis.statistics.estimates import interval, standard_deviation
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.topics.paper.published import RUNS, TRIALS, PublishedCell, published_cell


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
        ours = map(str, hands.value_counts().index) if printed or hands.nunique() > 1 else ()
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
