"""How the posture at a shared goal depends on what follows, and whether the hand feels it."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.methods import name_of
from coartic.analysis.study import Study
from coartic.analysis.tables.coarticulation import context_parts

MOST = 6
"""Pairs of tasks that the figure shows, at most."""
_OPEN: Any = {"marker": "s", "color": style.VERMILLION, "markerfacecolor": style.PAPER}


@figure(
    "context",
    "What the next goal changes",
    "Difference between the mean postures at the shared goal, divided into the part that leaves "
    "the hand in place and the part that moves it, each per root of the dimension of its space. "
    "Stars: permutation test over runs, Holm-corrected over the figure, of the part that leaves "
    f"the hand in place ({style.STARS}). Methods that are run once have none.",
)
def context(study: Study) -> Parts:
    """Motor-equivalent and non-motor-equivalent part of the difference between contexts.

    One panel for each goal that two tasks of the folder share before they differ.
    """
    data = context_parts(study)
    if not len(data):
        raise missing(study, "no method has solved runs on two tasks that share their first goals")
    places = list(data.groupby(["task", "where"], sort=False))
    if len(places) > MOST:
        raise missing(study, f"{len(places)} pairs of tasks share a goal, more than {MOST}")
    size = style.ONE, min(0.5 + 0.16 * (len(data) + 4 * len(places)), style.TALLEST)
    heights = [len(group) + 1 for _, group in places]
    drawing, panels = style.figure_of((len(places), 1), size, sharex=True, height_ratios=heights)
    farthest = data[["equivalent", "other"]].to_numpy(float).max() or 1.0  # all alike: any scale
    for axes, ((task, where), group) in zip(panels, places, strict=True):
        draw_parts(axes, group)
        axes.set_xlim(0, 1.12 * farthest)
        axes.set_title(textwrap.fill(f"{task}: {where}", 31))
    panels[-1].set_xlabel("difference per root of dimension\n(length unit, rad)")
    if len(places) > 1:
        style.letters(panels)
    handles = [
        style.entry("leaves the hand in place", linestyle="", marker="o", color=style.BLUE),
        style.entry("moves the hand", linestyle="", **_OPEN),
    ]
    style.legend(drawing, handles, 2)
    parts = spoken(data, "{method} {equivalent:.2f} and {other:.2f}")
    alt = f"The two parts of the difference between postures, by method: {parts}."
    return drawing, data, alt, ()


def draw_parts(axes: Axes, data: pd.DataFrame) -> None:
    """Both parts of each method."""
    for place, row in enumerate(data.to_dict("records")):
        values = [row["other"], row["equivalent"]]
        axes.plot(values, [-place, -place], color=style.GREY, linewidth=0.8, zorder=1)
        axes.plot(row["other"], -place, linestyle="", markersize=4, clip_on=False, **_OPEN)
        axes.plot(row["equivalent"], -place, "o", color=style.BLUE, markersize=4, clip_on=False)
        if not math.isnan(row["p_equivalent"]):
            mark, end = style.stars(row["holm_equivalent"]), (max(values), -place)
            axes.annotate(mark, end, (5, -0.5), textcoords="offset points", va="center")
    style.name_rows(axes, [name_of(method) for method in data.method])
    axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.4)
