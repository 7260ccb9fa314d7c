"""At what price: shares of levels of reward reached within a budget, over runs and tasks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.reached import WAY
from coartic.analysis.figures import style
from coartic.analysis.figures.frontier import NAMES
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.figures.selection import HEADLINES, missing
from coartic.analysis.methods import CONDITIONS, LEARNER, TOGETHER, short_name
from coartic.analysis.study import Study

SHOWN = ("trials", "forward_kinematics")
"""Spends that the printed figure has a panel of."""
_BAND: Any = {"step": "post", "alpha": 0.15, "linewidth": 0}


def look_alike(label: str) -> str:
    """Whose look a method has: the learner over all tasks that of its two-armed condition."""
    ends = (name for name in reversed(CONDITIONS) if name.removeprefix(LEARNER) in label)
    return next(ends, label) if label.startswith(TOGETHER) else label


def look_of(label: str) -> style.Look:
    """The look of :func:`look_alike`."""
    alike = look_alike(label)
    return style.looks([alike])[alike]


def main_methods(data: pd.DataFrame) -> list[str]:
    """Of the labels in ``data`` those that stand for their families, in the order of figures."""
    labels = list(dict.fromkeys(data.method))
    joint = [label for label in labels if label != look_alike(label)]
    own = [label for label in HEADLINES if label in labels]
    own = [label for label in own if not (joint and label.startswith(LEARNER))]
    return [*joint[:1], *own] or labels


@style.styled
def price(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Share of pairs of run and level of reward reached, against trials and kinematics.

    Raises CoarticError where no task has a known optimum beyond its initial solution.
    """
    data = study.reached
    if methods is not None:
        data = data[data.method.isin(methods)]
    if not len(data):
        raise missing(study, "no method has runs on a task with a known optimum")
    task = data.task.iloc[-1]  # all together come last
    shown = data[data.task == task]
    labels = list(methods or main_methods(shown))
    spends = [spend for spend in SHOWN if (shown.spend == spend).any()]
    rows = -(-len(labels) // 4)
    size = style.TWO, 2.2 + 0.15 * rows
    figure, panels = style.figure_of((1, len(spends)), size, sharey=True)
    for axes, spend in zip(panels, spends, strict=True):
        _panel(axes, shown[shown.spend == spend], labels, NAMES[spend])
    panels[0].set_ylabel("levels of reward reached (%)")
    style.letters(panels)
    handles = [style.entry(short_name(label), **look_of(label).line) for label in labels]
    style.legend(figure, handles, 4)
    ends = shown[(shown.spend == spends[0]) & shown.method.isin(labels)]
    ends = ends.groupby("method", sort=False).tail(1)
    return worded(
        "price",
        figure,
        data,
        study.tasks.values(),
        targets=len(WAY),
        over=task,
        ends=spoken(ends.assign(share=100 * ends.share), "{method} {share:.0f} %"),
    )


def _panel(axes: Axes, data: pd.DataFrame, labels: Sequence[str], name: str) -> None:
    style.log_axis(axes)
    least = data.budget[data.budget > 0].min()
    edge = least / 2
    for label in labels:
        own = data[data.method == label]
        look = look_of(label)
        x = own.budget.clip(lower=edge)
        axes.step(x, 100 * own.share, where="post", **look.line)
        axes.fill_between(x, 100 * own.low, 100 * own.high, color=look.color, **_BAND)
    axes.set_xlim(edge, data.budget.max())
    axes.set_ylim(-2, 102)
    axes.set_xlabel(name)
