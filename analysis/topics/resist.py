"""Whether goals whose posture resists their neighbours also impose theirs: slopes between goals."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import EC1, INITIAL, LEARNER, in_order, name_of
from coartic.analysis.section import Section
from coartic.analysis.signatures.locus import moved_goals
from coartic.analysis.statistics.correlations import rank_correlation
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import random_tasks
from coartic.analysis.words import interval_in_words
from coartic.robot import Array
from coartic.tasks.task import address_of

JUDGED = (
    EC1,
    "trajectory-optimisation/path-length",
    INITIAL,
    "nullspace-qp/none",
    "nullspace-qp/next-goal",
)
"""Methods of the claims: the learner, the planner of the shortest path, and reactive control."""
SHUFFLES = 999
"""Orders of the slopes of a task by which chance is estimated."""
FEWEST_GOALS = 5
"""Goals of a task: three inner ones are the fewest that are ranked."""


def correlations(carried: Array, ahead: Array) -> Array:
    """Rank correlation of resistance and aggression over the inner goals, of slopes
    (:func:`slopes_of`) of shape ``(..., G - 1)``."""
    return rank_correlation(*resistance_and_aggression(carried, ahead))


def correlation_by_chance(carried: Array, ahead: Array) -> float:
    """Mean of that of a task's slopes in :data:`SHUFFLES` orders, each direction by itself."""
    rng = np.random.default_rng(SEED)
    shuffled = [rng.permuted(np.tile(each, (SHUFFLES, 1)), axis=1) for each in (carried, ahead)]
    return random_tasks.mean_or_nan(correlations(*shuffled))


def resistance_and_aggression(carried: Array, ahead: Array) -> tuple[Array, Array]:
    """Of each inner goal, ``(..., G - 2)``: minus the mean slope of its posture on its neighbours'
    places, and the mean slope of its neighbours' postures on its own."""
    return -(carried[..., :-1] + ahead[..., 1:]) / 2, (carried[..., 1:] + ahead[..., :-1]) / 2


def slope_size(postures: Array, places: Array) -> Array:
    """Sizes of the regression of postures ``(n, G, dof)`` on places ``(n, 2)`` of a goal, ``(G,)``.

    By least squares: at each goal the root of the sum of squared slopes over joints and both
    coordinates, length unit and rad mixed, per length unit.
    """
    weights = np.linalg.pinv(places - places.mean(axis=0))
    return np.asarray(np.sqrt((np.tensordot(weights, postures, axes=1) ** 2).sum(axis=(0, 2))))


@cached
def resist_values(study: Study) -> pd.DataFrame:
    """Resistance against aggression of every method on each task all of whose goals were moved.

    Columns ``task`` (the one whose goals are moved), ``label``, ``links``, ``base``; ``carried``
    and ``ahead``: mean slopes; ``rho``, over inner goals; ``chance``: its mean where the slopes are
    in any order; ``beyond``, what it is above that; ``cells``.
    """
    moved: dict[str, dict[int, dict[str, Array]]] = {}
    for each in moved_goals(study.tasks):
        base = next(iter(each.positions)).partition(".")[0]
        places = {name: np.array(study.tasks[name].goals[each.goal - 1]) for name in each.positions}
        moved.setdefault(base, {})[each.goal] = places
    rows: list[Row] = []
    for base, by_goal in moved.items():
        task = study.tasks[next(iter(by_goal[min(by_goal)]))]
        if len(by_goal) < max(FEWEST_GOALS, len(task.goals)):
            continue
        names = [name for places in by_goal.values() for name in places]
        labels = [label for name, label in study.cells if name == names[0]]
        for label in labels:
            cells = [study.cells[name, label] for name in names if (name, label) in study.cells]
            if len(cells) == len(names) and all(len(cell.good) for cell in cells):
                carried, ahead = slopes_of(study, label, by_goal)
                rho = float(correlations(carried, ahead))
                chance = correlation_by_chance(carried, ahead)
                rows.append(
                    {
                        "task": base,
                        "label": label,
                        "links": len(task.robot.right_links),
                        "base": "locked" if task.locked_base else "free",
                        "carried": carried.mean(),
                        "ahead": ahead.mean(),
                        "rho": rho,
                        "chance": chance,
                        "beyond": rho - chance,
                        "cells": cells,
                    }
                )
    columns = ["task", "label", "links", "base", "carried", "ahead", "rho", "chance", "beyond"]
    return pd.DataFrame(rows, columns=[*columns, "cells"])


def slopes_of(
    study: Study, label: str, by_goal: dict[int, dict[str, Array]]
) -> tuple[Array, Array]:
    """How far postures of a method follow neighbouring goals, per length unit, each ``(G - 1,)``.

    Of the posture at goals 2 to G on the place of the goal before, and of that at goals 1 to G - 1
    on the place of the next goal; of the learner by its noiseless replays.
    """
    replayed = label.startswith(LEARNER)
    sizes = []
    for _, places in sorted(by_goal.items()):
        means = [study.postures(name, label, replay=replayed).mean(axis=0) for name in places]
        sizes.append(slope_size(np.array(means), np.array(list(places.values()))))
    by_place = np.array(sizes).T  # posture at the goal of the row, place of the goal of the column
    return np.diagonal(by_place, -1).copy(), np.diagonal(by_place, 1).copy()


@table("group, method, tasks, carried[], ahead[], rho[], chance, beyond[]")
def resist(study: Study) -> Rows:
    """Whether goals that resist also impose: means over tasks of correlations over inner goals."""
    frame = resist_values(study)
    groups = [("all", frame)]
    groups += [(f"{links} links", part) for links, part in frame.groupby("links")]
    groups += [(f"base {base}", part) for base, part in frame.groupby("base")]
    for group, part in groups:
        for label in in_order(list(dict.fromkeys(part.label))):
            rows = part[part.label == label]
            row: Row = {"group": group, "method": label, "tasks": len(rows)}
            for name in ("carried", "ahead", "rho", "beyond"):
                row |= random_tasks.mean_of(name, rows[name])
            row["chance"] = rows.chance.mean()
            cells: list[CellRuns] = [cell for every in rows.cells for cell in every]
            yield f"{group} {label}", row | runs_of(*cells)


@figure(
    "resist",
    "Do goals whose posture resists also impose theirs?",
    "Rank correlation over the inner goals of a task between resistance (how little the posture "
    "follows a neighbouring goal that moves) and aggression (how much the neighbours' postures "
    f"follow this goal), beyond chance: mean over random tasks with its {style.COVERAGE} "
    "interval. Of tongues it is highly positive. a: all tasks, b: by the number of links.",
)
def draw_resist(study: Study) -> Parts:
    """Correlations beyond chance by method, and by links."""
    data = resist(study)
    if not len(data):
        raise missing(study, "no runs on tasks each of whose goals is moved")
    drawing, panels = style.panels((1, 2), (style.TWO, 2.8), sharey=True)
    labels = list(data.method[data.group == "all"])
    colors = dict(zip(labels, itertools.cycle(style.PALETTE), strict=False))
    sizes = [group for group in dict.fromkeys(data.group) if group.endswith("links")]
    for axes, groups in zip(panels, (["all"], sizes), strict=True):
        for number, label in enumerate(labels):
            rows = data[(data.method == label) & data.group.isin(groups)].set_index("group")
            places = [groups.index(g) + 0.11 * (number - len(labels) / 2) for g in rows.index]
            dots: Any = {"color": colors[label], "linestyle": "", "markersize": 4, "bars": None}
            style.means_at(axes, places, rows, "beyond", **dots, label=name_of(label))
        axes.axhline(0, color=style.GREY, linewidth=0.8)
        axes.set_xlim(-0.5, len(groups) - 0.5)
        axes.set_xticks(range(len(groups)), [group.replace("all", "all tasks") for group in groups])
    panels[0].set_ylabel("correlation beyond chance")
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 3)
    rows = data[data.group == "all"].itertuples()
    each = (f"{name_of(str(row.method))}: {row.beyond:.2f}" for row in rows)
    return drawing, data, f"Correlation of resistance and aggression. {'; '.join(each)}.", ()


def finding_of_resist(study: Study) -> str:
    """The correlation of the learner, or of the first method, beyond chance."""
    data = resist(study)
    rows = data[data.group == "all"].to_dict("records")
    parts = [
        f"{name_of(row['method'])} {interval_in_words(row, 'beyond', digits=2)}" for row in rows
    ]
    if not parts:
        return ""
    return (
        f"On {rows[0]['tasks']} random tasks the rank correlation of resistance and aggression "
        f"over inner goals is beyond chance by: {'; '.join(parts)}."
    )


def beyond_chance(data: Data, label: str) -> pd.Series:
    """The correlation beyond chance on each random task that is judged; MissingError for none."""
    frame = resist_values(data.study)
    splits = frame.task.map(lambda name: getattr(address_of(name), "split", None))
    rows = frame[(frame.label == label) & splits.notna() & (splits != "development")]
    data.run_ids.extend(run for cells in rows.cells for cell in cells for run in cell.good.run_id)
    return rows.set_index("task").beyond


TEST = (
    "one-tailed bootstrap tests over random tasks of the rank correlation of resistance and "
    "aggression over inner goals, less that of the same slopes in any order: "
)


@judges(
    "learner-yields-where-it-imposes", TEST + "below 0 for the learner, by replays", labels=(EC1,)
)
@judges(
    "reaction-yields-where-it-imposes",
    TEST + "below 0 for the corrective process",
    labels=(INITIAL,),
)
@judges(
    "not-as-in-tongues",
    TEST + "below {tongues:g} for every method",
    labels=JUDGED,
    bound=MARGINS["tongues"],
)
def correlations_below(data: Data, labels: Sequence[str], bound: float = 0.0) -> Finding:
    """Whether the correlations of some methods are below a bound, each."""
    return random_tasks.means_over_tasks({
        f"{name_of(label)}: {{}} beyond chance": (beyond_chance(data, label), bound, -1)
        for label in labels
    })  # fmt: skip


RESIST = Section(
    "resist",
    short="Resist and impose",
    title="Do goals that resist their neighbours also impose themselves?",
    caption="Resistance and aggression of goals: rank correlation over the inner goals of a task",
    finding=finding_of_resist,
    figure="resist",
    table="resist",
    note=(
        "Slopes of the mean posture at a goal on the places of a neighbouring goal. Chance: the "
        "correlation of the same slopes in any order, as a slope is a part of one goal's influence "
        "and of its neighbour's aggression. Of the learner by noiseless replays."
    ),
)
