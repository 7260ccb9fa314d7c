"""Sections on learned rewards and hands, compared with the published rewards and hands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure
from coartic.analysis.methods import CONDITION_OF, LEARNERS, title_of
from coartic.analysis.published import RUNS, published_alone, published_cell
from coartic.analysis.statistics.hypotheses import (
    MARGIN,
    difference_to_published,
    equivalence,
    spread_test,
)
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Rows, runs_of, table
from coartic.analysis.words import interval, listed, marked
from coartic.estimates import standard_deviation
from coartic.learner.learning import TRIALS

_MARKS = {
    "equivalent": (style.BLUE, "o", style.BLUE),
    "undecided": (style.INK, "s", style.BACKGROUND),
    "different": (style.VERMILLION, "D", style.VERMILLION),
    "": (style.INK, "x", style.INK),
}


@cached
def published_and_ours(study: Study) -> list[dict[str, Any]]:
    """Every cell that the paper has too, in the order of the plan, and its hand sequences.

    Sequences follow their cell where the paper or our runs tell several apart: those that the paper
    publishes come first, then ours by their number of runs. A row has ``cell``, ``hands`` (empty
    for the whole cell), ``published`` and its ``published_sd``, ``published_runs`` (of hands 0 only
    where all others are published), ``pooled`` (whether the published mean is one over several hand
    sequences), ``several`` (whether the paper has them) and the ``margin`` of equivalence,
    ``ours``, ``ours_sd`` and ``runs`` of our runs with a solution, ``of_runs`` of the cell. Where
    both are there, it has ``difference[]``, ours less published, and a ``verdict`` if our runs have
    as many trials as the paper's.
    """
    rows = []
    for cell in study.cells.values():
        condition, hands = CONDITION_OF.get(cell.label, ""), cell.good.hands
        published = published_cell(cell.task, condition)
        if published is None:
            continue
        complete = sum(each.published_runs or 0 for of, each in published.items() if of) == RUNS
        several = len(published) > 1 or len(set(hands)) > 1
        ours = map(str, hands.value_counts().index) if several else ()
        for name in dict.fromkeys(["", *published, *ours]):
            rewards = cell.rewards[(hands == name).to_numpy(bool)] if name else cell.rewards
            summary = published.get(name)
            row: dict[str, Any] = {
                "cell": cell,
                "task": marked(study.tasks[cell.task]),
                "condition": condition,
                "hands": name,
                "published": summary.mean if summary else None,
                "published_sd": summary.sd if summary else None,
                "published_runs": summary.published_runs if summary else 0 if complete else None,
                "pooled": summary.derived if summary else False,
                "several": len(published) > 2,  # with that of the whole cell
                "margin": MARGIN * abs(summary.mean) if summary else None,
                "ours": rewards.mean() if len(rewards) else math.nan,
                "ours_sd": standard_deviation(rewards),
                "runs": len(rewards),
                "of_runs": len(cell.good),
                "verdict": None,
            }
            if summary and len(rewards):
                difference = difference_to_published(
                    rewards, summary.mean, summary.sd, summary.runs
                )
                row |= difference.columns("difference")
                if summary.sd is not None and not summary.derived:
                    for column, of_mean in (("p_sd", False), ("p_se", True)):
                        row[column] = spread_test(
                            rewards, summary.sd, summary.runs, of_mean=of_mean
                        )
                if (cell.good.trials == TRIALS).all():
                    row["verdict"] = equivalence(difference, row["margin"])
            rows.append(row)
    return rows


@table(
    "task; condition; published± .1; ours± .1; runs; difference[] .1; margin .1; verdict; "
    "p_sd: p of the spread .p; p_se: -; published_initial: -; ours_initial: -"
)
def list_published(study: Study) -> Rows:
    """List published and our learned rewards of the paper's cells, and their equivalence."""
    for row in published_and_ours(study):
        cell = row["cell"]
        if not row["hands"]:
            published = published_alone(cell.task, "initial hands")
            initial = {
                "published_initial": published and published.mean,
                "ours_initial": cell.good.initial_reward.dropna().mean(),
            }
            yield f"{cell.task} {row['condition']}", row | initial | runs_of(cell)


@table(
    "task; condition; hands; published_runs; runs: our runs; of_runs: of our runs; "
    "published± .1; ours± .1; difference[] .1; p_sd: p of the spread .p; p_se: -"
)
def list_hands(study: Study) -> Rows:
    """List learned rewards by hand sequence, published and ours, for cells with several."""
    for row in published_and_ours(study):
        good = row["cell"].good
        if row["hands"]:
            ids = " ".join(map(str, good.run_id[good.hands == row["hands"]]))
            name = f"{row['cell'].task} {row['condition']} {row['hands']}"
            yield name, row | {"run_ids": ids}


@figure(
    "Published and ours",
    f"Our mean learned reward minus the published one, with its {style.COVERAGE} interval. Grey: "
    f"margin of equivalence, ±{100 * MARGIN:.0f} % of the published reward. Filled circles: the "
    "interval lies within the margin (equivalent). Open squares: it crosses the margin "
    "(undecided). Diamonds: it lies outside (different). ↳: runs with one hand sequence; in "
    "brackets, how many of our runs have it, then how many of the published ones. * pooled from "
    "several published sequences.",
)
def draw_published(study: Study) -> Parts | None:
    """Draw the differences of mean rewards to published rewards, with intervals and margins."""
    shown = []
    for pair in published_and_ours(study):
        cell = pair["cell"]
        comparable = len(cell.good) and (cell.good.trials == TRIALS).all()
        if comparable and pair["published"] is not None and (pair["several"] or not pair["hands"]):
            shown.append(pair | {"task": cell.task, "method": cell.label})
    if not shown:
        return None
    order = list(study.tasks)
    shown.sort(key=lambda row: (order.index(row["task"]), LEARNERS.index(row["method"])))
    data = pd.DataFrame(shown)
    drawing, (axes,) = style.panels((1, 1), (style.ONE, 0.85 + 0.185 * len(data)))
    tasks = {name: task for name, task in study.tasks.items() if (data.task == name).any()}
    names, words = [], []
    for place, row in enumerate(data.to_dict("records")):
        published, margin, y = row["published_runs"], row["margin"], -place
        name = f"{marked(tasks[row['task']])}, {title_of(row['method'])}{'*' * row['pooled']}"
        if row["hands"]:
            of_published = (
                "" if published is None or math.isnan(published) else f"; {published:.0f}"
            )
            name = f"↳ {row['hands']} ({row['runs']}/{row['of_runs']}{of_published})"
        names.append(name)
        axes.barh(y, 2 * margin, 0.8, left=-margin, color=style.GREY, alpha=0.2)
        if not row["runs"]:
            axes.text(1.3 * margin, y, "never found here", va="center", color=style.GREY)
            continue
        color, marker, face = _MARKS[row["verdict"] if row["runs"] > 1 else ""]
        if not math.isnan(row["difference_low"]):
            axes.plot([row["difference_low"], row["difference_high"]], [y, y], color=color, lw=1.0)
        axes.plot(row["difference"], y, marker, color=color, markersize=4, markerfacecolor=face)
        who = f"{row['task']}, {title_of(row['method'])} {row['hands']}".strip()
        words.append(f"{who}: {row['difference']:+.1f}")
    axes.axvline(0, color=style.INK, linewidth=0.6)
    style.name_rows(axes, names)
    axes.spines["left"].set_visible(False)
    # Symmetric about zero: wide enough for every interval and margin.
    ends = ["difference", "difference_low", "difference_high", "margin"]
    reach = np.nanmax(np.abs(data.reindex(columns=ends).to_numpy(float)))
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    axes.set_xlabel("reward, ours − published")
    alt = "Differences of our mean rewards to the published ones, with intervals. "
    return drawing, data, f"{alt}{'; '.join(words)}.", tasks.values()


def rewards_reproduced(study: Study) -> str:
    """Say how many of our rewards agree with published rewards, and which undecided ones differ."""
    rows = [row for row in published_and_ours(study) if not row["hands"] and row["verdict"]]
    if not rows:
        return ""
    verdicts = [row["verdict"] for row in rows]
    agree, undecided, differ = map(verdicts.count, ("equivalent", "undecided", "different"))
    text = (
        f"Of the {len(rows)} learned rewards that the paper publishes, ours agree with {agree} "
        f"within 1 %; {differ or 'none'} {'differ' if differ > 1 else 'differs'} by more, "
        f"{undecided or 'none'} {'are' if undecided > 1 else 'is'} undecided.\n"
    )
    for row in rows:
        sure = row["difference_low"] > 0 or row["difference_high"] < 0
        if row["verdict"] == "undecided" and sure:
            text += (
                f"{row['condition']} on {row['task']} is "
                f"{interval(row, 'difference')} ticks from the published mean: its interval "
                "leaves out 0, not corrected for the number of rewards. "
            )
    return text


def changed_hands(study: Study) -> str:
    """Say on which tasks the learner's best condition ends with other than its initial hands."""
    changes = []
    for name, task in study.tasks.items():
        learners = [study.cells.get((name, label)) for label in LEARNERS]
        solved = [cell for cell in learners if cell is not None and len(cell.good)]
        best = max(solved, key=lambda cell: cell.rewards.mean(), default=None)
        if best is not None and (good := best.good).initial_hands.notna().any():
            before, commonest = good.initial_hands.dropna().iloc[0], list(good.hands.mode())
            if before not in commonest:
                changes.append(f"on {marked(task)} from {before} to {' or '.join(commonest)}")
    if not changes:
        return "The learner most often keeps the initial hands."
    return f"The learner most often changes hands {listed(changes)}."
