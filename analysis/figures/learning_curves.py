"""Reward against trial: best so far, and of the trials themselves."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from matplotlib.axes import Axes

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.methods import in_order, name_of
from coartic.analysis.study import Study
from coartic.analysis.tables import comparison
from coartic.analysis.trajectories import initial_solution


@figure(
    "learning-curves",
    "Learning curves",
    "Thick: best reward so far (mean over runs; band: middle half of the runs). Thin: reward of "
    f"the trials themselves (mean over runs and the last {comparison.WINDOW} trials; failed trials "
    "are left out). Dash-dotted: initial solution. Dotted: optimum. Trials far below the initial "
    "solution are cut off.",
)
def learning_curves(study: Study) -> Parts:
    """Reward of the learner, hill climbing, CMA-ES and methods of others, a panel a task."""
    data = comparison.learning_curves(study)
    if not len(data):
        raise missing(study, "no run that learns by trial")
    tasks = [study.tasks[name] for name in data.task.unique()]
    labels = in_order(data.method.unique())
    rows, columns = style.grid(len(tasks))
    size = style.TWO, min(2.15 * rows + 0.45, style.TALLEST)
    drawing, panels = style.figure_of((rows, columns), size, len(tasks))
    for place, (axes, task) in enumerate(zip(panels, tasks, strict=True)):
        draw_curves(axes, study, task, data[data.task == task.name], labels)
        axes.set_title(style.heading(task))
        axes.set_ylabel("" if place % columns else "reward (ticks)")
        axes.set_xlabel("trial" if place + columns >= len(tasks) else "")
    style.letters(panels)
    handles = [
        style.entry(name_of(label), linewidth=1.3, **look)
        for label, look in style.looks(labels).items()
    ]
    handles += [style.entry("initial", **style.INITIAL), style.entry("optimum", **style.OPTIMUM)]
    style.legend(drawing, handles, min(len(handles), 4))
    ends = data.groupby(["task", "method"], sort=False).tail(1)
    words = spoken(ends, "{task}, {method}: {best:.0f}")
    alt = f"Reward against trial. Mean best reward at the end: {words}."
    return drawing, data, alt, tasks


def draw_curves(
    axes: Axes, study: Study, task: Task, data: pd.DataFrame, labels: Sequence[str]
) -> None:
    """Curves of the methods on a task, between its initial solution and its optimum."""
    look_of = style.looks(labels)
    for label, rows in data.groupby("method", sort=False):
        look = look_of[str(label)]
        axes.fill_between(
            rows.trial, rows.best_low, rows.best_high, color=look["color"], alpha=0.22, linewidth=0
        )
        axes.plot(rows.trial, rows.best, linewidth=1.3, **look)
        axes.plot(rows.trial, rows.trials, linewidth=0.6, **look)
    floor, top = data.best.min(), data.best_high.max()
    initial = initial_solution(task, study.model)
    if initial is not None:
        axes.axhline(-initial.ticks, **style.INITIAL)
        floor, top = -initial.ticks, max(top, -initial.ticks)
    optimum = study.optima.get(task.name)
    if optimum is not None:
        axes.axhline(optimum.reward, **style.OPTIMUM)
        top = max(top, optimum.reward)
    reach = max(top - floor, 1.0)  # tick; nothing learned and no optimum
    axes.set_ylim(max(data.trials.min(), floor - 0.9 * reach) - 0.04 * reach, top + 0.06 * reach)
    style.log_axis(axes)
    axes.set_xlim(1, max(2, data.trial.max()))
