"""Pareto sets of reward and spend, and how sure it is that a method is on one."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.methods import solve_times
from coartic.analysis.comparisons.progress import LABELS
from coartic.analysis.results.folder import CellRuns
from coartic.analysis.results.optima import locks_base
from coartic.analysis.statistics.intervals import resampled
from coartic.record import SEARCH
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.study import Study

TIME_TOLERANCE = 0.1
"""Relative difference up to which two solve times are a tie."""
COLUMNS = (
    *("task", "method", "told", "runs", "solved", "reward", "spend", "amount"),
    *("front", "front_share", "front_told", "told_share"),
)
Flags = np.ndarray[Any, np.dtype[np.bool_]]


def pareto_sets(study: Study) -> pd.DataFrame:
    """Mean reward against spend: one row per task, method and spend, best reward first.

    A method is on the front if no other has a mean reward as high for as little spend, with either
    one better; ties are all on it. Times within :data:`TIME_TOLERANCE` of each other are ties:
    they vary between machines and between runs. Columns: ``task``, ``method``, ``told`` (a letter
    for each kind of information, :data:`coartic.analysis.comparisons.methods.TOLD`), ``runs``,
    ``solved``, mean ``reward``, ``spend`` (:data:`~coartic.analysis.comparisons.progress.LABELS`;
    ``information`` is the number of kinds of information told, which does not weigh them),
    ``amount`` (median over runs), ``front``, ``front_share`` (of
    :data:`~coartic.analysis.statistics.intervals.RESAMPLES` bootstrap resamples, in how many it is
    on the front), and ``front_told`` and ``told_share``: the same among methods that were told
    nothing that it was not.

    Runs are resampled within their cell, reward and spend of a run together, by run number:
    methods that did the same in every run stay tied, as methods that share their seeds may.
    A method with a single run is taken as it is. Methods with runs that have no solution are
    left out: a mean of the others flatters them. So are the optimum's searches, which are
    references, and methods with a base that a parameter locks.
    """
    parts = [part for task in study.tasks for part in _fronts(study, _solving(study, task))]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=COLUMNS)


def _solving(study: Study, task: str) -> list[CellRuns]:
    """The methods to compare on a task, in the order of the table of methods."""
    return [
        cell
        for key, row in study.method_rows.items()
        if key[0] == task
        and row.solved == row.runs > 0
        and not (cell := study.cells[key]).method.startswith(SEARCH)
        and not locks_base(cell.runs)
    ]


def _fronts(study: Study, cells: Sequence[CellRuns]) -> Iterator[pd.DataFrame]:
    """The fronts of one task, one a spend."""
    if not cells:
        return
    rows = [study.method_rows[cell.task, cell.label] for cell in cells]
    told = [frozenset(row.told) for row in rows]
    no_more: Flags = np.array([[other <= own for other in told] for own in told])
    reward = np.array([row.reward for row in rows])
    rewards_again = np.stack([resampled(cell.rewards).mean(axis=-1) for cell in cells], axis=-1)
    for spend in LABELS:
        spent = [_spent(cell, spend, len(row.told)) for cell, row in zip(cells, rows, strict=True)]
        amount = np.array([float(_median(each)) for each in spent])
        amounts = np.stack([_median(resampled(each)) for each in spent], axis=-1)
        tolerance = TIME_TOLERANCE if spend == "solve_s" else 0.0
        worse = dominated(reward, amount, tolerance)
        again = dominated(rewards_again, amounts, tolerance)
        known, seen = ~np.isnan(amount), ~np.isnan(amounts)
        yield pd.DataFrame(
            {
                "task": [cell.task for cell in cells],
                "method": [cell.label for cell in cells],
                "told": [row.told for row in rows],
                "runs": [row.runs for row in rows],
                "solved": [row.solved for row in rows],
                "reward": reward,
                "spend": spend,
                "amount": amount,
                "front": ~worse.any(axis=-1) & known,
                "front_share": (~again.any(axis=-1) & seen).mean(axis=0),
                "front_told": ~(worse & no_more).any(axis=-1) & known,
                "told_share": (~(again & no_more).any(axis=-1) & seen).mean(axis=0),
            }
        )


def dominated(reward: Array, amount: Array, tolerance: float = 0.0) -> Flags:
    """Whether method i is dominated by method j, shape ``(..., n, n)``.

    ``reward`` and ``amount`` have shape ``(..., n)``. Amounts whose ratio is at most
    1 + ``tolerance`` are ties. Domination has no cycles all the same: along one the reward
    could not change, and amounts would only fall.
    """
    own, other = reward[..., :, None], reward[..., None, :]
    spent, others = amount[..., :, None], amount[..., None, :]
    room = 1 + tolerance
    as_good = (other >= own) & (others <= spent * room)
    better = (other > own) | (others * room < spent)
    return as_good & better


def _spent(cell: CellRuns, spend: str, told: int) -> Array:
    """What each run spent (n,); NaN for times that are not taken."""
    if spend == "information":
        return np.full(len(cell.runs), float(told))
    times = spend == "solve_s"
    values = solve_times(cell.good).reindex(cell.runs.index) if times else cell.runs[spend]
    return values.to_numpy(dtype=np.float64, na_value=np.nan)


def _median(values: Array) -> Array:
    """Median over the last axis of the values that are known; NaN where none is."""
    if not np.isnan(values).any():
        return np.asarray(np.median(values, axis=-1))  # the same, in a tenth of the time
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        return np.asarray(np.nanmedian(values, axis=-1))
