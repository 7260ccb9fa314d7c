"""How far every method ends from the optimum, on each task and over all of them.

Of the tasks whose optimum and initial solution are known, each counting the same. The learner
explores one-armed and two-armed tasks under different conditions, so that one row joins them:
``dual-process (EC1, EC4)`` is EC1 where a task has one arm and EC4 where it has two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pandas as pd

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
from coartic.analysis.statistics.estimates import Estimate, mean
from coartic.analysis.statistics.hypotheses import sign_flip_test
from coartic.analysis.statistics.instances import gap_share, task_mean
from coartic.analysis.study import Study, cached
from coartic.analysis.topics.comparison.groups import group_of, method_rows
from coartic.analysis.trajectories import initial_reward

ALL_TASKS = "all tasks"
"""What stands in the column of tasks for the mean over all of them."""


@cached
def initial_and_optimum(study: Study) -> dict[str, tuple[float, int]]:
    """Rewards of the initial solution and of the optimum by task, where the optimum is better.

    Without tasks where one of them is not known or the optimum is 0. The initial solution is the
    corrective process alone with the task's initial hands, the optimum that with all joints free.
    """
    by_task = {}
    for name, task in study.tasks.items():
        best = study.optima.get(name)
        initial = initial_reward(task, study.model)
        if best is not None:
            can_improve = best.reward > initial  # never from NaN: no initial solution
            gap_is_a_share = best.reward != 0
            if can_improve and gap_is_a_share:
                by_task[name] = initial, best.reward
    return by_task


def optimum_in_words(study: Study) -> str:
    """What gaps are to: where an optimum is not proven, it is the best known reward."""
    proven = all(best.proven for best in study.optima.values())
    return "optimum" if proven else "best known reward"


@cached
def gaps(study: Study) -> pd.DataFrame:
    """One row a run of every task of :func:`initial_and_optimum`.

    Columns ``task``, ``method`` (its label, or the learner's conditions together), ``label``,
    ``run``, ``seed``, ``gap`` as a share of the optimum, NaN for a run without a solution.
    """
    frame = pd.DataFrame(columns=["task", "method", "label", "run", "seed", "gap"])
    rewards_by_task, parts = initial_and_optimum(study), []
    for (task, label), cell in study.cells.items():
        if task in rewards_by_task:
            _, optimum = rewards_by_task[task]
            rewards = cell.runs.reward.where(cell.runs.status == "ok")
            gap = gap_share(rewards.to_numpy(np.float64, na_value=math.nan), optimum)
            of_cell = cell.runs[["run", "seed"]].assign(
                task=task, method=label, label=label, gap=gap
            )
            parts.append(of_cell[frame.columns])
    frame = pd.concat(parts or [frame], ignore_index=True)
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
    """How far each method ends from the optimum: over all tasks, then task by task.

    Nearest first; of methods that solved every run, without searches for the optimum and variants.
    Columns ``task`` (or :data:`ALL_TASKS`), ``method`` (label), ``knows`` (what it uses of the
    reward: one of :data:`~.methods.GROUPS`), ``algorithm``, ``gap`` (mean, as a share of the
    optimum) with the ``low`` and ``high`` end of its 95 % interval over runs, and ``runs``.
    """
    rows = [
        (task, method, group_of(study, method), algorithm_of(method), *gap)
        for task, method, *gap in [*over_all(study), *task_by_task(study)]
        if not is_variant(method) and not is_search(method)
    ]
    columns = ["task", "method", "knows", "algorithm", "gap", "low", "high", "runs"]
    places = [ALL_TASKS, *study.tasks]
    rows.sort(key=lambda row: (places.index(str(row[0])), row[4]))
    return pd.DataFrame(rows, columns=columns)


def over_all(study: Study) -> Iterator[tuple[str, str, float, float, float, int]]:
    """Methods with a solution to every run of every task, where there are several: ``all tasks``,
    method, gap with its interval, and runs."""
    tasks = initial_and_optimum(study)
    for name, runs in gaps(study).groupby("method", sort=False):
        by_task = {str(task): of_task.gap.to_numpy() for task, of_task in runs.groupby("task")}
        if len(tasks) > 1 and len(by_task) == len(tasks) and runs.gap.notna().all():
            gap = task_mean(by_task)
            yield ALL_TASKS, str(name), gap.value, gap.low, gap.high, len(runs)


def task_by_task(study: Study) -> Iterator[tuple[str, str, float, float, float, int]]:
    """Methods with a solution to every run of a task: the task, label, gap with its interval, and
    number of runs."""
    for (task, label), cell in study.cells.items():
        has_gap = not math.isnan(method_rows(study).gap[task, label])
        if has_gap and len(cell.good) == len(cell.runs):
            best, reward = study.optima[task].reward, mean(cell.rewards)
            # The higher the reward, the smaller the gap.
            gap, low, high = gap_share([reward.value, reward.high, reward.low], best).tolist()
            yield task, label, gap, low, high, len(cell.runs)


def leaders(study: Study, group: str) -> pd.DataFrame:
    """The best form of each algorithm of a group over all tasks (or on the one), nearest first.

    The learner is there by the form that explores most. Columns ``p``, of the difference to the
    first row (:func:`apart`), NaN for that row itself, and ``least_p``, the smallest that so many
    runs can give. Each row is one test, so that a further method changes no other's p.
    """
    rows: pd.DataFrame = standings(study)
    rows = rows[(rows.task == rows.task.iloc[0]) & (rows.knows == group)] if len(rows) else rows
    learners = rows.method.map(is_learner).astype(bool)
    most = learners & rows.method.str.contains("EC4")
    shown = rows[~learners | (most if most.any() else learners)]
    shown = shown.drop_duplicates("algorithm").reset_index(drop=True)
    tests = [apart(study, shown.method[0], other) for other in shown.method[1:]]
    p, least = [test.p for test in tests], [test.least_p for test in tests]
    first = [math.nan] * min(len(shown), 1)
    return shown.assign(p=first + p, least_p=first + least)


def apart(study: Study, first: str, second: str) -> Estimate:
    """Two-tailed test of the difference of mean gaps of two methods over the tasks of both.

    A sign-flip test of runs paired by seed within their task; a method that is run once is compared
    with every run of the other. All tasks count the same; NaN without pairs on one of them. Runs
    that only one of them has do not count, unlike in the table ``against-learner``.
    """
    frame = gaps(study)
    one, two = (frame[frame.method == method] for method in (first, second))
    differences = []
    shared = set(one.task) & set(two.task)
    for task in (task for task in initial_and_optimum(study) if task in shared):
        a, b = one[one.task == task], two[two.task == task]
        both = a.merge(b, on="seed" if min(len(a), len(b)) > 1 else "task")
        differences.append((both.gap_x - both.gap_y).to_numpy(np.float64))
    if not differences or not all(map(len, differences)):
        return Estimate(math.nan)
    return sign_flip_test(np.concatenate([of_task / len(of_task) for of_task in differences]))
