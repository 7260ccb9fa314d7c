"""Learned reward by exploration condition (paper, Figure 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.paper import published_of
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import has, missing, solved
from coartic.analysis.figures.configurations import initial_solution
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.methods import CONDITIONS, LEARNER, name_of
from coartic.analysis.published import Summary, published_cell, published_initial
from coartic.analysis.statistics.estimates import RESAMPLES, Interval, mean, student
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import Study

STARS = ((0.001, "***"), (0.01, "**"), (0.05, "*"))


@style.styled
def bars(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Mean learned reward of each method, as a bar from the initial solution up.

    By default the paper's conditions on the tasks where the folder has more than one of
    them. Each method is tested against the one to its left, the first against the initial
    solution: one-tailed bootstrap tests, of conditions those of the comparisons and of the claims
    register, which corrects them for their number. Raises CoarticError where there is no such
    task.
    """
    least = 2 if methods is None else 1
    labels = {}
    for name in study.tasks:
        own = [label for label in (methods or _conditions(name)) if has(study, name, label)]
        if len(own) >= least:
            labels[name] = own
    if not labels:
        asked = ", ".join(methods or CONDITIONS)
        raise missing(study, f"no task with solved runs of more than one of {asked}")
    data = pd.concat([_rows(study, name, own) for name, own in labels.items()], ignore_index=True)
    # One row of panels, their widths as their numbers of bars.
    counts = [len(own) + 1.2 for own in labels.values()]
    width = style.column_width(0.5 + 0.58 * sum(counts))
    rows, columns = style.grid(len(labels), len(labels))
    ratios = counts if columns > 1 else None
    figure, panels = style.figure_of((rows, columns), (width, 2.6 * rows), width_ratios=ratios)
    for axes, name in zip(panels, labels, strict=True):
        runs = {label: study.cells[name, label].rewards for label in labels[name]}
        _panel(axes, data[data.task == name], runs)
        axes.set_title(style.heading(study.tasks[name]))
        axes.set_ylabel("learned reward (ticks)" if columns == 1 or axes is panels[0] else "")
    style.letters(panels)
    return worded(
        "learned-reward",
        figure,
        data,
        [study.tasks[name] for name in labels],
        resamples=RESAMPLES,
        means=spoken(data, "{task}, {method}: {reward:.1f}"),
    )


def _conditions(task: str) -> list[str]:
    """The paper's conditions on a task, or all of them on other tasks."""
    printed = [name for name in CONDITIONS if published_cell(task, name.removeprefix(LEARNER))]
    return printed or list(CONDITIONS)


def _rows(study: Study, task: str, labels: Sequence[str]) -> pd.DataFrame:
    """The initial solution, then the methods, each tested against the row before."""
    initial = float(-initial_solution(study, task).execution.ticks)
    printed = published_initial(task)
    published = float(printed.reward) if printed else math.nan
    rows: list[dict[str, Any]] = [
        {"task": task, "method": "initial", "reward": initial, "published": published}
    ]
    before: Any = initial
    for label in labels:
        cell = solved(study, task, label)
        rewards, paper = cell.rewards, published_of(cell)
        found = mean(rewards)
        printed_mean = _printed(paper.summary if paper else None)
        rows.append(
            {
                "task": task,
                "method": label,
                "runs": len(rewards),
                "reward": found.estimate,
                "low": found.low,
                "high": found.high,
                "published": printed_mean.value,
                "published_low": printed_mean.low,
                "published_high": printed_mean.high,
                "p": bootstrap_test(rewards, before).p,
            }
        )
        before = rewards
    columns = "task method runs reward low high published published_low published_high p"
    return pd.DataFrame(rows, columns=columns.split())


def _printed(summary: Summary | None) -> Interval:
    """A printed mean with Student's interval, where an SD is printed."""
    if summary is None or summary.sd is None or summary.runs < 2:
        return Interval(math.nan if summary is None else summary.mean)
    return student(summary.mean, summary.sd / math.sqrt(summary.runs), summary.runs - 1)


def _panel(axes: Axes, rows: pd.DataFrame, runs: dict[str, Any]) -> None:
    initial = float(rows.reward.iloc[0])
    look_of = style.looks(rows.method[1:])
    axes.axhline(initial, color=style.INK, linewidth=0.7, zorder=1)
    bar: Any = {"bottom": initial, "edgecolor": style.INK, "linewidth": 0.5, "zorder": 1}
    dot: Any = {"markersize": 1.6, "alpha": 0.55, "markeredgewidth": 0, "zorder": 3}
    diamond: Any = {"markersize": 3.4, "markerfacecolor": style.PAPER, "zorder": 4}
    for place, row in enumerate(rows.to_dict("records")):
        if place:
            color = look_of[row["method"]].color
            axes.bar(place, row["reward"] - initial, 0.62, color=color, **bar)
            _interval(axes, place - 0.16, row["reward"], row["low"], row["high"])
            rewards = np.sort(runs[row["method"]])
            offsets = 0.06 + 0.05 * (np.arange(len(rewards)) % 5)
            axes.plot(place + offsets, rewards, "o", color=style.INK, **dot)
        if not math.isnan(row["published"]):
            x = place + (0.42 if place else 0.0)
            _interval(axes, x, row["published"], row["published_low"], row["published_high"])
            axes.plot(x, row["published"], "D", color=style.INK, **diamond)
    _brackets(axes, rows, runs)
    names = ["initial", *(name_of(label) for label in rows.method[1:])]
    axes.set_xticks(range(len(rows)), names)
    axes.set_xlim(-0.45, len(rows) - 0.4)
    axes.tick_params(axis="x", length=0)
    if len(rows) > 5 or max(map(len, names)) > 9:
        axes.tick_params(axis="x", labelrotation=40)
        for text in axes.get_xticklabels():
            text.set(horizontalalignment="right", rotation_mode="anchor")


def _interval(axes: Axes, x: float, value: float, low: float, high: float) -> None:
    if math.isnan(low):
        return
    ends = [[value - low], [high - value]]
    line: Any = {"linewidth": 0.8, "capsize": 1.8, "capthick": 0.8, "zorder": 3}
    axes.errorbar(x, value, ends, color=style.INK, **line)


def _brackets(axes: Axes, rows: pd.DataFrame, runs: dict[str, Any]) -> None:
    """One between neighbours, above all that the two show."""
    shown = rows[["reward", "high", "published", "published_high"]].max(axis=1).tolist()
    tops = [max([top, *runs.get(label, ())]) for top, label in zip(shown, rows.method, strict=True)]
    bottom = min(rows[["reward", "published"]].min().min(), *(min(r) for r in runs.values()))
    step = 0.055 * max(max(tops) - bottom, 1.0)  # tick; nothing learned by anyone
    level = -math.inf
    for place, p in enumerate(rows.p.tolist()[1:], 1):
        level = max(tops[place - 1], tops[place], level) + 1.6 * step
        left, right, foot = place - 0.95, place - 0.05, level - 0.4 * step
        ends = [left, left, right, right], [foot, level, level, foot]
        axes.plot(*ends, color=style.INK, linewidth=0.7)
        color = style.INK if stars(p).startswith("*") else style.GREY
        axes.text(place - 0.5, level, stars(p), ha="center", va="bottom", color=color)
    axes.set_ylim(bottom - 1.2 * step, level + 2.2 * step)


def stars(p: float) -> str:
    """Significance as the paper's readers are used to it; a dash where there is no test."""
    if math.isnan(p):
        return "–"
    return next((mark for level, mark in STARS if p < level), "n.s.")
