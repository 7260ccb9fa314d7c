"""Which hands are chosen: sequences of ours, and of the paper's runs."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure
from coartic.analysis.methods import main_methods, name_of
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.table import Rows, table
from coartic.analysis.topics.published import RUNS
from coartic.analysis.topics.rewards import beside_paper, published_of, task_and_condition
from coartic.analysis.topics.scores import best_condition
from coartic.analysis.words import listed, marked

COLOURED = len(style.PALETTE)
"""Sequences of a task that have a colour; the rarer ones share grey."""
_EDGE: Any = {"edgecolor": style.INK, "linewidth": 0.4}


@table("task, condition, hands, published_runs, runs, of_runs, published±, ours±, difference[]")
def list_hands(study: Study) -> Rows:
    """Learned rewards by hand sequence, published and ours, where there are several."""
    for row in beside_paper(study):
        cell, name = row["cell"], task_and_condition(study, row["cell"])
        if row["hands"]:
            ids = cell.good.run_id[cell.good.hands == row["hands"]]
            behind = {"run_ids": " ".join(map(str, ids))}
            yield f"{cell.task} {name['condition']} {row['hands']}", row | name | behind


@cached
def hand_shares(study: Study) -> pd.DataFrame:
    """Shares of hand sequences on tasks with two hands, of every cell with a solved run.

    Columns ``task``, ``method``, ``source`` (``ours``, or ``published`` where the paper prints the
    runs of every sequence), ``hands``, ``runs``, ``share``; the commonest sequence first.
    """
    rows: list[tuple[str, str, str, str, int]] = []
    for (task, label), cell in study.cells.items():
        if len(study.tasks[task].hands) > 1 and len(cell.good):
            counts = cell.good.hands.value_counts()
            rows += [(task, label, "ours", str(name), int(n)) for name, n in counts.items()]
            paper = published_of(cell)
            printed = paper.sequences if paper else {}
            if sum(summary.printed_runs or 0 for summary in printed.values()) == RUNS:
                rows += [
                    (task, label, "published", name, summary.runs)
                    for name, summary in printed.items()
                    if summary.printed_runs
                ]
    frame = pd.DataFrame(rows, columns=["task", "method", "source", "hands", "runs"])
    totals = frame.groupby(["task", "method", "source"]).runs.transform("sum")
    return frame.assign(share=frame.runs / totals)


@figure(
    "Hand sequences",
    "Share of runs by hand sequence (L left, R right, goal by goal); numbers are runs. Hatched: "
    "published. Rare sequences are grey.",
)
def draw_recruitment(study: Study) -> Parts | None:
    """Shares of hand sequences of each main method, one panel for each task with two hands."""
    data = hand_shares(study)
    data = data[data.task.isin(one_by_one(study)) & data.method.isin(main_methods(data.method))]
    if not len(data):
        return None
    # Methods stand in one order on all tasks.
    order_of = {label: place for place, label in enumerate(main_methods(data.method))}
    data = data.sort_values(
        "method", key=lambda labels: labels.map(order_of), kind="stable", ignore_index=True
    )
    tasks = [task for name, task in study.tasks.items() if (data.task == name).any()]
    shares = data[data.source == "ours"].groupby("hands").share.sum()
    common = shares.sort_values(ascending=False, kind="stable").index
    # Sequences to be compared with published ones have a colour.
    order = list(dict.fromkeys([*data[data.source == "published"].hands, *common]))
    colors = dict(zip(order[:COLOURED], style.PALETTE, strict=False))
    shape = style.grid(len(tasks), 2)
    bars = data.drop_duplicates(["task", "method", "source"]).task.value_counts().max()
    size = style.TWO, (0.8 + 0.17 * bars) * shape[0]
    drawing, panels = style.panels(shape, size, len(tasks))
    for axes, task in zip(panels, tasks, strict=True):
        draw_bars(axes, task, data[data.task == task.name], order, colors)
    style.letters(panels)
    colors |= {"others": style.GREY} if len(order) > COLOURED else {}
    handles = [Patch(facecolor=color, label=hands, **_EDGE) for hands, color in colors.items()]
    style.legend(drawing, handles, len(handles), handlelength=1.0, columnspacing=1.2)
    alt = "; ".join(
        f"{task}, {name_of(str(label))}{'' if source == 'ours' else ', published'}: "
        + ", ".join(f"{row.hands} {row.share:.0%}" for row in rows.itertuples())
        for (task, label, source), rows in data.groupby(["task", "method", "source"], sort=False)
    )
    return drawing, data, f"Stacked bars of hand sequences. {alt}.", tasks


def draw_bars(
    axes: Axes, task: Task, data: pd.DataFrame, order: list[str], colors: dict[str, str]
) -> None:
    """A bar for each method, and below it the published one."""
    names = []
    groups = data.groupby(["method", "source"], sort=False)
    for place, ((label, source), rows) in enumerate(groups):
        ours, left = source == "ours", 0.0
        names.append(name_of(str(label)) if ours else "published")
        for row in sorted(rows.to_dict("records"), key=lambda row: order.index(row["hands"])):
            color, share = colors.get(row["hands"], style.GREY), row["share"]
            hatch = "" if ours else "//////"
            axes.barh(-place, share, 0.78, left=left, color=color, hatch=hatch, **_EDGE)
            if share >= 0.08 and ours:
                middle = left + share / 2, -place, str(row["runs"])
                axes.text(*middle, ha="center", va="center", fontsize=7, color=style.on(color))
            left += share
    style.name_rows(axes, names)
    axes.set_ylim(-len(names) + 0.5, 0.5)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.5, 1], ["0", "50", "100 %"])
    axes.set_xlabel("share of runs")
    axes.spines["left"].set_visible(False)
    axes.set_title(marked(task))


def changed_hands(study: Study) -> str:
    """On which tasks the learner's best condition ends with other hands than it began with."""
    changes = []
    for name, task in study.tasks.items():
        label = best_condition(study, name)
        good = study.cells[name, label].good if label else None
        if good is not None and good.initial_hands.notna().any():
            before, commonest = good.initial_hands.dropna().iloc[0], list(good.hands.mode())
            if before not in commonest:
                changes.append(f"on {marked(task)} from {before} to {' or '.join(commonest)}")
    if not changes:
        return "The learner keeps the hands of the initial solution."
    return f"The learner changes hands {listed(changes)}."
