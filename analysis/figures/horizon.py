"""How far ahead: gap of the planner by the goals in view."""

from __future__ import annotations

import itertools
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.claims.studies import HORIZONS
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import EC4, name_of
from coartic.analysis.study import Study
from coartic.analysis.tables.studies import horizon as horizon_table
from coartic.analysis.tables.studies import horizon_beside

PLACES = [str(h) for h in HORIZONS]
COLORS = (style.INK, style.BLUE, style.VERMILLION, style.GREEN)
"""Of the lines of a panel."""


@figure(
    "horizon",
    "Gap of a planner by how far it looks ahead",
    "Gap to the best known solution, mean over random tasks with its "
    f"{style.CONFIDENCE} interval (bootstrap over tasks), linear below 1 %. a: all tasks, by "
    "family (thin), and other methods where the planner has the same gap on their tasks. "
    "b: hands chosen by each plan, or those of the plan with all goals. c: joints that cost three "
    "times as much, by weighted path length.",
)
def horizon(study: Study) -> Parts:
    """The curve over all tasks, with given hands, and with dear joints."""
    data = horizon_table(study)
    if not len(data):
        raise missing(study, "no runs of the planner on instances of a family of tasks")
    drawing, panels = style.figure_of((1, 3), (style.TWO, 2.6), sharey=True)
    everywhere, hands, costs = panels
    families = data[data.group == "family"]
    for color, (name, rows) in zip(style.PALETTE, families.groupby("value"), strict=False):
        line: Any = {"color": color, "linewidth": 0.7}
        everywhere.plot(rows.h.map(PLACES.index), 100 * rows.gap, **line, label=name)
    for axes, group in ((everywhere, "all"), (hands, "hands"), (costs, "costs")):
        parts = data[data.group == group].groupby("value", sort=False)
        for number, (color, (name, rows)) in enumerate(zip(COLORS, parts, strict=False)):
            curve(axes, rows, color, 0.08 * number, str(name))
        axes.set_xticks(range(len(PLACES)), PLACES)
        axes.set_xlabel("goals ahead")
    beside(everywhere, horizon_beside(study))
    everywhere.set_yscale("symlog", linthresh=1, linscale=0.6)
    everywhere.set_yticks(
        [0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"]
    )
    everywhere.set_ylim(bottom=-0.1)
    everywhere.set_ylabel("gap (%)")
    for axes, title in zip(panels, ("all tasks", "given hands", "dear joints"), strict=True):
        axes.set_title(title)
        if axes is not everywhere and axes.lines:
            axes.legend(loc="upper right")
    style.letters(panels)
    style.legend(drawing, everywhere.get_legend_handles_labels()[0], 5)
    of_all = data[data.group == "all"]
    each = (f"{h} ahead: {gap:.1%}" for h, gap in zip(of_all.h, of_all.gap, strict=True))
    return drawing, data, f"Gap by goals in view. {'; '.join(each)}.", ()


def curve(axes: Axes, rows: pd.DataFrame, color: str, shift: float, name: str) -> None:
    """Means by horizon with their intervals."""
    places = rows.h.map(PLACES.index) + shift
    line: Any = {"color": color, "marker": "o", "markersize": 3, "linewidth": 1.2}
    axes.vlines(places, 100 * rows.gap_low, 100 * rows.gap_high, color=color, linewidth=0.9)
    axes.plot(places, 100 * rows.gap, **line, label=name)


def beside(axes: Axes, rows: pd.DataFrame) -> None:
    """Other methods at the horizons that they are equivalent to."""
    over_all = rows[rows.arms == "all"].to_dict("records")
    for row, marker in zip(over_all, itertools.cycle("sD^v"), strict=False):
        look = style.look_of(EC4 if row["method"] == "learner" else row["method"])
        at, gap = row["horizon"], 100 * row["gap"]
        thin: Any = {"color": look["color"], "linewidth": 0.8, "zorder": 4}
        axes.hlines(gap, row["horizon_low"], row["horizon_high"], **thin)
        axes.vlines(at, 100 * row["gap_low"], 100 * row["gap_high"], **thin)
        mark: Any = {"color": look["color"], "marker": marker, "markersize": 5, "zorder": 5}
        axes.plot(at, gap, linestyle="", **mark, label=name_of(row["method"]))
