"""Reward against trial: best so far, and of the trials themselves."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import has, missing
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.methods import CONDITIONS, EC1, name_of
from coartic.analysis.study import Study
from coartic.analysis.trajectories import initial_solution
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
    lengths = {run: len(rewards) for run, rewards in study.rewards()}
    found = [
        _Curves(name, label, runs, min(lengths[run] for run in runs))
        for name in study.tasks
        for label in (methods or _default(study, name))
        if has(study, name, label) and (runs := _learning(study, name, label, lengths))
    ]
    of_run = {run: curves for curves in found for run in curves.runs}
    for run, rewards in study.rewards():
        if run in of_run:
            of_run[run].add(rewards)
    parts = [curves.table() for curves in found]
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
        style.entry(name_of(label), linewidth=1.3, **look.line)
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
    others = [label for label in labels if label != EC1]
    two = set(CONDITIONS) & set(others)
    return others if two else labels


def _learning(study: Study, task: str, label: str, lengths: Container[str]) -> list[str]:
    """Ids of the runs of a method that learn by trial."""
    return [str(run) for run in study.cells[task, label].good.run_id if str(run) in lengths]


class _Curves:
    """Both curves of a method at chosen trials, made run by run."""

    def __init__(self, task: str, label: str, runs: Sequence[str], length: int) -> None:
        self.task, self.label, self.runs = task, label, runs
        self._at = np.unique(np.round(np.geomspace(1, length, POINTS)).astype(np.int64))
        self._best: list[Array] = []
        self._sums, self._counts = np.zeros(length), np.zeros(length)

    def add(self, rewards: Array) -> None:
        """One more run, by the reward of each of its trials."""
        rewards = rewards[: len(self._sums)]
        # Until every run has a solution (NaN before) there is no mean of them.
        self._best.append(np.fmax.accumulate(rewards)[self._at - 1])
        self._sums += np.nan_to_num(rewards)
        self._counts += ~np.isnan(rewards)

    def table(self) -> pd.DataFrame:
        """A row for each of the trials."""
        low, high = np.quantile(self._best, [0.25, 0.75], axis=0)
        return pd.DataFrame(
            {
                "task": self.task,
                "method": self.label,
                "runs": len(self.runs),
                "trial": self._at,
                "best": np.mean(self._best, axis=0),
                "best_low": low,
                "best_high": high,
                "trials": self._running()[self._at - 1],
            }
        )

    def _running(self) -> Array:
        """Mean of the last trials of all runs, (n,), NaN where none."""
        sums, counts = (
            pd.Series(values).rolling(WINDOW, min_periods=1).sum()
            for values in (self._sums, self._counts)
        )
        return (sums / counts).to_numpy()


def _panel(axes: Axes, study: Study, task: Task, data: pd.DataFrame, labels: Sequence[str]) -> None:
    look_of = style.looks(labels)
    for label, rows in data.groupby("method", sort=False):
        look = look_of[str(label)]
        axes.fill_between(
            rows.trial, rows.best_low, rows.best_high, color=look.color, alpha=0.22, linewidth=0
        )
        axes.plot(rows.trial, rows.best, linewidth=1.3, **look.line)
        axes.plot(rows.trial, rows.trials, linewidth=0.6, **look.line)
    floor, top = data.best.min(), data.best_high.max()
    initial = initial_solution(task, study.model)
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
