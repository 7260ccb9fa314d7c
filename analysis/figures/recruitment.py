"""Which hand hits which goal: shares of hand sequences, published beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from coartic import Task
from coartic.analysis.comparisons.paper import published_of
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import chosen, has, missing, solved
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.methods import name_of
from coartic.analysis.published import RUNS
from coartic.analysis.study import Study

MOST = len(style.PALETTE)
"""Sequences of a task that have a colour; the rarer ones share grey."""
OTHERS = "others"
_EDGE: Any = {"edgecolor": style.INK, "linewidth": 0.4}


@style.styled
def recruitment(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Shares of hand sequences of each method, one panel a task with two hands.

    Where the paper prints the number of runs of each sequence, its shares stand below ours.
    Raises CoarticError where no method was run on a task with two hands.
    """
    found = {name: task for name, task in study.tasks.items() if len(task.hands) > 1}
    if not found:
        raise missing(study, "no task with two hands")
    labels = chosen(study, list(found), methods)
    data = pd.concat([_shares(study, name, labels) for name in found], ignore_index=True)
    found = {name: task for name, task in found.items() if name in set(data.task)}
    shares = data[data.source == "ours"].groupby("hands").share.sum()
    printed = data[data.source == "published"].hands
    common = shares.sort_values(ascending=False, kind="stable").index
    order = list(dict.fromkeys([*printed, *common]))  # what is compared has a colour
    bars = [len(data[data.task == name].drop_duplicates(["method", "source"])) for name in found]
    shape = style.grid(len(found), 2)
    size = style.TWO, (0.75 + 0.155 * max(bars)) * shape[0]
    figure, panels = style.figure_of(shape, size)
    colors = dict(zip(order[:MOST], style.PALETTE, strict=False))
    for axes in panels[len(found) :]:
        axes.set_axis_off()
    panels = panels[: len(found)]
    for axes, task in zip(panels, found.values(), strict=True):
        _panel(axes, task, data[data.task == task.name], order, colors)
    style.letters(panels)
    colors |= {OTHERS: style.GREY} if len(order) > MOST else {}
    handles = [Patch(facecolor=color, label=hands, **_EDGE) for hands, color in colors.items()]
    style.legend(figure, handles, len(handles), handlelength=1.0, columnspacing=1.2)
    words = "; ".join(
        f"{task}, {name_of(str(label))}{'' if source == 'ours' else ', published'}: "
        + ", ".join(f"{row.hands} {row.share:.0%}" for row in rows.itertuples())
        for (task, label, source), rows in data.groupby(["task", "method", "source"], sort=False)
    )
    return worded("recruitment", figure, data, found.values(), shares=words)


def _shares(study: Study, task: str, labels: Sequence[str]) -> pd.DataFrame:
    """One row a method, source and sequence, the commonest first."""
    rows = []
    for label in labels:
        if not has(study, task, label):
            continue
        counts = solved(study, task, label).good.hands.value_counts()
        rows += [(task, label, "ours", str(hands), int(n)) for hands, n in counts.items()]
        paper = published_of(study.cells[task, label])
        printed = paper.sequences if paper else {}
        if sum(summary.printed_runs or 0 for summary in printed.values()) == RUNS:
            rows += [
                (task, label, "published", hands, summary.runs)
                for hands, summary in printed.items()
                if summary.printed_runs
            ]
    frame = pd.DataFrame(rows, columns=["task", "method", "source", "hands", "runs"])
    totals = frame.groupby(["method", "source"]).runs.transform("sum")
    return frame.assign(share=frame.runs / totals)


def _panel(
    axes: Axes, task: Task, data: pd.DataFrame, order: list[str], colors: dict[str, str]
) -> None:
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
                axes.text(*middle, ha="center", va="center", fontsize=6, color=style.on(color))
            left += share
    style.name_rows(axes, names)
    axes.set_ylim(-len(names) + 0.5, 0.5)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.5, 1], ["0", "50", "100 %"])
    axes.set_xlabel("share of runs")
    axes.spines["left"].set_visible(False)
    axes.set_title(style.heading(task))
