"""Published against ours, every cell and hand sequence that the paper prints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.comparisons.paper import PaperRow, SequenceRow, paper_rows, sequence_rows
from analysis.figures.plot import Plot
from analysis.figures.selection import CONDITIONS, missing
from analysis.figures.style import (
    BLUE,
    GREY,
    INK,
    ONE,
    PAPER,
    VERMILLION,
    dagger,
    name_rows,
    percent,
    styled,
)
from analysis.methods import short_name
from analysis.published import TRIALS, Summary
from analysis.statistics.equivalence import MARGIN, Equivalence
from analysis.statistics.estimates import CONFIDENCE
from coartic.robot import Array

if TYPE_CHECKING:
    from analysis.study import Study

_MARKS = {
    "equivalent": (BLUE, "o", BLUE),
    "undecided": (INK, "s", PAPER),
    "different": (VERMILLION, "D", VERMILLION),
}


@styled
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
        row
        for place in places
        if place in whole and len(whole[place].rewards)
        for row in _rows(whole[place], sequences)
    ]
    if not rows:
        raise missing(
            study,
            f"no solved runs with {TRIALS} trials of {', '.join(labels)} on a task that the "
            "paper prints a reward of",
        )
    data = pd.DataFrame(rows)
    figure = Figure(figsize=(ONE, 0.85 + 0.185 * len(data)), layout="constrained")
    axes = figure.subplots()
    _draw(axes, data, {name: name + " †" * bool(own.reconstructed) for name, own in found.items()})
    shown = {name: found[name] for name in data.task.unique()}
    words = "; ".join(
        f"{row['task']}, {short_name(row['method'])} {row['hands']}".strip()
        + f": {row['difference']:+.1f}"
        for row in rows
        if row["runs"]
    )
    return Plot(
        id="published",
        title="Published and ours",
        caption=(
            "Our mean learned reward less the published one, with its "
            f"{percent(CONFIDENCE)} interval (Welch, from the printed mean, SD and runs; Student "
            f"where no SD is printed). Grey: margin of equivalence, ±{percent(MARGIN)} of the "
            "published reward. Filled circles: interval within the margin (equivalent); open "
            "squares: it crosses it (undecided); diamonds: outside (different); crosses: no "
            "verdict. ↳: runs with one hand sequence, number of our runs of all our runs in "
            "brackets, then the published one; means pooled from several printed sequences are "
            "marked *."
            f"{dagger(shown.values())}"
        ),
        alt=f"Differences of mean reward to the published ones, with intervals. {words}.",
        figure=figure,
        data=data,
    )


def _rows(whole: PaperRow, sequences: Sequence[SequenceRow]) -> list[dict[str, Any]]:
    """A cell, then each hand sequence that the paper prints a reward of, where it tells them."""
    paper, rows = whole.paper, []
    if paper.summary is not None:
        rows.append(
            _row(whole, "", paper.summary, paper.summary.runs, whole.rewards, whole.difference)
        )
    for own in sequences:
        if own.cell is whole.cell and own.published is not None and len(paper.sequences) > 1:
            found = own.rewards, own.difference
            rows.append(_row(whole, own.hands, own.published, own.published_runs, *found))
    return rows


def _row(
    whole: PaperRow,
    hands: str,
    paper: Summary,
    paper_runs: int | None,
    rewards: Array,
    found: Equivalence | None,
) -> dict[str, Any]:
    return {
        "task": whole.cell.task,
        "method": whole.cell.label,
        "hands": hands,
        "runs": len(rewards),
        "of_runs": len(whole.rewards),
        "reward": float(rewards.mean()) if len(rewards) else math.nan,
        "published": paper.mean,
        "published_sd": math.nan if paper.sd is None else paper.sd,
        "published_runs": paper_runs,
        "pooled": paper.derived,
        "margin": MARGIN * abs(paper.mean),
        "difference": found.estimate if found else math.nan,
        "low": found.low if found else math.nan,
        "high": found.high if found else math.nan,
        "verdict": found.verdict if found and not math.isnan(found.low) else "",
    }


def _draw(axes: Axes, data: pd.DataFrame, marked: dict[str, str]) -> None:
    names = []
    for place, row in enumerate(data.to_dict("records")):
        y = -place
        axes.barh(y, 2 * row["margin"], 0.8, left=-row["margin"], color=GREY, alpha=0.3)
        value = row["difference"]
        color, marker, face = _MARKS.get(row["verdict"], (INK, "x", INK))
        if not math.isnan(value):
            if not math.isnan(row["low"]):
                axes.plot([row["low"], row["high"]], [y, y], color=color, linewidth=1.0)
            axes.plot(value, y, marker, color=color, markersize=4, markerfacecolor=face)
        if not row["runs"]:
            axes.text(1.3 * row["margin"], y, "never found here", va="center", color=GREY)
        if row["hands"]:
            printed = "" if row["published_runs"] is None else f"; {row['published_runs']:.0f}"
            names.append(f"↳ {row['hands']} ({row['runs']}/{row['of_runs']}{printed})")
        else:
            star = "*" if row["pooled"] else ""
            names.append(f"{marked[row['task']]}, {short_name(row['method'])}{star}")
    axes.axvline(0, color=INK, linewidth=0.6)
    name_rows(axes, names)
    axes.spines["left"].set_visible(False)
    axes.set_ylim(-len(data) + 0.4, 0.6)
    # The widest interval need not hide the others: symmetric about zero at least to margins.
    reach = np.nanmax(np.abs(data[["low", "high", "difference", "margin"]].to_numpy(float)))
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    axes.set_xlabel("ours − published (ticks; right: ours higher)")
