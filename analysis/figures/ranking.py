"""Who comes nearest: how far every method ends from the optimum, by what it knows."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.methods import GROUPS
from coartic.analysis.comparisons.standings import ALL_TASKS, standings
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.methods import is_learner, name_of
from coartic.analysis.study import Study
from coartic.analysis.words import in_brackets, number


@figure(
    "ranking",
    "Gap to the optimum",
    "Gap from the mean reward to the optimum, as a share of the optimum (mean over all tasks where "
    f"there are several), with its {style.CONFIDENCE} bootstrap interval over runs. Methods that "
    "are run once have no interval. Diamonds and bold names: the paper's learner.",
)
def ranking(study: Study) -> Parts:
    """Gap to the optimum of every method over all tasks, or on the one that there is."""
    data = standings(study)
    if not len(data):
        raise missing(study, "no method with a solution to every run and a known optimum")
    rows = data[data.task == data.task.iloc[0]]
    percent = rows.assign(**{name: 100 * rows[name] for name in ("gap", "low", "high")})
    groups = [(group, percent[percent.knows == group]) for group in GROUPS]
    groups = [(group, of_group) for group, of_group in groups if len(of_group)]
    heights = [len(of_group) + 0.8 for _, of_group in groups]
    size = 1.25 * style.ONE, 0.5 + 0.145 * (len(rows) + len(groups))
    drawing, panels = style.figure_of((len(groups), 1), size, sharex=True, height_ratios=heights)
    for axes, (group, of_group) in zip(panels, groups, strict=True):
        draw_group(axes, group, of_group)
    farthest = percent[["gap", "high"]].max(axis=None)
    panels[-1].set_xlim(-0.02 * farthest, 1.08 * farthest)
    where = "" if rows.task.iloc[0] == ALL_TASKS else f" on {rows.task.iloc[0]}"
    panels[-1].set_xlabel(f"gap to the optimum{where} (%)")
    alt = f"Gap to the optimum by method: {spoken(percent, '{method} {gap:.1f} %')}."
    return drawing, data, alt, study.tasks.values()


def draw_group(axes: Axes, group: str, rows: pd.DataFrame) -> None:
    """Methods that know as much of the reward, nearest first."""
    axes.set_title(f"{group[0].upper()}{group[1:]}")
    for place, row in enumerate(rows.to_dict("records")):
        color = style.look_of(row["method"])["color"]
        mark: Any = {"color": color, "clip_on": False, "markersize": 3.5}
        end = row["gap"]
        if not math.isnan(row["low"]):
            end = max(row["gap"], row["high"])
            axes.plot([row["low"], row["high"]], [-place, -place], color=color, linewidth=1.4)
        (dot,) = axes.plot(row["gap"], -place, "D" if is_learner(row["method"]) else "o", **mark)
        words = f"{number(row['gap'], 1)} % {in_brackets(row['low'], row['high'], 1)}".strip()
        style.tip(dot, f"{name_of(row['method'])}: {words}, {row['runs']} runs")
        beside: Any = {"textcoords": "offset points", "va": "center"}
        axes.annotate(number(row["gap"], 1), (end, -place), (5, 0), **beside)
    style.name_rows(axes, [name_of(method) for method in rows.method])
    for name, method in zip(axes.get_yticklabels(), rows.method, strict=True):
        if is_learner(method):
            name.set_fontweight("bold")
    axes.axvline(0, **style.OPTIMUM)
