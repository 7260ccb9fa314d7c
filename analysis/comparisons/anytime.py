"""Best reward so far within a budget: the anytime curves of all methods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.progress import BestSoFar, cells_by_spend
from coartic.analysis.statistics.intervals import mean_interval
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.study import Study

POINTS = 60
"""Budgets on an anytime curve."""
COLUMNS = (
    *("task", "method", "spend", "kind", "budget", "runs"),
    *("solved", "mean", "low", "high", "median"),
)


def anytime_curves(study: Study) -> pd.DataFrame:
    """Best reward so far within a budget: one row per task, method, spend and budget.

    Columns: ``task``, ``method``, ``spend``, ``kind`` (``curve`` for methods that learn by
    trial; ``point``, at the median spend of a whole run, for the others), ``budget``,
    ``runs``, ``solved`` (runs that have a solution within the budget), ``mean`` reward with
    the interval ``low`` to ``high``, and ``median`` reward.

    A curve starts where the first run has a solution and ends where the first run ends, so that
    nothing is extrapolated. The mean is missing until every run has a solution, never one of the
    faster runs alone; the median counts a run without one as worse than any. Intervals are those
    of :func:`coartic.analysis.statistics.intervals.mean_interval`, pointwise, not a band around
    the whole curve; they are missing for a single run. A cell's rows do not depend on other cells.
    Runs whose time is not taken (:func:`coartic.analysis.comparisons.methods.solve_times`) have no
    part in the curve over time, nor methods with a base that a parameter locks in any.
    """
    parts = []
    for cell, spend, runs in cells_by_spend(study):
        learns = any(run.learns for run in runs)
        budgets = _budgets(runs, spend) if learns else _whole(runs, spend)
        head = {"task": cell.task, "method": cell.label, "spend": spend}
        head["kind"] = "curve" if learns else "point"
        if len(budgets):
            rewards = _rewards(runs, spend, budgets, learns)
            parts.append(pd.DataFrame({**head, "budget": budgets, "runs": len(runs), **rewards}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=COLUMNS)


def _rewards(
    runs: Sequence[BestSoFar], spend: str, budgets: Array, learns: bool
) -> dict[str, Array]:
    """What the runs have reached within each budget (k,)."""
    # The spread of what planners spend is not one of their reward: theirs is of whole runs.
    within = budgets if learns else np.array([math.inf])
    values = np.array([run.best(spend, within) for run in runs])
    solved = np.isfinite(values)
    mean, low, high = mean_interval(np.where(solved.all(axis=0), values, math.nan))
    median = np.median(values, axis=0)
    median[~np.isfinite(median)] = math.nan
    return {"solved": solved.sum(axis=0), "mean": mean, "low": low, "high": high, "median": median}


def _budgets(runs: Sequence[BestSoFar], spend: str) -> Array:
    """Log-spaced budgets from the first solution to the first end of a run."""
    solved = [run for run in runs if run.solved]
    if not solved:
        return np.empty(0)
    first = min(run.spent[spend][0] for run in solved)
    end = min(run.total[spend] for run in solved)
    if not 0 < first <= end:
        return np.empty(0)
    budgets = np.geomspace(first, end, POINTS)
    budgets[[0, -1]] = first, end
    return np.unique(budgets if spend == "solve_s" else np.ceil(budgets))


def _whole(runs: Sequence[BestSoFar], spend: str) -> Array:
    """Median spend of whole runs, where there is one."""
    totals = np.array([run.total[spend] for run in runs])
    totals = totals[np.isfinite(totals)]
    return np.array([np.median(totals)]) if len(totals) else np.empty(0)
