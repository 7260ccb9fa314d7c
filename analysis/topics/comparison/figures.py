"""Methods beside each other: how far each ends from the optimum, what it costs to come near, and
how rewards rise with trials."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic import Task
from coartic.analysis import methods
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, missing, spoken
from coartic.analysis.optima import initial_reward
from coartic.analysis.settings import compares_settings, name_in, shown_methods
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.topics.comparison import running_times, scores, tables
from coartic.analysis.words import capital, in_brackets, marked, number
from coartic.robot import Array

PANELS = {"trials": "trials", "forward_kinematics": "forward-kinematics evaluations"}
"""Spends that the figure of costs has a panel of, and their axes."""
ECDF_STEPS = 150
"""Steps of an ECDF that are drawn."""
WINDOW = 100
"""Trials over which a learning curve averages the reward of trials."""
POINTS = 120
"""Trials of a learning curve that are drawn."""
CURVES = (*methods.LEARNERS, "random-search/climbing", "cma-es/bandit")
"""Built-in methods whose learning curves are drawn; of others they all are."""


@figure(
    "ranking",
    "Gap to the optimum",
    "Gap from the mean reward to the optimum, as a share of the optimum (mean over all tasks where "
    f"there are several), with its {style.COVERAGE} bootstrap interval over runs. Methods that "
    "are run once have no interval. Diamonds and bold names: the paper's learner.",
)
def gaps_to_optimum(study: Study) -> Parts:
    """Gap to the optimum of every method over all tasks, or on the one that there is."""
    rows = scores.main_gaps(study)
    if not len(rows):
        raise missing(study, "no method with a solution to every run and a known optimum")
    percent = rows.assign(**{name: 100 * rows[name] for name in ("gap", "low", "high")})
    groups = [(group, percent[percent.knows == group]) for group in scores.GROUPS]
    groups = [(group, of_group) for group, of_group in groups if len(of_group)]
    heights = [len(of_group) + 0.8 for _, of_group in groups]
    size = style.ONE, 0.55 + 0.165 * (len(rows) + len(groups))
    drawing, panels = style.panels((len(groups), 1), size, sharex=True, height_ratios=heights)
    for axes, (group, of_group) in zip(panels, groups, strict=True):
        draw_group(axes, study, group, of_group, looks_in(study, rows.method))
    farthest = float(np.nanmax(percent[["gap", "high"]]))
    panels[-1].set_xlim(-0.02 * farthest, 1.08 * farthest)
    name = rows.task.iloc[0]
    to = f"to {scores.optimum_in_words(study).removesuffix(' reward')}"
    where = to if name == scores.ALL_TASKS else f"on {study.tasks[name].label}"
    panels[-1].set_xlabel(f"gap {where} (%)")
    alt = f"Gap to the optimum by method: {spoken(percent, '{method} {gap:.1f} %')}."
    return drawing, rows, alt, study.tasks.values()


def draw_group(
    axes: Axes, study: Study, group: str, rows: pd.DataFrame, looks: Mapping[str, style.Look]
) -> None:
    """Methods that know as much of the reward, nearest first."""
    axes.set_title(capital(group.removeprefix("using the ")))
    for place, row in enumerate(rows.to_dict("records")):
        color = looks[row["method"]]["color"]
        mark: Any = {"color": color, "clip_on": False, "markersize": 3.5}
        end = row["gap"]
        if not math.isnan(row["low"]):
            end = max(row["gap"], row["high"])
            axes.plot([row["low"], row["high"]], [-place, -place], color=color, linewidth=1.4)
        shape = "D" if methods.is_learner(row["method"]) else "o"
        (dot,) = axes.plot(row["gap"], -place, shape, **mark)
        words = f"{number(row['gap'], 1)} % {in_brackets(row['low'], row['high'], 1)}".strip()
        style.tip(dot, f"{name_in(study, row['method'])}: {words}, {row['runs']} runs")
        beside: Any = {"textcoords": "offset points", "va": "center"}
        axes.annotate(number(row["gap"], 1), (end, -place), (5, 0), **beside)
    style.name_rows(axes, [name_in(study, method) for method in rows.method])
    for name, method in zip(axes.get_yticklabels(), rows.method, strict=True):
        if methods.is_learner(method):
            name.set_fontweight("bold")
    axes.axvline(0, **style.OPTIMUM)


@figure(
    "runtimes",
    "What it costs to come near",
    f"Share of {len(running_times.TARGETS)} reward targets reached within a budget (mean over all "
    "tasks where there are several). Targets are evenly spaced from the initial solution to the "
    "optimum; a run counts for each target that it has reached. a: trials; planners make none and "
    "are lines. b: forward-kinematics evaluations, spread evenly over a run's trials.",
)
def ecdf_of_runtimes(study: Study) -> Parts:
    """Share of targets reached, against trials and kinematics."""
    data = ecdf_curves(study)
    spends = [spend for spend in PANELS if (data.budget[data.spend == spend] > 0).any()]
    if not spends:
        raise missing(study, "no method that reaches a target on a task with a known optimum")
    looks = looks_in(study, data.method.unique())
    size = style.TWO, 2.4 + 0.16 * -(-len(looks) // 3)
    drawing, panels = style.panels((1, len(spends)), size)
    for axes, spend in zip(panels, spends, strict=True):
        of_spend = data[data.spend == spend]
        draw_shares(axes, study, of_spend, looks)
        axes.set_title(f"By {PANELS[spend]}")
        axes.set_xlabel(PANELS[spend])
        axes.set_ylabel("targets reached (%)")
    style.letters(panels)
    ends = data[data.spend == spends[-1]].groupby("method", sort=False).tail(1)
    ends = ends.assign(share=100 * ends.share)
    entries = [style.entry(name_in(study, label), **look) for label, look in looks.items()]
    style.legend(drawing, entries, 3)
    shares = spoken(ends, "{method} {share:.0f} %")
    alt = f"Share of reward targets reached against what was spent. At the end: {shares}."
    return drawing, data, alt, study.tasks.values()


def ecdf_curves(study: Study) -> pd.DataFrame:
    """Share of targets reached within a budget, of the main methods.

    A row at every step that is drawn: ``method``, ``spend`` (of :data:`PANELS`), ``budget``,
    ``share``.
    """
    parts = [pd.DataFrame(columns=["method", "spend", "budget", "share"])]
    times = running_times.running_times(study)
    for label in methods.in_order(shown_methods(study, tables.runtimes(study).index)):
        for spend in PANELS:
            if (label, spend) in times:
                budget, share = running_times.ecdf(times[label, spend])
                count = min(len(budget), ECDF_STEPS)
                at = np.unique(np.linspace(0, len(budget) - 1, count).round()).astype(int)
                rows = {"budget": budget[at], "share": share[at]}
                parts.append(pd.DataFrame({"method": label, "spend": spend, **rows}))
    return pd.concat(parts[1:] or parts, ignore_index=True)


def draw_shares(
    axes: Axes, study: Study, data: pd.DataFrame, looks: Mapping[str, style.Look]
) -> None:
    """A step curve for each method."""
    style.log_axis(axes)
    positive = data.budget[data.budget > 0]
    least, most = positive.min(), positive.max()
    edge = least / 1.5
    axes.axhline(50, color=style.GREY, linewidth=0.5)
    for label, rows in data.groupby("method", sort=False):
        x = np.concatenate([rows.budget.clip(lower=edge), [most]])
        y = np.concatenate([100 * rows.share, [100 * rows.share.iloc[-1]]])
        line: Any = {**looks[str(label)], "linewidth": 1.3}
        (drawn,) = axes.step(x, y, where="post", **line)
        name = name_in(study, str(label))
        style.tip(drawn, f"{name}: {y[-1]:.0f} % of the targets in the end")
        style.curve(name, drawn)
    axes.set_xlim(edge, most)
    axes.set_ylim(-2, 102)


@figure(
    "learning-curves",
    "Learning curves",
    "Thick: best reward so far (mean over runs; band: middle half of the runs). Thin: reward of "
    f"the trials themselves (mean over runs and the last {WINDOW} trials; failed trials "
    "are left out). Dash-dotted: initial solution. Dotted: optimum, or best known reward. Trials "
    "far below the initial solution are cut off.",
)
def reward_by_trial(study: Study) -> Parts:
    """Reward of the learner, hill climbing, CMA-ES and methods of others, a panel a task."""
    data = learning_curves(study)
    if not len(data):
        raise missing(study, "no run that learns by trial")
    tasks = [study.tasks[name] for name in data.task.unique()]
    labels = methods.in_order(data.method.unique())
    rows, columns = style.grid(len(tasks))
    size = style.TWO, min(2.2 * rows + 0.5, style.TALLEST)
    drawing, panels = style.panels((rows, columns), size, len(tasks))
    for place, (axes, task) in enumerate(zip(panels, tasks, strict=True)):
        draw_curves(axes, study, task, data[data.task == task.name], labels)
        axes.set_title(marked(task))
        axes.set_ylabel("reward (ticks)")
        axes.set_xlabel("trial" if place + columns >= len(tasks) else "")
    style.letters(panels)
    handles = [
        style.entry(name_in(study, label), linewidth=1.3, **look)
        for label, look in looks_in(study, labels).items()
    ]
    handles += [style.entry("initial solution", **style.INITIAL)]
    handles += [style.entry(scores.optimum_in_words(study), **style.OPTIMUM)] * bool(study.optima)
    style.legend(drawing, handles, min(len(handles), 4))
    ends = data.groupby(["task", "method"], sort=False).tail(1)
    words = spoken(ends, "{task}, {method}: {best:.0f}")
    alt = f"Reward against trial. Mean best reward at the end: {words}."
    return drawing, data, alt, tasks


def learning_curves(study: Study, window: int = WINDOW) -> pd.DataFrame:
    """Best reward so far and that of the trials themselves, by task and method.

    Of runs with a solution; EC1 on tasks without the two-armed conditions. Columns ``task``,
    ``method``, ``runs``, ``trial``, ``best`` (mean over runs) and its quartiles ``best_low`` and
    ``best_high``, ``trials`` (mean over runs and the last ``window`` trials).
    """
    shown = [*cells_with_curve(study)]
    wanted = {run for key in shown for run in study.cells[key].good.run_id}
    trials_of = {run: rewards for run, rewards in study.rewards() if run in wanted}
    curves = [pd.DataFrame()]
    for task, label in shown:
        ids = map(str, study.cells[task, label].good.run_id)
        runs = [trials_of[run_id] for run_id in ids if run_id in trials_of]
        if runs:
            named = {"task": task, "method": label, "runs": len(runs)}
            curve = learning_curve(runs, window)
            failed = study.cells[task, label].good.failed_trials.sum()
            if sum(int(np.isnan(run).sum()) for run in runs) > failed:  # more were left out
                curve["trials"] = np.full(len(curve["trial"]), math.nan)
            curves.append(pd.DataFrame(named | curve))
    return pd.concat(curves[1:] or curves, ignore_index=True)


def cells_with_curve(study: Study) -> Iterator[tuple[str, str]]:
    """Cells with a learning curve: EC1 stands for the learner where it is the only condition."""
    for task in (name for name in study.tasks if name in one_by_one(study)):
        solved = [
            label for (name, label), cell in study.cells.items() if name == task and len(cell.good)
        ]
        labels = [
            label
            for label in methods.in_order(solved)
            if label in CURVES or not methods.is_built_in(label) or compares_settings(study)
        ]
        two_armed = {*methods.LEARNERS} & {*labels} - {methods.EC1}
        yield from ((task, label) for label in labels if not (two_armed and label == methods.EC1))


def learning_curve(runs: Sequence[Array], window: int) -> dict[str, Array]:
    """Both curves at chosen trials, from the reward of every trial of runs, NaN where it failed."""
    length = min(map(len, runs))
    rewards = np.array([run[:length] for run in runs])
    at = np.unique(np.round(np.geomspace(1, length, POINTS)).astype(np.int64))
    # Until every run has a solution (NaN before) there is no mean of them.
    best = np.fmax.accumulate(rewards, axis=1)[:, at - 1]
    low, high = np.quantile(best, [0.25, 0.75], axis=0)
    sums, counts = (
        pd.Series(values).rolling(window, min_periods=1).sum()
        for values in (np.nansum(rewards, axis=0), (~np.isnan(rewards)).sum(axis=0))
    )
    trials = (sums / counts).to_numpy()[at - 1]
    mean = best.mean(axis=0)
    return {"trial": at, "best": mean, "best_low": low, "best_high": high, "trials": trials}


def draw_curves(
    axes: Axes, study: Study, task: Task, data: pd.DataFrame, labels: Sequence[str]
) -> None:
    """Curves of the methods on a task, between its initial solution and its optimum."""
    look_of = looks_in(study, labels)
    for label, rows in data.groupby("method", sort=False):
        look = look_of[str(label)]
        band: Any = {"color": look["color"], "alpha": 0.22, "linewidth": 0}
        middle_half = axes.fill_between(rows.trial, rows.best_low, rows.best_high, **band)
        best = axes.plot(rows.trial, rows.best, linewidth=1.3, **look)
        trials = axes.plot(rows.trial, rows.trials, linewidth=0.6, **look)
        style.curve(name_in(study, str(label)), middle_half, *best, *trials)
    floor, top = data.best.min(), data.best_high.max()
    initial = initial_reward(task)
    if not math.isnan(initial):
        style.curve("initial solution", axes.axhline(initial, **style.INITIAL))
        floor, top = initial, max(top, initial)
    optimum = study.optima.get(task.name)
    if optimum is not None:
        name = scores.optimum_in_words(study)
        style.curve(name, axes.axhline(optimum.reward, **style.OPTIMUM))
        top = max(top, optimum.reward)
    reach = max(top - floor, 1.0)  # tick; nothing learned and no optimum
    lowest = np.fmax(data.trials.min(), floor - 0.9 * reach)
    axes.set_ylim(lowest - 0.04 * reach, top + 0.06 * reach)
    style.log_axis(axes)
    axes.set_xlim(1, max(2, data.trial.max()))
