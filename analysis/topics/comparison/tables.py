"""Tables of the methods beside each other: gaps, costs, learning."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from coartic.analysis.methods import (
    CONDITIONS,
    EC1,
    KNOWN_METHODS,
    TOGETHER,
    in_order,
    is_search,
    is_variant,
    main_methods,
    most_exploring,
)
from coartic.analysis.statistics.estimates import LEVEL, interval
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.instances import Runs, gap_share, other_tasks, task_mean
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.coarticulation.tables import adjust_p
from coartic.analysis.topics.comparison.groups import BY_TRIAL, method_rows
from coartic.analysis.topics.comparison.runtimes import best_so_far, halfway, targets
from coartic.analysis.topics.comparison.runtimes import price as price_by_method
from coartic.analysis.topics.comparison.scores import (
    ALL_TASKS,
    gaps,
    initial_and_optimum,
    standings,
)
from coartic.analysis.topics.families.sample import one_by_one, sample
from coartic.analysis.trajectories import initial_reward
from coartic.analysis.words import marked
from coartic.robot import Array

BUDGETS = (100, 1_000, 10_000)
"""Trials after which the table of learning reads rewards."""
WINDOW = 100
"""Trials over which a learning curve averages the reward of trials."""
CURVES = (*CONDITIONS, "random-search/climbing", "cma-es/bandit")
"""Built-in methods whose learning curves are drawn; of others they all are."""
SPENDS = ("trials", "forward_kinematics")
"""What price curves count."""
_POINTS = 120  # trials of a learning curve
_STEPS = 150  # of a price curve, at most


@table("task, method, runs, reward, learner, p_holm, least_p")
def against_learner(study: Study) -> Rows:
    """Mean reward of every method and of the paper's learner that explores most, by task.

    Of methods that solved every run. A method that draws nothing has one reward, which is exact.
    The test takes samples as independent, though runs have the same seeds
    (:func:`~coartic.analysis.topics.comparison.scores.apart` pairs them): where the learner has 100
    runs and the other method 20, pairs would leave out 80.
    """
    rows: list[tuple[str, Row]] = []
    for (task, label), cell in study.cells.items():
        learner = study.cells.get((task, most_exploring(study.tasks[task])))
        if learner is None or learner is cell or task not in one_by_one(study):
            continue
        both_solved = len(cell.good) == len(cell.runs) and len(learner.good) == len(learner.runs)
        if is_variant(label) or is_search(label) or not both_solved:
            continue
        drawn = study.plan.methods[cell.method].stochastic
        rewards = cell.rewards if drawn else float(cell.rewards[0])
        row: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "method": label,
            "runs": len(cell.runs),
            "reward": cell.rewards.mean(),
            "learner": learner.rewards.mean(),
            "p_holm": (test := bootstrap_test(learner.rewards, rewards, "two-sided")).p,
            "least_p": test.least_p,
        }
        rows.append((f"{task} {label}", row | runs_of(cell, learner)))
    yield from adjust_p(rows)


@table("method, knows, gap[], better, worse, on *, runs")
def ranking(study: Study) -> Rows:
    """Gap to the optimum over all tasks and on each single one, grouped by what methods know."""
    rows = standings(study)
    single = {name for name, task in study.tasks.items() if task.family is None}
    tested = against_learner(study)
    named: list[tuple[str, Row]] = []
    for method, of_method in rows.groupby("method", sort=False):
        by_task = of_method.set_index("task")
        over = ALL_TASKS if len(set(rows.task)) > 1 else rows.task.iloc[0]
        row: Row = {"method": str(method), "knows": of_method.knows.iloc[0], "gap": math.nan}
        if over in by_task.index:
            mean = by_task.loc[over]
            row |= {"gap": mean.gap, "gap_low": mean.low, "gap_high": mean.high}
        labels = labels_of(study, str(method))
        row |= {
            f"on {task}": method_rows(study).gap[task, labels[task]] if task in labels else math.nan
            for task in initial_and_optimum(study)
            if task in single
        }
        of_labels = tested.index.isin([f"{task} {label}" for task, label in labels.items()])
        of_method = tested[of_labels]
        # With Holm's correction over its tasks: could any of its tests have told them apart?
        if len(of_method) and len(of_method) * of_method.least_p.min() < LEVEL:
            sure = tested[of_labels & (tested.p_holm < LEVEL)]
            row |= {"better": sum(sure.reward > sure.learner)}
            row |= {"worse": sum(sure.reward < sure.learner)}
        cells = [study.cells[key] for key in labels.items()]
        named.append(
            (str(method), row | {"runs": sum(len(c.runs) for c in cells)} | runs_of(*cells))
        )
    yield from sorted(named, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


@table(
    "method, runs, gap[], best_trial, on *, instances, gap_in_general[], trials, movement_ticks, "
    "solve_s"
)
def variants(study: Study) -> Rows:
    """Every method with each of its settings: gap over single tasks and over random ones, and cost.

    The learner is one row: EC1 where a task has one arm, EC4 where it has two. What a run costs
    is the mean over tasks. ``best_trial`` is the gap over single tasks of each run's best trial,
    which need not be its solution; for a method that makes no trials, that of its solution.
    """
    labels_by_row: dict[str, dict[str, str]] = {}
    for task, label in study.cells:
        method, _, variant = label.partition(" ")
        if method == most_exploring(study.tasks[task]):
            method = f"{TOGETHER}EC1, EC4)"
        if not is_search(label):
            labels_by_row.setdefault(f"{method} {variant}".strip(), {})[task] = label
    instances = sample(study)
    single = [name for name in initial_and_optimum(study) if study.tasks[name].family is None]
    for name, labels in labels_by_row.items():
        rewards = gaps(study).merge(pd.DataFrame(labels.items(), columns=["task", "method"]))
        rewards = rewards[rewards.task.isin(single)]
        by_task = {str(task): rows.gap.to_numpy() for task, rows in rewards.groupby("task")}
        row: Row = {"method": name}
        if by_task and len(by_task) == len(single) and rewards.gap.notna().all():
            row |= interval("gap", task_mean(by_task))
            best = [best_trial_gaps(study, task, labels[task]) for task in single]
            row["best_trial"] = np.mean([of_task.mean() for of_task in best])
        row |= {f"on {task}": of_task.mean() for task, of_task in by_task.items()}
        scores: dict[str, list[Runs]] = {}
        for task, label in labels.items():
            gap = instances.gap(task, label) if instances else None
            if gap is not None:
                scores.setdefault(str(study.tasks[task].family), []).append((gap,))
        row["instances"] = sum(map(len, scores.values()))
        if scores:
            row |= interval("gap_in_general", other_tasks(scores))
        cells = [study.cells[key] for key in labels.items()]
        costs = method_rows(study).loc[list(labels.items())]
        row |= {cost: costs[cost].mean() for cost in ("trials", "movement_ticks", "solve_s")}
        yield name, row | {"runs": sum(len(cell.runs) for cell in cells)} | runs_of(*cells)


def best_trial_gaps(study: Study, task: str, label: str) -> Array:
    """Gap of the best trial of each solved run, shape ``(n,)``."""
    runs = [best_so_far(study)[str(run)] for run in study.cells[task, label].good.run_id]
    best = [run.rewards[-1] for run in runs]
    return gap_share(best, initial_and_optimum(study)[task][1])


def labels_of(study: Study, method: str) -> dict[str, str]:
    """Label of a method by task: the learner over all tasks has several."""
    rows = gaps(study)
    rows = rows[rows.method == method].drop_duplicates(["task", "label"])
    return dict(zip(rows.task, rows.label, strict=True))


@table(
    "method, reached, trials_to_quarter[], trials_to_half[], kinematics_to_half[], "
    "seconds_to_half[], half on *",
)
def price(study: Study) -> Rows:
    """What it costs to reach a quarter and half of the targets; ``half on``: median trials to the
    target halfway, by task."""
    for name, row in price_by_method(study).iterrows():
        label = str(name)
        tasks = labels_of(study, label).items()
        cells = [study.cells[key] for key in tasks if row.task in (ALL_TASKS, key[0])]
        medians = halfway(study, label) if row.knows == BY_TRIAL else {}
        half = {f"half on {task}": trials for task, trials in medians.items()}
        yield label, {"method": label, **row} | half | runs_of(*cells)


@cached
def price_curves(study: Study) -> pd.DataFrame:
    """Share of targets reached within a budget, of the main methods.

    A row at every step that is drawn: ``method``, ``spend`` (of :data:`SPENDS`), ``budget``,
    ``share``.
    """
    parts = [pd.DataFrame(columns=["method", "spend", "budget", "share"])]
    priced = price_by_method(study)
    for label in in_order(main_methods(map(str, priced.index))):
        for spend in SPENDS:
            reached = targets(study).get((priced.task[label], label, spend))
            if reached is not None:
                budget, share = reached.curve()
                count = min(len(budget), _STEPS)
                at = np.unique(np.linspace(0, len(budget) - 1, count).round()).astype(int)
                rows = {"budget": budget[at], "share": share[at]}
                parts.append(pd.DataFrame({"method": label, "spend": spend, **rows}))
    return pd.concat(parts[1:] or parts, ignore_index=True)


@table("task, method, runs, initial, after_100, after_1000, after_10000, half_gain[]")
def learning(study: Study) -> Rows:
    """Best reward after so many trials, and when half of a run's gain was there."""
    for (task, label), cell in study.cells.items():
        runs = [best_so_far(study)[str(run)] for run in cell.runs.run_id]
        if task not in one_by_one(study) or is_variant(label) or is_search(label):
            continue
        if not runs or not all(run.learns and run.solved for run in runs):
            continue
        trials = min(run.total["trials"] for run in runs)
        if trials < BUDGETS[0]:  # a try or two, no learning
            continue
        budgets = np.array([budget for budget in BUDGETS if budget <= trials], dtype=float)
        best = np.array([run.best("trials", budgets) for run in runs])
        best[~np.isfinite(best)] = math.nan
        initial = initial_reward(study.tasks[task], study.model)
        halves = [half_gain(initial, run.rewards, run.spent["trials"]) for run in runs]
        quartiles = np.quantile(halves, [0.5, 0.25, 0.75], method="inverted_cdf").tolist()
        row: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "method": label,
            "runs": len(runs),
            "initial": initial,
            **{f"after_{int(n)}": best[:, k].mean() for k, n in enumerate(budgets)},
            **dict(zip(("half_gain", "half_gain_low", "half_gain_high"), quartiles, strict=True)),
        }
        yield f"{task} {label}", row | runs_of(cell)


def half_gain(initial: float, rewards: Array, trials: Array) -> float:
    """Trial at which half of what a run gains on the initial solution is there; ∞ without any."""
    enough = trials[(rewards >= (initial + rewards[-1]) / 2) & (rewards[-1] > initial)]
    return float(enough[0]) if len(enough) else math.inf


@cached
def learning_curves(study: Study) -> pd.DataFrame:
    """Best reward so far and that of the trials themselves, by task and method.

    Of runs with a solution; EC1 on tasks without the two-armed conditions. Columns ``task``,
    ``method``, ``runs``, ``trial``, ``best`` (mean over runs) and its quartiles ``best_low`` and
    ``best_high``, ``trials`` (mean over runs and the last :data:`WINDOW` trials).
    """
    trials_of = dict(study.rewards())
    curves = [pd.DataFrame()]
    for task, label in drawn_curves(study):
        ids = map(str, study.cells[task, label].good.run_id)
        runs = [trials_of[run_id] for run_id in ids if run_id in trials_of]
        if runs:
            named = {"task": task, "method": label, "runs": len(runs)}
            curves.append(pd.DataFrame(named | learning_curve(runs)))
    return pd.concat(curves[1:] or curves, ignore_index=True)


def drawn_curves(study: Study) -> Iterator[tuple[str, str]]:
    """Cells with a learning curve: EC1 stands for the learner where it is the only condition."""
    for task in (name for name in study.tasks if name in one_by_one(study)):
        solved = [
            label for (name, label), cell in study.cells.items() if name == task and len(cell.good)
        ]
        labels = [
            label
            for label in in_order(solved)
            if label in CURVES or label.partition(" ")[0] not in KNOWN_METHODS
        ]
        two_armed = {*CONDITIONS} & {*labels} - {EC1}
        yield from ((task, label) for label in labels if not (two_armed and label == EC1))


def learning_curve(runs: Sequence[Array]) -> dict[str, Array]:
    """Both curves at chosen trials, from the reward of every trial of runs, NaN where it failed."""
    length = min(map(len, runs))
    rewards = np.array([run[:length] for run in runs])
    at = np.unique(np.round(np.geomspace(1, length, _POINTS)).astype(np.int64))
    # Until every run has a solution (NaN before) there is no mean of them.
    best = np.fmax.accumulate(rewards, axis=1)[:, at - 1]
    low, high = np.quantile(best, [0.25, 0.75], axis=0)
    sums, counts = (
        pd.Series(values).rolling(WINDOW, min_periods=1).sum()
        for values in (np.nansum(rewards, axis=0), (~np.isnan(rewards)).sum(axis=0))
    )
    trials = (sums / counts).to_numpy()[at - 1]
    mean = best.mean(axis=0)
    return {"trial": at, "best": mean, "best_low": low, "best_high": high, "trials": trials}


@table(
    "task, method, runs, solved, reward±, gap, hands, trials, forward_kinematics, solve_s, told, "
    "corrections, jacobians, movement_ticks, other_arm",
)
def methods(study: Study) -> Rows:
    """Every method on every task: reward, gap, hands and what a run spends."""
    for row in method_rows(study).reset_index().to_dict("records"):
        task, label = row["task"], row["label"]
        if task in one_by_one(study):
            title = marked(study.tasks[task].label, study.tasks[task])
            values = {str(name): value for name, value in row.items()}
            values |= {"task": title, "method": label}
            yield f"{task} {label}", values | runs_of(study.cells[task, label])
