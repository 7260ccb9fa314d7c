"""How the posture at a shared goal depends on what follows, and whether the hand feels it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.figures import style
from coartic.analysis.figures.bars import stars
from coartic.analysis.figures.choice import NO_CONTEXTS, chosen, missing
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.methods import name_of
from coartic.analysis.signatures.register import signatures
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import Study

MOST = 6
_OPEN: Any = {"marker": "s", "color": style.VERMILLION, "markerfacecolor": style.PAPER}
_PARTS = {"motor-equivalent part": "equivalent", "non-motor-equivalent part": "other"}


@style.styled
def context(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Motor-equivalent and non-motor-equivalent part of the difference between contexts.

    One panel for each goal that two tasks of the folder share before they differ. Raises
    CoarticError where no method has runs on two such tasks, or there are more than
    :data:`MOST` panels.
    """
    data = _parts(study, methods)
    places = list(data.groupby(["task", "where"], sort=False))
    if len(places) > MOST:
        raise missing(study, f"{len(places)} pairs of tasks share a goal, more than {MOST}")
    rows = sum(len(group) + 4 for _, group in places)
    size = style.ONE, min(0.5 + 0.16 * rows, style.TALLEST)
    heights = [len(group) + 1 for _, group in places]
    figure, panels = style.figure_of((len(places), 1), size, sharex=True, height_ratios=heights)
    farthest = float(data[["equivalent", "other"]].max().max()) or 1.0  # all the same: any scale
    for axes, ((task, where), group) in zip(panels, places, strict=True):
        _panel(axes, group)
        axes.set_xlim(0, 1.12 * farthest)
        axes.set_title(textwrap.fill(f"{task}: {where}", 31))
    panels[-1].set_xlabel("difference per root of dimension\n(length unit, rad)")
    if len(places) > 1:
        style.letters(panels)
    handles = [
        style.entry("motor-equivalent", linestyle="", marker="o", color=style.BLUE),
        style.entry("moves the hand", linestyle="", **_OPEN),
    ]
    style.legend(figure, handles, 2)
    words = spoken(data, "{method} {equivalent:.2f} and {other:.2f}")
    return worded("context", figure, data, parts=words)


def _parts(study: Study, methods: Sequence[str] | None) -> pd.DataFrame:
    """One row a place and method: both parts, with p raw and adjusted over all rows."""
    frame = signatures(study)
    frame = frame[frame.signature.isin(_PARTS) & frame.value.notna()]
    labels = chosen(study, list(dict.fromkeys(frame.task)), methods) if len(frame) else []
    frame = frame[frame.label.isin(labels)]
    if not len(frame):
        raise missing(study, NO_CONTEXTS)
    keys = ["task", "where", "label", "n"]
    equivalent, other = (
        frame[frame.signature == name]
        .set_index(keys)[["value", "p"]]
        .rename(columns={"value": part, "p": f"p_{part}"})
        for name, part in _PARTS.items()
    )
    data = equivalent.join(other).reset_index().rename(columns={"label": "method", "n": "runs"})
    together = data[["p_equivalent", "p_other"]].to_numpy(dtype=float)
    adjusted = np.reshape(holm(together.ravel().tolist()), together.shape)
    data = data.assign(holm_equivalent=adjusted[:, 0], holm_other=adjusted[:, 1])
    return data.sort_values(
        ["task", "where", "method"],
        kind="stable",
        key=lambda column: column.map(labels.index) if column.name == "method" else column,
        ignore_index=True,
    )


def _panel(axes: Axes, data: pd.DataFrame) -> None:
    for place, row in enumerate(data.to_dict("records")):
        values = [row["other"], row["equivalent"]]
        axes.plot(values, [-place, -place], color=style.GREY, linewidth=0.8, zorder=1)
        axes.plot(row["other"], -place, linestyle="", markersize=4, clip_on=False, **_OPEN)
        axes.plot(row["equivalent"], -place, "o", color=style.BLUE, markersize=4, clip_on=False)
        if not math.isnan(row["p_equivalent"]):
            mark, end = stars(row["holm_equivalent"]), (max(values), -place)
            axes.annotate(mark, end, (5, -0.5), textcoords="offset points", va="center")
    style.name_rows(axes, [name_of(method) for method in data.method])
    axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.4)
