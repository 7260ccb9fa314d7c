"""Shares of targets reached within a budget: empirical distributions over runs and targets.

After COCO (Hansen et al. 2021): a target is a reward between those of the initial solution and of
the optimum, and what counts is the share of pairs of run and target that have been reached.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.overall import ends, variant
from coartic.analysis.comparisons.progress import SPENDS, BestSoFar, cells_by_spend
from coartic.analysis.statistics.across_tasks import band
from coartic.analysis.statistics.estimates import FEWEST
from coartic.record import SEARCH
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.study import Study

WAY = np.arange(1, 21) / 20
"""Targets, as shares of the way from the initial solution to the optimum."""
ALL_TASKS = "all tasks"
"""In the column of tasks: the mean over all of them."""
_BUDGETS = 60
_RESAMPLES = 200  # of runs, for bands that are looked at


class Reached(NamedTuple):
    """Share of pairs of run and target that a method has reached within a budget."""

    task: str
    """Or :data:`ALL_TASKS`."""
    method: str
    """Label, or the learner's over one-armed and two-armed tasks."""
    spend: str
    """Of :data:`~coartic.analysis.comparisons.progress.SPENDS`."""
    budget: float
    """0 is for what spends nothing."""
    share: float
    low: float
    """Of the pointwise 95 % percentile interval over runs; NaN where runs are too few."""
    high: float
    runs: int


def reached(study: Study) -> pd.DataFrame:
    """Rows as :class:`Reached`, where a share changes, of all methods without their variants.

    Of the tasks that have a scale (:func:`~coartic.analysis.comparisons.overall.ends`); a run
    whose steps are not known, such as the time of a cold one, has no part. A method has rows over
    all tasks if it ran on every one of them.
    """
    scale = ends(study)
    curves: dict[tuple[str, str, str], Array] = {}
    budgets = _budgets(study)
    for cell, spend, runs in cells_by_spend(study):
        shown = not variant(cell.label) and not cell.label.startswith(SEARCH)
        if cell.task in scale and runs and shown and spend in budgets:
            curve = _shares(runs, spend, budgets[spend], *scale[cell.task])
            curves[cell.task, cell.label, spend] = curve
    rows: list[Reached] = []
    for (task, label, spend), runs_by_budget in curves.items():
        rows += _rows(task, label, spend, budgets[spend], [runs_by_budget])
    for label, labels in _everywhere(study).items():
        for spend in budgets:
            keys = [(task, own, spend) for task, own in labels.items()]
            if len(scale) > 1 and all(key in curves for key in keys):
                parts = [curves[key] for key in keys]
                rows += _rows(ALL_TASKS, label, spend, budgets[spend], parts)
    return pd.DataFrame(rows, columns=Reached._fields)


def _budgets(study: Study) -> dict[str, Array]:
    """Of each spend 0, then a logarithmic grid over all that runs spent."""
    found = {}
    for spend in SPENDS:
        parts = [run.spent[spend] for run in study.best_so_far.values() if run.known(spend)]
        spent = np.concatenate(parts) if parts else np.empty(0)
        spent = spent[np.isfinite(spent) & (spent > 0)]
        if len(spent):
            grid = np.geomspace(spent.min(), spent.max(), _BUDGETS)
            grid[-1] = spent.max()
            found[spend] = np.concatenate([[0.0], grid])
    return found


def _shares(
    runs: Sequence[BestSoFar], spend: str, budgets: Array, start: float, best: float
) -> Array:
    """Share of the targets that each run has reached within each budget, ``(runs, budgets)``."""
    targets = np.ceil(start + WAY * (best - start) - 1e-9)
    return np.array([(run.best(spend, budgets)[:, None] >= targets).mean(axis=1) for run in runs])


def _everywhere(study: Study) -> Mapping[str, dict[str, str]]:
    """Methods that ran on all tasks: their labels by task."""
    own = study.scores.drop_duplicates(["method", "task"])
    found: dict[str, dict[str, str]] = {}
    for method in map(str, study.overall.method):
        if not variant(method):
            rows = own[own.method == method]
            found[method] = dict(zip(map(str, rows.task), map(str, rows.label), strict=True))
    return found


def _rows(
    task: str, label: str, spend: str, budgets: Array, parts: Sequence[Array]
) -> Iterator[Reached]:
    """One where the mean over ``parts`` changes, of the first budget and of the last."""
    share = np.mean([runs.mean(axis=0) for runs in parts], axis=0)
    low = high = np.full(len(share), math.nan)
    if min(map(len, parts)) >= FEWEST:
        low, high = band(parts, resamples=_RESAMPLES)
    count = sum(len(runs) for runs in parts)
    for place, budget in enumerate(budgets):
        inner = 0 < place < len(budgets) - 1
        if inner and share[place] == share[place - 1]:
            continue
        ends_here = float(low[place]), float(high[place])
        yield Reached(task, label, spend, float(budget), float(share[place]), *ends_here, count)
