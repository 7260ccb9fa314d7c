"""Compute running times: the costs at which runs reach reward targets.

Running times are defined as in COCO (Hansen et al. 2021). Their empirical distribution (ECDF) is
the share of pairs of run and target that are reached within a budget. :func:`runtimes` returns it
for a results folder, :func:`ecdf` for a plain frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic.analysis.frames import DUPLICATE, SCORES, checked, refuse_rows, scored
from coartic.analysis.standings import cells_of, ranked_tasks, runs_by_method
from coartic.analysis.study import Study, load, solved
from coartic.errors import CoarticError
from coartic.estimates import FEWER_RESAMPLES, IN_CACHE, MIN_VALUES, SEED, TAILS, Estimate, slices
from coartic.internal.limits import brief_value, real_array
from coartic.robot import Array
from coartic.runs.plan import world_title

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""Costs, as columns of :attr:`.Study.runs`; ``solve_s`` is wall time, in s."""
TARGETS = tuple(n / 20 for n in range(1, 21))
"""Targets, as shares of the distance between two rewards: that of the corrective process alone with
its best hands, and the best known reward."""

_MAX_DRAWN_RUNS = 20_000_000  # in all resamples together; very many runs have fewer resamples
RunningTimes = Sequence[Array]
"""For each task, the cost at which each run of a method reaches each target, shape
``(runs, targets)``; infinite if the run does not reach the target."""


def _pairs(times: RunningTimes) -> tuple[Array, Array, NDArray[np.int32]]:
    """Return the finite running times, their weights, and the numbers of their runs.

    Each array has shape ``(k,)``. Running times are in ascending order. Runs are numbered from 0
    through all tasks. All tasks have the same weight. The weights of all pairs of run and target,
    including pairs that are not reached, sum to 1. Each task must have a run.
    """
    values = np.concatenate([of_task.ravel() for of_task in times])
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    weights = [np.full(of_task.size, 1 / of_task.size / len(times)) for of_task in times]
    runs = (order // times[0].shape[1]).astype(np.int32)  # saves memory with very many runs
    return values[order], np.concatenate(weights)[order], runs


def share_by_budget(times: RunningTimes) -> tuple[Array, Array]:
    """Return the budgets at which the share of reached targets rises, and these shares.

    Both have shape ``(k,)``. If no target is reached, there is one infinite budget with share 0.
    """
    values, weights, _ = _pairs(times)
    if not len(values):
        return np.array([math.inf]), np.zeros(1)
    last = np.append(values[1:] != values[:-1], True)
    return values[last], np.minimum(np.cumsum(weights)[last], 1.0)  # 1 except for rounding


def share_reached(times: RunningTimes) -> float:
    """Return the share of pairs of run and target that are reached at any cost.

    The share is from 0 to 1. All tasks have the same weight.
    """
    return float(_pairs(times)[1].sum())


def budget_for(times: RunningTimes, share: float) -> Estimate:
    """Return the smallest budget within which a share of the targets is reached.

    Parameters
    ----------
    times : sequence of arrays, shape (runs, targets)
        Running times on each task. All tasks have the same weight.
    share : float
        Share of all pairs of run and target, above 0 and up to 1.

    Returns
    -------
    Estimate
        The budget. It is infinite if no budget is enough. The ends of the interval are percentiles
        of a bootstrap that resamples runs within tasks. The interval is not widened for few runs,
        because budgets can be infinite. There is no interval if a task has fewer than five runs.
    """
    values, weights, runs = _pairs(times)

    def budgets(counts: NDArray[np.uint8]) -> Array:
        reached = np.cumsum(weights * counts[:, runs], axis=1)
        return np.asarray(np.append(values, math.inf)[(reached < share - 1e-9).sum(axis=1)])

    sizes = tuple(map(len, times))
    value = float(budgets(np.ones((1, sum(sizes)), dtype=np.uint8))[0])
    if min(sizes) < MIN_VALUES:
        return Estimate(value)
    drawn, at_once = _draws(sizes), 1 + IN_CACHE // (1 + len(values))
    resampled = [budgets(drawn[part]) for part in slices(len(drawn), at_once)]
    low, high = np.quantile(np.concatenate(resampled), TAILS, method="inverted_cdf")
    return Estimate(value, float(low), float(high))


def interval_by_budget(times: RunningTimes, budgets: Array) -> tuple[Array, Array]:
    """Return the 95 % interval of the share of targets that are reached within each budget.

    The ends are percentiles of a bootstrap that resamples runs within tasks. All tasks have the
    same weight.

    Parameters
    ----------
    times : sequence of arrays, shape (runs, targets)
        Running times on each task.
    budgets : ndarray, shape (budgets,)
        Finite budgets, in the unit of ``times``.

    Returns
    -------
    (ndarray, ndarray), shapes (budgets,)
        Low and high ends; NaN if a task has fewer than five runs.
    """
    sizes = tuple(map(len, times))
    if min(sizes) < MIN_VALUES:
        return np.full(len(budgets), math.nan), np.full(len(budgets), math.nan)
    weights = np.repeat([1 / size / len(times) for size in sizes], sizes)
    reached = [np.searchsorted(np.sort(run), budgets, "right") / len(run)
               for of_task in times for run in of_task]  # fmt: skip
    drawn, at_once, within = _draws(sizes), 1 + IN_CACHE // len(weights), np.array(reached)
    shares = [(drawn[part] * weights) @ within for part in slices(len(drawn), at_once)]
    low, high = np.quantile(np.concatenate(shares), TAILS, axis=0)
    return low, high


@lru_cache(maxsize=4)  # most methods have the same number of runs
def _draws(sizes: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return how often each resample draws each run, shape ``(resamples, runs)``.

    ``sizes`` are the numbers of runs on each task, in order. There are 1,999 resamples; for very
    many runs fewer, but at least 200. The array is cached: do not change it.
    """
    rng = np.random.default_rng(SEED)
    resamples = min(FEWER_RESAMPLES, max(_MAX_DRAWN_RUNS // sum(sizes), 200))
    drawn = np.empty((resamples, sum(sizes)), dtype=np.uint8)
    for size, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True):
        for part in slices(resamples, 100):
            rows = rng.multinomial(size, np.full(size, 1 / size), part.stop - part.start)
            drawn[part, end - size : end] = rows
    return drawn


@lru_cache(maxsize=4)
def improvements(study: Study) -> dict[str, tuple[Array, Array]]:
    """Return the trials of each run that improved its best reward, and the new best rewards.

    The keys are run ids. Runs without rewards of trials are left out. Trials are numbered from 1.
    Rewards are in negative ticks. Both arrays have shape ``(n,)``.
    """
    by_run = {}
    for run_id, rewards in study.rewards():
        best = np.fmax.accumulate(np.append(-np.inf, rewards))  # fmax ignores NaN
        trials = 1 + np.flatnonzero(best[1:] > best[:-1])
        by_run[run_id] = trials.astype(np.float64), best[trials]
    return by_run


def best_after(steps: tuple[Array, Array], trials: Any) -> Array:
    """Return a run's best reward (in negative ticks) after each of some numbers of trials.

    ``steps`` are the trials and rewards of the run in :func:`improvements`. The result has the
    shape of ``trials``. It is NaN before the first reward.
    """
    numbers, rewards = steps
    return np.asarray(np.append(math.nan, rewards)[np.searchsorted(numbers, trials, "right")])


@lru_cache(maxsize=4)
def target_ranges(study: Study) -> dict[str, tuple[float, float]]:
    """Return the two rewards between which the targets of each task lie, by task name.

    They are :attr:`.Study.corrective_best` and the best known reward, both in negative ticks. A
    task is left out if one of the two is missing, or if both are equal. In a world with noise there
    are no targets, because the reward of a single trial there is partly luck.
    """
    if study.is_noisy:
        return {}
    zero = study.corrective_best
    rewards = {name: (zero[name], best.reward) for name, best in study.optima.items()}
    return {name: pair for name, pair in rewards.items() if pair[0] < pair[1]}  # False for NaN


@lru_cache(maxsize=4_096)
def times_of(
    study: Study, task: str, label: str, spend: str, shares: tuple[float, ...] = TARGETS
) -> Array:
    """Return the cost at which each run of a method on a task reached each target.

    Parameters
    ----------
    study : Study
    task : str
        A task of :func:`target_ranges`.
    label : str
        Label of the method.
    spend : str
        The cost: ``trials``, ``forward_kinematics`` or ``solve_s``.
    shares : tuple of float
        Targets, as shares of the distance from the corrective process alone to the optimum.

    Returns
    -------
    ndarray, shape (runs, targets)
        Infinite for a target that no trial of the run reached, and for a failed run. A solved run
        whose cost is unknown has no row.

    Notes
    -----
    - A run without rewards of trials reaches the targets of its solution at its end.
    - Forward-kinematics evaluations and time (:func:`solve_times`) are only known for a whole run.
      They are spread evenly over its trials, although early trials took 0.6 to 3.4 times as many
      evaluations.
    """
    initial, optimum = target_ranges(study)[task]
    targets = np.ceil(initial + np.array(shares) * (optimum - initial) - 1e-9)
    runs, learned, rows = study.cells[task, label], improvements(study), []
    totals = runs[spend]
    if spend == "solve_s":
        totals = solve_times(solved(runs)).reindex(runs.index)
    columns = runs.run_id, runs.status, runs.trials, totals, runs.reward
    lists = (column.tolist() for column in columns)
    for run_id, status, trials_made, total, reward in zip(*lists, strict=True):
        if status != "ok":
            rows.append(np.full(len(targets), math.inf))
        elif not pd.isna(total):
            spent, rewards = np.array([float(total)]), np.array([float(reward)])
            if str(run_id) in learned:
                trials, rewards = learned[str(run_id)]
                spent = trials if spend == "trials" else total * (trials / trials_made)
            rows.append(np.append(spent, math.inf)[np.searchsorted(rewards, targets)])
    return np.array(rows).reshape(-1, len(targets))


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Return the wall time of solving (in s) for the runs that were made in warm processes.

    A process is warm if it has performed the method before. If no run was made in a warm process,
    the times of all runs are returned. A run whose time of solving is 0 or missing has its total
    wall time. The result keeps the index of ``runs``.
    """
    times = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    warm = runs.warm.to_numpy(bool, na_value=False)
    return times[warm] if warm.any() else times


@lru_cache(maxsize=4)
def runs_with_targets(study: Study) -> dict[str, pd.DataFrame]:
    """Return the runs on ranked tasks with targets (:func:`target_ranges`), by label of the method.

    Methods that did not run on all of these tasks are left out.
    """
    tasks = [task for task in ranked_tasks(study) if task in target_ranges(study)]
    of_methods = {}
    for method, of_method in runs_by_method(study).items():
        runs = of_method[of_method.task.isin(tasks)]
        if len(runs) and runs.task.nunique() == len(tasks):
            of_methods[method] = runs
    return of_methods


def times_on_tasks(
    study: Study, runs: pd.DataFrame, spend: str, shares: tuple[float, ...] = TARGETS
) -> list[Array]:
    """Return :func:`times_of` for each cell of a method's runs, in order."""
    return [times_of(study, *cell, spend, shares) for cell in cells_of(runs)]


def runtimes(
    results: str | Path | Study, *, targets: Sequence[float] | Array = TARGETS
) -> pd.DataFrame:
    """Return the share of targets that each method reaches within a budget (ECDF of running times).

    Only methods that ran on all ranked tasks with targets are included. A failed run reaches no
    target. All tasks have the same weight.

    Parameters
    ----------
    results : str, Path or Study
        A results folder, or its study.
    targets : sequence of float, shape (n,), optional
        Shares of the distance from the corrective process alone, with its best hands, to the
        optimum, above 0 and up to 1; by default 0.05, 0.1, ..., 1. Targets are rounded up to
        integer ticks.

    Returns
    -------
    pandas.DataFrame
        A row for each budget at which the share rises:

        - ``method``: label of the method;
        - ``spend``: the cost: ``trials``, ``forward_kinematics`` (evaluations) or ``solve_s``
          (seconds). The last two are spread evenly over the trials of a run;
        - ``budget``: in the unit of the cost;
        - ``share``: share of the pairs of run and target that are reached within the budget.

        A method that reaches no target has one row for each cost, with share 0 and an infinite
        budget. If a cost of a method is unknown on a task, the method has no rows for it.

    Raises
    ------
    CoarticError
        The folder is not a results folder, it has runs in several worlds or in a world with noise,
        targets are out of bounds, or no task has a best known reward above the reward of the
        corrective process alone.
    """
    study = results if isinstance(results, Study) else load(results)
    if study.is_noisy:
        raise CoarticError(
            f"{study.folder} has runs in {world_title(study.world)}, where the reward of a single "
            "trial is partly luck: running times need a world without motor noise"
        )
    shares = np.empty(0)
    with suppress(ValueError):  # not numbers, or masked
        shares = real_array("targets", targets)
    if shares.ndim != 1 or not shares.size or not ((shares > 0) & (shares <= 1)).all():
        raise CoarticError(
            f"targets are {brief_value(targets)}; they must be numbers above 0 and up to 1"
        )
    if not target_ranges(study):
        raise CoarticError(
            f"{study.folder} has no task whose best known reward is above the reward of the "
            "corrective process alone; running times need one, because targets lie between the two"
        )
    rows = []
    for name, runs in runs_with_targets(study).items():
        for spend in SPENDS:
            times = times_on_tasks(study, runs, spend, tuple(shares.tolist()))
            if all(map(len, times)):
                steps = zip(*share_by_budget(times), strict=True)
                rows += [(name, spend, *step) for step in steps]
    return pd.DataFrame(rows, columns=["method", "spend", "budget", "share"])


def ecdf(frame: pd.DataFrame, targets: Sequence[float]) -> pd.DataFrame:
    """Return the share of targets that methods reach within a number of trials.

    Parameters
    ----------
    frame : DataFrame
        With columns ``method``, ``task``, ``run``, ``trials`` (made so far, from 1), ``reward`` and
        ``best_known`` (negative ticks): a row for each improvement of a run, or for its end. If
        there is a column ``setting``, each setting of a method counts as a method.
    targets : sequence of float
        Gaps to the best known reward, such as ``[0.1, 0.05, 0.01]``.

    Returns
    -------
    DataFrame
        A row for each number of trials at which a method's share rises: ``method``, ``trials`` and
        ``share``, the share of all pairs of run and target that are reached within these trials.
        All tasks have the same weight. A run without a reward reaches no target, and on a task
        without runs of the method no target is reached. A method that reaches no target has one
        row, with share 0 and infinite trials.

    Raises
    ------
    CoarticError
        A column is missing or a reward is wrong (:func:`ranking`), trials are below 1, targets are
        not gaps, or the frame has no best known reward.

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
    checked(frame, names=("run",))
    frame = scored(frame, "trials")
    in_order = frame.sort_values(["trials", "reward"], kind="stable")
    is_repeated = in_order.duplicated(["key", "trials"]) & ~in_order.duplicated(
        ["key", *SCORES, "trials"]
    )
    falls = in_order.groupby("key").reward.diff() < 0
    improve = f"{DUPLICATE}, and its reward must be the best so far, which never falls"
    refuse_rows(in_order, "method", is_repeated | falls, improve)
    refuse_rows(frame, "trials", ~(frame.trials >= 1), "it must be the number of trials, from 1")
    reach = np.empty(0)
    with suppress(TypeError, ValueError):  # not numbers
        reach = real_array("targets", targets)
    if reach.ndim != 1 or not reach.size or not ((reach >= 0) & (reach <= 1)).all():
        raise CoarticError(
            f"targets are {brief_value(targets)}; they must be gaps, shares of the best known "
            "reward from 0 to 1, such as [0.1, 0.05, 0.01] for 10, 5 and 1 % (not per cent or "
            "ticks)"
        )
    if not frame.best_known.notna().any():
        raise CoarticError(
            "column best_known has no reward; targets need the best known reward of at least one "
            "task"
        )
    tasks, rows = frame.task[frame.best_known.notna()].unique(), []
    for method, of_method in frame.groupby("method", sort=False):
        times = []
        for task in tasks:
            runs = of_method[of_method.task == task].groupby("key")
            reached = [[run.trials[run.gap <= gap].min() for gap in reach] for _, run in runs]
            trials = np.array(reached or [[np.nan] * len(reach)], dtype=np.float64)
            times.append(np.where(np.isnan(trials), np.inf, trials))
        steps = zip(*share_by_budget(times), strict=True)
        rows += [(method, *step) for step in steps]
    return pd.DataFrame(rows, columns=["method", "trials", "share"])
