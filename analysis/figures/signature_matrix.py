"""Methods by signatures of coarticulation, as a matrix of values."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.figures.selection import chosen, has, missing
from coartic.analysis.methods import short_name
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.study import Study
from coartic.analysis.words import slugs

SIGNATURES = {
    signature.name: signature.matrix for signature in REGISTER.values() if signature.matrix
}
"""Signatures of a column each, and the column's heading."""
LIMIT = 2.0  # standard deviations at which colours saturate
_MAP = "PuOr_r"


@style.styled
def signature_matrix(study: Study, *, methods: Sequence[str] | None = None) -> list[Plot]:
    """One matrix a task: a row a method, a column a signature that some method has there.

    The value of a cell is the mean over the places (goals, coordinates) of the signature.
    Raises CoarticError where no method has a signature on any of the tasks.
    """
    plots, ids = [], slugs(study.tasks)
    found, frame = study.tasks, study.signatures
    if methods is not None:
        chosen(study, list(found), methods)
    for name, task in found.items():
        asked = methods and [label for label in methods if has(study, name, label)]
        if asked == [] or not (frame.task == name).any():
            continue
        labels = chosen(study, [name], asked)
        data = _values(frame[(frame.task == name) & frame.label.isin(labels)], labels)
        if data.value.notna().any():
            plots.append(_plot(task, ids[name], data))
    if not plots:
        raise missing(study, "no solved run on any of the tasks: there are no signatures")
    return plots


def _values(frame: pd.DataFrame, labels: Sequence[str]) -> pd.DataFrame:
    """One row a method and signature: value, standardised value, or why there is none."""
    places = frame.groupby(["label", "signature"])
    data = pd.DataFrame(
        {"value": places.value.agg(lambda of: of.mean()), "places": places.value.count()}
    )
    for column in ("unit", "why_not"):  # the first there is
        data[column] = places[column].agg(lambda texts: next(filter(None, texts), ""))
    rows = pd.MultiIndex.from_product([labels, SIGNATURES], names=["method", "signature"])
    data = data.reindex(rows).fillna({"places": 0, "unit": "", "why_not": ""}).reset_index()
    data = data.astype({"places": int})
    data["why_not"] = data.why_not.mask(data.places > 0, "")
    by_name = data.groupby("signature").value
    differ = by_name.transform("min") < by_name.transform("max")
    spread = by_name.transform("std").where(differ)
    standard = (data.value - by_name.transform("mean")) / spread
    return data.assign(standardised=standard.where(data.value.isna(), standard.fillna(0.0)))


def _plot(task: Task, slug: str, data: pd.DataFrame) -> Plot:
    known = set(data.signature[data.value.notna()])
    columns = [name for name in SIGNATURES if name in known]
    labels = list(data.method.unique())
    shown = data[data.signature.isin(columns)].reset_index(drop=True)
    of = {"task": task.label, "limit": LIMIT, "rows": len(labels), "columns": len(columns)}
    of["methods"] = ", ".join(map(short_name, labels))
    figure = _matrix(shown, labels, columns)
    return worded("signatures", figure, shown, [task], id=f"signatures-{slug}", **of)


def _matrix(data: pd.DataFrame, labels: Sequence[str], columns: Sequence[str]) -> Figure:
    """The figure: labels by columns, as large as they need."""
    left = min(0.1 + 0.062 * max(len(short_name(label)) for label in labels), style.TWO / 2)
    above, right, below, tall = 1.38, 0.7, 0.06, 0.19  # inches
    side = min((style.TWO - left - right) / len(columns), 0.6)
    width = style.column_width(left + side * len(columns) + right)
    side = (width - left - right) / len(columns)
    height = above + tall * len(labels) + below
    figure = Figure(figsize=(width, height))
    across, up = side * len(columns) / width, tall * len(labels) / height
    axes = figure.add_axes((left / width, below / height, across, up))
    cells = data.set_index(["method", "signature"])
    for y, label in enumerate(labels):
        for x, name in enumerate(columns):
            value, standardised = cells.value[label, name], cells.standardised[label, name]
            _draw_cell(axes, x, y, float(value), float(standardised))
    axes.set_xlim(0, len(columns))
    axes.set_ylim(len(labels), 0)
    axes.set_yticks(np.arange(len(labels)) + 0.5, [short_name(label) for label in labels])
    axes.xaxis.tick_top()
    headings = [SIGNATURES[name] for name in columns]
    places = np.arange(len(columns)) + 0.5
    axes.set_xticks(places, headings, rotation=50, ha="left", rotation_mode="anchor")
    axes.tick_params(length=0, pad=2)
    axes.spines[:].set_visible(False)
    return figure


def _draw_cell(axes: Axes, x: int, y: int, value: float, standardised: float) -> None:
    """A value on its colour; hatched where there is none."""
    if math.isnan(value):
        empty = Rectangle((x, y), 1, 1, facecolor="none", edgecolor=style.GREY, linewidth=0)
        empty.set_hatch("/////")
        axes.add_artist(empty)
        return
    shade = standardised / (2 * LIMIT) + 0.5
    color = to_hex(colormaps[_MAP](min(max(shade, 0.0), 1.0)))
    axes.add_artist(Rectangle((x, y), 1, 1, facecolor=color, edgecolor=color, linewidth=0.3))
    text = axes.text(x + 0.5, y + 0.52, _figures(value), ha="center", va="center")
    text.set(fontsize=6, color=style.on(color))


def _figures(value: float) -> str:
    """Three figures at most."""
    size = abs(value)
    digits = 0 if size >= 99.5 else 1 if size >= 9.95 else 2 if size >= 0.0995 or not size else 3
    text = style.number(value, digits)
    return text.lstrip("−") if float(f"{value:.{digits}f}") == 0 else text
