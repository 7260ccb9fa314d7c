"""Learned reward by exploration condition (paper, Figure 8)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.methods import name_of
from coartic.analysis.statistics.estimates import RESAMPLES
from coartic.analysis.study import Study
from coartic.analysis.tables.paper import learned_rewards


@figure(
    "learned-reward",
    "Learned reward by condition",
    "Bars rise from the initial solution to the mean learned reward, with its "
    f"{style.CONFIDENCE} BCa interval over runs; grey dots are runs. Open diamonds: published mean "
    f"with its {style.CONFIDENCE} interval, where an SD is printed. Brackets: one-tailed bootstrap "
    "test that the mean is higher than the one to its left "
    f"({RESAMPLES} resamples, not corrected for their number, as in the paper): {style.STARS}, "
    "– no test. After Figure 8 of Shah, Barto & Fagg (2013).",
)
def learned_reward(study: Study) -> Parts:
    """Mean learned reward of each condition, as a bar from the initial solution up."""
    data = learned_rewards(study)
    data = data[data.task.isin(one_by_one(study))]
    if not len(data):
        raise missing(study, "no task with solved runs of two of the paper's conditions")
    tasks = [study.tasks[name] for name in data.task.unique()]
    # One row of panels, their widths as their numbers of bars.
    counts = [(data.task == task.name).sum() + 0.2 for task in tasks]
    size = style.column_width(0.5 + 0.58 * sum(counts)), 2.6
    drawing, panels = style.figure_of((1, len(tasks)), size, width_ratios=counts)
    for axes, task in zip(panels, tasks, strict=True):
        rows = data[data.task == task.name]
        runs = {label: study.cells[task.name, label].rewards for label in rows.method[1:]}
        draw_bars(axes, rows, runs)
        axes.set_title(style.heading(task))
    panels[0].set_ylabel("learned reward (ticks)")
    style.letters(panels)
    means = spoken(data, "{task}, {method}: {reward:.1f}")
    return drawing, data, f"Bars of mean learned reward with intervals. {means}.", tasks


def draw_bars(axes: Axes, rows: pd.DataFrame, runs: dict[str, Any]) -> None:
    """The initial solution, then a bar for each condition with its runs and the published mean."""
    initial = float(rows.reward.iloc[0])
    look_of = style.looks(rows.method[1:])
    axes.axhline(initial, color=style.INK, linewidth=0.7, zorder=1)
    bar: Any = {"bottom": initial, "edgecolor": style.INK, "linewidth": 0.5, "zorder": 1}
    dot: Any = {"markersize": 1.6, "alpha": 0.55, "markeredgewidth": 0, "zorder": 3}
    diamond: Any = {"markersize": 3.4, "markerfacecolor": style.PAPER, "zorder": 4}
    for place, row in enumerate(rows.to_dict("records")):
        if place:
            color = look_of[row["method"]]["color"]
            axes.bar(place, row["reward"] - initial, 0.62, color=color, **bar)
            draw_interval(axes, place - 0.16, row, "reward")
            rewards = np.sort(runs[row["method"]])
            offsets = 0.06 + 0.05 * (np.arange(len(rewards)) % 5)
            axes.plot(place + offsets, rewards, "o", color=style.INK, **dot)
        if not math.isnan(row["published"]):
            x = place + (0.42 if place else 0.0)
            draw_interval(axes, x, row, "published")
            axes.plot(x, row["published"], "D", color=style.INK, **diamond)
    draw_brackets(axes, rows, runs)
    names = ["initial", *map(name_of, rows.method[1:])]
    axes.set_xticks(range(len(rows)), names)
    axes.set_xlim(-0.45, len(rows) - 0.4)
    axes.tick_params(axis="x", length=0, labelrotation=40)
    for text in axes.get_xticklabels():
        text.set(horizontalalignment="right", rotation_mode="anchor")


def draw_interval(axes: Axes, x: float, row: Any, name: str) -> None:
    """The interval of a column, where it has one."""
    value, low, high = (row[f"{name}{ending}"] for ending in ("", "_low", "_high"))
    if not math.isnan(low):
        line: Any = {"linewidth": 0.8, "capsize": 1.8, "capthick": 0.8, "zorder": 3}
        axes.errorbar(x, value, [[value - low], [high - value]], color=style.INK, **line)


def draw_brackets(axes: Axes, rows: pd.DataFrame, runs: dict[str, Any]) -> None:
    """One between neighbours, above everything that the two show."""
    highest = rows[["reward", "reward_high", "published", "published_high"]].max(axis=1)
    tops = [max([top, *runs.get(m, ())]) for top, m in zip(highest, rows.method, strict=True)]
    bottom = min(rows[["reward", "published"]].min().min(), *(min(r) for r in runs.values()))
    step = 0.055 * max(max(tops) - bottom, 1.0)  # tick; nothing learned by anyone
    level = -math.inf
    for place, p in enumerate(rows.p.tolist()[1:], 1):
        level = max(tops[place - 1], tops[place], level) + 1.6 * step
        left, right, foot = place - 0.95, place - 0.05, level - 0.4 * step
        axes.plot(
            [left, left, right, right], [foot, level, level, foot], color=style.INK, linewidth=0.7
        )
        mark = style.stars(p)
        color = style.INK if mark.startswith("*") else style.GREY
        axes.text(place - 0.5, level, mark, ha="center", va="bottom", color=color)
    axes.set_ylim(bottom - 1.2 * step, level + 2.2 * step)
