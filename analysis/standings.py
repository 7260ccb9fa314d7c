"""Standings of methods: compared methods, compared tasks, and their gaps and shares.

Searches for the optimum are references and are not compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pandas as pd

from coartic.analysis.frames import compared_tasks, ranking
from coartic.analysis.method_frame import BY_TRIAL, with_joined_learners, without_settings
from coartic.analysis.study import Study, cached
from coartic.analysis.words import interval, number
from coartic.internal.text import counted
from coartic.runs.plan import trials_in


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
"""Columns of runs on which no comparison rests: without them a large folder takes less memory."""


@cached
def compared(study: Study) -> dict[str, pd.DataFrame]:
    """Return the runs, also failed ones, of every method except searches for the optimum, by label
    of the row in :attr:`.Study.methods`, in the order of these rows, without :data:`_OF_RECORD`.

    A row that joins two conditions of the learner has runs that are in the rows of these
    conditions, too. Runs on tasks without a best known reward are left out, and so are methods
    without other runs.
    """
    runs = study.runs[study.runs.best_known.notna()].drop(columns=_OF_RECORD, errors="ignore")
    runs.attrs = {}  # which pandas copies with every selection
    by_label = with_joined_learners(dict([*runs.groupby("label", sort=False)]))
    rows = study.methods.index[~study.methods.is_search]
    return {method: by_label[method] for method in rows if method in by_label}


def runs_on(study: Study, method: str, tasks: Iterable[str]) -> pd.DataFrame:
    """Return the runs of a method (label) on some tasks, failed runs too. Raises KeyError for a
    label that :func:`compared` does not have.

    No rows if the method has no run on one of the tasks, or if it is a row of
    :attr:`.Study.methods` that joins conditions of the learner and one condition has no run there.
    """
    runs, tasks = compared(study)[method], {*tasks}
    runs = runs[runs.task.isin(tasks)]
    complete = {*runs.task} == tasks and {*runs.label} == {*study.methods.parts[method]}
    return runs if complete else runs[:0]


def cells_of(runs: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the different pairs of task and method (label) in some runs, in order."""
    return [*dict.fromkeys(zip(runs.task, runs.label, strict=True))]


@cached
def common_tasks(study: Study) -> tuple[str, ...]:
    """Return the names of the tasks over which algorithms are compared (:func:`.compared_tasks`),
    in the order of the study. Empty if no method is compared."""
    every = compared(study).items()
    on = compared_tasks((study.methods.algorithm[method], {*runs.task}) for method, runs in every)
    return tuple(task for task in study.tasks if task in on)


@cached
def equal_trials(study: Study) -> int:
    """Return the number of trials of a run with which methods are ranked. Of methods that use the
    reward of each trial: the number in the suite's file, if the command asked for another and a
    method has it, or else the number that most algorithms have (of equals the least). Without such
    a method that has a parameter ``trials``: the most trials that a run made."""
    asked, algorithms = _trials_asked(study), dict[int, set[str]]()
    for method in compared(study):
        for part in study.methods.parts[method]:
            if asked[part] and study.methods.information[method] == BY_TRIAL:
                algorithm = study.methods.algorithm[method]
                algorithms.setdefault(asked[part], set()).add(algorithm)
    by_suite = study.plan[0].suite_trials
    if by_suite in algorithms:
        return by_suite
    if not algorithms:
        return int(study.runs.trials.fillna(0).max())
    return max(sorted(algorithms), key=lambda n: len(algorithms[n]))


@cached
def trials_of(study: Study) -> dict[str, int]:
    """Return, by label, the number of trials of a run of each row of :attr:`.Study.methods`: its
    parameter ``trials``; without this parameter the most trials made, at least
    :func:`equal_trials`; of joined conditions the larger; for a method that does not use the reward
    of each trial always :func:`equal_trials`."""
    asked, equal = _trials_asked(study), equal_trials(study)
    made = study.runs.fillna({"trials": 0}).groupby("label").trials.max()
    return {
        str(label): max(asked[part] or max(int(made[part]), equal) for part in row.parts)
        if row.information == BY_TRIAL
        else equal
        for label, row in study.methods.iterrows()
    }


@cached
def _trials_asked(study: Study) -> dict[str, int]:
    """Return the parameter ``trials`` of each method with its setting, by label; 0 without such a
    whole number."""
    return {job.cell.label: trials_in(job.cell.parameters) for job in study.plan}


def together(study: Study, by_method: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Join frames of runs, by label of a row of :attr:`.Study.methods`, into one frame with a new
    index, the label in column ``method`` and an empty ``setting``; without runs it has no rows."""
    parts = [runs.assign(method=method) for method, runs in by_method.items()]
    return pd.concat([*parts, study.runs[:0]], ignore_index=True).assign(setting="")


def common_runs(study: Study) -> pd.DataFrame:
    """Return the runs on :func:`common_tasks` of every compared method that ran on all of them
    (:func:`runs_on`), as one frame (:func:`together`)."""
    tasks = common_tasks(study)
    return together(study, {method: runs_on(study, method, tasks) for method in compared(study)})


@cached
def board(study: Study, also: frozenset[str] = frozenset()) -> pd.DataFrame:
    """Return the standings: a row for each method that has a gap to the best known reward, by
    label, with the columns of :func:`.ranking` and of :attr:`.Study.methods`, and with ``ranked``,
    True or False.

    Ranked is a method of :func:`common_runs` that solved every run there, with at most
    :func:`equal_trials` trials (with any number in a study that varies it); the smallest gap is
    first. Rows that are not ranked follow: of methods with more trials, and of methods from files
    or in ``also`` that lack a run or a solution on one of these tasks, whose numbers are means over
    the tasks on which they solved every run. Other methods have no row.
    """
    runs, methods = common_runs(study), study.methods
    parts = [ranking(runs)] if len(runs) else []
    there = {*parts[0].index[parts[0].gap.notna()]} if parts else set()
    for method, every in compared(study).items():
        on_solved = every[every.task.isin(solved_tasks(study, method))]
        is_shown = not methods.built_in[method] or method in also
        if len(on_solved) and method not in there and is_shown:
            parts.append(ranking(together(study, {method: on_solved})))
    rows = pd.concat(parts) if parts else pd.DataFrame(columns=["gap", "share", "runs"])
    rows = rows[rows.gap.notna()].join(methods)
    has_more = rows.index.map(trials_of(study)) > equal_trials(study)
    has_more &= study.varied[0] != "trials"
    rows = rows.assign(ranked=rows.index.isin(there) & ~has_more)
    return rows.sort_values(["ranked", "gap"], ascending=[False, True])


def not_ranked(study: Study, also: frozenset[str] = frozenset()) -> list[str]:
    """Return a sentence for each row of :func:`board` that is not ranked, settings left out: its
    gap, why it is not ranked, and the gap of the first ranked method with the same use of the
    reward on the same tasks, if that ran on all of them; and for each method from a file, or of the
    labels ``also``, that solved every run on no task and so has no row."""
    rows, sentences = without_settings(board(study, also)), []
    for method in rows.index[~rows.ranked]:
        on, common = solved_tasks(study, method), common_tasks(study)
        on = common if {*common} <= {*on} else on  # as in the row
        name = study.methods.title[method]
        text = f"{name} {interval(rows.loc[method], 'gap', scale=100, unit=' %')} is not ranked"
        reasons = [_on_tasks(study, method)]
        if trials_of(study)[method] > equal_trials(study):
            others = number(equal_trials(study))
            reasons.append(f"{number(trials_of(study)[method])} trials, not {others}")
        text += f": {'; '.join(filter(None, reasons))}"
        alike = rows[rows.ranked & (rows.information == rows.information[method])]
        for first in alike.index[:1]:
            if len(same := runs_on(study, first, on)):
                gap = ranking(together(study, {first: same})).gap.iloc[0]
                text += f"; on {'it' if len(on) == 1 else 'these'} {alike.title[first]} has "
                text += f"{number(100 * gap, 1)} %"
        sentences.append(f"{text}.")
    for method in compared(study):
        shown = not study.methods.built_in[method] or method in also
        if shown and not solved_tasks(study, method):
            sentences.append(
                f"{study.methods.title[method]} is not ranked: {_on_tasks(study, method)}."
            )
    return sentences


def own_methods(study: Study) -> list[str]:
    """Return the labels of the methods from files that solved every run on a task or more, in the
    order of :func:`board`."""
    rows = board(study)
    return [*rows.index[~rows.built_in.astype(bool)]]


@cached
def solved_tasks(study: Study, method: str) -> tuple[str, ...]:
    """Return the names of the tasks on which a method of :func:`compared` solved every run."""
    by_task = compared(study)[method].groupby("task", sort=False)
    return tuple(str(task) for task, runs in by_task if runs.reward.notna().all())


def shown_name(study: Study, method: str) -> str:
    """Return the title of a method and, for a method of :func:`compared`, why its numbers are not
    comparable with the numbers of other methods:
    ``mine (3 of 8 tasks)`` for a method from a file that did not solve every run on
    :func:`common_tasks`; ``mine (at most 77 of 400 trials)`` for a method from a file that uses the
    reward of each trial and whose runs all made fewer trials than :func:`trials_of` has; ``mine
    (400 trials)`` for another number of trials than :func:`equal_trials`, where the title has no
    setting of ``trials``."""
    row, trials = study.methods.loc[method], trials_of(study)[method]
    if method not in compared(study):
        return str(row.title)
    apart = [] if row.built_in else [_on_tasks(study, method)]
    made = int(compared(study)[method].trials.fillna(0).max())
    if not row.built_in and row.information == BY_TRIAL and made < trials:
        apart.append(f"at most {number(made)} of {number(trials)} trials")
    if trials != equal_trials(study) and "trials=" not in row.title:
        apart.append(f"{number(trials)} trials")
    words = "; ".join(filter(None, apart))
    return f"{row.title} ({words})" if words else str(row.title)


def _on_tasks(study: Study, method: str) -> str:
    """Return on how many of all tasks of :func:`compared` a method solved every run, ``3 of 8
    tasks``, with the number of its failed runs if there are any; empty if it solved every run on
    the tasks over which methods are ranked (:func:`common_tasks`)."""
    on = {*solved_tasks(study, method)}
    if {*common_tasks(study)} <= on:
        return ""
    every = {task for runs in compared(study).values() for task in runs.task}
    failed = int(compared(study)[method].reward.isna().sum())
    more = f", {counted(failed, 'failed run')}" if failed else ""
    return f"{len(on)} of {counted(len(every), 'task')}{more}"
