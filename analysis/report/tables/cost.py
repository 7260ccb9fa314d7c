"""Reward against what is spent: targets, areas under the anytime curve, Pareto sets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pandas as pd

from analysis.comparisons.frontier import LABELS
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Estimate, Row, Value
from analysis.report.tables.common import finite, table, table_ids, with_interval

if TYPE_CHECKING:
    from analysis.study import Study


def targets_table(study: Study, targets: pd.DataFrame, task: str) -> DataTable | None:
    """Trials to come near the optimum, the nearest target first to be reached on top."""
    frame = targets[
        (targets.task == task) & (targets.spend == "trials") & (targets.other_arm == "free")
    ]
    shares = sorted(frame.share.unique(), reverse=True)
    rows = []
    for method, own in frame.groupby("method", sort=False):
        by_share = {row["share"]: row for row in own.to_dict("records")}
        if not any(row["reached"] for row in by_share.values()):
            continue
        values: list[Value] = [str(method)]
        for share in shares:
            row = by_share[share]
            median = float(row["median"])
            values += [
                f"{row['reached']}/{row['runs']}",
                Estimate(median, None, float(row["low"]), float(row["high"]))
                if math.isfinite(median) and row["runs"] > 1
                else median
                if math.isfinite(median)
                else None,
            ]
        rows.append((sum(-by_share[s]["reached"] / by_share[s]["runs"] for s in shares),
                     Row(str(method), tuple(values), ((task, str(method)),))))  # fmt: skip
    heads = [Column("method", "method")]
    for share in shares:
        name = f"within_{share:.0%}".rstrip("%")
        printed = share in (shares[0], shares[-1])
        heads.append(Column(f"{name}_reached", f"within {100 * share:.0f} %", printed=printed))
        heads.append(Column(name, "median trials", "number", digits=0, printed=printed))
    return table(
        f"targets-{table_ids(study)[task]}",
        f"Trials to come near the optimum of {escaped(task)}, other arm free.",
        tuple(heads),
        [row for _, row in sorted(rows, key=lambda pair: pair[0])],
        (
            "Runs that came within a share of the optimum, and the median of trials to get there "
            "over all runs (Kaplan-Meier; runs stopped by their budget are censored). Planners "
            "need no trials. Methods that never come within 5 % are left out.",
        ),
    )


def areas_table(study: Study, areas: pd.DataFrame, task: str) -> DataTable | None:
    """Area under the anytime curve over every spend, the best first."""
    frame = areas[(areas.task == task) & (areas.other_arm == "free")]
    spends = list(dict.fromkeys(frame.spend))
    rows = []
    for method, own in frame.groupby("method", sort=False):
        by_spend = {row["spend"]: row for row in own.to_dict("records")}
        rows.append(
            Row(
                str(method),
                (
                    str(method),
                    *(
                        with_interval(float(row["area"]), float(row["low"]), float(row["high"]))
                        if (row := by_spend.get(spend))
                        else None
                        for spend in spends
                    ),
                ),
                ((task, str(method)),),
            )
        )
    rows.sort(key=lambda row: _number(row.values[1]))  # noqa: PD011 (no frame)
    return table(
        f"areas-{table_ids(study)[task]}",
        f"Area under the anytime curve on {escaped(task)}, other arm free.",
        (
            Column("method", "method"),
            *(
                Column(str(spend), LABELS[str(spend)], "number", digits=3, printed=i < 2)
                for i, spend in enumerate(spends)
            ),
        ),
        rows,
        (
            "Mean gap to the optimum, as a share of it, over the logarithm of the budget: 0 is "
            "optimal from the first trial on, 1 nothing found. Within a task and a column only.",
        ),
    )


def pareto_table(study: Study, pareto: pd.DataFrame, task: str) -> DataTable | None:
    """Methods on some Pareto set of reward and spend."""
    frame = pareto[pareto.task == task]
    spends = list(dict.fromkeys(frame.spend))
    rows = []
    for method, own in frame.groupby("method", sort=False):
        by_spend = {row["spend"]: row for row in own.to_dict("records")}
        if not any(row["front_share"] > 0.05 for row in by_spend.values()):
            continue
        first = own.iloc[0]
        values: list[Value] = [str(method), str(first.told), float(first.reward)]
        for spend in spends:
            row = by_spend[spend]
            values += [_whole(row["amount"]), finite(row["front_share"])]
        rows.append(Row(str(method), tuple(values), ((task, str(method)),)))
    heads = [
        Column("method", "method"), Column("told", "told"),
        Column("reward", "reward", "number", "ticks", 1),
    ]  # fmt: skip
    for i, spend in enumerate(spends):
        heads.append(Column(str(spend), LABELS[str(spend)], "number", printed=i < 3))
        heads.append(Column(f"{spend}_front", "on front", "share", digits=0, printed=i < 3))
    return table(
        f"pareto-{table_ids(study)[task]}",
        f"Pareto sets of reward and spend on {escaped(task)}.",
        tuple(heads),
        rows,
        (
            "Of every spend the median over runs, and in how many bootstrap resamples the method "
            "is on the front: no other with as much reward spends less. Methods on none (in at "
            "most 5 % of resamples) are left out, and so are the optimum's own searches. Solve "
            "times within 10 % are ties.",
        ),
    )


def _whole(value: float) -> float | int | None:
    """Counts that a median left whole are written so; None for NaN."""
    return int(value) if float(value).is_integer() else finite(value)


def _number(value: Value) -> float:
    if isinstance(value, Estimate):
        return value.value
    return value if isinstance(value, int | float) else math.inf
