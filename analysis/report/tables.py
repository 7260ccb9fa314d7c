"""The report's tables: frames of the analysis as tables that know their cells."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from analysis.comparison import published_of
from analysis.equivalence import MARGIN, difference
from analysis.methods import methods_notes
from analysis.published import TRIALS, Summary, published_exhaustive, published_initial
from analysis.report.document import CellKey, Column, DataTable, Estimate, Row, Value
from analysis.statistics import CONFIDENCE, mean
from analysis.study import SEED, Study

_INTERVAL = f"{CONFIDENCE:.0%} interval"


def published_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells, published and ours."""
    rows = []
    for cell in study.results.cells:
        paper = published_of(cell)
        rewards = cell.good.reward.to_numpy(dtype=np.float64)
        if paper is None:
            continue
        found = None
        if paper.summary is not None and len(rewards):
            found = difference(rewards, paper.summary)
        comparable = (cell.good.trials == TRIALS).all() and not getattr(
            paper.summary, "derived", True
        )
        initial = cell.good.initial_reward.dropna()
        rows.append(
            Row(
                f"{cell.task} {cell.label}",
                (
                    _marked(study, cell.task),
                    cell.label,
                    _summary(paper.summary),
                    paper.summary.runs if paper.summary else None,
                    mean_of(rewards),
                    len(rewards),
                    None if found is None else _apart(found.estimate, found.low, found.high),
                    found.verdict if found is not None and comparable else None,
                    float(initial.iloc[0]) if len(initial) else None,
                    (published_initial(cell.task) or (None, None))[1],
                    _counts(cell.good.hands),
                    ", ".join(f"{s.hands} {s.runs or ''}".strip() for s in paper.sequences) or None,
                ),
                ((cell.task, cell.label),),
            )
        )
    return _table(
        "published",
        "Learned reward in the paper's cells, published and ours.",
        (
            Column("task", "task"),
            Column("method", "method"),
            Column("published", "published", "number", "ticks", 1),
            Column("published_runs", "runs", "number"),
            Column("ours", f"ours [{_INTERVAL}]", "number", "ticks", 1),
            Column("runs", "runs", "number"),
            Column("difference", f"difference [{_INTERVAL}]", "number", "ticks", 1),
            Column("verdict", f"verdict, margin {MARGIN:.0%}"),
            Column("initial", "initial", "number", "ticks", 0),
            Column("published_initial", "published", "number", "ticks", 0),
            Column("hands", "hands: runs"),
            Column("published_hands", "published"),
        ),
        rows,
        (
            "Published: mean ± SD. Ours: mean ± SD with its BCa interval. The difference has "
            "Welch's interval from the printed mean, SD and runs; where no SD is printed the "
            "printed mean is taken as exact. *Equivalent*: the interval lies within the margin "
            "of the published reward; *different*: outside; *undecided*: neither. A published mean "
            "over hand sequences, pooled from what is printed, gets no verdict.",
        ),
    )


def exhaustive_table(study: Study) -> DataTable | None:
    """The best hand sequences of the corrective process alone."""
    rows = []
    for task in study.results.tasks:
        trials = study.results.sequences[study.results.sequences.task == task]
        if len(trials) < 2:
            continue
        paper, best = published_exhaustive(task), trials.dropna(subset=["reward"])
        rows.append(
            Row(
                task,
                (
                    _marked(study, task),
                    f"{paper[0]} {paper[1]}" if paper else None,
                    ", ".join(f"{row.hands} {row.reward}" for row in best.head(4).itertuples()),
                    len(trials),
                    int(trials.reward.isna().sum()),
                ),
            )
        )
    return _table(
        "exhaustive",
        "The corrective process alone with every hand sequence.",
        (
            Column("task", "task"),
            Column("published", "best, published"),
            Column("best", "best four, ours"),
            Column("sequences", "sequences", "number"),
            Column("failed", "failed", "number"),
        ),
        rows,
    )


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
    return _table(
        f"methods-{task.lower()}",
        f"All methods on {_marked(study, task)}"
        + ("" if best is None else f"; optimum {best.reward}{' (proven)' if best.proven else ''}")
        + ".",
        (
            Column("method", "method"),
            Column("reward", f"reward [{_INTERVAL}]", "number", "ticks", 1),
            Column("solved", "solved", "number"),
            Column("runs", "runs", "number"),
            Column("gap", "gap", "number", "ticks", 1),
            Column("gap_share", "gap", "share", digits=1),
            Column("gap_still", "gap, arm still", "number", "ticks", 1),
            Column("told", "told"),
            Column("hands", "hands: runs"),
            Column("other_arm", "other arm"),
            Column("trials", "trials", "number"),
            Column("movement_ticks", "ticks", "number"),
            Column("forward_kinematics", "kinematics", "number"),
            Column("jacobians", "Jacobians", "number"),
            Column("solver_iterations", "iterations", "number"),
            Column("solve_s", "solve", "number", "s"),
        ),
        rows,
    )


def reading_of_methods(study: Study) -> tuple[str, ...]:
    """What the columns of :func:`methods_table` mean."""
    return tuple(methods_notes(study.results))


def mean_of(rewards: Any) -> Estimate | None:
    """Mean with SD and BCa interval, as far as there are any."""
    if not len(rewards):
        return None
    found = mean(rewards, seed=SEED)
    sd = float(np.std(rewards, ddof=1)) if len(rewards) > 1 else None
    if math.isnan(found.low):
        return Estimate(found.estimate, sd)
    return Estimate(found.estimate, sd, found.low, found.high)


def frame_table(
    name: str,
    caption: str,
    frame: pd.DataFrame,
    columns: Iterable[tuple[Column, str | tuple[str, str, str]]],
    *,
    key: str,
    cells: Any = None,
    notes: tuple[str, ...] = (),
) -> DataTable | None:
    """Rows of a frame as a table: each column of one of the frame's, or of three of them
    (value, low, high). ``cells`` gives the cells of a row; ``key`` is its column of names."""
    columns = list(columns)
    rows = [
        Row(
            str(row[key]),
            tuple(_value(row, source, column) for column, source in columns),
            tuple(cells(row)) if cells is not None else (),
        )
        for row in frame.to_dict("records")
    ]
    return _table(name, caption, tuple(column for column, _ in columns), rows, notes)


def _value(row: dict[Any, Any], source: str | tuple[str, str, str], column: Column) -> Value:
    if isinstance(source, tuple):
        value, low, high = (float(row[name]) for name in source)
        return _apart(value, low, high)
    value = row[source]
    if column.kind == "text":
        return None if pd.isna(value) or value == "" else str(value)
    return None if pd.isna(value) else value.item() if hasattr(value, "item") else value


def _table(
    name: str,
    caption: str,
    columns: tuple[Column, ...],
    rows: list[Row],
    notes: tuple[str, ...] = (),
) -> DataTable | None:
    return DataTable(name, caption, columns, tuple(rows), notes) if rows else None


def _apart(value: float, low: float, high: float) -> Value:
    if math.isnan(value):
        return None
    return Estimate(value) if math.isnan(low) else Estimate(value, None, low, high)


def _summary(summary: Summary | None) -> Estimate | None:
    return None if summary is None else Estimate(summary.mean, summary.sd)


def _whole(value: float) -> int | None:
    return None if math.isnan(value) or not value else round(value)


def _counts(hands: pd.Series) -> str | None:
    return ", ".join(f"{name} {count}" for name, count in hands.value_counts().items()) or None


def _marked(study: Study, task: str) -> str:
    return f"{task} †" if study.results.tasks[task].reconstructed else task


def cell_key(row: dict[Any, Any]) -> tuple[CellKey, ...]:
    """The cell of a row with a task and a method's label."""
    return ((str(row["task"]), str(row["method"])),)
