"""Gaps, rankings and running times of a plain frame of results, also of one that you made.

The frame has a row for each run, with the columns ``method``, ``task``, ``reward`` (ticks, NaN for
a run that failed) and ``best_known``, the best reward known of the task. ``load(folder).runs`` is
such a frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from coartic.analysis.optima import gap_share
from coartic.analysis.statistics import running_times
from coartic.analysis.statistics.instances import task_mean
from coartic.errors import CoarticError
from coartic.estimates import Estimate, mean


def check_columns(frame: pd.DataFrame, *names: str) -> None:
    """Raise CoarticError for a frame without one of some columns."""
    missing = [name for name in names if name not in frame.columns]
    if missing:
        raise CoarticError(f"the frame has no column {', '.join(missing)}")


def gaps(frame: pd.DataFrame) -> pd.Series:
    """Gap of each run to the best known reward of its task.

    Parameters
    ----------
    frame : DataFrame
        With columns ``reward`` and ``best_known``, ticks.

    Returns
    -------
    Series
        (best known - reward) / \\|best known\\| of each row: 0.01 is 1 % more ticks than the best
        known. NaN for a run that failed, and where no reward is known.

    Raises
    ------
    CoarticError
        For a frame without these columns.

    Examples
    --------
    >>> frame = pd.DataFrame({"reward": [-303, -292], "best_known": [-292, -292]})
    >>> gaps(frame).round(3).tolist()
    [0.038, 0.0]
    """
    check_columns(frame, "reward", "best_known")
    reward, best = (
        frame[name].astype("Float64").to_numpy(np.float64, na_value=np.nan)
        for name in ("reward", "best_known")
    )
    return pd.Series(gap_share(reward, best), frame.index, name="gap")


def means(frame: pd.DataFrame, by: Sequence[str], columns: Sequence[str]) -> pd.DataFrame:
    """Means of groups of rows with their 95 % intervals.

    Parameters
    ----------
    frame : DataFrame
        A row for each task (or each run), with the columns of ``by`` and ``columns``.
    by : sequence of str
        Columns that make a group; NaN is a group of its own.
    columns : sequence of str
        Columns of numbers; NaN does not count.

    Returns
    -------
    DataFrame
        A row for each group in the order of first appearance: ``by``, ``rows``, the number of
        rows, and of each column ``x`` the mean ``x`` with ``x_low`` and ``x_high`` (BCa bootstrap,
        NaN with fewer than three values).

    Raises
    ------
    CoarticError
        For a frame without one of the columns.

    Examples
    --------
    >>> frame = pd.DataFrame({"h": [0, 0, 0, 1, 1, 1], "gap": [0.3, 0.2, 0.4, 0.1, 0.1, 0.1]})
    >>> means(frame, ["h"], ["gap"]).round(2)
       h  rows  gap  gap_low  gap_high
    0  0     3  0.3      0.2      0.37
    1  1     3  0.1      0.1      0.10
    """
    check_columns(frame, *by, *columns)
    rows = []
    for key, group in frame.groupby([*by], sort=False, dropna=False):
        row = {**dict(zip(by, key, strict=True)), "rows": len(group)}
        for name in columns:
            there = group[name].dropna().to_numpy(dtype=np.float64)
            row |= mean(there).columns(name) if len(there) else {}
        rows.append(row)
    ends = [f"{name}{end}" for name in columns for end in ("", "_low", "_high")]
    return pd.DataFrame(rows, columns=[*by, "rows", *ends])


def ranking(frame: pd.DataFrame) -> pd.DataFrame:
    """Rank methods by their mean gap over tasks.

    Parameters
    ----------
    frame : DataFrame
        With columns ``method``, ``task``, ``reward`` and ``best_known``.

    Returns
    -------
    DataFrame
        A row for each method: ``gap``, the mean over tasks of the mean over solved runs, with its
        95 % interval ``gap_low`` to ``gap_high`` for other runs on the same tasks (stratified
        bootstrap, NaN with fewer than three runs on a task); ``tasks`` that it solved, ``runs`` and
        ``failed``. The nearest is first. A method that did not solve every task of the frame has
        no gap and is last.

    Raises
    ------
    CoarticError
        For a frame without these columns.

    Examples
    --------
    >>> frame = pd.DataFrame(
    ...     {"method": ["mine", "mine", "yours"], "task": "ascending",
    ...      "reward": [-300, -296, -310], "best_known": -292}
    ... )
    >>> ranking(frame)[["gap", "runs", "failed"]].round(3)
              gap  runs  failed
    method
    mine    0.021     2       0
    yours   0.062     1       0
    """
    check_columns(frame, "method", "task", "reward", "best_known")
    frame = frame.assign(gap=gaps(frame))
    every = set(frame.task[frame.best_known.notna()])
    rows = {}
    for method, of_method in frame.groupby("method", sort=False):
        solved = of_method[of_method.gap.notna()]
        by_task = {str(task): runs.gap.to_numpy() for task, runs in solved.groupby("task")}
        solved_all = by_task and set(by_task) == every
        rows[method] = {
            **(task_mean(by_task) if solved_all else Estimate(np.nan)).columns("gap"),
            "tasks": len(by_task),
            "runs": len(of_method),
            "failed": int(of_method.reward.isna().sum()),
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("method")
    return table.sort_values("gap", kind="stable")


def ecdf(frame: pd.DataFrame, targets: Sequence[float]) -> pd.DataFrame:
    """Share of runs and targets that methods reach within a number of trials.

    Parameters
    ----------
    frame : DataFrame
        With columns ``method``, ``task``, ``run``, ``trials`` (made so far, from 1), ``reward`` and
        ``best_known``: a row each time a run became better, or one for its end.
    targets : sequence of float
        Gaps to the best known that count as reached, such as ``[0.1, 0.05, 0.01]``.

    Returns
    -------
    DataFrame
        A row at each number of trials at which a method's share rises: ``method``, ``trials``,
        ``share`` of all pairs of run and target (tasks count alike) that are reached within them.

    Raises
    ------
    CoarticError
        For a frame without these columns, and without targets.

    Examples
    --------
    >>> frame = pd.DataFrame(
    ...     {"method": "mine", "task": "ascending", "run": 0, "trials": [1, 40, 900],
    ...      "reward": [-319, -305, -293], "best_known": -292}
    ... )
    >>> ecdf(frame, [0.05, 0.01])
      method  trials  share
    0   mine    40.0    0.5
    1   mine   900.0    1.0
    """
    check_columns(frame, "method", "task", "run", "trials", "reward", "best_known")
    if not len(targets):
        raise CoarticError("targets are empty: name gaps, such as [0.1, 0.05, 0.01]")
    frame = frame.assign(gap=gaps(frame))
    rows = []
    for method, of_method in frame.groupby("method", sort=False):
        times = [
            np.array([[run.trials[run.gap <= target].min() for target in targets]
                      for _, run in of_task.groupby("run")], dtype=np.float64)
            for _, of_task in of_method.groupby("task")
        ]  # fmt: skip
        trials, share = running_times.share_by_budget(times)
        rows.append(pd.DataFrame({"method": method, "trials": trials, "share": share}))
    return pd.concat(rows, ignore_index=True)
