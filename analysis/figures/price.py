"""What it costs to come near the optimum: shares of targets reached within a budget."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.reached import WAY, targets
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import missing
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.methods import in_order, look_alike, main_methods, name_of
from coartic.analysis.study import Study

PANELS = {"trials": "trials", "forward_kinematics": "forward-kinematics evaluations"}
"""Spends that the figure has a panel of, and their axes."""
POINTS = 150
"""Steps of a curve that are drawn, at most."""


@style.styled
def price(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Share of targets reached, against trials and kinematics.

    Raises CoarticError where no task has a known optimum beyond its initial solution.
    """
    known = list(targets(study))
    if not known:
        raise missing(study, "no method has runs on a task with a known optimum")
    over = known[0][0]  # all tasks together come first
    labels = list(dict.fromkeys(method for task, method, _ in known if task == over))
    labels = [label for label in methods if label in labels] if methods else main_methods(labels)
    data = _curves(study, over, in_order(labels))
    spends = [spend for spend in PANELS if (data.spend == spend).any()]
    if not spends:
        raise missing(study, "no method that reaches one of the targets")
    figure, panels = style.figure_of((1, len(spends)), (style.TWO, 2.6), sharey=True)
    for axes, spend in zip(panels, spends, strict=True):
        _panel(axes, data[data.spend == spend])
        axes.set_xlabel(PANELS[spend])
    panels[0].set_ylabel("targets reached (%)")
    style.letters(panels)
    ends = data[data.spend == spends[-1]].groupby("method", sort=False).tail(1)
    names = dict(zip(map(name_of, ends.method), 100 * ends.share, strict=True))
    style.label_ends(panels[-1], names, 5.5)
    words = spoken(ends.assign(share=100 * ends.share), "{method} {share:.0f} %")
    tasks = study.tasks.values()
    return worded("price", figure, data, tasks, targets=len(WAY), over=over, ends=words)


def _curves(study: Study, task: str, labels: Sequence[str]) -> pd.DataFrame:
    """A row at every step that is drawn: ``method``, ``spend``, ``budget``, ``share``."""
    parts = []
    for label in labels:
        for spend in PANELS:
            found = targets(study).get((task, label, spend))
            if found is None:
                continue
            budget, share = found.curve()
            kept = np.unique(np.linspace(0, len(budget) - 1, min(len(budget), POINTS)).round())
            at = kept.astype(int)
            rows = {"budget": budget[at], "share": share[at]}
            parts.append(pd.DataFrame({"method": label, "spend": spend, **rows}))
    return pd.concat(parts, ignore_index=True)


def _panel(axes: Axes, data: pd.DataFrame) -> None:
    style.log_axis(axes)
    positive = data.budget[data.budget > 0]
    least, most = positive.min(), positive.max()
    edge = least / 1.5
    axes.axhline(50, color=style.GREY, linewidth=0.5)
    for label, rows in data.groupby("method", sort=False):
        look = style.looks([look_alike(str(label))])[look_alike(str(label))]
        x = np.concatenate([rows.budget.clip(lower=edge), [most]])
        y = np.concatenate([100 * rows.share, [100 * rows.share.iloc[-1]]])
        line: Any = {**look.line, "linewidth": 1.3}
        (drawn,) = axes.step(x, y, where="post", **line)
        style.tip(drawn, f"{name_of(str(label))}: {y[-1]:.0f} % of the targets in the end")
    axes.set_xlim(edge, most)
    axes.set_ylim(-2, 102)
