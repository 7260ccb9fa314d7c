"""Published against ours, every cell and hand sequence that the paper prints."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import name_of
from coartic.analysis.published import TRIALS
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.study import Study
from coartic.analysis.tables.paper import published_differences
from coartic.analysis.words import marked

_MARKS = {
    "equivalent": (style.BLUE, "o", style.BLUE),
    "undecided": (style.INK, "s", style.PAPER),
    "different": (style.VERMILLION, "D", style.VERMILLION),
    "": (style.INK, "x", style.INK),
}


@figure(
    "published",
    "Published and ours",
    f"Our mean learned reward minus the published one, with its {style.CONFIDENCE} interval. Grey: "
    f"margin of equivalence, ±{100 * MARGIN:.0f} % of the published reward. Filled circles: the "
    "interval lies within the margin (equivalent). Open squares: it crosses the margin "
    "(undecided). Diamonds: it lies outside (different). ↳: runs with one hand sequence; in "
    "brackets, how many of our runs have it, then how many of the published ones. * pooled from "
    "several printed sequences.",
)
def published(study: Study) -> Parts:
    """Difference of every mean reward to the printed one, with interval and margin."""
    data = published_differences(study)
    if not len(data):
        raise missing(
            study, f"no solved runs of the learner with {TRIALS} trials on a task of the paper"
        )
    drawing = Figure(figsize=(style.ONE, 0.85 + 0.185 * len(data)), layout="constrained")
    tasks = {name: task for name, task in study.tasks.items() if (data.task == name).any()}
    rows = data.to_dict("records")
    names = []
    for row in rows:
        if row["hands"]:
            runs = row["published_runs"]
            printed = "" if runs is None or math.isnan(runs) else f"; {runs:.0f}"
            names.append(f"↳ {row['hands']} ({row['runs']}/{row['of_runs']}{printed})")
        else:
            pooled = "*" if row["pooled"] else ""
            name = marked(row["task"], tasks[row["task"]])
            names.append(f"{name}, {name_of(row['method'])}{pooled}")
    axes = drawing.subplots()
    for place, row in enumerate(rows):
        draw_row(axes, -place, row)
    axes.axvline(0, color=style.INK, linewidth=0.6)
    style.name_rows(axes, names)
    axes.spines["left"].set_visible(False)
    # Symmetric about zero: wide enough for every interval and margin.
    ends = ["difference", "difference_low", "difference_high", "margin"]
    reach = np.nanmax(np.abs(data.reindex(columns=ends).to_numpy(float)))
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    axes.set_xlabel("ours − published (ticks)")
    words = "; ".join(
        f"{row['task']}, {name_of(row['method'])} {row['hands']}".strip()
        + f": {row['difference']:+.1f}"
        for row in rows
        if row["runs"]
    )
    alt = f"Differences of our mean rewards to the published ones, with intervals. {words}."
    return drawing, data, alt, tasks.values()


def draw_row(axes: Axes, y: float, row: Any) -> None:
    """Margin, interval and difference of one comparison."""
    axes.barh(y, 2 * row["margin"], 0.8, left=-row["margin"], color=style.GREY, alpha=0.3)
    color, marker, face = _MARKS[row["verdict"] if row["runs"] > 1 else ""]
    if not row["runs"]:
        axes.text(1.3 * row["margin"], y, "never found here", va="center", color=style.GREY)
        return
    low, high = row["difference_low"], row["difference_high"]
    if not math.isnan(low):
        axes.plot([low, high], [y, y], color=color, linewidth=1.0)
    axes.plot(row["difference"], y, marker, color=color, markersize=4, markerfacecolor=face)
