"""Reward against what it costs: anytime curves with their intervals, and Pareto points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coartic import Task
from coartic.analysis.comparisons.progress import SPENDS
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.figures.selection import chosen, missing
from coartic.analysis.methods import short_name
from coartic.analysis.study import Study
from coartic.record import SEARCH

NAMES = {
    "trials": "physical trials",
    "movement_ticks": "control ticks of all trials",
    "forward_kinematics": "forward-kinematics evaluations",
    "solve_s": "solve time (s)",
}
_MARK: Any = {"markersize": 4, "markeredgewidth": 0.4, "markeredgecolor": style.INK}
_RING: Any = {"color": style.INK, "markerfacecolor": "none"}


@style.styled
def frontier(study: Study, *, methods: Sequence[str] | None = None) -> list[Plot]:
    """Best reward so far against each spend, one figure a spend, one panel a task.

    Methods that plan are a point at all that they spend; those that spend nothing of a kind
    stand at the left edge. Raises CoarticError where there is nothing to draw.
    """
    found = study.tasks
    labels = [name for name in chosen(study, list(found), methods) if not name.startswith(SEARCH)]
    frame = study.anytime
    frame = frame[frame.task.isin(found) & frame.method.isin(labels) & frame["mean"].notna()]
    keys = ["task", "method", "spend"]
    front = pd.MultiIndex.from_frame(study.pareto[study.pareto.front.astype(bool)][keys])
    frame = frame.assign(front=pd.MultiIndex.from_frame(frame[keys]).isin(front))
    plots = []
    for spend in SPENDS:
        data = frame[frame.spend == spend].reset_index(drop=True)
        if len(data):
            shown = {name: task for name, task in found.items() if name in set(data.task)}
            plots.append(_plot(study, spend, data, shown, labels))
    if not plots:
        raise missing(study, "no run of the methods has a solution and a known spend")
    return plots


def _plot(
    study: Study, spend: str, data: pd.DataFrame, tasks: dict[str, Task], labels: Sequence[str]
) -> Plot:
    present = [label for label in labels if label in set(data.method)]
    below = 0.25 + 0.15 * math.ceil((len(present) + 2) / 4)
    figure, panels = style.task_panels(
        tasks.values(), 2.1, below, NAMES[spend], "best reward so far (ticks)", sharex=True
    )
    positive = data.budget[data.budget > 0]
    left = 10 ** math.floor(math.log10(positive.min())) if len(positive) else 1.0
    edge = left if (data.budget > 0).all() else 0.6 * left
    for axes, task in zip(panels, tasks, strict=True):
        optimum = study.optima.get((task, "free"))
        _panel(axes, data[data.task == task], present, edge, optimum.reward if optimum else None)
    panels[0].set_xlim(edge, max(1.5 * data.budget.max(), 10 * left))  # shared
    _legend(figure, data, present)
    ends = data.groupby(["task", "method"], sort=False).tail(1)
    return worded(
        "frontier",
        figure,
        data,
        tasks.values(),
        id=f"frontier-{spend.replace('_', '-')}",
        spend=NAMES[spend],
        ends=spoken(ends, "{task}, {method}: {mean:.0f}"),
    )


def _panel(
    axes: Axes, data: pd.DataFrame, labels: Sequence[str], edge: float, optimum: float | None
) -> None:
    look_of = style.looks(labels)
    style.log_axis(axes)
    ends = data.groupby("method", sort=False)["mean"].last()
    top = max(data["mean"].max(), optimum if optimum is not None else -math.inf)
    # The worst quarter of the methods does not decide the scale.
    low = float(ends.quantile(0.25)) if len(ends) > 3 else float(ends.min())
    low = min(low, float(ends.max()) - 1)
    low -= 0.5 * (top - low)
    axes.set_ylim(low, top + 0.08 * (top - low))
    for label, rows in data.groupby("method", sort=False):
        look = look_of[str(label)]
        if rows.kind.iloc[0] == "curve":
            axes.step(rows.budget, rows["mean"], where="post", **look.line)
            band: Any = {"step": "post", "color": look.color, "alpha": 0.2, "linewidth": 0}
            axes.fill_between(rows.budget, rows.low, rows.high, **band)
        last = rows.iloc[-1]
        x, y = max(last.budget, edge), max(last["mean"], low)
        axes.plot(x, y, look.marker, color=look.color, clip_on=False, zorder=4, **_MARK)
        if last.front:
            ring: Any = {**_RING, "markersize": 8, "markeredgewidth": 0.7}
            axes.plot(x, y, "o", clip_on=False, zorder=5, **ring)
    if optimum is not None:
        axes.axhline(optimum, **style.OPTIMUM)


def _legend(figure: Figure, data: pd.DataFrame, labels: Sequence[str]) -> None:
    curves = set(data[data.kind == "curve"].method)
    handles = [
        style.entry(
            short_name(label),
            marker=look.marker,
            **look.line | ({} if label in curves else {"linestyle": ""}),
            **_MARK,
        )
        for label, look in style.looks(labels).items()
    ]
    ring = style.entry("Pareto front", linestyle="", marker="o", markersize=7, **_RING)
    style.legend(figure, [*handles, ring, style.entry("optimum", **style.OPTIMUM)], 4)
