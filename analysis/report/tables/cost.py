"""Reward against what is spent: targets, areas under the anytime curve, Pareto sets."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import pandas as pd

from analysis.comparisons.areas import Area
from analysis.comparisons.pareto import TIME_TOLERANCE
from analysis.comparisons.progress import LABELS, SPENDS
from analysis.comparisons.targets import Target
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Estimate, Row, Value
from analysis.report.tables.common import finite, table, table_ids, with_interval
from analysis.words import typographic
from coartic.record import SEARCH

if TYPE_CHECKING:
    from analysis.study import Study

OtherArm = Literal["free", "still"]
TARGET_SPENDS = ("trials", "forward_kinematics")
"""Spends whose targets have tables; ``targets.csv`` has all."""
SOMETIMES = 0.05
"""Share of resamples in which a method that has a row is on some front."""
READING_OF_COST = (
    "Two-armed tasks have two optima: with all joints free, and with the arm that is not chosen "
    "kept still; the second concerns methods that keep it so. The optimum's own searches and "
    "methods with a base that a parameter locks are left out. Kinematics and time within a run "
    "are its totals, spread evenly over its trials. A planner makes no trials.",
    "**Targets**: of runs that their budget of trials stopped nobody knows when they would have "
    "come near. They are censored, all at the horizon, the least spend at which one of them "
    "ended: what was reached behind it counts among the runs that came near, not in the median "
    "(18/20 and >2000 with a horizon of 2000: 18 runs did, but not half of the 20 within the 2000 "
    "that all runs had). Other runs never reach what they missed. `targets.csv` of `coartic "
    "analyse` has all four spends.",
    "**Areas**: from one average trial to the largest whole spend of a method that learns; "
    "comparable within a column. `areas.csv` has them in full, `anytime.csv` the curves.",
    "**Pareto sets**: a method is on the front if none has a mean reward as high for as little "
    "spend, and one of them better. A method with a single run has nothing to resample. Counts "
    f"are exact; solve times within {100 * TIME_TOLERANCE:.0f} % of each other count as ties, "
    "because they vary between machines and runs. Methods with a run that has no solution are "
    "left out; methods on no front are in `pareto.csv`.",
)
"""What is behind the tables of this module."""
_number = partial(Column, kind="number", rests_on=("runs",))
_of_optimum = partial(Column, kind="number", rests_on=("runs", "optimum"))
_SUFFIX = {"trials": "", "forward_kinematics": "-kinematics"}


def other_arms(study: Study, task: str) -> tuple[OtherArm, ...]:
    """The optima that a task has: with one arm there is none to keep still."""
    return ("free", "still") if len(study.tasks[task].hands) > 1 else ("free",)


def targets_table(
    study: Study, task: str, spend: str = "trials", other_arm: OtherArm = "free"
) -> DataTable | None:
    """Spend to come near an optimum, the method that does so most often on top."""
    frame = _of_methods(study.targets, task)
    frame = frame[(frame.spend == spend) & (frame.other_arm == other_arm)]
    methods = {
        str(name): [Target(*row) for row in own.itertuples(index=False, name=None)]
        for name, own in frame.groupby("method", sort=False)
    }
    near = [rows for rows in methods.values() if any(row.reached for row in rows)]
    if not near:
        return None
    of_spend, of_arm = _SUFFIX[spend], "" if other_arm == "free" else "-still"
    never = ", ".join(name for name, rows in methods.items() if rows not in near)
    note = (
        "Runs that came within a share of the optimum, and the median spend to get there "
        "over all runs (Kaplan-Meier; runs stopped by their budget are censored at the "
        f"horizon).{' Planners need no trials.' if spend == 'trials' else ''}"
    )
    if never:
        note += f" Never within {100 * near[0][0].share:.0f} %: {escaped(never)}."
    return table(
        f"targets-{table_ids(study)[task]}{of_spend}{of_arm}",
        f"{LABELS[spend].capitalize()} to come near the optimum of {escaped(task)}, other arm "
        f"{other_arm}.",
        (
            Column("method", "method"),
            *_within(near[0], spend, other_arm),
            _number("horizon", "horizon", digits=0, printed=False),
        ),
        [_target_row(rows) for rows in sorted(near, key=_nearness)],
        (note,),
    )


def _within(targets: list[Target], spend: str, other_arm: OtherArm) -> Iterator[Column]:
    """Of each share two columns: runs that came so near, and what it took."""
    for target in targets:
        name = f"within_{target.share:.0%}".rstrip("%")
        head = f"within {100 * target.share:.0f} %: {typographic(str(target.target))}"
        ends = target in (targets[0], targets[-1])
        column = partial(_of_optimum, other_arm=other_arm, printed=ends)
        yield column(f"{name}_reached", head, kind="text")
        yield column(name, f"median {LABELS[spend]}", digits=0)


def _target_row(targets: list[Target]) -> Row:
    """A method's, the widest share first."""
    values: list[Value] = [targets[0].method]
    for target in targets:
        values += [f"{target.reached}/{target.runs}", _median(target)]
    horizon = targets[0].horizon
    values.append(horizon if math.isfinite(horizon) else None)
    return Row(targets[0].method, tuple(values), ((targets[0].task, targets[0].method),))


def _median(target: Target) -> Value:
    """Infinite where fewer than half came near within the horizon; None where none ever did."""
    if not target.reached:
        return None
    bounded = target.runs > 1 and math.isfinite(target.low)
    if not bounded and math.isfinite(target.median):
        return target.median
    low, high = (target.low, target.high) if bounded else (None, None)
    beyond = target.horizon if math.isfinite(target.horizon) else None
    return Estimate(target.median, low=low, high=high, beyond=beyond)


def _nearness(targets: list[Target]) -> tuple[float, ...]:
    """Sorts methods best first: shares of runs from the nearest target on, then medians."""
    nearest = targets[::-1]
    return (*(-t.reached / t.runs for t in nearest), *(t.median for t in nearest))


def areas_table(study: Study, task: str) -> DataTable | None:
    """Area under the anytime curve over every spend and of every optimum, the best first."""
    frame = _of_methods(study.areas, task)
    arms = [arm for arm in other_arms(study, task) if (frame.other_arm == arm).any()]
    spends = [spend for spend in SPENDS if (frame.spend == spend).any()]
    places = [(arm, spend) for arm in arms for spend in spends]
    known: dict[str, dict[tuple[str, str], Area]] = {}
    for row in frame.itertuples(index=False, name=None):
        area = Area(*row)
        known.setdefault(area.method, {})[area.other_arm, area.spend] = area

    def first(method: str) -> float:
        return known[method][places[0]].area if places[0] in known[method] else math.inf

    rows = []
    for method in sorted(known, key=first):
        own = (known[method].get(place) for place in places)
        values = (found and with_interval(found.area, found.low, found.high) for found in own)
        rows.append(Row(method, (method, *values), ((task, method),)))
    heads = [
        _of_optimum(
            spend if arm == "free" else f"{spend}_still",
            f"over {LABELS[spend]}" + ("" if arm == "free" else ", arm still"),
            digits=3,
            other_arm=arm,
            family="all methods of the table, as the largest spend of one that learns is the end",
            printed=arm == "free" and spend in spends[:2],
        )
        for arm, spend in places
    ]
    return table(
        f"areas-{table_ids(study)[task]}",
        f"Area under the anytime curve on {escaped(task)}.",
        (Column("method", "method"), *heads),
        rows,
        (
            "Mean gap to the optimum, as a share of it, over the logarithm of the budget, with "
            "its percentile bootstrap interval: 0 is optimal from the first trial on, 1 nothing "
            "found. Within a task and a column only.",
        ),
    )


def pareto_table(study: Study, task: str) -> DataTable | None:
    """Methods on some Pareto set of reward and spend."""
    frame = study.pareto[study.pareto.task == task]
    rows = [
        Row(str(method), tuple(_on_fronts(own)), ((task, str(method)),))
        for method, own in frame.groupby("method", sort=False)
        if (own.told_share > SOMETIMES).any()
    ]
    heads = [
        Column("method", "method"),
        Column("told", "told", rests_on=("text",)),
        _number("reward", "reward", unit="ticks", digits=1),
    ]
    for place, (spend, label) in enumerate(LABELS.items()):
        share = partial(_number, kind="share", digits=0)
        every = "all methods compared on the task"
        heads += [
            _number(spend, label, printed=place < 3),
            share(f"{spend}_front", "on front", printed=place < 3, family=every),
            share(
                f"{spend}_told",
                "of those told no more",
                printed=False,
                family=f"{every}, of which those count that are told no more",
            ),
        ]
    made = table(
        f"pareto-{table_ids(study)[task]}",
        f"Pareto sets of reward and spend on {escaped(task)}.",
        tuple(heads),
        rows,
        (
            "Of every spend the median over runs, and in how many bootstrap resamples of the runs "
            "the method is on the front of all, and on that of the methods that are told no more "
            "than it is. Methods on none (in at most 5 % of resamples) are left out.",
        ),
    )
    named = {str(row.key) for row in rows}
    unshown = ((task, str(method)) for method in frame.method.unique() if method not in named)
    return made and replace(made, unshown=tuple(unshown))


def _on_fronts(rows: pd.DataFrame) -> Iterator[Value]:
    """A method's values, spend by spend."""
    first = rows.iloc[0]
    yield from (str(first.method), str(first.told), float(first.reward))
    for amount, front, told in zip(rows.amount, rows.front_share, rows.told_share, strict=True):
        whole = float(amount).is_integer()
        yield from (int(amount) if whole else finite(amount), finite(front), finite(told))


def _of_methods(frame: pd.DataFrame, task: str) -> pd.DataFrame:
    """Rows of a task without the optimum's searches, which are what the others are held to."""
    return frame[(frame.task == task) & ~frame.method.str.startswith(SEARCH)]
