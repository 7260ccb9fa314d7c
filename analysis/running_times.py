"""Running times of any methods, by task or by family, to targets of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pandas as pd

from coartic.analysis import methods as known
from coartic.analysis.statistics.running_times import share_by_budget
from coartic.analysis.study import Study, load
from coartic.analysis.topics import scores
from coartic.analysis.topics.costs import SPENDS, TARGETS, times_of
from coartic.errors import CoarticError
from coartic.inputs import brief_value
from coartic.robot import Array
from coartic.text import id_named, unknown

By = Literal["task", "family"]
EVERYTHING = "all"
"""The group of all tasks."""


def runtimes(
    results: str | Path | Study,
    *,
    by: By | None = None,
    methods: str | Sequence[str] = (),
    targets: Sequence[float] | Array = TARGETS,
) -> pd.DataFrame:
    """Share of reward targets that methods reach within a budget: the ECDF of running times.

    Parameters
    ----------
    results : str, Path or Study
        A results folder, or a study of one.
    by : {"task", "family"}, optional
        One ECDF for each; over all tasks by default. Tasks of a group count alike.
    methods : str or sequence of str, optional
        Methods with their variants, such as ``"cma-es/bandit trials=200"`` or ``"CMA-ES"``; by
        default all that
        are compared in the report and have runs on all tasks of a group. Where methods are named,
        a group has the tasks on which all of them have runs.
    targets : sequence of float, shape (n,), optional
        As shares of the way from the initial solution to the optimum, above 0 and up to 1; by
        default 0.05, 0.1, ..., 1. Rewards are whole, so a target is the next whole tick.

    Returns
    -------
    pandas.DataFrame
        A row at each budget at which the share rises: ``group``, ``method``, ``spend`` (``trials``;
        ``forward_kinematics``, evaluations, and ``solve_s``, seconds, both spread evenly over the
        trials of a run), ``budget``, and ``share`` of the pairs of run and target that are reached
        within it. A method that reaches no target has one row, of share 0 and an infinite budget.

    Raises
    ------
    CoarticError
        For what is no results folder, an unknown method, targets out of bounds, and where no task
        has a known optimum that is better than the initial solution.
    """
    study = results if isinstance(results, Study) else load(results)
    shares = np.asarray(targets, dtype=np.float64)
    if shares.ndim != 1 or not shares.size or not ((shares > 0) & (shares <= 1)).all():
        raise CoarticError(
            f"targets are {brief_value(targets)}: needed are numbers above 0 and up to 1"
        )
    if by is not None and by not in get_args(By):
        raise CoarticError(f"by is {by!r}; it must be 'task' or 'family'")
    cells = {
        method: {task: study.cells[task, label] for task, label in labels.items()}
        for method, labels in scores.labels_by_task(study).items()
    }
    called = {name: known.name_of(name) for name in cells}
    wanted = [methods] if isinstance(methods, str) else map(str, methods)
    methods = [id_named(name, called) for name in wanted]
    for name in methods:
        if name not in cells:
            raise CoarticError(unknown("method", name, cells, called))
    groups: dict[str, list[str]] = {}
    for task in scores.initial_and_optimum(study):
        if all(task in cells[name] for name in methods):
            family = study.tasks[task].family or task
            groups.setdefault({None: EVERYTHING, "task": task, "family": family}[by], []).append(
                task
            )
    if not scores.initial_and_optimum(study):
        raise CoarticError("no task has a known optimum that is better than its initial solution")
    if not groups:
        raise CoarticError(f"no task has runs of all of {', '.join(methods)}")
    compared = {name: cells[name] for name in methods} or scores.compared(study)
    rows = []
    for group, tasks in groups.items():
        for name in known.in_order(compared):
            if not compared[name].keys() >= {*tasks}:
                continue
            of_group = [compared[name][task] for task in tasks]
            single = len({cell.label for cell in of_group}) == 1
            if not methods and single and name.startswith(known.TOGETHER):
                continue  # the learner's conditions together are one of them here
            for spend in SPENDS:
                times = [times_of(study, cell, spend, shares) for cell in of_group]
                if all(map(len, times)):
                    budgets, reached = map(np.ndarray.tolist, share_by_budget(times))
                    steps = zip(budgets or [np.inf], reached or [0.0], strict=True)
                    rows += [(group, name, spend, *step) for step in steps]
    return pd.DataFrame(rows, columns=["group", "method", "spend", "budget", "share"])
