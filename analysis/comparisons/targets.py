"""What it takes to come near the optimum, runs that never do counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from coartic.analysis.comparisons.progress import BestSoFar, cells_by_optimum
from coartic.analysis.results.folder import CellRuns
from coartic.analysis.statistics.estimates import CONFIDENCE
from coartic.analysis.statistics.intervals import kaplan_meier_median
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.study import Study

SHARES = (0.05, 0.02, 0.01)
"""Distances from the optimum that count as reached, as shares of it."""


class Target(NamedTuple):
    """A row of :func:`targets`."""

    task: str
    method: str
    other_arm: str
    spend: str
    share: float
    target: int
    runs: int
    reached: int
    reached_low: float
    reached_high: float
    median: float
    low: float
    high: float
    horizon: float


def targets(study: Study, *, shares: Sequence[float] = SHARES) -> pd.DataFrame:
    """Spend to come near the optimum R*: one row per other arm, task, method, spend and share.

    A run reaches a share when its gap, R* − reward, is at most that share of |R*|.
    Columns: ``task``, ``method``, ``other_arm`` (which optimum), ``spend``, ``share``,
    ``target`` (the reward that this takes), ``runs``, ``reached`` (how many runs),
    ``reached_low`` and ``reached_high`` (exact 95 % interval of the probability to reach it,
    Clopper & Pearson, 1934), ``median`` spend to reach it with the interval ``low`` to ``high``
    (:func:`coartic.analysis.statistics.intervals.kaplan_meier_median`), and ``horizon``.

    The median is over all runs, infinite where half of them did not reach the target; so are
    limits that the runs do not bound. Runs that could have gone on are right-censored, all at the
    horizon: the least spend at which one of them ended. (Each at its own end would make censoring
    depend on the outcome: worse trials take more ticks. Lin et al., 1997, on costs.) What was
    reached behind the horizon counts in ``reached`` only. A run could have gone on if its budget
    of trials stopped it (:attr:`BestSoFar.stopped
    <coartic.analysis.comparisons.progress.BestSoFar.stopped>`). Runs that ended by themselves
    never reach a target that they missed: a planner's, an exhaustive search's that tried all it
    had, one without a solution. The horizon is infinite where all runs ended by themselves. Runs
    whose time is not taken have no part in those over time.

    Tasks without a known optimum have no rows, nor have methods with a base that a parameter
    locks, for which it is no optimum; of the optimum with the other arm still neither have
    methods that move that arm.
    """
    rows = [_target(*place, share) for place in cells_by_optimum(study) for share in shares]
    return pd.DataFrame(rows, columns=Target._fields)


def _target(
    other_arm: str, optimum: int, cell: CellRuns, spend: str, runs: list[BestSoFar], share: float
) -> Target:
    target = math.ceil(optimum - share * abs(optimum) - 1e-9)
    times, horizon = _times(runs, spend, target)
    count = int(np.isfinite(times).sum())
    low, high = _chance(count, len(runs))
    seen = np.isfinite(times) & (times <= horizon)
    median = kaplan_meier_median(np.minimum(times, horizon), seen)
    return Target(
        *(cell.task, cell.label, other_arm, spend, share, target, len(runs), count),
        *(low, high, median.value, median.low, median.high, horizon),
    )


@cache  # many targets are reached by as many runs
def _chance(count: int, runs: int) -> tuple[float, float]:
    """Interval of a share (Clopper and Pearson)."""
    found = binomtest(count, runs).proportion_ci(CONFIDENCE, method="exact")
    return found.low, found.high


def _times(runs: Sequence[BestSoFar], spend: str, target: float) -> tuple[Array, float]:
    """Spend of each run to reach a reward, infinite where it did not, and the horizon."""
    reached = (run.spent[spend][run.rewards >= target].tolist() for run in runs)
    times = [spent[0] if spent else math.inf for spent in reached]
    ends = [run.total[spend] for run in runs if run.stopped and run.solved]
    return np.array(times), min(ends, default=math.inf)
