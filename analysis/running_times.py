"""Compute running times: the costs, such as trials, at which runs reach reward targets.

Running times and their ECDF are defined as in COCO (Hansen et al. 2021). The empirical cumulative
distribution function (ECDF) of running times maps a budget to the fraction of pairs of a run and a
target in which the run reached the target within the budget. Here the fraction is computed on each
task, and then averaged over tasks. :func:`runtimes` returns the ECDF for a results folder, and
:func:`ecdf` for a frame of your own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic.analysis.frames import DUPLICATE, SCORES, checked, refuse_rows, scored
from coartic.analysis.standings import cells_of, ranked_tasks, runs_by_method
from coartic.analysis.study import Study, improvements, load, shared_cells, solved
from coartic.errors import CoarticError
from coartic.estimates import FEWER_RESAMPLES, IN_CACHE, MIN_VALUES, SEED, TAILS, Estimate, slices
from coartic.internal.limits import brief_value, real_array
from coartic.robot import Array
from coartic.runs.plan import world_title

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""The three costs, named as columns of :attr:`.Study.runs`: numbers of trials, numbers of
forward-kinematics evaluations, and the wall time of solving, in s."""
TARGETS = tuple(n / 20 for n in range(1, 21))
"""Reward targets. Each is a fraction of the distance between two rewards: 0 is the reward of the
corrective process alone with its best hands, and 1 is the best known reward."""

_MAX_DRAWN_RUNS = 20_000_000  # in all resamples together; very many runs have fewer resamples
RunningTimes = Sequence[Array]
"""A list with an array for each task, shape ``(runs, targets)``: the cost at which each run of a
method reaches each target. The cost is infinite if the run does not reach the target. All arrays
have the same number of targets."""


def _pairs(times: RunningTimes) -> tuple[Array, Array, NDArray[np.int32]]:
    """Return the pairs of a run and a reached target, ordered by running time.

    Parameters
    ----------
    times : sequence of arrays, shape (runs, targets)
        Running times on each task. Each task must have at least one run.

    Returns
    -------
    ndarray, shape (k,)
        Running times of the k pairs whose target is reached, in ascending order.
    ndarray, shape (k,)
        Weight of each of the k pairs. All tasks have the same weight, and within a task all pairs
        have the same weight. The weights of all pairs, reached or not, sum to 1.
    ndarray of int, shape (k,)
        Number of the run of each of the k pairs. Runs are numbered from 0, continuously over all
        tasks.
    """
    values = np.concatenate([of_task.ravel() for of_task in times])
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    weights = [np.full(of_task.size, 1 / of_task.size / len(times)) for of_task in times]
    runs = (order // times[0].shape[1]).astype(np.int32)  # saves memory with very many runs
    return values[order], np.concatenate(weights)[order], runs


def share_by_budget(times: RunningTimes) -> tuple[Array, Array]:
    """Return the budgets and the values at the steps of the ECDF of running times.

    Parameters
    ----------
    times : sequence of arrays, shape (runs, targets)
        Running times on each task. All tasks have the same weight.

    Returns
    -------
    ndarray, shape (k,)
        Budgets at which the ECDF rises, in ascending order, in the unit of ``times``.
    ndarray, shape (k,)
        Value of the ECDF at each of these budgets: the fraction of pairs of a run and a target in
        which the run reached the target within the budget, computed on each task and averaged over
        tasks. If no target is reached, there is one infinite budget with the value 0.
    """
    values, weights, _ = _pairs(times)
    if not len(values):
        return np.array([math.inf]), np.zeros(1)
    last = np.append(values[1:] != values[:-1], True)
    return values[last], np.minimum(np.cumsum(weights)[last], 1.0)  # 1 except for rounding


def share_reached(times: RunningTimes) -> float:
    """Return the fraction of targets that the runs of a method reach at any cost, from 0 to 1.

    On each task, this is the fraction of pairs of a run and a target in which the run reached the
    target. The result is the mean of these fractions over tasks. ``times`` contains an array of
    running times for each task, shape ``(runs, targets)``.
    """
    return float(_pairs(times)[1].sum())


def budget_for(times: RunningTimes, share: float) -> Estimate:
    """Return the smallest budget within which a share of the targets is reached.

    Parameters
    ----------
    times : sequence of arrays, shape (runs, targets)
        Running times on each task. All tasks have the same weight.
    share : float
        Value that the ECDF (:func:`share_by_budget`) must reach, above 0 and up to 1.

    Returns
    -------
    Estimate
        The budget, in the unit of ``times``, with its 95 % interval. The budget is infinite if the
        ECDF does not reach ``share`` at any cost. The interval is the percentile interval of a
        bootstrap that resamples runs within tasks. The interval is not widened for small numbers of
        runs, because budgets can be infinite. There is no interval if a task has fewer than five
        runs.
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
    """Return the 95 % interval of the ECDF of running times at each budget.

    The interval is the percentile interval of a bootstrap that resamples runs within tasks. All
    tasks have the same weight.

    Parameters
    ----------
    times : sequence of arrays, shape (runs, targets)
        Running times on each task.
    budgets : ndarray, shape (budgets,)
        Finite budgets, in the unit of ``times``.

    Returns
    -------
    (ndarray, ndarray), shapes (budgets,)
        Lower and upper ends of the interval, fractions from 0 to 1. They are NaN if a task has
        fewer than five runs.
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
    """Return how often each bootstrap sample draws each run, shape ``(resamples, runs)``.

    ``sizes`` contains the number of runs on each task. There are 1,999 bootstrap samples, or fewer
    (at least 200) for more than about 10,000 runs. The array is cached: do not change it.
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
def target_ranges(study: Study) -> dict[str, tuple[float, float]]:
    """Return a dict that maps the name of each task to the range of its reward targets.

    The range is a pair: the reward of the corrective process alone (:attr:`.Study.corrective_best`)
    and the best known reward, both in negative ticks. A task is left out if one of the two rewards
    is missing, or if both are equal. The dict is empty in a world with noise, where the reward of a
    single trial is partly luck. It is cached: do not change it.
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
    """Return the running times of the runs of a method on a task.

    Parameters
    ----------
    study : Study
    task : str
        Name of a task that has targets (:func:`target_ranges`).
    label : str
        Label of the method.
    spend : {"trials", "forward_kinematics", "solve_s"}
        The cost: number of trials, number of forward-kinematics evaluations, or wall time in s.
    shares : tuple of float
        Targets, as fractions of the distance from the reward of the corrective process alone (0) to
        the best known reward (1). Each target reward is rounded up to an integer.

    Returns
    -------
    ndarray, shape (runs, targets)
        Running times, in the unit of the cost. They are infinite for a target that no trial of the
        run reached, and for a failed run. A solved run whose cost is unknown has no row. The array
        is cached: do not change it.

    Notes
    -----
    - A run without stored rewards of trials reaches all targets up to the reward of its solution
      when the run ends. If the method makes no trials, the number of trials is then 0.
    - Forward-kinematics evaluations and wall time (:func:`solve_times`) are only known for a whole
      run. They are spread evenly over its trials, which is not exact: the first trials can take
      several times as many evaluations as the average trial.
    """
    initial, optimum = target_ranges(study)[task]
    targets = np.ceil(initial + np.array(shares) * (optimum - initial) - 1e-9)
    runs, learned, rows = shared_cells(study)[task, label], improvements(study), []
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
    """Return the wall times of the runs that were made in a warm process.

    A process is warm if it has run the method before, so that the wall time does not include
    compilation. If no run was made in a warm process, the times of all runs are returned.

    Parameters
    ----------
    runs : DataFrame
        Runs, with columns ``solve_s`` and ``wall_s`` (in s) and ``warm``.

    Returns
    -------
    Series
        Times in s, with the index of the selected runs: ``solve_s`` (the time of solving), or
        ``wall_s`` for a run whose ``solve_s`` is 0 or missing.
    """
    times = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    warm = runs.warm.to_numpy(bool, na_value=False)
    return times[warm] if warm.any() else times


@lru_cache(maxsize=4)
def runs_with_targets(study: Study) -> dict[str, pd.DataFrame]:
    """Return a dict that maps each row of the ranking to its runs on tasks with targets.

    The keys are those of :func:`.runs_by_method`. The tasks are those of :func:`.ranked_tasks` that
    have targets (:func:`target_ranges`). Only rows of the ranking that have runs on all these
    tasks are included. The dict is cached: do not change it.
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
    """Return the running times of a method on each of its tasks (:func:`times_of`).

    ``runs`` are the runs of a row of the ranking. The list contains an array, shape ``(runs,
    targets)``, for each pair of a task and a label in ``runs``, in the order of the rows.
    """
    return [times_of(study, *cell, spend, shares) for cell in cells_of(runs)]


def runtimes(
    results: str | Path | Study, *, targets: Sequence[float] | Array = TARGETS
) -> pd.DataFrame:
    """Return the share of targets that each method reaches within a budget: its ECDF.

    The tasks are those whose best known reward is above the reward of the corrective process alone,
    and on which a method other than a search for the optimum was run. Methods without a run on one
    of these tasks, and searches for the optimum, are left out. A failed run reaches no target. All
    tasks have the same weight.

    Parameters
    ----------
    results : str, Path or Study
        A results folder, or its study.
    targets : sequence of float, shape (n,), optional
        Reward targets, as fractions of the distance from the reward of the corrective process alone
        with its best hands (0) to the best known reward (1). They are above 0 and up to 1; by
        default 0.05, 0.1, ..., 1. Each target reward is rounded up to an integer.

    Returns
    -------
    pandas.DataFrame
        A row for each step of the ECDF of each method and cost:

        - ``method``: label of the method, or of a row of the ranking that two conditions of the
          learner share, such as ``dual-process (EC1, EC4)``;
        - ``spend``: the cost: ``trials``, ``forward_kinematics`` (evaluations) or ``solve_s``
          (seconds). The last two are spread evenly over the trials of a run;
        - ``budget``: budget at which the ECDF rises, in the unit of the cost;
        - ``share``: value of the ECDF at this budget: the fraction of pairs of a run and a target
          in which the run reached the target within the budget, computed on each task and averaged
          over tasks.

        A method that reaches no target has one row for each cost, with share 0 and an infinite
        budget. A solved run whose cost is unknown is left out (:func:`times_of`); if no run of a
        method is left on a task, the method has no rows for this cost.

    Raises
    ------
    CoarticError
        - The folder is not a results folder, or runs of its suite are missing.
        - It has runs in several worlds, or in a world with noise.
        - There are no targets, or a target is not above 0 and up to 1.
        - No task has a best known reward above the reward of the corrective process alone.
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
    """Return the ECDF of running times of the methods in a frame of your own.

    The running time of a run for a target is the number of trials after which the run reached the
    target. The ECDF maps a number of trials to the share of targets reached within these trials.

    Parameters
    ----------
    frame : DataFrame
        A row for each improvement of a run, or only one row for the end of the run, with the
        columns

        - ``method``, ``task`` and ``run``: names of the method and of the task, and name or number
          of the run. If there is a column ``setting``, each setting of a method is treated as a
          method of its own;
        - ``trials``: number of trials that the run had made, from 1;
        - ``reward``: best reward of the run so far, negative ticks; NaN for a failed run;
        - ``best_known``: best known reward of the task, negative ticks.
    targets : sequence of float
        Gaps to the best known reward, as fractions from 0 to 1, such as ``[0.1, 0.05, 0.01]``.

    Returns
    -------
    DataFrame
        A row for each step of the ECDF of each method:

        - ``method``: name of the method;
        - ``trials``: number of trials at which the ECDF rises;
        - ``share``: value of the ECDF at this number of trials: the fraction of pairs of a run and
          a target in which the run reached the target within these trials, computed on each task
          and averaged over tasks.

        All tasks have the same weight, whatever their numbers of runs. Tasks without a best known
        reward are left out. A run without a reward reaches no target. If a method has no runs on a
        task, its fraction on this task is 0. A method that reaches no target has one row, with
        share 0 and infinite trials.

    Raises
    ------
    CoarticError
        - A column is missing, a reward is wrong, a task has several best known rewards, or column
          ``world`` names several worlds (:func:`.ranking`).
        - ``trials`` is missing or below 1.
        - The reward of a run falls, or a run has two different rewards after the same trials.
        - There are no targets, or a target is not from 0 to 1.
        - All entries of column ``best_known`` are missing.

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
