"""Scores: a frame of the runs that are compared, and the table of methods.

Methods are compared by their gap to the best known reward of a task. The learner explores
one-armed and two-armed tasks under different conditions, so that one method joins them:
``dual-process (EC1, EC4)`` is EC1 where a task has one arm and EC4 where it has two.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

import pandas as pd

from coartic.analysis import methods
from coartic.analysis.methods import EC1, EC3, EC4, is_search, is_setting, name_of
from coartic.analysis.optima import gap_share, locks_base
from coartic.analysis.settings import compares_settings, name_in
from coartic.analysis.study import CellRuns, Study, cached, one_by_one, typical_run
from coartic.analysis.table import SHORT_ID, Rows, runs_of, table
from coartic.analysis.words import marked, number, tally
from coartic.estimates import standard_deviation
from coartic.internal.text import counted
from coartic.method import Information

BY_TRIAL, BY_FORMULA, WITHOUT_REWARD = GROUPS = (
    "using the reward of each trial",
    "using the reward as a formula",
    "not using the reward",
)
"""Groups of methods by their use of the reward."""


def reference(study: Study, tasks: Iterable[str]) -> str:
    """Return what gaps on these tasks are to: ``optimum`` where all are proven, ``best of this
    folder`` where nothing else is known of any, or else ``best known reward``."""
    best = [study.optima[task] for task in tasks]
    if all(each.proven for each in best):
        return "optimum"
    return "best of this folder" if all(each.only_here for each in best) else "best known reward"


@cached
def labels_by_task(study: Study) -> dict[str, dict[str, str]]:
    """Labels by task of every method, on tasks with a best known reward.

    A method has its own label on all tasks; the learner's conditions together have several.
    """
    by_method: dict[str, dict[str, str]] = {}
    for task, label in study.cells:
        if task in study.optima:
            by_method.setdefault(label, {})[task] = label
    one_armed = by_method.get(EC1, {})
    for more in (EC4, EC3):
        two_armed = by_method.get(more, {})
        elsewhere = {task: label for task, label in one_armed.items() if task not in two_armed}
        if two_armed and elsewhere:
            together = f"{methods.TOGETHER}EC1, {more.removeprefix(methods.LEARNER)})"
            by_method[together] = elsewhere | two_armed
    return by_method


@cached
def compared(study: Study) -> dict[str, dict[str, CellRuns]]:
    """Cells by task of every method that is compared, the learner's conditions together too.

    Without searches for the optimum, cells that lock the base, which solve another problem, and
    settings, unless these are compared.
    """
    every = {
        method: {
            task: cell
            for task, label in labels.items()
            if not locks_base((cell := study.cells[task, label]).runs)
        }
        for method, labels in labels_by_task(study).items()
        if is_compared(study, method)
    }
    return {method: cells for method, cells in every.items() if cells}


@cached
def common_tasks(study: Study) -> list[str]:
    """Return the tasks that a mean is over, which are all tasks unless too few methods ran on all.

    Of the sets of tasks on which a method ran, the set with the most pairs of a task and an
    algorithm that ran on the whole set.
    """
    ran_on = {method: {*cells} for method, cells in compared(study).items()}

    def pairs(tasks: set[str]) -> tuple[int, int]:
        ran = {methods.algorithm_of(method) for method, on in ran_on.items() if on >= tasks}
        return len(tasks) * len(ran), len(tasks)

    tasks = max(ran_on.values(), key=pairs, default=set())
    return [task for task in study.tasks if task in tasks]


@cached
def solved_tasks(study: Study, method: str) -> tuple[str, ...]:
    """Return the tasks on which a method of :func:`compared` solved every run."""
    cells = compared(study)[method].items()
    return tuple(task for task, cell in cells if len(cell.good) == len(cell.runs) > 0)


def coverage(study: Study, method: str) -> str:
    """Return on how many of the compared tasks a method solved every run, as ``10 of 50 tasks``;
    empty where it did on all."""
    every = {task for cells in compared(study).values() for task in cells}
    solved = len(solved_tasks(study, method))
    return f"{solved} of {counted(len(every), 'task')}" if solved < len(every) else ""


def shown_name(study: Study, method: str) -> str:
    """Return the name of a method; of a method from a file that did not solve all of
    :func:`common_tasks` with the number of its tasks."""
    name = name_in(study, method)
    if methods.is_built_in(method) or {*common_tasks(study)} <= {*solved_tasks(study, method)}:
        return name
    return f"{name} ({coverage(study, method)})"


@cached
def scores(study: Study) -> pd.DataFrame:
    """Return a row for each run of the compared methods, for :func:`coartic.analysis.ranking`.

    Columns ``method`` (label, or the learner's conditions together), ``task``, ``run``, ``seed``,
    ``reward`` (NaN for a run without a solution) and ``best_known``.
    """
    columns = ["method", "task", "run", "seed", "reward", "best_known"]
    parts = [
        cell.runs[["run", "seed"]].assign(
            method=method,
            task=task,
            reward=cell.runs.reward.where(cell.runs.status == "ok").astype(float),
            best_known=study.optima[task].reward,
        )[columns]
        for method, cells in compared(study).items()
        for task, cell in cells.items()
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def is_compared(study: Study, label: str) -> bool:
    """Whether a method is compared with others: no search for the optimum, and a setting only where
    settings are compared."""
    shown = compares_settings(study) or not is_setting(label)
    return shown and not is_search(label)


@cached
def groups(study: Study) -> dict[str, str]:
    """Which of :data:`GROUPS` each method belongs to.

    A method that makes a single trial on every task makes no use of the reward of a trial. The
    learner's conditions together have the information of each.
    """
    of_label = {}
    for label in dict.fromkeys(label for _, label in study.cells):
        parts = [cell.runs for (_, name), cell in study.cells.items() if name == label]
        information = ", ".join(each for runs in parts for each in runs.information.unique()).split(
            ", "
        )
        several = any((runs.trials > 1).any() for runs in parts)
        learns = Information.REWARD_BY_TRIAL.value in information and several
        by_formula = Information.REWARD_FORMULA.value in information
        of_label[label] = BY_FORMULA if by_formula else BY_TRIAL if learns else WITHOUT_REWARD
    together = {name: EC1 for name in labels_by_task(study) if name not in of_label}
    return of_label | {name: of_label[label] for name, label in together.items()}


def cell_gap(study: Study, cell: CellRuns) -> float:
    """Gap of a cell's mean reward to the best known; NaN where either is missing."""
    best = study.optima.get(cell.task)
    if best is None or not len(cell.good) or locks_base(cell.runs):
        return math.nan
    return float(gap_share(cell.rewards.mean(), best.reward))


def failed_runs(cells: Iterable[CellRuns], consequence: str) -> str:
    """A sentence with a leading space; empty where none of the cells' runs failed.

    It counts all runs of the methods of which some failed, and ends with the ``consequence``:
    `` 3 of 40 runs of hill climbing failed and are not counted.``
    """
    runs, failed = Counter[str](), Counter[str]()
    for cell in {(cell.task, cell.label): cell for cell in cells}.values():
        runs[cell.label] += len(cell.runs)
        failed[cell.label] += len(cell.runs) - len(cell.good)
    who = [label for label in failed if failed[label]]
    if not who:
        return ""
    names = " and ".join(map(name_of, who)) if len(who) < 3 else f"{len(who)} methods"
    total = sum(runs[label] for label in who)
    return f" {number(failed.total())} of {number(total)} runs of {names} failed{consequence}."


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Wall time of solving, s: of runs in a warm process, or of all where there are none.

    ``runs`` have a solution. Their whole time stands for methods that mark no solving.
    """
    times = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    warm = runs.warm.to_numpy(bool, na_value=False)
    return times[warm] if warm.any() else times


@table(
    "task, method, runs, solved, reward±, gap, hands, trials, forward_kinematics, solve_s, "
    "median_run",
)
def list_methods(study: Study) -> Rows:
    """Every method on every task: mean reward, gap, hands and costs (medians).

    Within a task searches for the optimum come first, then the highest mean reward.
    ``median_run``: beginning of the id of the run whose reward is nearest the median.
    """
    places = {task: place for place, task in enumerate(one_by_one(study))}
    cells = [cell for cell in study.cells.values() if cell.task in places]
    means = {id(cell): cell.rewards.mean() if len(cell.good) else -math.inf for cell in cells}
    cells.sort(key=lambda c: (places[c.task], not is_search(c.label), -means[id(c)]))
    for cell in cells:
        good, runs = cell.good, cell.runs
        row = {
            "task": marked(study.tasks[cell.task]),
            "method": cell.label,
            "runs": len(runs),
            "solved": len(good),
            "reward": means[id(cell)] if len(good) else math.nan,
            "reward_sd": standard_deviation(cell.rewards),
            "gap": cell_gap(study, cell),
            "hands": tally(Counter(good.hands)) if len(good) > 1 else "".join(good.hands),
            "trials": runs.trials.astype(float).median(),
            "forward_kinematics": runs.forward_kinematics.astype(float).median(),
            "solve_s": solve_times(good).astype(float).median(),
        }
        if len(good):
            row["median_run"] = typical_run(good)[:SHORT_ID]
        yield f"{cell.task} {cell.label}", row | runs_of(cell)
