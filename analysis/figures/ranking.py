"""Who comes nearest: how far every method ends from the optimum, by what it knows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.methods import GROUPS
from coartic.analysis.comparisons.standings import ALL_TASKS, standings
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import missing
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.methods import is_learner, look_alike, name_of
from coartic.analysis.study import Study
from coartic.analysis.words import in_brackets, number


@style.styled
def ranking(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Gap to the optimum of every method over all tasks, or on the one that there is.

    Raises CoarticError where no optimum is known.
    """
    data = standings(study)
    if methods is not None:
        data = data[data.method.isin(methods)]
    if not len(data):
        raise missing(study, "no method with a solution to every run and a known optimum")
    shown = data[data.task == data.task.iloc[0]]
    percent = shown.assign(**{name: 100 * shown[name] for name in ("gap", "low", "high")})
    groups = [(group, percent[percent.knows == group]) for group in GROUPS]
    groups = [(group, rows) for group, rows in groups if len(rows)]
    heights = [len(rows) + 0.8 for _, rows in groups]
    size = 1.25 * style.ONE, 0.5 + 0.145 * (len(shown) + len(groups))
    figure, panels = style.figure_of((len(groups), 1), size, sharex=True, height_ratios=heights)
    for axes, (group, rows) in zip(panels, groups, strict=True):
        _panel(axes, group, rows)
    farthest = percent[["gap", "high"]].max(axis=None)
    panels[-1].set_xlim(-0.02 * farthest, 1.08 * farthest)
    panels[-1].set_xlabel("gap to the optimum (%)")
    over = "mean over all tasks" if shown.task.iloc[0] == ALL_TASKS else f"on {shown.task.iloc[0]}"
    gaps = spoken(percent, "{method} {gap:.1f} %")
    return worded("ranking", figure, data, study.tasks.values(), over=over, gaps=gaps)


def _panel(axes: Axes, group: str, rows: pd.DataFrame) -> None:
    axes.set_title(f"{group[0].upper()}{group[1:]}")
    for place, row in enumerate(rows.to_dict("records")):
        color = style.looks([look_alike(row["method"])])[look_alike(row["method"])].color
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
