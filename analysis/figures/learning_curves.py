"""Reward against trial: best so far, and of the trials themselves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from analysis.figures import style
from analysis.figures.plot import Plot, spoken, worded
from analysis.figures.selection import CONDITIONS, has, missing
from analysis.methods import short_name
from analysis.signatures.trajectories import Trajectories
from analysis.study import Study
from coartic import Task
from coartic.robot import Array

WINDOW = 100
"""Trials over which the reward of trials is averaged."""
POINTS = 120
_DEFAULT = (*CONDITIONS, "random-search/climbing", "cma-es/bandit")


@style.styled
def learning_curves(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Reward of methods that learn by trial, one panel a task.

    By default the learner's conditions, hill climbing and CMA-ES. Raises CoarticError where
    there is nothing to draw.
    """
    learning = study.results.learning()
    by_run = {str(run): rows for run, rows in learning.groupby("run_id", sort=False)}
    parts = [
        _curves(study, name, label, by_run)
        for name in study.tasks
        for label in (methods or _default(study, name))
        if has(study, name, label)
    ]
    parts = [part for part in parts if len(part)]
    if not parts:
        raise missing(study, f"no run of {', '.join(methods or _DEFAULT)} that learns by trial")
    data = pd.concat(parts, ignore_index=True)
    shown = {name: study.tasks[name] for name in data.task.unique()}
    asked = list(methods or _DEFAULT)
    labels = sorted(data.method.unique(), key=asked.index)
    figure, panels = style.task_panels(shown.values(), 2.15, 0.45, "trial", "reward (ticks)")
    for axes, task in zip(panels, shown.values(), strict=True):
        _panel(axes, study, task, data[data.task == task.name], labels)
    handles = [
        style.entry(short_name(label), linewidth=1.3, **look.line)
        for label, look in style.looks(labels).items()
    ]
    handles += [style.entry("initial", **style.INITIAL), style.entry("optimum", **style.OPTIMUM)]
    style.legend(figure, handles, min(len(handles), 4))
    ends = spoken(
        data.groupby(["task", "method"], sort=False).tail(1), "{task}, {method}: {best:.0f}"
    )
    return worded("learning-curves", figure, data, shown.values(), window=WINDOW, ends=ends)


def _default(study: Study, task: str) -> list[str]:
    """EC1 stands for the learner on one-armed tasks, the others on two-armed ones."""
    labels = [label for label in _DEFAULT if has(study, task, label)]
    others = [label for label in labels if label != CONDITIONS[0]]
    two = set(CONDITIONS) & set(others)
    return others if two else labels


def _curves(study: Study, task: str, label: str, by_run: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Both curves of a method at chosen trials; empty where it does not learn by trial."""
    ids = [str(run) for run in study.cells[task, label].good.run_id if str(run) in by_run]
    if not ids:
        return pd.DataFrame()
    runs = [by_run[run].reward.to_numpy(dtype=np.float64, na_value=np.nan) for run in ids]
    length = min(map(len, runs))
    rewards = np.array([run[:length] for run in runs])
    at = np.unique(np.round(np.geomspace(1, length, POINTS)).astype(np.int64))
    # Until every run has a solution (NaN before) there is no mean of them.
    best = np.fmax.accumulate(rewards, axis=1)[:, at - 1]
    low, high = np.quantile(best, [0.25, 0.75], axis=0)
    return pd.DataFrame(
        {
            "task": task,
            "method": label,
            "runs": len(ids),
            "trial": at,
            "best": best.mean(axis=0),
            "best_low": low,
            "best_high": high,
            "trials": _running(rewards)[at - 1],
        }
    )


def _running(rewards: Array) -> Array:
    """Mean of the last trials of all runs: (runs, n) to (n,), NaN where none."""
    sums, counts = (
        pd.Series(values.sum(axis=0)).rolling(WINDOW, min_periods=1).sum()
        for values in (np.nan_to_num(rewards), ~np.isnan(rewards))
    )
    return (sums / counts).to_numpy()


def _panel(
    axes: Axes, study: Study, task: Task, data: pd.DataFrame, labels: Sequence[str]
) -> None:
    look_of = style.looks(labels)
    for label, rows in data.groupby("method", sort=False):
        look = look_of[str(label)]
        axes.fill_between(
            rows.trial, rows.best_low, rows.best_high, color=look.color, alpha=0.22, linewidth=0
        )
        axes.plot(rows.trial, rows.best, linewidth=1.3, **look.line)
        axes.plot(rows.trial, rows.trials, linewidth=0.6, **look.line)
    floor, top = data.best.min(), data.best_high.max()
    initial = Trajectories(task, "", "", ()).initial
    if initial is not None:
        axes.axhline(-initial.ticks, **style.INITIAL)
        floor, top = -initial.ticks, max(top, -initial.ticks)
    optimum = study.optima.get((task.name, "free"))
    if optimum is not None:
        axes.axhline(optimum.reward, **style.OPTIMUM)
        top = max(top, optimum.reward)
    reach = max(top - floor, 1.0)  # tick; nothing learned and no optimum
    axes.set_ylim(max(data.trials.min(), floor - 0.9 * reach) - 0.04 * reach, top + 0.06 * reach)
    style.log_axis(axes)
    axes.set_xlim(1, max(2, data.trial.max()))
