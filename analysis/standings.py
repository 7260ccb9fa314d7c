"""Rank the methods of a study, and say why some methods are not ranked.

A method is ranked if it has runs on all tasks of the ranking, if all these runs are solved, and if
it was not asked for another number of trials than that of the ranking (:func:`ranking_budget`).
Searches for the optimum are references and are not ranked.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import chain

import numpy as np
import pandas as pd

from coartic.analysis.frames import ranking
from coartic.analysis.methods import BY_TRIAL
from coartic.analysis.statistics import (
    are_separated,
    means_of_other_runs,
    means_on_other_tasks,
    place_intervals,
)
from coartic.analysis.study import Study, check_study
from coartic.analysis.words import listed, number
from coartic.estimates import MIN_TASKS, MIN_VALUES
from coartic.internal.text import pluralize
from coartic.method.as_method import methods_named_in
from coartic.robot import Array


def reference(study: Study, tasks: Iterable[str]) -> str:
    """Return what sentences call the best known rewards of tasks, such as ``optimum``.

    A reward is called *local* if it is not proven to be the optimum, and is known only from methods
    of this folder (:attr:`.BestKnown.only_here`). The name is

    - ``optimum`` if all rewards are proven, or if there are no tasks;
    - ``best known reward`` if at least one reward is not proven, and none is local;
    - ``best of this folder`` if all rewards are local.

    If some rewards are local and others are not, the name is that of the others alone, followed by
    ``or best of this folder``. Raises KeyError for a task without a best known reward.
    """
    best = [study.optima[task] for task in tasks]
    others = [known.proven for known in best if known.proven or not known.only_here]
    known = "optimum" if all(others) else "best known reward"
    names = [known] if others or not best else []
    if len(others) < len(best):
        names.append("best of this folder")
    return " or ".join(names)


NOT_HERE = "no runs in this world"
"""Reason for not ranking a method that has runs only in other worlds of the folder."""
_OWN_NOT_HERE = f"{NOT_HERE}; coartic run with its method file makes them, if it can run here"
"""The same for a method from a file."""
ESTIMATES, COUNTS = ("gap", "share"), ("tasks", "runs", "failed")
"""Columns of :func:`.ranking` that are estimates with an interval, and columns that are counts."""
PLACES = ("place", "place_low", "place_high", "separated")
"""Columns of :func:`standings` on the places of ranked methods."""
_OF_RECORD = ["reason", "date", "commit", "packages", "result", "used", "parameters", "information"]
"""Columns of runs that no ranking uses. They are dropped to save memory in large folders."""


@lru_cache(maxsize=4)
def compared_runs(study: Study) -> pd.DataFrame:
    """Return the runs that the ranking uses, including failed runs.

    These are all runs on tasks with a best known reward, without the runs of searches for the
    optimum. The columns :data:`_OF_RECORD` are left out. The frame is cached: do not change it.
    Raises CoarticError for a study of several worlds (:attr:`.Study.worlds`).
    """
    check_study(study)
    runs = study.runs[study.runs.best_known.notna()].drop(columns=_OF_RECORD, errors="ignore")
    runs.attrs = {}  # pandas would copy attrs with every selection
    return runs[~runs.label.map(study.methods.is_search).astype(bool)]


@lru_cache(maxsize=4)
def runs_by_method(study: Study) -> dict[str, pd.DataFrame]:
    """Return a dict that maps each row of the ranking to its runs.

    The keys are the values of column ``ranked_as`` of :func:`compared_runs`, in the order of
    :attr:`.Study.methods`. The dict is cached: do not change it.
    """
    by_method = dict([*compared_runs(study).groupby("ranked_as", sort=False)])
    return {label: by_method[label] for label in study.methods.index if label in by_method}


def runs_on(study: Study, method: str, tasks: Iterable[str]) -> pd.DataFrame:
    """Return the runs of a method on given tasks, including failed runs.

    The runs are selected from :func:`compared_runs`. ``method`` is the label of the method, or the
    label of a row of the ranking. If the method has no run on one of the tasks, the frame is empty.
    It is also empty for a search for the optimum, and if one of the tasks has no best known reward.
    Raises CoarticError for a study of several worlds.
    """
    runs, tasks = compared_runs(study), {*tasks}
    runs = runs[runs.task.isin(tasks) & ((runs.ranked_as == method) | (runs.label == method))]
    return runs if {*runs.task} == tasks else runs[:0]


def cells_of(runs: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the distinct pairs of a task and a label in ``runs``.

    The pairs are in the order in which they first appear.
    """
    return [*dict.fromkeys(zip(runs.task, runs.label, strict=True))]


@lru_cache(maxsize=4)
def ranked_tasks(study: Study) -> tuple[str, ...]:
    """Return the names of the tasks on which methods are ranked.

    These are all tasks that have a best known reward, and on which a method other than a search for
    the optimum was run. The names are in the order of :attr:`.Study.tasks`.
    """
    tasks = {*compared_runs(study).task}
    return tuple(task for task in study.tasks if task in tasks)


@lru_cache(maxsize=4)
def ranking_budget(study: Study) -> int | None:
    """Return the number of trials that ranked methods were asked for, or None.

    Column ``budget`` of :func:`compared_runs` has the number of trials that each run was asked for.
    The result is

    - None if no method has trials, or if one method has runs with different numbers of trials: the
      study then compares these numbers;
    - otherwise the number of trials that the last ``coartic run`` asked for (or the file of the
      suite, if the command named no number), if a method has this number of trials;
    - otherwise the number of trials that is most frequent among algorithms; if several numbers are
      equally frequent, the smallest of them.
    """
    runs = compared_runs(study).dropna(subset="budget")
    if runs[["method", "budget"]].drop_duplicates().duplicated("method").any():
        return None
    algorithms = runs.label.map(study.methods.algorithm).groupby(runs.budget).nunique()
    asked = study.plan[0].trials
    if asked in algorithms.index:
        return asked
    return int(algorithms.idxmax()) if len(runs) else None  # type: ignore[call-overload]


@lru_cache(maxsize=4)
def standings(study: Study) -> pd.DataFrame:
    """Rank the methods of a study by their mean gap.

    A method is ranked if it has runs on all tasks of :func:`ranked_tasks`, if all these runs are
    solved, and if it was asked for the number of trials of :func:`ranking_budget`. The number of
    trials does not matter for a method without trials, or if :func:`ranking_budget` returns None.
    If another number of trials is the only reason why a method is not ranked, the method has a gap.

    Returns
    -------
    DataFrame
        A row for each method of :func:`runs_by_method`, indexed by label. Ranked methods come
        first, in ascending order of their gaps; methods that are not ranked follow. The frame has
        the columns of :func:`.ranking` and of :attr:`.Study.methods`. Column ``why`` is the reason
        why a method is not ranked; it is empty for a ranked method. Column ``note`` says, if it
        applies,

        - from which other method's runs the method takes its hands, or the ticks at which it stops,
          and how many runs never took so few (:mod:`coartic.method.as_method`);
        - how many trials the solved runs of a method from a file made, if the method uses the
          reward of each trial, and this number differs from the number that was asked for;
        - how many executions failed in a world with noise.

        ``place_low`` and ``place_high`` are the ends of the 95 % interval of a method's place among
        the ranked methods, ``place`` is this interval in words, such as ``2–3``, and ``separated``
        says whether the method and the next one are separated (:func:`.are_separated`). If a task
        is an instance of a family, instances are resampled within families, otherwise runs within
        tasks. The four columns are empty or NaN

        - if a method is not ranked;
        - if instances are resampled, and there are fewer than three of a family;
        - if runs are resampled, and a stochastic method has fewer than five on a task.

        The frame also contains a row for each method, except searches for the optimum, that has
        runs only in other worlds (:attr:`.Study.elsewhere`). The reason then begins with
        :data:`NOT_HERE`.

    Raises
    ------
    CoarticError
        The study has several worlds (:attr:`.Study.worlds`).
    """
    runs, budget = compared_runs(study), ranking_budget(study)
    elsewhere = study.elsewhere
    if len(elsewhere):
        elsewhere = elsewhere[~elsewhere.is_search.astype(bool)]
        why = np.where(elsewhere.built_in.astype(bool), NOT_HERE, _OWN_NOT_HERE)
        elsewhere = elsewhere.assign(why=why, note="", **dict.fromkeys(COUNTS, 0))
    if not len(runs):
        estimates = [f"{name}{end}" for name in ESTIMATES for end in ("", "_low", "_high")]
        columns = [*estimates, "without_gain", *COUNTS, "why", "note", *study.methods, *PLACES]
        return elsewhere.reindex(columns=columns)
    by_method = runs_by_method(study)
    rows = ranking(runs.drop(columns="budget")).loc[[*by_method]].join(study.methods)
    reasons, notes, named = [], [], defaultdict[str, set[tuple[str, str]]](set)
    for cell in (job.cell for job in study.plan if job.cell.named):
        named[cell.label] |= {*methods_named_in(cell.parameters).items()}
    for (_, row), of_method in zip(rows.iterrows(), by_method.values(), strict=True):
        asked = sorted(map(int, of_method.budget.dropna().unique()))
        is_other = bool(budget) and bool({*asked} - {budget})
        trials = (
            f"{listed(map(number, asked))} trials, not {number(budget or 0)}" if is_other else ""
        )
        reasons.append("; ".join(filter(None, [row.why, trials])))
        due = max([*asked, budget or 0])
        made = of_method.trials[of_method.value.notna()].dropna().astype(int)
        is_told = not row.built_in and row.information == BY_TRIAL and due and (made != due).any()
        ends = dict.fromkeys([made.min(), made.max()])
        failed = int(of_method.failed_executions.sum())
        never = int((of_method.reached == False).sum())  # noqa: E712  # missing without `until`
        note = [
            *(
                f"takes its {'ticks' if name == 'until' else 'hands'} from runs of {other}, whose "
                "trials are not counted"
                for name, other in sorted({*chain(*(named[label] for label in {*of_method.label}))})
            ),
            (f"{pluralize(never, 'run')} never took so few ticks" if never else ""),
            (f"made {' to '.join(map(number, ends))} of {number(due)} trials" if is_told else ""),
            (f"{pluralize(failed, 'execution')} failed" if failed else ""),
        ]
        notes.append("; ".join(filter(None, note)))
    rows = rows.assign(why=reasons, note=notes)
    if len(elsewhere):
        rows = pd.concat([rows, elsewhere])
    rows = rows.sort_values(
        ["why", "gap"], key=lambda column: column != "" if column.name == "why" else column
    )
    means = _resampled_gaps(study, [*map(str, rows.index[rows.why == ""])])
    places: list[tuple[object, ...]] = [("", math.nan, math.nan, math.nan) for _ in rows.index]
    if means is not None:
        separated = *are_separated(means), math.nan
        places[: len(separated)] = [
            (f"{low}–{high}" if low < high else f"{low}", low, high, apart)
            for (low, high), apart in zip(place_intervals(means), separated, strict=True)
        ]
    return rows.join(pd.DataFrame(places, rows.index, [*PLACES], dtype=object))


def has_instances(study: Study) -> bool:
    """Return whether methods are ranked on a task that is an instance of a family."""
    return any(study.tasks[name].family for name in ranked_tasks(study))


def _resampled_gaps(study: Study, methods: Sequence[str]) -> Array | None:
    """Return the mean gaps of ranked methods in resamples; None if there is too little to resample.

    The shape is ``(resamples, methods)``. :func:`standings` says what is resampled.
    """
    if not methods:
        return None
    tasks = ranked_tasks(study)
    gaps = [runs_by_method(study)[label].groupby("task").gap for label in methods]
    if has_instances(study):
        strata = defaultdict[str, list[str]](list)
        for name in tasks:
            strata[study.tasks[name].family or name].append(name)
        families = [names for names in strata.values() if study.tasks[names[0]].family]
        if min(map(len, families)) < MIN_TASKS:
            return None
        means = pd.concat([of.mean() for of in gaps], axis=1)
        return means_on_other_tasks([means.loc[names].to_numpy() for names in strata.values()])
    samples = list[list[Array]]()
    for label, of in zip(methods, gaps, strict=True):
        runs = [of.get_group(task).to_numpy(np.float64) for task in tasks]
        if study.methods.stochastic[label] and min(map(len, runs)) < MIN_VALUES:
            return None
        samples.append(runs)
    return means_of_other_runs(samples)


def neighbours(study: Study) -> str:
    """Return how many neighbours in the ranking are not separated, in a sentence.

    If only runs are resampled, a second sentence says so. The result is empty without places, and
    if only one method is ranked.
    """
    separated = standings(study).separated.dropna()
    if separated.empty:
        return ""
    count = int((~separated.astype(bool)).sum())
    are = "is" if count == 1 else "are"
    sentence = f"{count} of {pluralize(len(separated), 'neighbour')} {are} not separated."
    if not has_instances(study):
        sentence += " Only runs are resampled, because the tasks are fixed."
    return sentence


def has_few_runs(study: Study, methods: Iterable[str], tasks: Iterable[str]) -> bool:
    """Return whether a stochastic method has fewer than five runs on one of the tasks.

    So few runs are not enough for a test. ``methods`` are labels of methods, or labels of rows of
    the ranking. Deterministic methods, and methods without runs on one of the tasks, are not
    checked.
    """
    stochastic = study.methods.stochastic.astype(bool)
    drawn = [runs_on(study, method, tasks) for method in methods]
    counts = [runs[runs.label.map(stochastic)].groupby("task").size() for runs in drawn]
    return min((int(of.min()) for of in counts if len(of)), default=MIN_VALUES) < MIN_VALUES


@lru_cache(maxsize=1_024)
def solved_tasks(study: Study, method: str) -> tuple[str, ...]:
    """Return the names of the tasks on which a method has runs, all of them solved.

    Only tasks with a best known reward are included. ``method`` is the label of the method, or the
    label of a row of the ranking. The names are in the order of the runs.
    """
    runs = compared_runs(study)
    runs = runs[(runs.ranked_as == method) | (runs.label == method)]
    failed = {*runs.task[runs.value.isna()]}
    return tuple(str(task) for task in dict.fromkeys(runs.task) if task not in failed)
