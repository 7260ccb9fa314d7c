"""Running times of any methods to targets of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import methods as names_of_methods
from coartic.analysis.statistics.running_times import share_by_budget
from coartic.analysis.study import Study, load
from coartic.analysis.topics import scores
from coartic.analysis.topics.costs import SPENDS, TARGETS, cells_compared, times_of
from coartic.errors import CoarticError
from coartic.inputs import brief_value
from coartic.robot import Array
from coartic.text import id_named, unknown


def runtimes(
    results: str | Path | Study,
    *,
    methods: str | Sequence[str] = (),
    targets: Sequence[float] | Array = TARGETS,
) -> pd.DataFrame:
    """Share of reward targets that methods reach within a budget: the ECDF of running times.

    Parameters
    ----------
    results : str, Path or Study
        A results folder, or a study of one.
    methods : str or sequence of str, optional
        Methods with their variants, such as ``"cma-es/bandit trials=200"`` or ``"CMA-ES"``, on the
        tasks on which all of them have runs; by default all that are compared in the report and
        have runs on all tasks. Tasks count alike.
    targets : sequence of float, shape (n,), optional
        As shares of the way from the initial solution to the optimum, above 0 and up to 1; by
        default 0.05, 0.1, ..., 1. Rewards are whole, so a target is the next whole tick.

    Returns
    -------
    pandas.DataFrame
        A row at each budget at which the share rises: ``method``, ``spend`` (``trials``;
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
    tasks = list(scores.initial_and_optimum(study))
    if not tasks:
        raise CoarticError("no task has a known optimum that is better than its initial solution")
    chosen = cells_compared(study)
    if methods:
        labels = scores.labels_by_task(study)
        called = {name: names_of_methods.name_of(name) for name in labels}
        wanted = [methods] if isinstance(methods, str) else map(str, methods)
        names = [id_named(name, called) for name in wanted]
        for name in names:
            if name not in labels:
                raise CoarticError(unknown("method", name, labels))
        tasks = [task for task in tasks if all(task in labels[name] for name in names)]
        if not tasks:
            raise CoarticError(f"no task has runs of all of {', '.join(names)}")
        chosen = {name: [study.cells[task, labels[name][task]] for task in tasks]
                  for name in names_of_methods.in_order(names)}  # fmt: skip
    rows = []
    for name, cells in chosen.items():
        for spend in SPENDS:
            times = [times_of(study, cell, spend, shares) for cell in cells]
            if all(map(len, times)):
                budgets, reached = map(np.ndarray.tolist, share_by_budget(times))
                steps = zip(budgets or [np.inf], reached or [0.0], strict=True)
                rows += [(name, spend, *step) for step in steps]
    return pd.DataFrame(rows, columns=["method", "spend", "budget", "share"])
