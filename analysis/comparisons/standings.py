"""How far every method ends from the optimum, on each task and over all of them.

Of the tasks whose optimum and initial solution are known, each counting the same. The learner
explores one-armed and two-armed tasks under different conditions, so that one row joins them:
``dual-process (EC1, EC4)`` is EC1 where a task has one arm and EC4 where it has two.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.methods import knows, method_rows
from coartic.analysis.methods import (
    EC1,
    EC3,
    EC4,
    LEARNER,
    TOGETHER,
    algorithm_of,
    is_learner,
    is_search,
    is_variant,
)
from coartic.analysis.statistics.across_tasks import gap_share, task_mean
from coartic.analysis.statistics.estimates import RESAMPLES, SEED, mean
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import Study, cached
from coartic.analysis.trajectories import initial_solution
from coartic.robot import Array

ALL_TASKS = "all tasks"
"""In the column of tasks: the mean over all of them."""


class Standing(NamedTuple):
    """How far a method ends from the optimum on a task, or over all."""

    task: str
    """Or :data:`ALL_TASKS`."""
    method: str
    """Label."""
    knows: str
    """What it knows of the reward: one of :data:`~.methods.GROUPS`."""
    algorithm: str
    gap: float
    """Mean, as a share of the optimum."""
    low: float
    high: float
    """Ends of the 95 % interval over runs, NaN where there is none."""
    runs: int


@cached
def ends(study: Study) -> dict[str, tuple[float, int]]:
    """Rewards of the initial solution and of the optimum by task, where both are known.

    The initial solution is the corrective process alone with the task's initial hands, the
    optimum that with all joints free.
    """
    found = {}
    for name, task in study.tasks.items():
        best = study.optima.get((name, "free"))
        initial = initial_solution(task, study.model)
        if best is not None and initial is not None and 0 != best.reward > -initial.ticks:
            found[name] = float(-initial.ticks), best.reward
    return found


@cached
def gaps(study: Study) -> pd.DataFrame:
    """One row a run of every task of :func:`ends`.

    Columns ``task``, ``method`` (its label, or the learner's conditions together), ``label``,
    ``run``, ``seed``, ``gap`` as a share of the optimum, NaN for a run without a solution.
    """
    parts = [pd.DataFrame(columns=["task", "method", "label", "run", "seed", "gap"])]
    for (task, label), cell in study.cells.items():
        if task in ends(study):
            rewards = cell.runs.reward.where(cell.runs.status == "ok")
            values = rewards.to_numpy(dtype=np.float64, na_value=math.nan)
            columns = {"run": cell.runs.run.to_numpy(), "seed": cell.runs.seed.to_numpy()}
            columns["gap"] = gap_share(values, ends(study)[task][1])
            parts.append(pd.DataFrame({"task": task, "method": label, "label": label, **columns}))
    frame = pd.concat(parts[1:] or parts, ignore_index=True)
    one_armed = frame[frame.label == EC1]
    for more in (EC4, EC3):
        two_armed = frame[frame.label == more]
        elsewhere = one_armed[~one_armed.task.isin(two_armed.task)]
        if len(two_armed) and len(elsewhere):
            together = f"{TOGETHER}EC1, {more.removeprefix(LEARNER)})"
            joined = pd.concat([elsewhere, two_armed]).assign(method=together)
            frame = pd.concat([frame, joined], ignore_index=True)
    return frame


@cached
def standings(study: Study) -> pd.DataFrame:
    """Rows as :class:`Standing`, nearest first: over all tasks, then task by task.

    Of methods that solved every run; searches for the optimum and variants are left out.
    """
    rows = [*_over_all(study), *_by_task(study)]
    frame = pd.DataFrame(rows, columns=Standing._fields)
    place = {name: number for number, name in enumerate((ALL_TASKS, *study.tasks))}
    order = frame.task.map(place)
    return frame.assign(order=order).sort_values(
        ["order", "gap"], kind="stable", ignore_index=True
    ).drop(columns="order")  # fmt: skip


def _over_all(study: Study) -> Iterator[Standing]:
    frame, tasks = gaps(study), ends(study)
    for method, runs in frame.groupby("method", sort=False):
        by_task = {str(task): own.gap.to_numpy() for task, own in runs.groupby("task")}
        shown = not is_variant(str(method)) and not is_search(str(method))
        if shown and len(tasks) > 1 and len(by_task) == len(tasks) and runs.gap.notna().all():
            found = task_mean(by_task)
            told = method_rows(study)[str(runs.task.iloc[0]), str(runs.label.iloc[0])].told
            yield Standing(
                *(ALL_TASKS, str(method), knows(told), algorithm_of(str(method))),
                *(found.estimate, found.low, found.high, len(runs)),
            )


def _by_task(study: Study) -> Iterator[Standing]:
    for (task, label), row in method_rows(study).items():
        best = study.optima.get((task, "free"))
        known = best is not None and best.reward and not math.isnan(row.gap)
        if known and row.solved == row.runs and not is_variant(label) and not is_search(label):
            assert best is not None
            found = mean(study.cells[task, label].rewards)
            # The higher the reward, the smaller the gap.
            values = (found.estimate, found.high, found.low)
            gap, low, high = ((best.reward - value) / -best.reward for value in values)
            algorithm = algorithm_of(label)
            yield Standing(task, label, knows(row.told), algorithm, gap, low, high, row.runs)


def leaders(study: Study, group: str) -> pd.DataFrame:
    """The best form of each algorithm of a group over all tasks (or on the one), nearest first.

    The learner is there by the form that explores most. Column ``p``: of the difference to the
    first row, NaN for that row itself: paired by task and seed, sign-flip test, two-tailed,
    after Holm's correction over the rows.
    """
    rows: pd.DataFrame = standings(study)
    if len(rows):
        rows = rows[(rows.task == rows.task.iloc[0]) & (rows.knows == group)]
    if not len(rows):
        return rows.assign(p=[])
    learners = np.array([is_learner(method) for method in rows.method])
    most = np.array(["EC4" in method for method in rows.method])
    shown = rows[~learners | (most if (learners & most).any() else learners)]
    shown = shown.drop_duplicates("algorithm").reset_index(drop=True)
    p = [apart_p(study, shown.method[0], other) for other in shown.method[1:]]
    tested: pd.DataFrame = shown.assign(p=[math.nan, *holm(p)])
    return tested


def apart_p(study: Study, first: str, second: str) -> float:
    """Two-tailed p of the difference of mean gaps of two methods over the tasks of both.

    Runs are paired by seed within their task; a method that is run once is compared with every
    run of the other. Sign-flip test with all tasks counting the same; NaN without pairs.
    """
    frame = gaps(study)
    one, two = (frame[frame.method == method] for method in (first, second))
    differences, weights = [], []
    for task in (task for task in ends(study) if task in set(one.task) & set(two.task)):
        values = _paired(one[one.task == task], two[two.task == task])
        if not len(values):
            return math.nan
        differences.append(values)
        weights.append(np.full(len(values), 1 / len(values)))
    if sum(map(len, differences)) < 2:
        return math.nan
    terms = np.concatenate(differences) * np.concatenate(weights)
    signs = np.random.default_rng(SEED).choice([-1.0, 1.0], size=(RESAMPLES, len(terms)))
    reached = np.abs(signs @ terms) >= abs(terms.sum()) - 1e-12
    return float((1 + reached.sum()) / (1 + RESAMPLES))


def _paired(one: pd.DataFrame, two: pd.DataFrame) -> Array:
    """Differences of gaps of runs that share a seed, or of each run to the only one."""
    if min(len(one), len(two)) == 1:
        found = itertools.product(one.gap, two.gap)
        return np.array([a - b for a, b in found])
    both = one.merge(two, on="seed", suffixes=("_one", "_two"))
    return (both.gap_one - both.gap_two).to_numpy(dtype=np.float64)
