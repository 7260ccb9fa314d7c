"""Area under the anytime curve: one number for how soon a method comes near the optimum."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.progress import BestSoFar, cells_by_optimum, cells_by_spend
from coartic.analysis.statistics.intervals import mean_interval

if TYPE_CHECKING:
    from coartic.analysis.study import Study


class Area(NamedTuple):
    """A row of :func:`areas`."""

    task: str
    method: str
    other_arm: str
    spend: str
    start: float
    end: float
    runs: int
    area: float
    low: float
    high: float


def areas(study: Study) -> pd.DataFrame:
    """Area under the anytime curve: one row per other arm, task, method and spend.

    The area of a run is its gap to the optimum R*, averaged over the logarithm of the
    budget B from ``start`` to ``end``:

        1 / ln(end / start) · ∫ min(1, (R* − best reward within B) / |R*|) d ln B,

    with a gap of 1 where there is no solution yet. It lies between 0 (optimal from
    ``start`` on) and 1; 0.1 means 10 % from the optimum on average, each doubling of the
    budget counting alike. A run that has ended keeps its best reward. ``end`` is the largest
    whole spend of a run that learns by trial, over all methods of the task, and ``start`` is
    ``end`` over the number of trials, one average trial: areas compare within a task, a
    spend and a folder only. The steps are integrated exactly.

    Columns: those of :class:`Area`. ``other_arm``: which optimum; ``area`` is the mean over
    ``runs`` with its interval ``low`` to ``high``
    (:func:`coartic.analysis.statistics.intervals.mean_interval`). Tasks without a known optimum,
    spends without a run that learns, and methods with a base that a parameter locks have no rows;
    of the optimum with the other arm still neither have methods that move that arm.
    """
    ends: dict[tuple[str, str], float] = {}
    for cell, spend, runs in cells_by_spend(study):
        totals = [run.total[spend] for run in runs if run.learns and run.solved]
        ends[cell.task, spend] = max([ends.get((cell.task, spend), 0.0), *totals])
    rows = []
    for other_arm, best, cell, spend, runs in cells_by_optimum(study):
        end, trials = ends[cell.task, spend], ends[cell.task, "trials"]
        if not best or trials <= 1:  # nothing to fall short of, or nobody who learns
            continue
        start = end / trials
        each = np.array([[_area(run, spend, best, start, end)] for run in runs])
        mean, low, high = (float(value[0]) for value in mean_interval(each))
        head = cell.task, cell.label, other_arm, spend, start, end
        rows.append(Area(*head, len(runs), mean, low, high))
    return pd.DataFrame(rows, columns=Area._fields)


def _area(run: BestSoFar, spend: str, optimum: float, start: float, end: float) -> float:
    gaps = np.minimum(1.0, (optimum - np.concatenate([[-np.inf], run.rewards])) / abs(optimum))
    edges = np.clip(np.concatenate([[start], run.spent[spend], [end]]), start, end)
    return float(np.average(gaps, weights=np.diff(np.log(edges))))
