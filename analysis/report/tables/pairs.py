"""The learner against the others, pair by pair: what is gained and what it costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import pandas as pd

from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Row
from analysis.report.tables.common import table, table_ids, value_of

if TYPE_CHECKING:
    from analysis.study import Study


def pairwise_table(study: Study, pairs: pd.DataFrame, task: str) -> DataTable | None:
    """The learner against the others on one task: differences, tests, effect sizes."""
    return _pairs(
        study, pairs, task, "compared", f"The learner against the others on {escaped(task)}.",
        (
            (Column("difference", "difference", "number", "ticks", 1),
             ("difference", "low", "high")),
            (Column("expected", "first expected", printed=False), "expected"),
            (Column("p_bootstrap", "one-tailed p", "p", digits=4, printed=False), "p_bootstrap"),
            (Column("p_bootstrap_holm", "one-tailed p, Holm", "p", digits=4, printed=False),
             "p_bootstrap_holm"),
            (Column("p_permutation", "two-tailed p", "p", digits=4, printed=False),
             "p_permutation"),
            (Column("p_permutation_holm", "two-tailed p, Holm", "p", digits=4),
             "p_permutation_holm"),
            (Column("delta", "Cliff's δ", "number", digits=2, printed=False),
             ("delta", "delta_low", "delta_high")),
            (Column("improvement", "P(first higher)", "number", digits=2),
             ("improvement", "improvement_low", "improvement_high")),
        ),
        "Difference: mean reward of the first less the second's. One-tailed: the paper's "
        "bootstrap test in the direction expected before looking; two-tailed: permutation test. "
        "Holm's correction is over the rows of this table.",
    )  # fmt: skip


def cost_table(study: Study, pairs: pd.DataFrame, task: str) -> DataTable | None:
    """The same pairs: what the second spends and is told, and how many runs it would take."""
    number: Literal["number"] = "number"
    return _pairs(
        study, pairs, task, "costs",
        f"Reward per unit of experience, computation and information on {escaped(task)}.",
        (
            (Column("difference", "difference", number, "ticks", 1), "difference"),
            (Column("trials", "trials", number, "×"), "trials"),
            (Column("movement_ticks", "ticks", number, "×", printed=False), "movement_ticks"),
            (Column("evaluations", "evaluations", number, "×"), "evaluations"),
            (Column("solve_s", "solve time", number, "×"), "solve_s"),
            (Column("told_more", "told more"), "told_more"),
            (Column("told_less", "told less"), "told_less"),
            (Column("runs_5", "runs for 5 %", number, digits=0, printed=False), "runs_5"),
            (Column("runs_2", "runs for 2 %", number, digits=0, printed=False), "runs_2"),
            (Column("runs_1", "runs for 1 %", number, digits=0), "runs_1"),
            (Column("smallest", "smallest found", number, "ticks", 1, printed=False), "smallest"),
        ),
        "×: what the second spends in a run over what the first spends (none where the second "
        "spends nothing). Evaluations: forward kinematics and Jacobians. Told more, less: letters "
        "as in the tables of all methods. Runs: of each, to find a difference of so much of the "
        "optimum with power 80 %; smallest: what these runs find so.",
    )  # fmt: skip


def _pairs(
    study: Study,
    pairs: pd.DataFrame,
    task: str,
    name: str,
    caption: str,
    columns: tuple[tuple[Column, str | tuple[str, str, str]], ...],
    note: str,
) -> DataTable | None:
    heads = ((Column("first", "first"), "first"), (Column("second", "second"), "second"))
    every = (*heads, *columns)
    rows = [
        Row(
            f"{row['first']} - {row['second']}",
            tuple(value_of(row, source, column) for column, source in every),
            ((task, str(row["first"])), (task, str(row["second"]))),
        )
        for row in pairs[pairs.task == task].to_dict("records")
    ]
    return table(
        f"{name}-{table_ids(study)[task]}", caption, tuple(c for c, _ in every), rows, (note,)
    )
