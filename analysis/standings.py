"""The ranking of a study: who solved all tasks that were asked for, and why others are not ranked.

Searches for the optimum are references and are not ranked.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import pandas as pd

from coartic.analysis.frames import ranking
from coartic.analysis.methods import BY_TRIAL
from coartic.analysis.study import Study
from coartic.analysis.words import listed, number
from coartic.internal.text import counted


def reference(study: Study, tasks: Iterable[str]) -> str:
    """Return a name for the best known rewards of these tasks: ``optimum`` if all are proven, or
    without tasks, else ``best known reward``. Unproven rewards of methods of this folder alone do
    not count there, and add ``or best of this folder``; if all are such, the name is ``best of this
    folder``. Raises KeyError for a task without a best known reward."""
    best = [study.optima[task] for task in tasks]
    others = [each.proven for each in best if each.proven or not each.only_here]
    known = "optimum" if all(others) else "best known reward"
    names = [known] if others or not best else []
    if len(others) < len(best):
        names.append("best of this folder")
    return " or ".join(names)


_OF_RECORD = ["reason", "date", "commit", "packages", "result", "used", "parameters", "information"]
"""Columns of runs on which no ranking rests: without them a large folder takes less memory."""


@lru_cache(maxsize=4)
def compared_runs(study: Study) -> pd.DataFrame:
    """Return the runs that are ranked, failed ones too: of every method except searches for the
    optimum, on tasks with a best known reward, without :data:`_OF_RECORD`."""
    runs = study.runs[study.runs.best_known.notna()].drop(columns=_OF_RECORD, errors="ignore")
    runs.attrs = {}  # which pandas copies with every selection
    return runs[~runs.label.map(study.methods.is_search).astype(bool)]


@lru_cache(maxsize=4)
def runs_by_method(study: Study) -> dict[str, pd.DataFrame]:
    """Return :func:`compared_runs` by the label of their row in the ranking (``ranked_as``), in the
    order of :attr:`.Study.methods`."""
    by_method = dict([*compared_runs(study).groupby("ranked_as", sort=False)])
    return {label: by_method[label] for label in study.methods.index if label in by_method}


def runs_on(study: Study, method: str, tasks: Iterable[str]) -> pd.DataFrame:
    """Return the runs of a method (a label, also of a row of the ranking) on some tasks, failed
    runs too; no rows if the method has no run on one of the tasks."""
    runs, tasks = compared_runs(study), {*tasks}
    runs = runs[runs.task.isin(tasks) & ((runs.ranked_as == method) | (runs.label == method))]
    return runs if {*runs.task} == tasks else runs[:0]


def cells_of(runs: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the different pairs of task and method (label) in some runs, in order."""
    return [*dict.fromkeys(zip(runs.task, runs.label, strict=True))]


@lru_cache(maxsize=4)
def ranked_tasks(study: Study) -> tuple[str, ...]:
    """Return the names of the tasks over which methods are ranked: all that the command asked for
    and that have a best known reward, in the order of the study."""
    tasks = {*compared_runs(study).task}
    return tuple(task for task in study.tasks if task in tasks)


@lru_cache(maxsize=4)
def ranking_budget(study: Study) -> int | None:
    """Return the number of trials of a run with which methods are ranked (column ``budget``).

    It is the number in the suite's file if the command asked for another one and a method has it,
    or else the number that most algorithms have, of equals the least. None if no method has trials,
    and if a method has several numbers, because the study compares them.
    """
    runs = compared_runs(study).dropna(subset="budget")
    if runs[["method", "budget"]].drop_duplicates().duplicated("method").any():
        return None
    algorithms = runs.label.map(study.methods.algorithm).groupby(runs.budget).nunique()
    by_suite = study.plan[0].suite_trials
    if by_suite in algorithms.index:
        return by_suite
    return int(algorithms.idxmax()) if len(runs) else None  # type: ignore[call-overload]


@lru_cache(maxsize=4)
def standings(study: Study) -> pd.DataFrame:
    """Return a row for each method of :func:`runs_by_method`, by label: the columns of
    :func:`.ranking`, ``note``, and the columns of :attr:`.Study.methods`.

    Ranked are the methods that solved all of :func:`ranked_tasks` with :func:`ranking_budget`, the
    smallest gap first. The others follow, with the reason in ``why``; one with another number of
    trials has a gap if it solved all tasks. ``note`` says how many trials a method from a file made
    if these are not as many as it was asked for, and of how many runs the solution can fail with
    motor noise.
    """
    runs, budget = compared_runs(study), ranking_budget(study)
    if not len(runs):
        return pd.DataFrame(columns=["gap", "noisy_gap", "runs", "why", "note", *study.methods])
    by_method = runs_by_method(study)
    rows = ranking(runs.drop(columns="budget")).loc[[*by_method]].join(study.methods)
    reasons, notes = [], []
    for (_, row), of_method in zip(rows.iterrows(), by_method.values(), strict=True):
        asked = sorted(map(int, of_method.budget.dropna().unique()))
        is_other = bool(budget) and bool({*asked} - {budget})
        trials = (
            f"{listed(map(number, asked))} trials, not {number(budget or 0)}" if is_other else ""
        )
        reasons.append("; ".join(filter(None, [row.why, trials])))
        made, due = int(of_method.trials.fillna(0).max()), max([*asked, budget or 0])
        is_told = not row.built_in and row.information == BY_TRIAL and due and made != due
        fragile = int((of_method.reward.notna() & of_method.noisy_ticks.isna()).sum())
        note = [
            f"made {number(made)} of {number(due)} trials" * bool(is_told),
            f"{fragile} of {counted(len(of_method), 'solution')} can fail with motor noise"
            * bool(fragile),
        ]
        notes.append("; ".join(filter(None, note)))
    rows = rows.assign(why=reasons, note=notes)
    return rows.sort_values(["why", "gap"], key=lambda of: of != "" if of.name == "why" else of)


@lru_cache(maxsize=1_024)
def solved_tasks(study: Study, method: str) -> tuple[str, ...]:
    """Return the names of the tasks on which a method (a label, also of a row of the ranking)
    solved every run."""
    runs = compared_runs(study)
    runs = runs[(runs.ranked_as == method) | (runs.label == method)]
    failed = {*runs.task[runs.reward.isna()]}
    return tuple(str(task) for task in dict.fromkeys(runs.task) if task not in failed)
