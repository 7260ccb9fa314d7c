"""What it costs to come near the optimum: shares of targets reached within a budget."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.reached import WAY
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.methods import name_of
from coartic.analysis.study import Study
from coartic.analysis.tables.comparison import price_curves

PANELS = {"trials": "trials", "forward_kinematics": "forward-kinematics evaluations"}
"""Spends that the figure has a panel of, and their axes."""


@figure(
    "price",
    "What it costs to come near",
    f"Share of {len(WAY)} reward targets reached within a budget (mean over all tasks where there "
    "are several). Targets are evenly spaced from the initial solution to the optimum; a run "
    "counts for each target that it has reached. a: trials; planners make none and are lines. "
    "b: forward-kinematics evaluations, spread evenly over a run's trials.",
)
def price(study: Study) -> Parts:
    """Share of targets reached, against trials and kinematics."""
    data = price_curves(study)
    spends = [spend for spend in PANELS if (data.budget[data.spend == spend] > 0).any()]
    if not spends:
        raise missing(study, "no method that reaches a target on a task with a known optimum")
    drawing, panels = style.figure_of((1, len(spends)), (style.TWO, 2.6), sharey=True)
    for axes, spend in zip(panels, spends, strict=True):
        draw_curves(axes, data[data.spend == spend])
        axes.set_xlabel(PANELS[spend])
    panels[0].set_ylabel("targets reached (%)")
    style.letters(panels)
    ends = data[data.spend == spends[-1]].groupby("method", sort=False).tail(1)
    ends = ends.assign(share=100 * ends.share)
    names = dict(zip(map(name_of, ends.method), ends.share, strict=True))
    style.label_ends(panels[-1], names, 5.5)
    shares = spoken(ends, "{method} {share:.0f} %")
    alt = f"Share of reward targets reached against what was spent. At the end: {shares}."
    return drawing, data, alt, study.tasks.values()


def draw_curves(axes: Axes, data: pd.DataFrame) -> None:
    """A step curve for each method."""
    style.log_axis(axes)
    positive = data.budget[data.budget > 0]
    least, most = positive.min(), positive.max()
    edge = least / 1.5
    axes.axhline(50, color=style.GREY, linewidth=0.5)
    for label, rows in data.groupby("method", sort=False):
        x = np.concatenate([rows.budget.clip(lower=edge), [most]])
        y = np.concatenate([100 * rows.share, [100 * rows.share.iloc[-1]]])
        line: Any = {**style.look_of(str(label)), "linewidth": 1.3}
        (drawn,) = axes.step(x, y, where="post", **line)
        style.tip(drawn, f"{name_of(str(label))}: {y[-1]:.0f} % of the targets in the end")
    axes.set_xlim(edge, most)
    axes.set_ylim(-2, 102)
