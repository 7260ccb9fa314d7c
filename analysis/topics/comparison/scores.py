"""Scores: how far every method ends from the optimum, on each task and over all of them.

The tables of methods, gaps and variants are views of :func:`scores`. Means over tasks are over
those whose optimum and initial solution are known, each counting the same. The learner explores
one-armed and two-armed tasks under different conditions, so that one method joins them:
``dual-process (EC1, EC4)`` is EC1 where a task has one arm and EC4 where it has two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import methods
from coartic.analysis.optima import gap_share, initial_reward, locks_base
from coartic.analysis.settings import compares_settings
from coartic.analysis.statistics.estimates import Estimate, mean, standard_deviation
from coartic.analysis.statistics.hypotheses import sign_flip_test
from coartic.analysis.statistics.instances import task_mean
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.words import tally
from coartic.method import Information
from coartic.robot import Array

TOLD_LETTERS = {
    Information.GOALS: "G",
    Information.FORWARD_KINEMATICS: "F",
    Information.JACOBIAN: "J",
    Information.CORRECTIVE_PROCESS: "A",
    Information.REWARD_BY_TRIAL: "T",
    Information.REWARD_BY_SUBTASK: "U",
    Information.KINEMATIC_MODEL: "K",
    Information.REWARD_FORMULA: "R",
    Information.SECONDARY_OBJECTIVES: "S",
}
"""A letter for each kind of information, in the order in which the tables show them."""
BY_TRIAL, BY_FORMULA, WITHOUT_REWARD = GROUPS = (
    "using the reward of each trial",
    "using the reward as a formula",
    "not using the reward",
)
"""What methods are told of the reward and make use of."""
STILL = 1e-9  # rad of joint travel that a solver's rounding leaves
ALL_TASKS = "all tasks"
"""What stands in the column of tasks for the mean over all of them."""


@cached
def scores(study: Study) -> pd.DataFrame:
    """One row for every method on every task, its label and the task being the index.

    Within a task searches for the optimum come first, then the highest mean reward. ``runs``;
    ``solved``: runs with a solution, of which ``reward`` is the mean, ``reward_sd`` the standard
    deviation (ticks), ``gap`` with ``low`` and ``high`` the distance of the mean to the optimum as
    a share of it with its interval over runs, and ``hands`` the sequences, the commonest first;
    ``told``: a letter for each kind of information (:data:`TOLD_LETTERS`); ``corrections``:
    corrective movements in all solutions; ``other_arm``: whether the arm that is not chosen keeps
    ``still`` in all solutions or ``moves``. ``trials``, ``movement_ticks``, ``forward_kinematics``
    and ``jacobians`` are medians over all runs, ``solve_s`` is that of :func:`solve_times`. NaN
    where a value is not known.
    """
    frame = pd.DataFrame([cell_score(study, cell) for cell in study.cells.values()])
    frame["place"] = frame.task.map(list(study.tasks).index)
    frame["is_search"] = frame.method.map(methods.is_search)
    order = ["place", "is_search", "reward"]
    frame = frame.sort_values(order, ascending=[True, False, False], kind="stable")
    return frame.drop(columns=order[:2]).set_index(["task", "method"])


def cell_score(study: Study, cell: CellRuns) -> dict[str, object]:
    """A row of :func:`scores`."""
    good, runs = cell.good, cell.runs
    best = None if locks_base(runs) else study.optima.get(cell.task)
    reward = mean(cell.rewards) if len(good) else Estimate(math.nan)
    # The higher the reward, the smaller the gap.
    ends = reward.value, reward.high, reward.low
    gap, low, high = gap_share(ends, best.reward if best and best.reward else math.nan).tolist()
    told = set(runs.told.iloc[0].split(", ")) if len(runs) else set()
    hands = tally(good.hands.value_counts().to_dict())
    arm = "still" if (floats(good.other_arm_travel) <= STILL).all() else "moves"
    return {
        "task": cell.task,
        "method": cell.label,
        "told": "".join(letter for item, letter in TOLD_LETTERS.items() if item.value in told),
        "runs": len(runs),
        "solved": len(good),
        "reward": reward.value,
        "reward_sd": standard_deviation(cell.rewards),
        "gap": gap,
        "low": low,
        "high": high,
        "hands": hands if len(good) > 1 else "".join(good.hands),
        "corrections": int(good.solution_corrections.sum()),
        "other_arm": arm if len(good) else "",
        "trials": median(runs.trials),
        "movement_ticks": median(runs.movement_ticks),
        "forward_kinematics": median(runs.forward_kinematics),
        "jacobians": median(runs.jacobians),
        "solve_s": median(solve_times(good)),
    }


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Wall time of solving, s: of runs in a warm process, or of all where there are none.

    ``runs`` have a solution. Their whole time stands for methods that mark no solving.
    """
    warm = runs.warm.to_numpy(dtype=bool, na_value=False)
    solving, all_in_all = floats(runs.solve_s), floats(runs.wall_s)
    marked = np.where(solving > 0, solving, all_in_all)
    times = pd.Series(marked, runs.index, dtype=runs.solve_s.dtype)
    return times[warm] if warm.any() else times


def median(values: pd.Series) -> float:
    """Median of the known values; NaN where none is, as for runs that crashed."""
    present = floats(values)
    present = present[~np.isnan(present)]
    return float(np.median(present)) if len(present) else math.nan


def floats(values: pd.Series) -> Array:
    """A column (n,), NaN where a value is missing."""
    return np.asarray(values.to_numpy(dtype=np.float64, na_value=np.nan))


def group_of(study: Study, label: str) -> str:
    """Which of :data:`GROUPS` a method belongs to.

    A method that makes a single trial on every task makes no use of the reward that it is told. The
    learner's conditions together are told what each of them is.
    """
    label = methods.EC1 if label.startswith(methods.TOGETHER) else label
    rows = scores(study).xs(label, level="method")
    told = "".join(rows.told)
    if TOLD_LETTERS[Information.REWARD_FORMULA] in told:
        return BY_FORMULA
    learns = TOLD_LETTERS[Information.REWARD_BY_TRIAL] in told and not (rows.trials <= 1).all()
    return BY_TRIAL if learns else WITHOUT_REWARD


def best_condition(study: Study, task: str) -> str | None:
    """Label of the learner's own condition with the highest mean reward on a task."""
    rewards = {
        label: float(cell.rewards.mean())
        for (name, label), cell in study.cells.items()
        if name == task and label in methods.LEARNERS and len(cell.good)
    }
    return max(rewards, key=lambda label: rewards[label]) if rewards else None


@cached
def initial_and_optimum(study: Study) -> dict[str, tuple[float, int]]:
    """Rewards of the initial solution and of the optimum by task, where the optimum is better.

    Without tasks where one of them is not known or the optimum is 0. The initial solution is the
    corrective process alone with the task's initial hands, the optimum that with all joints free.
    """
    by_task = {}
    for name, task in study.tasks.items():
        best = study.optima.get(name)
        if best is not None and best.reward != 0:
            initial = initial_reward(task)
            if best.reward > initial:  # never where there is no initial solution: NaN
                by_task[name] = initial, best.reward
    return by_task


def optimum_in_words(study: Study) -> str:
    """What gaps are to: where an optimum is not proven, it is the best known reward."""
    proven = all(best.proven for best in study.optima.values())
    return "optimum" if proven else "best known reward"


@cached
def labels_by_task(study: Study) -> dict[str, dict[str, str]]:
    """Labels by task of every method, on tasks of :func:`initial_and_optimum`.

    A method has its own label on all tasks; the learner's conditions together have several.
    """
    by_method: dict[str, dict[str, str]] = {}
    for task, label in study.cells:
        if task in initial_and_optimum(study):
            by_method.setdefault(label, {})[task] = label
    one_armed = by_method.get(methods.EC1, {})
    for more in (methods.EC4, methods.EC3):
        two_armed = by_method.get(more, {})
        elsewhere = {task: label for task, label in one_armed.items() if task not in two_armed}
        if two_armed and elsewhere:
            together = f"{methods.TOGETHER}EC1, {more.removeprefix(methods.LEARNER)})"
            by_method[together] = elsewhere | two_armed
    return by_method


def run_gaps(study: Study, task: str, label: str) -> Array:
    """Gap of each run to the optimum, as a share of it, (n,); NaN for a run without a solution."""
    runs = study.cells[task, label].runs
    rewards = runs.reward.where(runs.status == "ok")
    return gap_share(floats(rewards), initial_and_optimum(study)[task][1])


def gaps_by_seed(study: Study, task: str, label: str) -> dict[int, float]:
    """Gap of each run by its seed."""
    seeds = study.cells[task, label].runs.seed
    return dict(zip(seeds, run_gaps(study, task, label), strict=True))


def mean_gap(study: Study, labels: dict[str, str]) -> Estimate | None:
    """Mean gap over tasks with its interval; None where there are no runs, or a run has no
    solution. ``labels``: by task."""
    by_task = {task: run_gaps(study, task, labels[task]) for task in sorted(labels)}
    if not by_task or any(np.isnan(of_task).any() for of_task in by_task.values()):
        return None
    return task_mean(by_task)


@cached
def gaps(study: Study) -> pd.DataFrame:
    """Gap of each method to the optimum: over all tasks, then task by task, nearest first.

    Of methods that solved every run, without searches for the optimum and variants. Columns
    ``task`` (or :data:`ALL_TASKS`), ``method`` (label), ``knows`` (its group), ``gap``, ``low``,
    ``high``, ``runs``, ``algorithm``.
    """
    every: list[Any] = [*over_all_tasks(study), *scores(study).reset_index().to_dict("records")]
    rows = [
        row | {"knows": group_of(study, row["method"])}
        for row in every
        if is_compared(study, row["method"]) and row["solved"] == row["runs"]
        if not math.isnan(row["gap"])
    ]
    places = [ALL_TASKS, *study.tasks]
    rows.sort(key=lambda row: (places.index(row["task"]), row["gap"]))
    columns = ["task", "method", "knows", "gap", "low", "high", "runs"]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.assign(algorithm=list(map(methods.algorithm_of, frame.method)))


def is_compared(study: Study, label: str) -> bool:
    """Whether a method is compared with others: no search for the optimum, and a variant only where
    settings are compared."""
    shown = compares_settings(study) or not methods.is_variant(label)
    return shown and not methods.is_search(label)


def over_all_tasks(study: Study) -> Iterator[dict[str, Any]]:
    """Rows of :func:`gaps` over all tasks, where there are several."""
    tasks = initial_and_optimum(study)
    for method, labels in labels_by_task(study).items():
        if 1 < len(tasks) == len(labels) and is_compared(study, method):
            gap = mean_gap(study, labels)
            runs = sum(len(study.cells[key].runs) for key in labels.items())
            if gap is not None:
                row = {"task": ALL_TASKS, "method": method, "runs": runs, "solved": runs}
                yield row | {"gap": gap.value, "low": gap.low, "high": gap.high}


def main_gaps(study: Study) -> pd.DataFrame:
    """Rows of :func:`gaps` over all tasks, or on the first task where there are none."""
    rows = gaps(study)
    return rows[rows.task == rows.task.iloc[0]] if len(rows) else rows


def leaders(study: Study, group: str) -> pd.DataFrame:
    """The best form of each algorithm of a group over all tasks (or on the one), nearest first.

    The learner is there by the form that explores most. Columns ``p``, of the difference to the
    first row (:func:`paired_difference`), NaN for that row itself, and ``least_p``, the smallest
    that so many runs can give. Each row is one test, so that a further method changes no other's p.
    """
    rows: pd.DataFrame = main_gaps(study)
    rows = rows[rows.knows == group]
    learners = rows.method.map(methods.is_learner).astype(bool)
    most = learners & rows.method.str.contains("EC4")
    best = rows[~learners | (most if most.any() else learners)]
    one = "method" if compares_settings(study) else "algorithm"
    best = best.drop_duplicates(one).reset_index(drop=True)
    tests = [paired_difference(study, best.method[0], other) for other in best.method[1:]]
    p, least = [test.p for test in tests], [test.least_p for test in tests]
    first = [math.nan] * min(len(best), 1)
    return best.assign(p=first + p, least_p=first + least)


def paired_difference(study: Study, first: str, second: str) -> Estimate:
    """Two-tailed test of the difference of mean gaps of two methods over the tasks of both.

    A sign-flip test of runs paired by seed within their task; a method that is run once is compared
    with every run of the other. All tasks count the same; NaN without pairs on one of them. Runs
    that only one of them has do not count, unlike in the table ``against-learner``.
    """
    one, two = (labels_by_task(study).get(method, {}) for method in (first, second))
    differences = []
    for task in (task for task in initial_and_optimum(study) if task in one and task in two):
        a, b = (gaps_by_seed(study, task, labels[task]) for labels in (one, two))
        if min(len(a), len(b)) > 1:
            pairs = [a[seed] - b[seed] for seed in a if seed in b]
        else:
            pairs = [gap - other for gap in a.values() for other in b.values()]
        differences.append(np.array(pairs))
    if not differences or not all(map(len, differences)):
        return Estimate(math.nan)
    return sign_flip_test(np.concatenate([of_task / len(of_task) for of_task in differences]))
