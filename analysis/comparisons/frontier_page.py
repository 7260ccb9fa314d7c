"""Reward against what it costs, as a Markdown page: targets, areas, Pareto sets by task."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from analysis.comparisons.frontier import LABELS, OTHER_ARMS, TIME_TOLERANCE
from analysis.comparisons.progress import SPENDS
from analysis.markup import escaped
from analysis.page import Heading, Part, page
from analysis.results.folder import Results
from analysis.results.optima import METHODS as OPTIMUM
from analysis.results.optima import Optimum, optima
from analysis.statistics.estimates import CONFIDENCE
from analysis.table import NONE, Table, short

SHOWN = ("trials", "forward_kinematics")
"""Spends whose targets are on the page; ``targets.csv`` has all."""
SURE = CONFIDENCE
"""Share of resamples from which on a method is called on the front; below 1 - SURE, off it."""


def frontier_page(
    results: Results, targets: pd.DataFrame, areas: pd.DataFrame, pareto: pd.DataFrame
) -> str:
    """Targets over trials and kinematics, areas and Pareto sets as a Markdown page.

    From the frames of :mod:`analysis.frontier`: targets and areas of both optima.
    """
    references = optima(results)
    parts: list[Part] = [Heading(1, "Reward and what it costs"), *_NOTES]
    for name, task in results.tasks.items():
        parts.append(Heading(2, f"{name}{' †' if task.reconstructed else ''}"))
        arms = OTHER_ARMS if len(task.hands) > 1 else OTHER_ARMS[:1]
        known = [_optimum(references.get((name, arm)), arm) for arm in arms]
        parts.append(f"Optimum: {'; '.join(known)}.")
        for spend in SHOWN:
            for table, never in targets_tables(_own(targets, name, arms), spend):
                parts += _shown([table])
                parts += (
                    [f"No run within the widest: {escaped(', '.join(never))}."] if never else []
                )
        parts += _shown(areas_tables(_own(areas, name, arms)))
        parts += _shown(pareto_tables(pareto[pareto.task == name]))
    if any(task.reconstructed for task in results.tasks.values()):
        parts.append("† Reconstructed task (docs/model.md).")
    return page(parts)


_NOTES = (
    "Two-armed tasks have two optima: with all joints free, and with the arm that is not chosen "
    "kept still; the second concerns methods that keep it so. The optimum's own searches and "
    "methods with a base that a parameter locks are left out. Kinematics and time within a run "
    "are its totals, spread evenly over its trials. A planner makes no trials.",
    "**Targets**: runs that came within a share of the optimum, of all runs; median spend to get "
    "there with its 95 % interval over all runs (Kaplan-Meier). Runs that their budget of trials "
    "stopped are censored, all at the horizon, the least spend at which one of them ended: what "
    "was reached behind it counts among the runs that came near, not in the median (18/20, > 2 M: "
    "18 runs did, but not half of the 20 within the 2 M that all runs had). Other runs never "
    "reach what they missed. Rows by how many runs reached the nearest target, then by the "
    "median. `targets.csv` has all four spends.",
    "**Areas**: gap to the optimum averaged over the logarithm of the budget, from one average "
    "trial to the largest whole spend of a method that learns, with its 95 % interval "
    "(percentile bootstrap over runs): 0 is optimal from the first trial on, 1 has nothing; "
    "comparable within a column. Least area over trials first. `areas.csv` has them in full, "
    "`anytime.csv` the curves.",
    "**Pareto sets**: a method is on the front if none has a mean reward as high for as little "
    f"spend, and one of them better. ● on the front in at least {SURE:.0%} of bootstrap "
    f"resamples of the runs, ◐ in {1 - SURE:.0%} to {SURE:.0%}; ○ and ◌ the same among methods "
    "that were told no more. A method with a single run has nothing to resample. Spend is the "
    f"median over runs. Counts are exact; solve times within {TIME_TOLERANCE:.0%} of each other "
    "count as ties, because they vary between machines and runs. Methods with a run that has no "
    "solution are left out; methods on no front are in `pareto.csv`.",
)


def targets_tables(frame: pd.DataFrame, spend: str) -> list[tuple[Table, list[str]]]:
    """:func:`~.targets_frame` over one spend, a table per task and arm.

    A cell is: runs that reached the target of all runs, median spend [95 % interval]; the
    median is greater than the horizon where too few reached it within that. Methods none of
    whose runs reached any target come beside the table; the optimum's searches are left out.
    """
    frame = frame[(frame.spend == spend) & ~frame.method.str.startswith(OPTIMUM)]
    tables = []
    for (name, arm), rows in frame.groupby(["task", "other_arm"], sort=False):
        targets = rows.drop_duplicates("share")
        columns = [
            f"within {share:.3g} %: {target}"
            for share, target in zip(100 * targets.share, targets.target, strict=True)
        ]
        methods = {
            str(method): own.sort_values("share", ascending=False).to_dict("records")
            for method, own in rows.groupby("method", sort=False)
        }
        reached = {key: own for key, own in methods.items() if any(row["reached"] for row in own)}
        lines = [
            (method, *map(_target_cell, reached[method]))
            for method in sorted(reached, key=lambda method: _nearness(reached[method]))
        ]
        title = f"{name}: {LABELS[spend]} to come near the optimum, other arm {arm}"
        never = [method for method in methods if method not in reached]
        tables.append((Table(title, ("method", *columns), tuple(lines)), never))
    return tables


def areas_tables(frame: pd.DataFrame) -> list[Table]:
    """:func:`analysis.comparisons.frontier.area_frame` as a table per task and other arm."""
    frame = frame[~frame.method.str.startswith(OPTIMUM)]
    tables = []
    for (name, arm), rows in frame.groupby(["task", "other_arm"], sort=False):
        cells = {(row["method"], row["spend"]): row for row in rows.to_dict("records")}
        over_trials = rows[rows.spend == SPENDS[0]].sort_values("area", kind="stable")
        lines = [
            (str(method), *(_area_cell(cells.get((method, spend))) for spend in SPENDS))
            for method in over_trials.method
        ]
        columns = ("method", *(f"over {LABELS[spend]}" for spend in SPENDS))
        title = f"{name}: area under the anytime curve, other arm {arm}"
        tables.append(Table(title, columns, tuple(lines)))
    return tables


def pareto_tables(frame: pd.DataFrame) -> list[Table]:
    """Methods on a front of ``pareto_frame``, a table per task."""
    tables = []
    for name, rows in frame.groupby("task", sort=False):
        on_one = rows.told_share > 1 - SURE
        kept = rows[on_one.groupby(rows.method).transform("any")]
        lines = []
        for method, own in kept.groupby("method", sort=False):
            first = own.iloc[0]
            cells = (
                f"{short(row['amount'])} {_mark(row)}".rstrip() for row in own.to_dict("records")
            )
            lines.append((str(method), first.told, f"{first.reward:.1f}", *cells))
        columns = ("method", "told", "reward", *LABELS.values())
        tables.append(Table(f"{name}: Pareto sets of reward and spend", columns, tuple(lines)))
    return tables


def _own(frame: pd.DataFrame, task: str, arms: Sequence[str]) -> pd.DataFrame:
    return frame[(frame.task == task) & frame.other_arm.isin(arms)]


def _shown(tables: list[Table]) -> list[Part]:
    return [part for table in tables if table.rows for part in (Heading(3, table.title), table)]


def _optimum(known: Optimum | None, arm: str) -> str:
    """An optimum in words, and whether it is proven to be one."""
    if known is None:
        return f"none is known with the other arm {arm}, so nothing is said of nearness to it"
    if known.proven:
        sure = "proven"
    elif known.bound is None:
        sure = "**not proven**: the best that was found, by search alone"
    else:
        sure = f"**not proven**: the best that was found; none exceeds {known.bound}"
    return f"{known.reward} with the other arm {arm} ({sure})"


def _nearness(rows: list[dict[Any, Any]]) -> tuple[float, ...]:
    """Sorts methods best first: shares of runs from the nearest target on, then medians."""
    nearest = rows[::-1]
    return (
        *(-row["reached"] / row["runs"] for row in nearest),
        *(row["median"] for row in nearest),
    )


def _mark(row: Mapping[Any, Any]) -> str:
    """On the front of all methods, and where that is not sure, of those told no more."""

    def one(share: float, sure: str, perhaps: str) -> str:
        return sure if share >= SURE else perhaps if share > 1 - SURE else ""

    every, told = one(row["front_share"], "●", "◐"), one(row["told_share"], "○", "◌")
    return every if every == "●" or (told == "◌" and every) else every + told


def _area_cell(row: Mapping[Any, Any] | None) -> str:
    if row is None:
        return NONE
    text = f"{row['area']:.3f}"
    if math.isnan(row["low"]):
        return text
    return text + f" [{row['low']:.3f}, {row['high']:.3f}]"


def _target_cell(row: Mapping[Any, Any]) -> str:
    text = f"{row['reached']}/{row['runs']}"
    median, horizon = row["median"], row["horizon"]
    if not row["reached"] or (math.isinf(median) and math.isinf(horizon)):
        return text
    text += f", {short(median)}" if math.isfinite(median) else f", > {short(horizon)}"
    if row["runs"] == 1 or math.isinf(row["low"]) or row["high"] == 0:  # 0: spent by none
        return text
    return text + f" [{short(row['low'])}, {short(row['high'])}]"
