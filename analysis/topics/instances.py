"""The instances of a folder: the best known of each, and how far methods stay behind it."""

from __future__ import annotations

import pandas as pd

from coartic.analysis.methods import most_exploring
from coartic.analysis.optima import BestKnown, gap_share, locks_base
from coartic.analysis.statistics.instances import Scores
from coartic.analysis.study import Study, cached
from coartic.runs.plan import SEARCH


@cached
def best_of_instances(study: Study) -> dict[str, BestKnown]:
    """Best known reward of each instance of a family that has one."""
    optima = study.optima.items()
    return {name: best for name, best in optima if study.tasks[name].family is not None}


@cached
def solved(study: Study) -> pd.DataFrame:
    """A row for each method on each instance that it solved in some run, family by family.

    Without searches for the optimum. Columns ``family``, ``task``, ``label`` (``learner`` is the
    condition that explores most on the instance), and of the solved runs, shape ``(n,)``: ``gap``
    to the best known reward, as a share of it, and ``to_bound``, which the gap to the optimum is
    at most; None where nothing is proven.
    """
    labels = [label for label in dict.fromkeys(label for _, label in study.cells)
              if not label.startswith(SEARCH)]  # fmt: skip
    rows = []
    for name, best in best_of_instances(study).items():
        for shown in ("learner", *labels):
            label = most_exploring(study.tasks[name]) if shown == "learner" else shown
            cell = study.cells.get((name, label))
            if cell is not None and len(cell.good) and not locks_base(cell.runs):
                bound = None if best.bound is None else gap_share(cell.rewards, best.bound)
                gap = gap_share(cell.rewards, best.reward)
                rows.append((study.tasks[name].family, name, shown, gap, bound))
    frame = pd.DataFrame(rows, columns=["family", "task", "label", "gap", "to_bound"])
    place = {family: number for number, family in enumerate(frame.family.unique())}
    return frame.sort_values("family", key=lambda of: of.map(place), kind="stable")


def by_family(rows: pd.DataFrame, column: str) -> Scores:
    """Values of instances by family, without instances that have none."""
    rows = rows[rows[column].notna()]
    return {
        str(family): [(values,) for values in of_family[column]]
        for family, of_family in rows.groupby("family", sort=False)
    }
