"""Section on the speed of learning: rewards by trial."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import standings
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, name_in_figure, spoken
from coartic.analysis.method_frame import headline_methods
from coartic.analysis.methods import EC1, LEARNERS, title_of
from coartic.analysis.sections.costs import best_after, improvements
from coartic.analysis.study import Study, one_by_one, solved
from coartic.analysis.table import Rows, row_of_cell, table
from coartic.analysis.words import marked

BUDGETS = (100, 1_000, 10_000)
"""Numbers of trials after which the table has rewards."""
CURVES = (*LEARNERS, "hill-climbing", "cma-es/bandit")
"""Built-in methods with learning curves; all methods from files with trials have them, too."""


@table(
    "Best reward so far, mean over runs (ticks)",
    "task; method; runs; corrective_best: corrective process, best hands .1; "
    "after_100: after 100 trials .1; "
    "after_1000: after 1000 trials .1; after_10000: after 10\u202f000 trials .1",
)
def list_learning(study: Study) -> Rows:
    """Yield a row for each task of :func:`.one_by_one` and each method, except searches, if all its
    runs there have a solution and made 100 trials or more: the best reward, negative ticks, after
    each number of trials in :data:`BUDGETS` that all runs made, a mean over runs; NaN if a run has
    no solution by then."""
    learned = improvements(study)
    for (task, label), runs in study.cells.items():
        is_shown = task in one_by_one(study) and not study.methods.is_search[label]
        is_solved = len(solved(runs)) == len(runs) and learned.keys() >= {*runs.run_id}
        fewest = runs.trials.min()
        if not (is_shown and is_solved and fewest >= BUDGETS[0]):  # a try or two, no learning
            continue
        row = row_of_cell(study, runs) | {"corrective_best": study.corrective_best[task]}
        for budget in (each for each in BUDGETS if each <= fewest):
            best = [best_after(learned[run_id], budget) for run_id in runs.run_id]
            row[f"after_{budget}"] = np.mean(best)
        yield f"{task} {label}", row


@figure(
    "Learning curves",
    "Best reward so far (mean over runs; band: quartiles). n = {n} runs of a method on a task.",
)
def draw_learning_curves(study: Study) -> Parts | None:
    """Draw :func:`learning_curves`, the best reward so far against the trial, a panel for each
    task; None without a curve."""
    data = learning_curves(study)
    if not len(data):
        return None
    tasks = [study.tasks[name] for name in data.task.unique()]
    labels = [label for label in study.methods.index if label in {*data.method}]
    rows, columns = style.grid(len(tasks))
    size = style.TWO, min(2.2 * rows + 0.5, style.TALLEST)
    if style.is_narrow():
        size = style.ONE, 1.4 * rows + 0.4
    drawing, panels = style.panels((rows, columns), size, len(tasks), style.LEAST_SMALL_PANEL)
    looks = looks_in(study, labels)
    for place, (axes, task) in enumerate(zip(panels, tasks, strict=True)):
        of_task = data[data.task == task.name]
        for label, curve in of_task.groupby("method", sort=False):
            look = looks[str(label)]
            band: Any = {"color": look["color"], "alpha": 0.22, "linewidth": 0}
            axes.fill_between(curve.trial, curve.best_low, curve.best_high, **band)
            axes.plot(curve.trial, curve.best, **look)
        floor, top = of_task.best.min(), of_task.best_high.max()
        zero, optimum = study.corrective_best[task.name], study.optima.get(task.name)
        if not math.isnan(zero):
            axes.axhline(zero, **style.INITIAL)
            floor, top = min(floor, zero), max(top, zero)
        if optimum is not None:
            axes.axhline(optimum.reward, **style.OPTIMUM)
            top = max(top, optimum.reward)
        reach = max(top - floor, 1.0)  # tick; nothing learned and no optimum
        axes.set_ylim(floor - 0.04 * reach, top + 0.06 * reach)
        style.log_axis(axes)
        axes.set_xlim(1, max(2, of_task.trial.max()))
        axes.set_title(marked(task))
        axes.set_ylabel("" if place % columns and style.is_narrow() else "reward (ticks)")
        axes.set_xlabel("trial" if place + columns >= len(tasks) else "")
    style.letters(panels)
    handles = [
        style.legend_line(name_in_figure(study, label), **look) for label, look in looks.items()
    ]
    if any(study.corrective_best[task.name] == study.corrective_best[task.name] for task in tasks):
        name = title_of("corrective-alone/best-hands", short=style.is_narrow())
        handles.append(style.legend_line(name, **style.INITIAL))
    if known := [task.name for task in tasks if task.name in study.optima]:
        handles.append(style.legend_line(standings.reference(study, known), **style.OPTIMUM))
    style.legend(drawing, handles, min(len(handles), 4))
    ends = data.groupby(["task", "method"], sort=False).tail(1)
    words = spoken(study, ends, "{task}, {title}: {best:.0f}")
    alt = f"Reward against trial. Mean best reward at the end: {words}."
    return drawing, data, alt, ""


def learning_curves(study: Study) -> pd.DataFrame:
    """Return the best reward so far, negative ticks, by task, method and number of trials.

    Runs count that are solved and have rewards of trials, on tasks of :func:`.one_by_one`. Methods
    are the :func:`.headline_methods` among :data:`CURVES` and methods from files of users; EC1 has
    a curve only on tasks without such runs of EC2 to EC4. Columns: ``task``, ``method`` (label),
    ``runs`` (number of runs), ``trial`` (at most 120 numbers, from 1 to the trials of the shortest
    run), ``best`` (mean over runs, NaN until all have a solution), quartiles ``best_low`` and
    ``best_high``. Without any curve the frame is empty and has no columns.
    """
    learned, curves = improvements(study), [pd.DataFrame()]
    cells = {
        (task, label): runs
        for (task, label), every in study.cells.items()
        if task in one_by_one(study) and len(runs := solved(every[every.run_id.isin(learned)]))
    }
    rows = study.methods[study.methods.index.isin([label for _, label in cells])]
    drawn = headline_methods(rows[rows.base.isin(CURVES) | ~rows.built_in])
    for task, label in itertools.product(one_by_one(study), drawn):
        two_armed = any((task, learner) in cells for learner in LEARNERS[1:])
        if (task, label) not in cells or (two_armed and label == EC1):
            continue
        runs = cells[task, label]
        at = np.unique(np.round(np.geomspace(1, int(runs.trials.min()), 120)).astype(np.int64))
        # Until every run has a solution (NaN before) there is no mean of them.
        best = np.array([best_after(learned[run_id], at) for run_id in runs.run_id])
        if np.isnan(best).any(axis=0).all():
            continue
        low, high = np.quantile(best, [0.25, 0.75], axis=0)
        curve = {"trial": at, "best": best.mean(axis=0), "best_low": low, "best_high": high}
        named = {"task": task, "method": label, "runs": len(runs)}
        curves.append(pd.DataFrame(named | curve))
    return pd.concat(curves[1:] or curves, ignore_index=True)
