"""The paper beside our runs: mean rewards, and shares of hand sequences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import main_methods, name_of
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.topics.paper.tables import hand_shares, published_differences
from coartic.analysis.words import marked
from coartic.learner.learning import TRIALS

_MARKS = {
    "equivalent": (style.BLUE, "o", style.BLUE),
    "undecided": (style.INK, "s", style.BACKGROUND),
    "different": (style.VERMILLION, "D", style.VERMILLION),
    "": (style.INK, "x", style.INK),
}


@figure(
    "published",
    "Published and ours",
    f"Our mean learned reward minus the published one, with its {style.COVERAGE} interval. Grey: "
    f"margin of equivalence, ±{100 * MARGIN:.0f} % of the published reward. Filled circles: the "
    "interval lies within the margin (equivalent). Open squares: it crosses the margin "
    "(undecided). Diamonds: it lies outside (different). ↳: runs with one hand sequence; in "
    "brackets, how many of our runs have it, then how many of the published ones. * pooled from "
    "several printed sequences.",
)
def draw_published(study: Study) -> Parts:
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
            name = marked(tasks[row["task"]])
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
    axes.barh(y, 2 * row["margin"], 0.8, left=-row["margin"], color=style.GREY, alpha=0.2)
    color, marker, face = _MARKS[row["verdict"] if row["runs"] > 1 else ""]
    if not row["runs"]:
        axes.text(1.3 * row["margin"], y, "never found here", va="center", color=style.GREY)
        return
    low, high = row["difference_low"], row["difference_high"]
    if not math.isnan(low):
        axes.plot([low, high], [y, y], color=color, linewidth=1.0)
    axes.plot(row["difference"], y, marker, color=color, markersize=4, markerfacecolor=face)


COLOURED = len(style.PALETTE)
"""Sequences of a task that have a colour; the rarer ones share grey."""
_EDGE: Any = {"edgecolor": style.INK, "linewidth": 0.4}


@figure(
    "recruitment",
    "Hand sequences",
    "Share of runs by hand sequence (L left, R right, goal by goal); numbers are runs. Hatched: "
    "published. Rare sequences are grey.",
)
def draw_recruitment(study: Study) -> Parts:
    """Shares of hand sequences of each main method, one panel for each task with two hands."""
    data = hand_shares(study)
    data = data[data.task.isin(one_by_one(study)) & data.method.isin(main_methods(data.method))]
    if not len(data):
        raise missing(study, "no solved run on a task with two hands")
    # Methods stand in one order on all tasks.
    order_of = {label: place for place, label in enumerate(main_methods(data.method))}
    data = data.sort_values(
        "method", key=lambda labels: labels.map(order_of), kind="stable", ignore_index=True
    )
    tasks = [task for name, task in study.tasks.items() if (data.task == name).any()]
    shares = data[data.source == "ours"].groupby("hands").share.sum()
    common = shares.sort_values(ascending=False, kind="stable").index
    # Sequences to be compared with published ones have a colour.
    order = list(dict.fromkeys([*data[data.source == "published"].hands, *common]))
    colors = dict(zip(order[:COLOURED], style.PALETTE, strict=False))
    shape = style.grid(len(tasks), 2)
    bars = data.drop_duplicates(["task", "method", "source"]).task.value_counts().max()
    size = style.TWO, (0.8 + 0.17 * bars) * shape[0]
    drawing, panels = style.panels(shape, size, len(tasks))
    for axes, task in zip(panels, tasks, strict=True):
        draw_bars(axes, task, data[data.task == task.name], order, colors)
    style.letters(panels)
    colors |= {"others": style.GREY} if len(order) > COLOURED else {}
    handles = [Patch(facecolor=color, label=hands, **_EDGE) for hands, color in colors.items()]
    style.legend(drawing, handles, len(handles), handlelength=1.0, columnspacing=1.2)
    alt = "; ".join(
        f"{task}, {name_of(str(label))}{'' if source == 'ours' else ', published'}: "
        + ", ".join(f"{row.hands} {row.share:.0%}" for row in rows.itertuples())
        for (task, label, source), rows in data.groupby(["task", "method", "source"], sort=False)
    )
    return drawing, data, f"Stacked bars of hand sequences. {alt}.", tasks


def draw_bars(
    axes: Axes, task: Task, data: pd.DataFrame, order: list[str], colors: dict[str, str]
) -> None:
    """A bar for each method, and below it the published one."""
    names = []
    groups = data.groupby(["method", "source"], sort=False)
    for place, ((label, source), rows) in enumerate(groups):
        ours, left = source == "ours", 0.0
        names.append(name_of(str(label)) if ours else "published")
        for row in sorted(rows.to_dict("records"), key=lambda row: order.index(row["hands"])):
            color, share = colors.get(row["hands"], style.GREY), row["share"]
            hatch = "" if ours else "//////"
            axes.barh(-place, share, 0.78, left=left, color=color, hatch=hatch, **_EDGE)
            if share >= 0.08 and ours:
                middle = left + share / 2, -place, str(row["runs"])
                axes.text(*middle, ha="center", va="center", fontsize=7, color=style.on(color))
            left += share
    style.name_rows(axes, names)
    axes.set_ylim(-len(names) + 0.5, 0.5)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.5, 1], ["0", "50", "100 %"])
    axes.set_xlabel("share of runs")
    axes.spines["left"].set_visible(False)
    axes.set_title(marked(task))
