"""Every method side by side, on one task and over all."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analysis.comparisons.methods import TOLD, MethodRow
from analysis.comparisons.overall import WITHIN
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, RestsOn, Row
from analysis.report.tables.common import (
    marked,
    mean_of,
    row_of,
    table,
    table_ids,
    with_interval,
)
from analysis.words import true_minus
from coartic.method import Information
from coartic.record import SEARCH
from coartic.text import counted

if TYPE_CHECKING:
    from analysis.study import Study


READING_OF_METHODS = (
    "Reward: of the runs that have a solution. Other arm: whether the arm that is not chosen "
    "keeps still in all of a method's solutions, as executed.",
    "Gap: ticks from the optimum of the task to the mean reward, and as a share of the optimum; "
    "*gap, arm still*: to the optimum with the other arm still, of methods whose solutions keep "
    "it so (EC1 uses the right hand alone; its gap is to the optimum with both hands all the "
    "same). The optimum is the best of two independent searches, and *proven* where branch and "
    "bound leaves nothing above it (docs/model.md); its rows come first and are references, not "
    "competitors.",
    "Trials, control ticks of those trials, forward kinematics, Jacobians, solver iterations "
    "and solve time are medians over runs, of one run each; what a robot would do while it "
    "executes the solution is not part of them. Solve time leaves out what is built once.",
)
"""What the columns of :func:`methods_table` mean, in inline markup."""


def reading_of_methods(study: Study) -> tuple[str, ...]:
    """What the columns of :func:`methods_table` mean, and what does not fit."""
    impossible, corrected = [], []
    for (task, label), row in study.method_rows.items():
        name = escaped(f"{task} x {label}")
        if row.beaten:
            are = "is" if row.beaten == 1 else "are"
            impossible.append(
                f"**{counted(row.beaten, 'run')} of {name} {are} better than the optimum: it is "
                "not one. Report this.**"
            )
        if row.corrections and TOLD[Information.REWARD_BY_TRIAL] not in row.told:
            corrected.append(
                f"{name}: its solutions needed "
                f"{counted(row.corrections, 'corrective movement')} in all."
            )
    return (*impossible, *READING_OF_METHODS, *corrected)


def methods_table(study: Study, task: str) -> DataTable | None:
    """Every method on one task: the optimum's searches, then the best mean reward first."""
    own = [row for row in study.method_rows.values() if row.task == task]
    return table(
        f"methods-{table_ids(study)[task]}",
        f"All methods on {escaped(marked(study, task))}; {_optimum(study, task)}.",
        _METHODS,
        [_method_row(study, row) for row in own],
    )


_ON_OPTIMUM: tuple[RestsOn, ...] = ("runs", "optimum")


_on_optimum = partial(Column, rests_on=_ON_OPTIMUM)
_of_runs = partial(Column, rests_on=("runs",), printed=False)
_SPENT = (
    Column("trials", "trials", "number", rests_on=("runs",)),
    _of_runs("movement_ticks", "ticks", "number"),
    _of_runs("forward_kinematics", "kinematics", "number"),
    _of_runs("jacobians", "Jacobians", "number"),
    _of_runs("solver_iterations", "iterations", "number"),
)
_METHODS = (
    Column("method", "method"),
    Column("reward", "reward", "number", "ticks", 1, rests_on=("runs",)),
    _of_runs("solved", "solved", "number"),
    _of_runs("runs", "runs", "number"),
    _on_optimum("gap", "gap", "number", "ticks", 1, printed=False),
    _on_optimum("gap_share", "gap", "share", digits=1),
    _on_optimum(
        "gap_still", "gap, arm still", "number", "ticks", 1, other_arm="still", printed=False
    ),
    Column("told", "told"),
    _of_runs("hands", "hands: runs"),
    _of_runs("other_arm", "other arm"),
    *_SPENT,
    Column("solve_s", "solve", "number", "s", rests_on=("runs",)),
)
_OVERALL = (
    Column("method", "method"),
    _of_runs("runs", "runs", "number"),
    _of_runs("failed", "of them failed", "number"),
    _on_optimum("score", "score", "number", digits=2),
    _on_optimum("gap", "gap", "share", digits=1),
    *(
        _on_optimum(near, f"within {100 * share:.0f} %", "share", digits=0, printed=share == 0.05)
        for near, share in WITHIN.items()
    ),
)
_ENDS = ("", "_low", "_high")


def _method_row(study: Study, row: MethodRow) -> Row:
    key = row.task, row.label
    own = {column.name: _whole(getattr(row, column.name)) for column in _SPENT}
    rewards = study.cells[key].good.reward.to_numpy(dtype=np.float64)
    return row_of(
        _METHODS, row.label, row, (key,), method=row.label, reward=mean_of(rewards), **own
    )


def _optimum(study: Study, task: str) -> str:
    """What is known of a task's best rewards, in inline markup."""
    known = []
    for arm in ("free", "still"):
        best = study.optima.get((task, arm))
        if best is not None:
            bound = "no bound proven" if best.bound is None else f"proven bound {best.bound}"
            how = "proven" if best.proven else bound
            known.append(f"{arm} {best.reward} {best.hands} ({how})")
    if not known:
        return f"its optimum is not among the runs (methods {escaped(SEARCH)}\\*)"
    return f"optimum, by the other arm: {true_minus(', '.join(known))}"


def overall_table(study: Study) -> DataTable | None:
    """Every method over all tasks that have an optimum."""
    rows, scores = [], study.scores
    estimates = [column.name for column in _OVERALL[3:]]
    for place, method in enumerate(study.overall.method):
        found, own = study.overall.iloc[place], scores[scores.method == method]
        intervals = ([float(found[f"{name}{end}"]) for end in _ENDS] for name in estimates)
        counted = int(found.runs), int(found.failed)
        values = (str(method), *counted, *(with_interval(*each) for each in intervals))
        cells = zip(own.task.map(str), own.label.map(str), strict=True)
        rows.append(Row(str(method), values, tuple(dict.fromkeys(cells))))
    known, tasks = scores.task.nunique(), len(study.tasks)
    of = "All tasks" if known == tasks else f"The {known} of {tasks} tasks with a known optimum"
    return table(
        "across-tasks",
        f"{of} together, each counting the same.",
        _OVERALL,
        rows,
        (
            "Score: interquartile mean of normalised rewards, 0 the initial solution, 1 the "
            "optimum with all joints free. Gap: mean share of the optimum. Within: share of runs "
            "whose gap is at most so much. 95 % intervals by stratified "
            "bootstrap, about other runs on these tasks.",
        ),
    )


def _whole(value: float) -> int | None:
    return None if math.isnan(value) or not value else round(value)
