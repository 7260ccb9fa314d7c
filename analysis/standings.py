"""Standings of methods: compared methods, compared tasks, and gaps to the best known reward.

A gap is the distance of a method's mean reward to the best known reward of a task. Searches for the
optimum are references and are not compared; neither are runs that lock the base, which solve
another problem.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.optima import BestKnown
from coartic.analysis.statistics.hypotheses import sign_flip_test
from coartic.analysis.statistics.instances import task_mean
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.words import number
from coartic.estimates import Estimate
from coartic.internal.text import counted
from coartic.learner.conditions import CONDITIONS


def reference(study: Study, tasks: Iterable[str]) -> str:
    """Return the name of the reward to which gaps on these tasks are taken: ``optimum`` if all are
    proven, ``best of this folder`` if no other reward is known on any, or else ``best known
    reward``."""
    best = [study.optima[task] for task in tasks]
    if all(each.proven for each in best):
        return "optimum"
    return "best of this folder" if all(each.only_here for each in best) else "best known reward"


@cached
def compared(study: Study) -> dict[str, dict[str, CellRuns]]:
    """Return the cells of every compared method by task, on tasks with a best known reward."""
    rows, by_method = study.methods, dict[str, dict[str, CellRuns]]()
    for method, parts in rows.parts[rows.kind != "optimum search"].items():
        keys = [(task, part) for part in parts for task in study.tasks]
        by_task = {key[0]: study.cells[key] for key in keys if key in study.cells}
        cells = {task: cell for task, cell in by_task.items() if cell.runs.best_known.notna().any()}
        if len({cell.label for cell in cells.values()}) == len(parts):
            by_method[str(method)] = cells
    return by_method


def cells_on(study: Study, method: str, tasks: Iterable[str]) -> list[CellRuns]:
    """Return the cells of a compared method on some tasks.

    Empty if the method lacks one of the tasks, or if these tasks have only one of the conditions
    of a row that joins several.
    """
    of_method, tasks = compared(study)[method], [*tasks]
    cells = [of_method[task] for task in tasks if task in of_method]
    on_all = len(cells) == len(tasks)
    return cells if on_all and {c.label for c in cells} == {*study.methods.parts[method]} else []


@cached
def common_tasks(study: Study) -> tuple[str, ...]:
    """Return the tasks over which algorithms are compared: all tasks, unless too few algorithms ran
    on all of them.

    Of the sets of tasks on which one method ran, the set with the most pairs of a task and an
    algorithm that ran on all tasks of the set.
    """
    sets = [(study.methods.algorithm[m], {*cells}) for m, cells in compared(study).items()]

    def pairs(tasks: set[str]) -> tuple[int, int]:
        algorithms = len({algorithm for algorithm, on in sets if on >= tasks})
        return len(tasks) * algorithms, len(tasks)

    widest = max((tasks for _, tasks in sets), key=pairs, default=set())
    return tuple(task for task in study.tasks if task in widest)


@cached
def solved_tasks(study: Study, method: str) -> tuple[str, ...]:
    """Return the tasks on which a compared method solved every run."""
    return tuple(task for task, cell in compared(study)[method].items() if cell.all_good)


def coverage(study: Study, method: str) -> str:
    """Return the number of compared tasks on which a method solved every run, as ``10 of 50
    tasks``; empty if these are all tasks."""
    every = {task for cells in compared(study).values() for task in cells}
    solved = len(solved_tasks(study, method))
    return f"{solved} of {counted(len(every), 'task')}" if solved < len(every) else ""


def best_of_instances(study: Study) -> dict[str, BestKnown]:
    """Return the best known rewards of the instances of families."""
    optima = study.optima.items()
    return {name: best for name, best in optima if study.tasks[name].family is not None}


def shown_name(study: Study, method: str) -> str:
    """Return the name of a method, with the number of its tasks for a method from a file that did
    not solve all of :func:`common_tasks`."""
    row = study.methods.loc[method]
    if row.built_in or {*common_tasks(study)} <= {*solved_tasks(study, method)}:
        return str(row.title)
    return f"{row.title} ({coverage(study, method)})"


@cached
def gaps_on(study: Study, tasks: tuple[str, ...]) -> pd.DataFrame:
    """Return the mean gap over some tasks of each method that solved every run on all of them,
    nearest first.

    Columns ``method``, ``gap`` with its interval for other runs on the same tasks, numbers of
    ``tasks`` and ``runs``, and the columns of :attr:`.Study.methods`.
    """
    rows = []
    for method in compared(study):
        cells = sorted(cells_on(study, method, tasks), key=lambda cell: cell.task)
        if cells and all(cell.all_good for cell in cells):
            gap = task_mean([cell.gaps for cell in cells])
            runs = sum(len(cell.runs) for cell in cells)
            rows.append((method, gap.value, gap.low, gap.high, len(cells), runs))
    columns = ["method", "gap", "gap_low", "gap_high", "tasks", "runs"]
    frame = pd.DataFrame(rows, columns=columns).sort_values("gap", kind="stable")
    return frame.join(study.methods, on="method")


def main_gaps(study: Study) -> pd.DataFrame:
    """Return :func:`gaps_on` the tasks over which algorithms are compared."""
    return gaps_on(study, common_tasks(study))


def leaders(rows: pd.DataFrame, group: str) -> pd.DataFrame:
    """Return the best row of each algorithm of a group, from rows of :func:`gaps_on`, nearest
    first.

    The learner is represented by the condition that explores most. A setting counts if its method
    did not run with the defaults.
    """
    rows = rows[(rows.information == group) & (rows.under == "")]
    is_learner, conditions = rows.kind == "learner", [*CONDITIONS]
    most = max(rows.condition[is_learner], key=conditions.index, default="")
    kept = rows[~is_learner | (rows.condition == most)]
    return kept.drop_duplicates("algorithm").reset_index(drop=True)


def is_learner(rows: Any) -> Any:
    """Return whether rows of :attr:`.Study.methods`, or a row, are the learner with defaults."""
    return (rows["kind"] == "learner") & (rows["setting"] == "")


def called(row: Mapping[Any, Any] | pd.Series) -> str:
    """Return the name of a method in sentences, by its row of :attr:`.Study.methods`."""
    return "the learner" if is_learner(row) else str(row["title"])


def paired_difference(study: Study, first: str, second: str, tasks: Iterable[str]) -> Estimate:
    """Test the difference of the mean gaps of two methods over some tasks, two-tailed.

    A sign-flip test of runs paired by seed within their task; the single run of a deterministic
    method is paired with every run of the other method. All tasks count the same. NaN if a task has
    no pair. Runs without a partner do not count, unlike in table ``against-learner``.
    """
    differences = []
    tasks = [*tasks]
    both = (cells_on(study, method, tasks) for method in (first, second))
    for cells in zip(*both, strict=True):
        a, b = (cell.good[["seed"]].assign(gap=cell.gaps) for cell in cells)
        once = min(len(a), len(b)) == 1
        pairs = a.merge(b, "cross") if once else a.merge(b, on="seed")
        differences.append((pairs.gap_x - pairs.gap_y).to_numpy())
    if not differences or not all(map(len, differences)):
        return Estimate(math.nan)
    return sign_flip_test(np.concatenate([of_task / len(of_task) for of_task in differences]))


def failed_runs(study: Study, cells: Iterable[CellRuns], consequence: str) -> str:
    """Return a sentence on failed runs, with a leading space; empty if no run failed.

    The sentence counts all runs of the methods with failed runs, and ends with the ``consequence``:
    `` 3 of 40 runs of hill climbing failed and are not counted.``
    """
    runs, failed = Counter[str](), Counter[str]()
    for cell in {(cell.task, cell.label): cell for cell in cells}.values():
        runs[cell.label] += len(cell.runs)
        failed[cell.label] += len(cell.runs) - len(cell.good)
    who = [label for label in failed if failed[label]]
    if not who:
        return ""
    names = f"{len(who)} methods" if len(who) > 2 else " and ".join(study.methods.title[who])
    total = sum(runs[label] for label in who)
    return f" {number(failed.total())} of {number(total)} runs of {names} failed{consequence}."
