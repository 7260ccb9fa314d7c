"""How far ahead a planner must look: gaps by the number of goals in view."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from coartic import Task
from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.section import Section
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import random_tasks
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.words import interval_in_words, plural

ALL_GOALS = "all"
HORIZONS: tuple[int | str, ...] = (0, 1, 2, 3, 4, ALL_GOALS)
BASES = ("free", "on a rail", "fixed")
"""How the base can move, by the number of directions in which it is locked."""
KINDS: dict[str, Callable[[Task], str]] = {
    "family": lambda task: str(task.family).partition("/")[0],
    "goals": lambda task: str(len(task.goals)) if len(task.goals) <= 5 else "6 or more",
    "arms": lambda task: ("one", "two")[len(task.hands) - 1],
    "links": lambda task: str(len(task.robot.right_links)),
    "base": lambda task: BASES[len(task.locked_base)],
}
"""Kinds of tasks that the table has apart."""
BEYOND = "5+"
"""All goals beyond the fourth goal ahead."""
STEPS: tuple[tuple[str, int | str, int | None, int], ...] = (
    ("0", 0, None, 0),
    *((str(h), h, h - 1, h) for h in (1, 2, 3, 4)),
    (BEYOND, ALL_GOALS, 4, 5),
    (ALL_GOALS, ALL_GOALS, None, 0),
)
"""Rows of the table of horizons: name, horizon, the one before it that its gain is over, and goals
that a task must have ahead."""
ENOUGH = 0.9
"""Share of the tasks that have a horizon on which it must have been run to be shown."""


@cached
def plans_by_horizon(study: Study) -> dict[str, dict[int, tuple[int, CellRuns]]]:
    """Ticks of what the planner made of every random task, and its cell, by task and goals ahead.

    All goals in view are as many as follow the first. Of version 1, plans with given hands or
    costly joints are left out.
    """
    seen: dict[str, dict[int, tuple[int, CellRuns]]] = {}
    for cell, parameters in random_tasks.solved_cells(study).get(random_tasks.RECEDING_HORIZON, ()):
        task, plain = study.tasks[cell.task], {"hands": "planned", "costs": "none"}
        if task.family is not None and plain.items() <= (plain | parameters).items():
            at = min(parameters["horizon"], len(task.goals) - 1)
            seen.setdefault(cell.task, {})[at] = -int(cell.rewards[0]), cell
    return seen


@cached
def gaps_by_horizon(study: Study) -> pd.DataFrame:
    """Gaps of the planner on every random task, a row for each: per cent of the best known.

    Columns :data:`HORIZONS`, missing where nothing was run and where the task has not so many goals
    ahead; ``ahead``: goals ahead at the first movement, four of five; ``cells`` behind the gaps by
    horizon.
    """
    references = sample(study).references
    rows = {}
    for name, plans in plans_by_horizon(study).items():
        last, shortest = len(study.tasks[name].goals) - 1, -float(references[name].reward)
        lengths = {at: ticks for at, (ticks, _) in plans.items()}
        ticks = [lengths.get(last if h == ALL_GOALS else int(h), math.nan) for h in HORIZONS]
        cells = {at: cell for at, (_, cell) in plans.items()}
        rows[name] = [*(100 * (np.array(ticks) / shortest - 1)), last, cells]
    return pd.DataFrame.from_dict(rows, orient="index", columns=[*HORIZONS, "ahead", "cells"])


def cells_at(gaps: pd.DataFrame, horizon: int | str) -> list[CellRuns]:
    """The planner's cells behind a column of gaps."""
    rows = zip(gaps.ahead, gaps.cells, strict=True)
    places = ((ahead if horizon == ALL_GOALS else horizon, cells) for ahead, cells in rows)
    return [cells[at] for at, cells in places if at in cells]


def groups(study: Study) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Kinds of tasks, each with its gaps by horizon."""
    gaps = gaps_by_horizon(study)
    yield "all", "all", gaps
    for kind, value_of in KINDS.items():
        for value, part in gaps.groupby(np.array([value_of(study.tasks[n]) for n in gaps.index])):
            yield kind, str(value), part


@table("group, value, h, tasks, gap[], gain[], seconds")
def horizon(study: Study) -> Rows:
    """Gap of the planner by goals ahead, and what the last of these goals gains, as shares.

    Over the tasks of a group that have so many goals ahead. ``h`` of 5+ are those beyond the fourth
    together; all is over all tasks, whatever they have.
    """
    for group, value, every in groups(study):
        for name, h, before, fewest in STEPS:
            rows = every[every.ahead >= fewest]
            if before is not None and enough(rows[before]):
                rows = rows[rows[before].notna()]
            elif name == BEYOND:
                continue
            if not enough(rows[h]):
                continue
            rows = rows[rows[h].notna()]
            cells = cells_at(rows, h)
            row: Row = {"group": group, "value": value, "h": name, "tasks": len(rows)}
            row |= random_tasks.mean_of("gap", rows[h] / 100)
            if before is not None:
                row |= random_tasks.mean_of("gain", (rows[before] - rows[h]) / 100)
            row["seconds"] = float(np.mean([cell.good.cpu_s.mean() for cell in cells]))
            yield f"{group} {value} h={name}", row | runs_of(*cells)


def enough(gaps: pd.Series) -> bool:
    """Whether a horizon was run on enough of the tasks that have it to be shown."""
    return bool(gaps.notna().mean() > ENOUGH)  # without tasks it is NaN


@table("sign, words, h, tasks, mean[], to_come[]")
def horizon_signs(study: Study) -> Rows:
    """Signs of coarticulation of the planner by goals ahead, means over tasks that have more, and
    what they gain by all goals."""
    gaps = gaps_by_horizon(study)
    cells = {h: {cell.task: cell for cell in cells_at(gaps, h)} for h in HORIZONS}
    for name, sign in SIGNS.items():
        signs = {
            h: {
                task: random_tasks.mean_or_nan(sign.of(study.trajectories(task, cell.label)))
                for task, cell in by_task.items()
            }
            for h, by_task in cells.items()
        }
        for h in HORIZONS:
            values = pd.DataFrame({"here": signs[h], "all": signs[ALL_GOALS]}).dropna()
            values = values[gaps.ahead[values.index] > (0 if h == ALL_GOALS else h)]
            if len(values):
                row: Row = {"sign": name, "words": sign.words, "h": str(h), "tasks": len(values)}
                row |= random_tasks.mean_of("mean", values.here)
                if h != ALL_GOALS:
                    row |= random_tasks.mean_of("to_come", values["all"] - values.here)
                yield f"{name} h={h}", row | runs_of(*(cells[h][task] for task in values.index))


PLACES = [str(h) for h in HORIZONS]


@figure(
    "horizon",
    "Gap of a planner by how far it looks ahead",
    f"Gap to the best known solution, mean over random tasks with its {style.COVERAGE} interval "
    "(bootstrap over tasks), linear below 1 %, by goals of the task, at horizons that all of a "
    "line's tasks have. A line ends where all goals are in view.",
)
def draw_horizon(study: Study) -> Parts:
    """A curve for each number of goals."""
    data = horizon(study)
    if not len(data):
        raise missing(study, "no runs of the planner on instances of a family of tasks")
    drawing, (axes,) = style.panels((1, 1), (style.ONE, 2.6))
    parts = data[data.group == "goals"].groupby("value", sort=False)
    for number, (color, (name, rows)) in enumerate(zip(style.PALETTE, parts, strict=False)):
        if BEYOND not in set(rows.h):
            rows = rows[rows.h != ALL_GOALS]  # that is its last horizon
        rows = rows[rows.h.isin(PLACES) & (rows.tasks == rows.tasks.max())]
        at = rows.h.map(PLACES.index) + 0.08 * number
        line: Any = {"color": color, "linewidth": 1.2, "bars": 0.9, "scale": 100}
        style.means_at(axes, at, rows, "gap", **line, label=str(name))
    axes.set_xticks(range(len(PLACES)), PLACES)
    axes.set_xlabel("goals ahead")
    axes.legend(title="goals of the task", loc="upper right")
    axes.set_yscale("symlog", linthresh=1, linscale=0.6)
    axes.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"])
    axes.set_ylim(bottom=-0.1)
    axes.set_ylabel("gap (%)")
    gained = data[(data.group == "all") & data.gain.notna()]
    each = (f"{h} ahead: {gain:.1%}" for h, gain in zip(gained.h, gained.gain, strict=True))
    return drawing, data, f"Gain of each goal ahead where it exists. {'; '.join(each)}.", ()


def finding_of_horizon(study: Study) -> str:
    """Gaps without and with one goal ahead, and what further goals gain on tasks that have them."""
    data = horizon(study)
    by_h = data[data.group == "all"].set_index("h").to_dict("index")
    if not {"0", "1"} <= by_h.keys():
        return ""
    gaps = [interval_in_words(by_h[h], "gap", " %", scale=100) for h in ("0", "1")]
    names = {"2": "the second gains", "3": "the third gains", "4": "the fourth gains"}
    further = [
        f"{words} {interval_in_words(by_h[h], 'gain', ' %', scale=100)} "
        f"({plural(by_h[h]['tasks'], 'task')})"
        for h, words in {**names, BEYOND: "the others together gain"}.items()
        if h in by_h and not math.isnan(by_h[h]["gain"])
    ]
    sentence = (
        f"On {by_h['0']['tasks']} random tasks a planner that looks no goal ahead ends {gaps[0]} "
        f"from the best known reward, with one goal ahead {gaps[1]}."
    )
    if further:
        sentence += f" On tasks that have so many goals ahead, {', '.join(further)}."
    return sentence


def gaps_of(data: Data) -> pd.DataFrame:
    """Gaps by horizon on the tasks that methods were not tuned on, indexed by task."""
    gaps = gaps_by_horizon(data.study)
    gaps = gaps.loc[[name for name in gaps.index if data.task(name).split != "development"]]
    runs = data.study.runs
    planned = runs[(runs.method == random_tasks.RECEDING_HORIZON) & runs.task.isin(gaps.index)]
    data.run_ids.extend(planned.run_id)
    return gaps


@judges(
    "first-of-several-goals-ahead-gains-most",
    test="one-tailed bootstrap test over random tasks with three goals or more: the gap of the "
    "planner falls by more from no goal ahead to one than from one to all",
)
def first_goal_gains_most(data: Data) -> Finding:
    """Gain of the first goal ahead less that of all further ones."""
    gaps = gaps_of(data)
    more = (gaps[0] - gaps[1]) - (gaps[1] - gaps[ALL_GOALS])
    sentence = "The first goal ahead gains {} points more than all others together"
    return random_tasks.means_over_tasks({sentence: (more.where(gaps.ahead > 1), 0.0, 1)})


@judges(
    "further-goals-gain-little-where-they-are",
    test="one-tailed bootstrap tests over random tasks: from one goal ahead to two the gap of the "
    "planner falls by more than {gain:g} % on tasks with three goals or more, and from three to "
    "four by less on those with five or more",
)
def further_goals_gain_little(data: Data) -> Finding:
    """Gains of the second and of the fourth goal ahead."""
    gaps, least = gaps_of(data), MARGINS["gain"]
    return random_tasks.means_over_tasks(
        {
            "The second goal ahead gains {} points": (gaps[1] - gaps[2], least, 1),
            "the fourth gains {} points": (gaps[3] - gaps[4], least, -1),
        }
    )


@judges(
    "learner-behind-one-goal-ahead",
    test="one-tailed bootstrap test over random tasks: the learner's gap is higher by more than "
    "{gain:g} %",
)
def learner_behind_one_goal_ahead(data: Data) -> Finding:
    """Gap of the learner less that of the planner with one goal ahead."""
    gaps, instances, learner = gaps_of(data), sample(data.study), {}
    for name in gaps.index:
        gap, cell = instances.gap(name, "learner"), instances.cell(name, "learner")
        if gap is not None and cell is not None:
            learner[name] = 100 * float(gap.mean())
            data.run_ids.extend(cell.good.run_id)
    behind = pd.Series(learner, dtype=np.float64) - gaps[1]
    sentence = "The learner loses {} points more than the planner with one goal ahead"
    return random_tasks.means_over_tasks({sentence: (behind, MARGINS["gain"], 1)})


HORIZON = Section(
    "horizon",
    short="Horizon",
    title="How far ahead must a plan look?",
    caption=("Gap of the planner by goals ahead, in per cent of the best known reward"),
    finding=finding_of_horizon,
    figure="horizon",
    table="horizon",
    note=(
        "Rows are over tasks that have so many goals ahead at their first movement, with the gain"
        " of the last of these goals (5+: of all beyond the fourth); all is over all tasks. Table "
        "horizon-signs has the signs of coarticulation."
    ),
)
