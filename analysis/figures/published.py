"""Published against ours, every cell and hand sequence that the paper prints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.figures.plot import Plot
from analysis.figures.selection import CONDITIONS, has, known_tasks, missing, solved
from analysis.figures.style import (
    BLUE,
    GREY,
    INK,
    ONE,
    PAPER,
    SMALL,
    VERMILLION,
    dagger,
    percent,
    styled,
)
from analysis.methods import LEARNER, short_name
from analysis.published import TRIALS, Summary, published_cell
from analysis.statistics.equivalence import MARGIN, difference
from analysis.statistics.estimates import CONFIDENCE

if TYPE_CHECKING:
    from analysis.study import Study

_MARKS = {
    "equivalent": (BLUE, "o", BLUE),
    "undecided": (INK, "s", PAPER),
    "different": (VERMILLION, "D", VERMILLION),
}


@styled
def published(
    study: Study, *, methods: Sequence[str] | None = None, tasks: Sequence[str] | None = None
) -> Plot:
    """Difference of every mean reward to the printed one, with interval and margin.

    Cells with the paper's number of trials, by default of its conditions; where it reports
    hand sequences, those too. Raises CoarticError where the folder has none of the paper's cells.
    """
    found, labels = known_tasks(study, tasks), methods or CONDITIONS
    rows = [
        row
        for name in found
        for label in labels
        if has(study, name, label)
        for row in _rows(study, name, label)
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
    _draw(axes, data, {name: task.reconstructed != () for name, task in found.items()})
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


def _rows(study: Study, task: str, label: str) -> list[dict[str, Any]]:
    paper = published_cell(task, label.removeprefix(LEARNER))
    good = solved(study, task, label).good
    if paper is None or not bool((good.trials == TRIALS).all()):
        return []
    rows = []
    if paper.summary is not None:
        rows.append(_row(task, label, "", good, len(good), paper.summary, paper.summary.runs))
    if len(paper.sequences) > 1:
        for sequence in paper.sequences:
            if sequence.summary is not None:
                own = good[good.hands == sequence.hands]
                rows.append(
                    _row(
                        task, label, sequence.hands, own, len(good), sequence.summary,
                        sequence.runs,
                    )
                )  # fmt: skip
    return rows


def _row(
    task: str, label: str, hands: str, runs: pd.DataFrame, of: int, paper: Summary,
    paper_runs: int | None,
) -> dict[str, Any]:  # fmt: skip
    rewards = runs.reward.to_numpy(dtype=np.float64)
    row: dict[str, Any] = {
        "task": task,
        "method": label,
        "hands": hands,
        "runs": len(rewards),
        "of_runs": of,
        "reward": float(rewards.mean()) if len(rewards) else math.nan,
        "published": paper.mean,
        "published_sd": math.nan if paper.sd is None else paper.sd,
        "published_runs": paper_runs,
        "pooled": paper.derived,
        "margin": MARGIN * abs(paper.mean),
    }
    if not len(rewards):
        return row | dict.fromkeys(("difference", "low", "high"), math.nan) | {"verdict": ""}
    found = difference(rewards, paper)
    verdict = "" if math.isnan(found.low) else found.verdict
    return row | {
        "difference": found.estimate,
        "low": found.low,
        "high": found.high,
        "verdict": verdict,
    }


def _draw(axes: Axes, data: pd.DataFrame, reconstructed: dict[str, bool]) -> None:
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
            axes.text(
                1.3 * row["margin"], y, "never found here", va="center", fontsize=SMALL, color=GREY
            )
        if row["hands"]:
            printed = "" if row["published_runs"] is None else f"; {row['published_runs']:.0f}"
            names.append(f"↳ {row['hands']} ({row['runs']}/{row['of_runs']}{printed})")
        else:
            dagger_ = " †" if reconstructed[row["task"]] else ""
            star = "*" if row["pooled"] else ""
            names.append(f"{row['task']}{dagger_}, {short_name(row['method'])}{star}")
    axes.axvline(0, color=INK, linewidth=0.6)
    axes.set_yticks([-place for place in range(len(data))], names)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.set_ylim(-len(data) + 0.4, 0.6)
    # The widest interval need not hide the others: symmetric about zero at least to margins.
    reach = np.nanmax(np.abs(data[["low", "high", "difference", "margin"]].to_numpy(float)))
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    axes.set_xlabel("ours − published (ticks; right: ours higher)", fontsize=SMALL)
