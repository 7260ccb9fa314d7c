"""Tables of the methods beside each other: gaps, costs, learning."""

from __future__ import annotations

import math

import numpy as np

from coartic.analysis import methods as known
from coartic.analysis.optima import initial_reward
from coartic.analysis.statistics.estimates import LEVEL, interval
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import Study, one_by_one, typical_run
from coartic.analysis.table import SHORT_ID, Row, Rows, runs_of, table
from coartic.analysis.topics.coarticulation.tables import adjust_p
from coartic.analysis.topics.comparison import scores
from coartic.analysis.topics.comparison.running_times import (
    budget_for,
    cells_compared,
    running_times,
    share_reached,
    steps_of,
    trials_to_half,
)
from coartic.analysis.words import marked
from coartic.robot import Array

BUDGETS = (100, 1_000, 10_000)
"""Trials after which the table of learning reads rewards."""
COSTS = (
    ("trials_to_quarter", "trials", 0.25),
    ("trials_to_half", "trials", 0.5),
    ("kinematics_to_half", "forward_kinematics", 0.5),
    ("seconds_to_half", "solve_s", 0.5),
)
"""Columns of :func:`runtimes`: what is spent to reach which share of the targets."""


@table("task, method, runs, reward, learner, p_holm, least_p")
def against_learner(study: Study) -> Rows:
    """Mean reward of every method and of the paper's learner that explores most, by task.

    Of methods that solved every run. A method that draws nothing has one reward, which is exact.
    The test takes samples as independent, though runs have the same seeds
    (:func:`.scores.paired_difference` pairs them): where the learner has 100
    runs and the other method 20, pairs would leave out 80.
    """
    rows: list[tuple[str, Row]] = []
    for (task, label), cell in study.cells.items():
        learner = study.cells.get((task, known.most_exploring(study.tasks[task])))
        if learner is None or learner is cell or task not in one_by_one(study):
            continue
        both_solved = len(cell.good) == len(cell.runs) and len(learner.good) == len(learner.runs)
        if not scores.is_compared(study, label) or not both_solved:
            continue
        drawn = study.plan.methods[cell.method].stochastic
        rewards = cell.rewards if drawn else float(cell.rewards[0])
        row: Row = {
            "task": marked(study.tasks[task]),
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
    rows = scores.gaps(study)
    over = scores.ALL_TASKS if len(set(rows.task)) > 1 else next(iter(rows.task), "")
    single = [t for t in scores.initial_and_optimum(study) if study.tasks[t].family is None]
    tested = against_learner(study)
    named: list[tuple[str, Row]] = []
    for method, of_method in rows.groupby("method", sort=False):
        row: Row = {"method": str(method), "knows": of_method.knows.iloc[0], "gap": math.nan}
        for mean in of_method[of_method.task == over].itertuples():
            row |= {"gap": mean.gap, "gap_low": mean.low, "gap_high": mean.high}
        labels: dict[str, str] = scores.labels_by_task(study).get(str(method), {})
        at = {task: (task, labels[task]) for task in single if task in labels}
        row |= {f"on {task}": math.nan for task in single}
        row |= {f"on {task}": scores.scores(study).gap[key] for task, key in at.items()}
        of_labels = tested.index.isin([f"{task} {label}" for task, label in labels.items()])
        tests = tested[of_labels]
        # With Holm's correction over its tasks: could any of its tests have told them apart?
        if tests.least_p.count() * tests.least_p.min() < LEVEL:
            sure = tests[tests.p_holm < LEVEL]
            row |= {"better": sum(sure.reward > sure.learner)}
            row |= {"worse": sum(sure.reward < sure.learner)}
        cells = [study.cells[key] for key in labels.items()]
        row |= {"runs": sum(len(cell.runs) for cell in cells), **runs_of(*cells)}
        named.append((str(method), row))
    yield from sorted(named, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


@table(
    "method, reached, trials_to_quarter[], trials_to_half[], kinematics_to_half[], "
    "seconds_to_half[], half on *",
)
def runtimes(study: Study) -> Rows:
    """What it costs to reach a quarter and half of the targets; ``half on``: median trials to the
    target halfway, by task."""
    compared, times = cells_compared(study), running_times(study)
    for label in known.in_order(compared):
        if (label, "trials") not in times:
            continue
        row: Row = {"method": label, "reached": share_reached(times[label, "trials"])}
        for name, spend, share in COSTS:
            if (label, spend) in times:
                row |= interval(name, budget_for(times[label, spend], share))
        if scores.group_of(study, label) == scores.BY_TRIAL:
            medians = trials_to_half(study, label)
            row |= {f"half on {task}": trials for task, trials in medians.items()}
        yield label, row | runs_of(*compared[label])


@table("task, method, runs, initial, after_100, after_1000, after_10000, half_gain[]")
def learning(study: Study) -> Rows:
    """Best reward after so many trials, and when half of a run's gain was there."""
    for (task, label), cell in study.cells.items():
        runs = steps_of(study, cell)
        if task not in one_by_one(study) or not scores.is_compared(study, label):
            continue
        if not runs or not all(run.learns and run.solved for run in runs):
            continue
        trials = min(run.total["trials"] for run in runs)
        if trials < BUDGETS[0]:  # a try or two, no learning
            continue
        budgets = np.array([budget for budget in BUDGETS if budget <= trials], dtype=float)
        best = np.array([run.best("trials", budgets) for run in runs])
        best[~np.isfinite(best)] = math.nan
        initial = initial_reward(study.tasks[task])
        halves = [half_gain(initial, run.rewards, run.spent("trials")) for run in runs]
        quartiles = np.quantile(halves, [0.5, 0.25, 0.75], method="inverted_cdf").tolist()
        row: Row = {
            "task": marked(study.tasks[task]),
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


@table(
    "task, method, runs, solved, reward±, gap, hands, trials, forward_kinematics, solve_s, told, "
    "corrections, jacobians, movement_ticks, other_arm, median_run",
)
def methods(study: Study) -> Rows:
    """Every method on every task: reward, gap, hands and what a run spends.

    ``median_run``: beginning of the id of the run whose reward is nearest the median.
    """
    for row in scores.scores(study).reset_index().to_dict("records"):
        task, label = row["task"], row["method"]
        if task in one_by_one(study):
            values = {str(name): value for name, value in row.items()}
            values["task"], cell = marked(study.tasks[task]), study.cells[task, label]
            if len(cell.good):
                values["median_run"] = str(cell.good.run_id.iloc[typical_run(cell)])[:SHORT_ID]
            yield f"{task} {label}", values | runs_of(cell)
