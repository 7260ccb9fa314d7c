"""Running times: the costs at which runs reach reward targets, after COCO (Hansen et al. 2021).

The ECDF of running times is the share of pairs of run and target reached within a budget:
:func:`runtimes` of a results folder, :func:`ecdf` of a plain frame.
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
from coartic.estimates import FEWER_RESAMPLES, FEWEST, IN_CACHE, SEED, TAILS, Estimate, slices
from coartic.internal.limits import brief_value, real_array
from coartic.robot import Array

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""Costs, as columns of :attr:`.Study.runs`; ``solve_s`` is wall time, s."""
TARGETS = tuple(n / 20 for n in range(1, 21))
"""Targets, as shares of the distance from the corrective process alone, with its best hands, to the
optimum."""

_MOST_RUNS_DRAWN = 20_000_000  # in all resamples of a budget: of very many runs there are fewer
RunningTimes = Sequence[Array]
"""Running times of a method: for each task the cost at which each run reaches each target, shape
``(runs, targets)``; infinite for a target that the run does not reach."""


def _pairs(times: RunningTimes) -> tuple[Array, Array, NDArray[np.int32]]:
    """Return the finite running times in ascending order, their weights, and the numbers of their
    runs, counted from 0 through all tasks; shape ``(k,)`` each.

    The weights of all pairs of run and target, also of pairs that are not reached, sum to 1; each
    task has the same weight and needs a run.
    """
    values = np.concatenate([of_task.ravel() for of_task in times])
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    weights = [np.full(of_task.size, 1 / of_task.size / len(times)) for of_task in times]
    runs = (order // times[0].shape[1]).astype(np.int32)  # of very many runs
    return values[order], np.concatenate(weights)[order], runs


def share_by_budget(times: RunningTimes) -> tuple[Array, Array]:
    """Return the budgets at which the share of reached targets rises, ``(k,)``, and the share that
    is reached within each of these budgets, ``(k,)``.

    If no target is reached, one infinite budget with a share of 0.
    """
    values, weights, _ = _pairs(times)
    if not len(values):
        return np.array([math.inf]), np.zeros(1)
    last = np.append(values[1:] != values[:-1], True)
    return values[last], np.minimum(np.cumsum(weights)[last], 1.0)  # 1 except for rounding


def share_reached(times: RunningTimes) -> float:
    """Return the share, 0 to 1, of all pairs of run and target that are reached at any cost; each
    task has the same weight."""
    return float(_pairs(times)[1].sum())


def budget_for(times: RunningTimes, share: float) -> Estimate:
    """Return the least budget within which a share (above 0, up to 1) of all pairs of run and
    target is reached, infinite if no budget is enough; each task has the same weight.

    The percentile interval is of the bootstrap over runs within tasks, not widened: budgets can be
    infinite. No interval if a task has fewer than five runs.
    """
    values, weights, runs = _pairs(times)

    def budgets(counts: NDArray[np.uint8]) -> Array:
        reached = np.cumsum(weights * counts[:, runs], axis=1)
        return np.asarray(np.append(values, math.inf)[(reached < share - 1e-9).sum(axis=1)])

    sizes = tuple(map(len, times))
    value = float(budgets(np.ones((1, sum(sizes)), dtype=np.uint8))[0])
    if min(sizes) < FEWEST:
        return Estimate(value)
    drawn, at_once = _draws(sizes), 1 + IN_CACHE // (1 + len(values))
    resampled = [budgets(drawn[part]) for part in slices(len(drawn), at_once)]
    low, high = np.quantile(np.concatenate(resampled), TAILS, method="inverted_cdf")
    return Estimate(value, float(low), float(high))


def interval_by_budget(times: RunningTimes, budgets: Array) -> tuple[Array, Array]:
    """Return low and high ends, ``(budgets,)`` each, of the 95 % interval of the share of reward
    targets reached within each budget, a finite number in the unit of ``times``.

    The percentile interval is of the bootstrap over runs within tasks; NaN if a task has fewer than
    five runs.
    """
    sizes = tuple(map(len, times))
    if min(sizes) < FEWEST:
        return np.full(len(budgets), math.nan), np.full(len(budgets), math.nan)
    weights = np.repeat([1 / size / len(times) for size in sizes], sizes)
    reached = [np.searchsorted(np.sort(run), budgets, "right") / len(run)
               for of_task in times for run in of_task]  # fmt: skip
    drawn, at_once, within = _draws(sizes), 1 + IN_CACHE // len(weights), np.array(reached)
    shares = [(drawn[part] * weights) @ within for part in slices(len(drawn), at_once)]
    low, high = np.quantile(np.concatenate(shares), TAILS, axis=0)
    return low, high


@lru_cache(maxsize=4)  # methods mostly have as many runs as another
def _draws(sizes: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the number of times that each resample draws each run, shape ``(resamples, runs)``,
    for tasks with ``sizes`` runs, in their order: 1,999 resamples, fewer for very many runs, at
    least 200. The array is cached: do not change it."""
    rng = np.random.default_rng(SEED)
    resamples = min(FEWER_RESAMPLES, max(_MOST_RUNS_DRAWN // sum(sizes), 200))
    drawn = np.empty((resamples, sum(sizes)), dtype=np.uint8)
    for size, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True):
        for part in slices(resamples, 100):
            rows = rng.multinomial(size, np.full(size, 1 / size), part.stop - part.start)
            drawn[part, end - size : end] = rows
    return drawn


@lru_cache(maxsize=4)
def improvements(study: Study) -> dict[str, tuple[Array, Array]]:
    """Return for each run with rewards of trials, by run id, the numbers, from 1, of the trials
    with a higher reward than all trials before, and these rewards, negative ticks; shape ``(n,)``
    each."""
    by_run = {}
    for run_id, rewards in study.rewards():
        best = np.fmax.accumulate(np.append(-np.inf, rewards))  # without NaN
        trials = 1 + np.flatnonzero(best[1:] > best[:-1])
        by_run[run_id] = trials.astype(np.float64), best[trials]
    return by_run


def best_after(steps: tuple[Array, Array], trials: Any) -> Array:
    """Return a run's best reward, negative ticks, after each number of trials in ``trials``, in the
    shape of ``trials``; NaN before the first reward. ``steps``: the trials of the run with a new
    best reward, from 1, and these rewards (:func:`improvements`)."""
    numbers, rewards = steps
    return np.asarray(np.append(math.nan, rewards)[np.searchsorted(numbers, trials, "right")])


@lru_cache(maxsize=4)
def target_ranges(study: Study) -> dict[str, tuple[float, int]]:
    """Return the two rewards between which targets lie, negative ticks, by name of the task:
    :attr:`.Study.corrective_best`, of the corrective process alone, and the best known reward.

    Tasks without one of the two, or with equal ones, are left out.
    """
    zero = study.corrective_best
    rewards = {name: (zero[name], best.reward) for name, best in study.optima.items()}
    return {name: pair for name, pair in rewards.items() if pair[0] < pair[1]}  # NaN: none


@lru_cache(maxsize=4_096)
def times_of(
    study: Study, task: str, label: str, spend: str, shares: tuple[float, ...] = TARGETS
) -> Array:
    """Return the cost ``spend`` (``trials``, ``forward_kinematics`` or ``solve_s``) at which each
    run of a method on a task of :func:`target_ranges` reached each target, shape
    ``(runs, targets)``.

    ``shares`` are the targets, as shares of the distance from the corrective process alone to the
    optimum. Infinite for a target that no trial of the run reached, and for a failed run; a solved
    run without a known cost has no row. A run without rewards of trials reaches the targets of its
    solution at its end. Forward-kinematics evaluations and
    time (:func:`solve_times`) are totals of a run, spread evenly over its trials, though early
    trials took 0.6 to 3.4 times as many evaluations.
    """
    initial, optimum = target_ranges(study)[task]
    targets = np.ceil(initial + np.array(shares) * (optimum - initial) - 1e-9)
    runs, learned, rows = study.cells[task, label], improvements(study), []
    totals = runs[spend]
    if spend == "solve_s":
        totals = solve_times(solved(runs)).reindex(runs.index)
    columns = runs.run_id, runs.status, runs.trials, totals, runs.reward
    for run_id, status, made, total, reward in zip(*(of.tolist() for of in columns), strict=True):
        if status != "ok":
            rows.append(np.full(len(targets), math.inf))
        elif not pd.isna(total):
            spent, rewards = np.array([float(total)]), np.array([float(reward)])
            if str(run_id) in learned:
                trials, rewards = learned[str(run_id)]
                spent = trials if spend == "trials" else total * (trials / made)
            rows.append(np.append(spent, math.inf)[np.searchsorted(rewards, targets)])
    return np.array(rows).reshape(-1, len(targets))


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Return the wall time of solving, s, of the runs that were made in warm processes, or of all
    runs if no process was warm, by the index of ``runs``; of a run without a time of solving above
    0 its whole wall time."""
    times = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    warm = runs.warm.to_numpy(bool, na_value=False)
    return times[warm] if warm.any() else times


@lru_cache(maxsize=4)
def runs_with_targets(study: Study) -> dict[str, pd.DataFrame]:
    """Return, by label, the runs of each method that ran on all tasks with targets
    (:func:`target_ranges`) among the ranked tasks."""
    tasks = [task for task in ranked_tasks(study) if task in target_ranges(study)]
    of_methods = {}
    for method, every in runs_by_method(study).items():
        runs = every[every.task.isin(tasks)]
        if len(runs) and runs.task.nunique() == len(tasks):
            of_methods[method] = runs
    return of_methods


def times_on_tasks(
    study: Study, runs: pd.DataFrame, spend: str, shares: tuple[float, ...] = TARGETS
) -> list[Array]:
    """Return a list of the costs at which targets were reached, shape ``(runs, targets)`` each
    (:func:`times_of`), for each cell of ``runs``, runs of a method, in their order."""
    return [times_of(study, *cell, spend, shares) for cell in cells_of(runs)]


def runtimes(
    results: str | Path | Study, *, targets: Sequence[float] | Array = TARGETS
) -> pd.DataFrame:
    """Return the share of reward targets that methods reach within a budget: the ECDF of running
    times.

    Methods are those that ran on all ranked tasks that have targets; a failed run reaches none.
    Tasks have the same weight.

    Parameters
    ----------
    results : str, Path or Study
        A results folder, or its study.
    targets : sequence of float, shape (n,), optional
        Shares of the distance from the corrective process alone, with its best hands, to the
        optimum, above 0 and up to 1; by default 0.05, 0.1, ..., 1. Targets are rounded up to whole
        ticks.

    Returns
    -------
    pandas.DataFrame
        A row for each budget at which the share rises: ``method``, ``spend`` (``trials``;
        ``forward_kinematics``, evaluations, and ``solve_s``, seconds, both spread evenly over the
        trials of a run), ``budget``, and ``share``, the share of the pairs of run and target
        reached within the budget. A method that reaches no target has a single row for each cost,
        with share 0 and an infinite budget; a method without a known cost on a task has no row for
        this cost.

    Raises
    ------
    CoarticError
        The folder is no results folder, targets are out of bounds, or no task has a best known
        reward above the reward of the corrective process alone.
    """
    study = results if isinstance(results, Study) else load(results)
    shares = np.empty(0)
    with suppress(ValueError):  # no numbers, or masked
        shares = real_array("targets", targets)
    if shares.ndim != 1 or not shares.size or not ((shares > 0) & (shares <= 1)).all():
        raise CoarticError(
            f"targets are {brief_value(targets)}: needed are numbers above 0 and up to 1"
        )
    if not target_ranges(study):
        raise CoarticError("no task has a best known reward above the corrective process alone")
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
        ``best_known`` (negative ticks): a row for each improvement of a run, or for its end. With a
        column ``setting``, a method with several settings is several methods.
    targets : sequence of float
        Gaps to the best known reward, such as ``[0.1, 0.05, 0.01]``.

    Returns
    -------
    DataFrame
        A row for each number of trials at which a method's share rises: ``method``, ``trials`` and
        ``share``, the share of all pairs of run and target reached within these trials; tasks have
        the same weight. A task without runs, and a run without a reward, reach no target. A method
        that reaches no target has a single row, with share 0 and infinite trials.

    Raises
    ------
    CoarticError
        A column is missing or a reward is wrong (:func:`ranking`), trials are below 1, targets are
        no gaps, or the frame has no best known reward.

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
    again = in_order.duplicated(["key", "trials"]) & ~in_order.duplicated(
        ["key", *SCORES, "trials"]
    )
    falls = in_order.groupby("key").reward.diff() < 0
    improve = f"{DUPLICATE}, or its reward falls; needed are the best rewards so far"
    refuse_rows(in_order, "method", again | falls, improve)
    refuse_rows(frame, "trials", ~(frame.trials >= 1), "needed is the number of trials, from 1")
    reach = np.empty(0)
    with suppress(TypeError, ValueError):  # no numbers
        reach = real_array("targets", targets)
    if reach.ndim != 1 or not reach.size or not ((reach >= 0) & (reach <= 1)).all():
        raise CoarticError(
            f"targets are {brief_value(targets)}: needed are gaps, shares of the best known reward "
            "from 0 to 1, such as [0.1, 0.05, 0.01] for 10, 5 and 1 % (no per cent, no ticks)"
        )
    if not frame.best_known.notna().any():
        raise CoarticError("the frame has no best_known reward, so no targets")
    every, rows = frame.task[frame.best_known.notna()].unique(), []
    for method, of_method in frame.groupby("method", sort=False):
        times = []
        for task in every:
            runs = of_method[of_method.task == task].groupby("key")
            reached = [[run.trials[run.gap <= gap].min() for gap in reach] for _, run in runs]
            trials = np.array(reached or [[np.nan] * len(reach)], dtype=np.float64)
            times.append(np.where(np.isnan(trials), np.inf, trials))
        steps = zip(*share_by_budget(times), strict=True)
        rows += [(method, *step) for step in steps]
    return pd.DataFrame(rows, columns=["method", "trials", "share"])
