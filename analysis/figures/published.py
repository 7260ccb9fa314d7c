"""Published against ours, every cell and hand sequence that the paper prints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coartic.analysis.comparisons.paper import PaperRow, SequenceRow, paper_rows, sequence_rows
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import missing
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.methods import CONDITIONS, name_of
from coartic.analysis.published import TRIALS, Summary
from coartic.analysis.statistics.equivalence import MARGIN, Equivalence
from coartic.analysis.study import Study
from coartic.analysis.words import marked

_MARKS = {
    "equivalent": (style.BLUE, "o", style.BLUE),
    "undecided": (style.INK, "s", style.PAPER),
    "different": (style.VERMILLION, "D", style.VERMILLION),
}


@style.styled
def published(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Difference of every mean reward to the printed one, with interval and margin.

    Cells with the paper's number of trials, by default of its conditions; where it reports
    hand sequences, those too. Raises CoarticError where the folder has none of the paper's cells.
    """
    found, labels = study.tasks, methods or CONDITIONS
    places = [(name, label) for name in found for label in labels]
    whole = {(row.cell.task, row.cell.label): row for row in paper_rows(study) if row.comparable}
    sequences = sequence_rows(study)
    rows = [
        _row(row, row.published, len(whole[place].rewards))
        for place in places
        if place in whole and len(whole[place].rewards)
        for row in _rows(whole[place], sequences)
        if row.published is not None
    ]
    if not rows:
        raise missing(
            study,
            f"no solved runs with {TRIALS} trials of {', '.join(labels)} on a task that the "
            "paper prints a reward of",
        )
    data = pd.DataFrame(rows)
    figure = Figure(figsize=(style.ONE, 0.85 + 0.185 * len(data)), layout="constrained")
    axes = figure.subplots()
    _draw(axes, data, {name: marked(name, own) for name, own in found.items()})
    shown = {name: found[name] for name in data.task.unique()}
    words = "; ".join(
        f"{row['task']}, {name_of(row['method'])} {row['hands']}".strip()
        + f": {row['difference']:+.1f}"
        for row in rows
        if row["runs"]
    )
    margin = f"{100 * MARGIN:.0f}"
    return worded("published", figure, data, shown.values(), margin=margin, differences=words)


def _rows(whole: PaperRow, sequences: Sequence[SequenceRow]) -> Iterator[SequenceRow]:
    """A cell, then each hand sequence that the paper prints a reward of, where it tells them."""
    paper = whole.paper
    if (printed := paper.summary) is not None:
        yield SequenceRow(whole.cell, "", printed, printed.runs, whole.rewards, whole.difference)
    if len(paper.sequences) > 1:
        yield from (own for own in sequences if own.cell is whole.cell)


def _row(own: SequenceRow, paper: Summary, of_runs: int) -> dict[str, Any]:
    found = own.difference or Equivalence(math.nan, (), "", margin=math.nan)
    return {
        "task": own.cell.task,
        "method": own.cell.label,
        "hands": own.hands,
        "runs": len(own.rewards),
        "of_runs": of_runs,
        "reward": float(own.rewards.mean()) if len(own.rewards) else math.nan,
        "published": paper.mean,
        "published_sd": math.nan if paper.sd is None else paper.sd,
        "published_runs": own.published_runs,
        "pooled": paper.derived,
        "margin": MARGIN * abs(paper.mean),
        "difference": found.estimate,
        "low": found.low,
        "high": found.high,
        "verdict": "" if math.isnan(found.low) else found.verdict,
    }


def _draw(axes: Axes, data: pd.DataFrame, marked: dict[str, str]) -> None:
    names = []
    for place, row in enumerate(data.to_dict("records")):
        y = -place
        axes.barh(y, 2 * row["margin"], 0.8, left=-row["margin"], color=style.GREY, alpha=0.3)
        value = row["difference"]
        color, marker, face = _MARKS.get(row["verdict"], (style.INK, "x", style.INK))
        if not math.isnan(value):
            if not math.isnan(row["low"]):
                axes.plot([row["low"], row["high"]], [y, y], color=color, linewidth=1.0)
            axes.plot(value, y, marker, color=color, markersize=4, markerfacecolor=face)
        if not row["runs"]:
            axes.text(1.3 * row["margin"], y, "never found here", va="center", color=style.GREY)
        if row["hands"]:
            printed = "" if row["published_runs"] is None else f"; {row['published_runs']:.0f}"
            names.append(f"↳ {row['hands']} ({row['runs']}/{row['of_runs']}{printed})")
        else:
            star = "*" if row["pooled"] else ""
            names.append(f"{marked[row['task']]}, {name_of(row['method'])}{star}")
    axes.axvline(0, color=style.INK, linewidth=0.6)
    style.name_rows(axes, names)
    axes.spines["left"].set_visible(False)
    # The widest interval need not hide the others: symmetric about zero at least to margins.
    reach = np.nanmax(np.abs(data[["low", "high", "difference", "margin"]].to_numpy(float)))
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    axes.set_xlabel("ours − published (ticks)")
