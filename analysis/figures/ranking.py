"""Who wins: how far every method ends from the optimum, grouped by what it is told."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.comparisons.methods import INFORMED, UNTOLD, informed
from coartic.analysis.comparisons.overall import variant
from coartic.analysis.comparisons.reached import ALL_TASKS
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.figures.price import look_of
from coartic.analysis.figures.selection import missing
from coartic.analysis.methods import LEARNER, TOGETHER, family_of, short_name
from coartic.analysis.statistics.estimates import mean
from coartic.analysis.study import Study
from coartic.record import SEARCH

GROUPS = (*reversed(INFORMED.values()), UNTOLD)
"""What methods know of the reward: those that learn, those that compute it, those that do not."""


class Standing(NamedTuple):
    """How far a method ends from the optimum on a task, or over all; gaps in per cent of it."""

    task: str
    method: str
    """Label."""
    told: str
    """One of :data:`GROUPS`."""
    family: str
    gap: float
    low: float
    high: float
    """Ends of the 95 % interval, NaN where there is none."""
    runs: int
    failed: int


def standings(study: Study) -> pd.DataFrame:
    """Rows as :class:`Standing`, nearest first: over all tasks, then task by task.

    Of methods with a solution to every run and a known optimum; the optimum's searches and
    variants are left out.
    """
    rows = [*_over_all(study), *_by_task(study)]
    frame = pd.DataFrame(rows, columns=Standing._fields)
    place = {name: k for k, name in enumerate((ALL_TASKS, *study.tasks))}
    return frame.sort_values(
        ["task", "gap"],
        key=lambda column: column.map(place) if column.name == "task" else column,
        kind="stable",
        ignore_index=True,
    )


def _over_all(study: Study) -> Iterator[Standing]:
    labels = study.scores.drop_duplicates("method").set_index("method")[["task", "label"]]
    for _, row in study.overall.iterrows():
        method = str(row.method)
        if variant(method) or pd.isna(row.gap):
            continue
        told = informed(
            study.method_rows[str(labels.task[method]), str(labels.label[method])].told
        )
        gap, low, high = (100 * float(row[name]) for name in ("gap", "gap_low", "gap_high"))
        named = ALL_TASKS, method, told, family_of(method)
        yield Standing(*named, gap, low, high, int(row.runs), int(row.failed))


def _by_task(study: Study) -> Iterator[Standing]:
    for (task, label), row in study.method_rows.items():
        best = study.optima.get((task, "free"))
        if best is None or not best.reward or pd.isna(row.gap) or row.solved < row.runs:
            continue
        if variant(label) or label.startswith(SEARCH):
            continue
        found = mean(study.cells[task, label].rewards)
        # The higher the reward, the smaller the gap.
        ends = (found.estimate, found.high, found.low)
        gap, low, high = (100 * (best.reward - value) / -best.reward for value in ends)
        named = task, label, informed(row.told), family_of(label)
        yield Standing(*named, gap, low, high, row.runs, row.runs - row.solved)


@style.styled
def ranking(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Gap to the optimum of every method over all tasks, or on the one that there is.

    Raises CoarticError where no optimum is known.
    """
    data = standings(study)
    if methods is not None:
        data = data[data.method.isin(methods)]
    if not len(data):
        raise missing(study, "no method with a solution to every run and a known optimum")
    shown = data[data.task == data.task.iloc[0]]
    groups = [(told, shown[shown.told == told]) for told in GROUPS if (shown.told == told).any()]
    rows = len(shown) + len(groups)
    size, heights = (style.TWO, 0.5 + 0.145 * rows), [len(own) + 0.8 for _, own in groups]
    figure, panels = style.figure_of((len(groups), 1), size, sharex=True, height_ratios=heights)
    for axes, (told, own) in zip(panels, groups, strict=True):
        _panel(axes, told, own)
    last = panels[-1]
    last.set_xlim(-0.02 * shown.gap.max(), 1.05 * shown[["gap", "high"]].max(axis=None))
    last.set_xlabel("gap to the optimum (%), nearer 0 is better")
    over = "mean over all tasks" if shown.task.iloc[0] == ALL_TASKS else f"on {shown.task.iloc[0]}"
    return worded(
        "ranking",
        figure,
        data,
        study.tasks.values(),
        over=over,
        gaps=spoken(shown, "{method} {gap:.1f} %"),
    )


def _panel(axes: Axes, told: str, own: pd.DataFrame) -> None:
    axes.set_title(told)
    for place, values in enumerate(own.itertuples(index=False, name=None)):
        row = Standing(*values)
        color = look_of(row.method).color
        mark: Any = {"color": color, "clip_on": False, "markersize": 3.5}
        end = row.gap
        if not math.isnan(row.low):
            end = max(row.gap, row.high)
            axes.plot([row.low, row.high], [-place, -place], color=color, linewidth=1.4)
        axes.plot(row.gap, -place, "D" if learner(row.method) else "o", **mark)
        of: Any = {"textcoords": "offset points", "va": "center"}
        axes.annotate(f"{row.gap:.1f}", (end, -place), (5, 0), **of)
    style.name_rows(axes, [short_name(method) for method in own.method])
    for name, method in zip(axes.get_yticklabels(), own.method, strict=True):
        if learner(method):
            name.set_fontweight("bold")
    axes.axvline(0, **style.OPTIMUM)


def learner(label: str) -> bool:
    """Whether it is the paper's learner under its own conditions."""
    return label.startswith((LEARNER, TOGETHER)) and not variant(label)
