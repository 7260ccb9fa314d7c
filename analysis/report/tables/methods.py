"""Every method side by side, on one task and over all."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from analysis.comparisons.methods import TOLD, MethodRow
from analysis.comparisons.overall import NEAR
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Row
from analysis.report.tables.common import marked, mean_of, table, table_ids, value_of
from analysis.words import true_minus
from coartic.method import Information
from coartic.record import SEARCH

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
            impossible.append(
                f"**{row.beaten} runs of {name} are better than the optimum: it is not one. "
                "Report this.**"
            )
        if row.corrections and TOLD[Information.REWARD_BY_TRIAL] not in row.told:
            corrected.append(
                f"{name}: its solutions needed {row.corrections} corrective movements in all."
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


def _number_of(name: str, header: str, *, printed: bool = False) -> Column:
    return Column(name, header, "number", rests_on=("runs",), printed=printed)


_METHODS = (
    Column("method", "method"),
    Column("reward", "reward", "number", "ticks", 1, rests_on=("runs",)),
    _number_of("solved", "solved"),
    _number_of("runs", "runs"),
    Column("gap", "gap", "number", "ticks", 1, rests_on=("runs", "optimum"), printed=False),
    Column("gap_share", "gap", "share", digits=1, rests_on=("runs", "optimum")),
    Column(
        "gap_still",
        "gap, arm still",
        "number",
        "ticks",
        1,
        rests_on=("runs", "optimum"),
        other_arm="still",
        printed=False,
    ),
    Column("told", "told"),
    Column("hands", "hands: runs", rests_on=("runs",), printed=False),
    Column("other_arm", "other arm", rests_on=("runs",), printed=False),
    _number_of("trials", "trials", printed=True),
    _number_of("movement_ticks", "ticks"),
    _number_of("forward_kinematics", "kinematics"),
    _number_of("jacobians", "Jacobians"),
    _number_of("solver_iterations", "iterations"),
    Column("solve_s", "solve", "number", "s", rests_on=("runs",)),
)


def _method_row(study: Study, row: MethodRow) -> Row:
    key = row.task, row.label
    values = (
        row.label,
        mean_of(study.cells[key].good.reward.to_numpy(dtype=np.float64)),
        row.solved,
        row.runs,
        row.gap,
        row.gap_share,
        row.gap_still,
        row.told or None,
        row.hands or None,
        row.other_arm or None,
        _whole(row.trials),
        _whole(row.movement_ticks),
        _whole(row.forward_kinematics),
        _whole(row.jacobians),
        _whole(row.solver_iterations),
        row.solve_s,
    )
    return Row(row.label, values, (key,))


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


def overall_table(study: Study, overall: pd.DataFrame, scores: pd.DataFrame) -> DataTable | None:
    """Every method over all tasks that have an optimum."""
    columns: list[tuple[Column, str | tuple[str, str, str]]] = [
        (Column("method", "method"), "method"),
        (_number_of("runs", "runs"), "runs"),
        (
            Column("score", "score", "number", digits=2, rests_on=("runs", "optimum")),
            ("score", "score_low", "score_high"),
        ),
        (
            Column("gap", "gap", "share", digits=1, rests_on=("runs", "optimum")),
            ("gap", "gap_low", "gap_high"),
        ),
    ]
    for share in NEAR:
        near = f"within_{share:.0%}".rstrip("%")
        head = Column(
            near,
            f"within {100 * share:.0f} %",
            "share",
            digits=0,
            rests_on=("runs", "optimum"),
            printed=share == 0.05,
        )
        columns.append((head, (near, f"{near}_low", f"{near}_high")))
    rows = []
    for row in overall.to_dict("records"):
        own = scores[scores.method == row["method"]]
        rows.append(
            Row(
                str(row["method"]),
                tuple(value_of(row, source, column) for column, source in columns),
                tuple(dict.fromkeys(zip(own.task.map(str), own.label.map(str), strict=True))),
            )
        )
    known, tasks = scores.task.nunique(), len(study.results.tasks)
    of = "All tasks" if known == tasks else f"The {known} of {tasks} tasks with a known optimum"
    return table(
        "across-tasks",
        f"{of} together, each counting the same.",
        tuple(column for column, _ in columns),
        rows,
        (
            "Score: interquartile mean of normalised rewards, 0 the initial solution, 1 the "
            "optimum. Gap: mean share of the optimum. Within: share of runs whose gap is at most "
            "so much. 95 % intervals by stratified bootstrap, about other runs on these tasks.",
        ),
    )


def _whole(value: float) -> int | None:
    return None if math.isnan(value) or not value else round(value)
