"""Every method side by side, on one task and over all."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from analysis.comparisons.methods import methods_notes
from analysis.comparisons.overall import NEAR
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Row
from analysis.report.tables.common import marked, mean_of, table, table_ids, value_of
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study


def methods_table(study: Study, task: str) -> DataTable | None:
    """Every method on one task: the optimum's searches, then the best mean reward first."""
    rows = []
    for (name, label), row in study.methods.items():
        if name != task:
            continue
        rewards = study.cells[name, label].good.reward.to_numpy(dtype=np.float64)
        rows.append(
            Row(
                label,
                (
                    label,
                    mean_of(rewards),
                    row["solved"],
                    row["runs"],
                    row["gap"],
                    row["gap_share"],
                    row["gap_still"],
                    row["told"] or None,
                    row["hands"] or None,
                    row["other_arm"] or None,
                    *(_whole(row[n]) for n in ("trials", "movement_ticks", "forward_kinematics")),
                    *(_whole(row[n]) for n in ("jacobians", "solver_iterations")),
                    row["solve_s"],
                ),
                ((name, label),),
            )
        )
    best = study.optima.get((task, "free"))
    return table(
        f"methods-{table_ids(study)[task]}",
        f"All methods on {escaped(marked(study, task))}"
        + (
            ""
            if best is None
            else f"; optimum {typographic(str(best.reward))}{' (proven)' if best.proven else ''}"
        )
        + ".",
        (
            Column("method", "method"),
            Column("reward", "reward", "number", "ticks", 1),
            Column("solved", "solved", "number", printed=False),
            Column("runs", "runs", "number", printed=False),
            Column("gap", "gap", "number", "ticks", 1, printed=False),
            Column("gap_share", "gap", "share", digits=1),
            Column("gap_still", "gap, arm still", "number", "ticks", 1, printed=False),
            Column("told", "told"),
            Column("hands", "hands: runs", printed=False),
            Column("other_arm", "other arm", printed=False),
            Column("trials", "trials", "number"),
            Column("movement_ticks", "ticks", "number", printed=False),
            Column("forward_kinematics", "kinematics", "number", printed=False),
            Column("jacobians", "Jacobians", "number", printed=False),
            Column("solver_iterations", "iterations", "number", printed=False),
            Column("solve_s", "solve", "number", "s"),
        ),
        rows,
    )


def reading_of_methods(study: Study) -> tuple[str, ...]:
    """What the columns of :func:`methods_table` mean."""
    return tuple(methods_notes(study.results))


def overall_table(study: Study, overall: pd.DataFrame, scores: pd.DataFrame) -> DataTable | None:
    """Every method over all tasks that have an optimum."""
    columns: list[tuple[Column, str | tuple[str, str, str]]] = [
        (Column("method", "method"), "method"),
        (Column("runs", "runs", "number", printed=False), "runs"),
        (Column("score", "score", "number", digits=2), ("score", "score_low", "score_high")),
        (Column("gap", "gap", "share", digits=1), ("gap", "gap_low", "gap_high")),
    ]
    for share in NEAR:
        near = f"within_{share:.0%}".rstrip("%")
        head = Column(
            near, f"within {100 * share:.0f} %", "share", digits=0, printed=share == 0.05
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
