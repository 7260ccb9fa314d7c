"""Standings of methods: compared methods, compared tasks, and their gaps and shares.

Searches for the optimum are references and are not compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pandas as pd

from coartic.analysis.frames import ranking
from coartic.analysis.method_frame import with_joined_learners
from coartic.analysis.study import Study, cached
from coartic.internal.text import counted


def reference(study: Study, tasks: Iterable[str]) -> str:
    """Return the name of the rewards to which gaps on these tasks are taken: ``optimum`` if all
    best known rewards are proven, or without tasks; ``best of this folder`` if all are known from
    methods of this folder alone; or else ``best known reward``. Raises KeyError for a task without
    a best known reward."""
    best = [study.optima[task] for task in tasks]
    if all(each.proven for each in best):
        return "optimum"
    return "best of this folder" if all(each.only_here for each in best) else "best known reward"


@cached
def compared(study: Study) -> dict[str, pd.DataFrame]:
    """Return the runs, also failed ones, of every method except searches for the optimum, by label
    of the row in :attr:`.Study.methods`, in the order of these rows.

    A row that joins two conditions of the learner has runs that are in the rows of these
    conditions, too. Runs on tasks without a best known reward are left out, and so are methods
    without other runs.
    """
    runs = study.runs[study.runs.best_known.notna()]
    runs.attrs = {}  # which pandas copies with every selection
    by_label = with_joined_learners(dict([*runs.groupby("label", sort=False)]))
    rows = study.methods.index[~study.methods.is_search]
    return {method: by_label[method] for method in rows if method in by_label}


def runs_on(study: Study, method: str, tasks: Iterable[str]) -> pd.DataFrame:
    """Return the runs of a method on some tasks, failed ones too. Raises KeyError for a label that
    :func:`compared` does not have.

    No rows if the method has no run on one of the tasks, or if it is a row of
    :attr:`.Study.methods` that joins conditions of the learner and one condition has no run there.
    """
    runs, tasks = compared(study)[method], {*tasks}
    runs = runs[runs.task.isin(tasks)]
    complete = {*runs.task} == tasks and {*runs.label} == {*study.methods.parts[method]}
    return runs if complete else runs[:0]


def cells_of(runs: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the pair of task and label of each cell of some runs, in the order of the runs."""
    return [*dict.fromkeys(zip(runs.task, runs.label, strict=True))]


@cached
def common_tasks(study: Study) -> tuple[str, ...]:
    """Return the names of the tasks over which algorithms are compared, in the order of the study.

    They are the tasks of one method: the method for which the number of its tasks, times the number
    of algorithms that ran on all these tasks, is largest. Empty if no method is compared.
    """
    every = compared(study).items()
    sets = [(study.methods.algorithm[method], {*runs.task}) for method, runs in every]

    def pairs(tasks: set[str]) -> tuple[int, int]:
        algorithms = len({algorithm for algorithm, on in sets if on >= tasks})
        return len(tasks) * algorithms, len(tasks)

    widest = max((tasks for _, tasks in sets), key=pairs, default=set())
    return tuple(task for task in study.tasks if task in widest)


def together(study: Study, by_method: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return runs of rows of :attr:`.Study.methods`, given by label, as one frame with a new index,
    the label in column ``method`` and an empty ``setting``; without runs a frame without rows."""
    parts = [runs.assign(method=method) for method, runs in by_method.items()]
    return pd.concat([*parts, study.runs[:0]], ignore_index=True).assign(setting="")


def common_runs(study: Study) -> pd.DataFrame:
    """Return the runs on :func:`common_tasks` of the methods that ran on all of them, as one frame
    (:func:`together`)."""
    tasks = common_tasks(study)
    return together(study, {method: runs_on(study, method, tasks) for method in compared(study)})


@cached
def board(study: Study) -> pd.DataFrame:
    """Return a row for each method with a gap, by label, the smallest gap first, with the columns
    of :func:`.ranking` (``gap``, ``share``, ...) and of :attr:`.Study.methods` (``title``, ...).

    Methods that solved every run on :func:`common_tasks` are ranked over these tasks, other methods
    from files over the tasks on which they solved every run; other built-in methods have no row.
    """
    runs, methods = common_runs(study), study.methods
    parts = [ranking(runs)] if len(runs) else []
    there = {*parts[0].index[parts[0].gap.notna()]} if parts else set()
    for method, every in compared(study).items():
        on_solved = every[every.task.isin(solved_tasks(study, method))]
        if len(on_solved) and method not in there and not methods.built_in[method]:
            parts.append(ranking(together(study, {method: on_solved})))
    rows = pd.concat(parts) if parts else pd.DataFrame(columns=["gap", "share", "runs"])
    return rows[rows.gap.notna()].sort_values("gap", kind="stable").join(methods)


def own_methods(study: Study) -> list[str]:
    """Return the labels of the methods from files that solved every run on a task or more, the
    smallest gap first."""
    rows = board(study)
    return [*rows.index[~rows.built_in.astype(bool)]]


@cached
def solved_tasks(study: Study, method: str) -> tuple[str, ...]:
    """Return the names of the tasks on which a method of :func:`compared` solved every run."""
    by_task = compared(study)[method].groupby("task", sort=False)
    return tuple(str(task) for task, runs in by_task if runs.reward.notna().all())


def shown_name(study: Study, method: str) -> str:
    """Return the title of a method; of a method from a file that did not solve every run on
    :func:`common_tasks` the title with the number of tasks that it solved: ``mine (3 of 8
    tasks)``."""
    row, on = study.methods.loc[method], {*solved_tasks(study, method)}
    if row.built_in or {*common_tasks(study)} <= on:
        return str(row.title)
    every = {task for runs in compared(study).values() for task in runs.task}
    return f"{row.title} ({len(on)} of {counted(len(every), 'task')})"
