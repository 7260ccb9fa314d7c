"""How far ahead a planner must look: gaps by the number of goals in view."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic import Task
from coartic.analysis.claims.data import Data
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import most_exploring
from coartic.analysis.optima import gap_share
from coartic.analysis.section import Section
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.topics.random_tasks import (
    finding,
    mean_of,
    mean_or_nan,
    reported,
    solved_cells,
)
from coartic.motion.costs import joint_costs, segment_lengths
from coartic.tasks.task import MOST_GOALS

PLANNER = "receding-horizon"
ALL_GOALS = "all"
HORIZONS: tuple[int | str, ...] = (0, 1, 2, 3, 4, ALL_GOALS)
DEAR = ("base", "right-arm")
"""Joints that cost more than the others, where the claim on them is tested."""


@cached
def gaps_by_horizon(study: Study) -> pd.DataFrame:
    """Gaps of the planner on every random task, a row for each: per cent of the shortest.

    Indexed by task, ``hands`` and ``costs``; columns :data:`HORIZONS`, missing where nothing was
    run and where the task has not so many goals ahead: a task with five has four at its first
    movement. Of ticks, over the best known of the task; with costly joints of the weighted path
    length that was executed, over the shortest of all runs with the same costs.
    """
    references = instances.references if (instances := sample(study)) else {}
    lengths: dict[tuple[str, str, str], dict[int, float]] = {}
    for cell, parameters in solved_cells(study, PLANNER):
        if cell.task in references:
            task, costly = study.tasks[cell.task], parameters["costs"]
            length = -float(cell.rewards[0])
            if costly != "none":
                costs = joint_costs(task.robot, costly, parameters["cost_factor"])
                (executed,) = study.trajectories(cell.task, cell.label).runs
                length = float(segment_lengths(executed.configurations, costs).sum())
            horizon = min(parameters["horizon"], len(task.goals) - 1)
            lengths.setdefault((cell.task, parameters["hands"], costly), {})[horizon] = length
    rows = {}
    for (name, hands, costly), by_horizon in lengths.items():
        last = len(study.tasks[name].goals) - 1
        if hands == "optimal":  # with all goals in view it is the same plan
            planned = lengths.get((name, "planned", costly), {})
            by_horizon.setdefault(last, planned.get(last, math.nan))
        shortest = -float(references[name].reward)
        if costly != "none":
            shortest = min(by_horizon.values())
        seen = [last if h == ALL_GOALS else int(h) for h in HORIZONS]
        there = [by_horizon.get(h, math.nan) if h <= last else math.nan for h in seen]
        rows[name, hands, costly] = 100 * (np.array(there) / shortest - 1)
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=list(HORIZONS))
    frame.index = pd.MultiIndex.from_tuples(list(rows), names=["task", "hands", "costs"])
    return frame


def goals_ahead(study: Study, gaps: pd.DataFrame) -> pd.Series:
    """How many goals are ahead at the first movement, of each row of :func:`gaps_by_horizon`."""
    names = gaps.index.get_level_values("task")
    return pd.Series([len(study.tasks[name].goals) - 1 for name in names], gaps.index, dtype=int)


BASES = ("free", "on a rail", "fixed")
"""How the base can move, by the number of directions in which it is locked."""
KINDS: dict[str, Callable[[Task], str]] = {
    "family": lambda task: str(task.family).partition("/")[0],
    "goals": lambda task: str(len(task.goals)) if len(task.goals) <= 5 else "6 or more",
    "arms": lambda task: ("one", "two")[len(task.hands) - 1],
    "links": lambda task: str(len(task.robot.right_links)),
    "base": lambda task: BASES[len(task.locked_base)],
}
"""What tasks are told apart by."""
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
def planner_cells(study: Study) -> dict[tuple[str, str, str, int], CellRuns]:
    """Cells of the planner by task, hands, costs and horizon, at most the goals less one."""
    cells = {}
    for cell, parameters in solved_cells(study, PLANNER):
        horizon = min(parameters["horizon"], len(study.tasks[cell.task].goals) - 1)
        cells[cell.task, parameters["hands"], parameters["costs"], horizon] = cell
    return cells


def cells_at(study: Study, gaps: pd.DataFrame, horizon: int | str) -> list[CellRuns]:
    """The planner's cells behind a column of gaps, whose rows are tasks, hands and costs.

    Hands that are given with all goals in view are those that were planned.
    """
    ahead = MOST_GOALS if horizon == ALL_GOALS else int(horizon)
    cells = planner_cells(study)
    keys = ((*place, min(ahead, len(study.tasks[place[0]].goals) - 1)) for place in gaps.index)
    there = (cells.get(key) or cells.get((key[0], "planned", *key[2:])) for key in keys)
    return [cell for cell in there if cell is not None]


def groups(study: Study) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Kinds of tasks and of planners, each with its gaps by horizon.

    A planner that has its hands given, or dear joints, follows the plain one on the same tasks.
    """
    every = gaps_by_horizon(study)
    parts = dict(list(every.groupby(["hands", "costs"], sort=False)))
    plain = parts.pop(("planned", "none"), every[:0])
    yield "all", "all", plain
    names = plain.index.get_level_values("task")
    for kind, value_of in KINDS.items():
        for value, part in plain.groupby(np.array([value_of(study.tasks[n]) for n in names])):
            yield kind, str(value), part
    given = [("given", part) for (hands, _), part in parts.items() if hands == "optimal"]
    dear = [(f"{costs} dear", part) for (_, costs), part in parts.items() if costs != "none"]
    for kind, plainly, others in (("hands", "planned", given), ("costs", "equal", dear)):
        tasks = {name for _, part in others for name in part.index.get_level_values("task")}
        if others:
            yield kind, plainly, plain[names.isin(tasks)]
        for planner, part in others:
            yield kind, planner, part


@table("group, value, h, tasks, gap[], gain[], seconds")
def horizon(study: Study) -> Rows:
    """Gap of the planner by goals ahead, and what the last of these goals gains, as shares.

    Over the tasks of a group that have so many goals ahead. ``h`` of 5+ are those beyond the fourth
    together; all is over all tasks, whatever they have.
    """
    for group, value, every in groups(study):
        ahead = goals_ahead(study, every)
        for name, h, before, fewest in STEPS:
            rows = every[ahead >= fewest]
            if before is not None and enough(rows[before]):
                rows = rows[rows[before].notna()]
            elif name == BEYOND:
                continue
            if not enough(rows[h]):
                continue
            rows = rows[rows[h].notna()]
            cells = cells_at(study, rows, h)
            row: Row = {"group": group, "value": value, "h": name, "tasks": len(rows)}
            row |= mean_of("gap", rows[h] / 100)
            if before is not None:
                row |= mean_of("gain", (rows[before] - rows[h]) / 100)
            row["seconds"] = float(np.mean([cell.good.cpu_s.mean() for cell in cells]))
            yield f"{group} {value} h={name}", row | runs_of(*cells)


def enough(gaps: pd.Series) -> bool:
    """Whether a horizon was run on enough of the tasks that have it to be shown."""
    return bool(gaps.notna().mean() > ENOUGH)  # without tasks it is NaN


@table("sign, words, h, tasks, mean[], to_come[]")
def horizon_signs(study: Study) -> Rows:
    """Signs of coarticulation of the planner by goals ahead, means over tasks that have more, and
    what they gain by all goals."""
    gaps = gaps_by_horizon(study).query("hands == 'planned' and costs == 'none'")
    ahead = goals_ahead(study, gaps)
    cells = {h: cells_at(study, gaps, h) for h in HORIZONS}
    for name, sign in SIGNS.items():
        of_task = {
            h: {
                cell.task: mean_or_nan(sign.of(study.trajectories(cell.task, cell.label)))
                for cell in at_horizon
            }
            for h, at_horizon in cells.items()
        }
        for h in HORIZONS:
            more = gaps.index[(ahead > h) if h != ALL_GOALS else (ahead > 0)]
            names = more.get_level_values("task")
            values = pd.DataFrame({"here": of_task[h], "all": of_task[ALL_GOALS]})
            values = values[values.index.isin(names)].dropna()
            if len(values):
                row: Row = {"sign": name, "words": sign.words, "h": str(h), "tasks": len(values)}
                row |= mean_of("mean", values.here)
                if h != ALL_GOALS:
                    row |= mean_of("to_come", values["all"] - values.here)
                of_tasks = [cell for cell in cells[h] if cell.task in values.index]
                yield f"{name} h={h}", row | runs_of(*of_tasks)


PLACES = [str(h) for h in HORIZONS]


@figure(
    "horizon",
    "Gap of a planner by how far it looks ahead",
    f"Gap to the best known solution, mean over random tasks with its {style.CONFIDENCE} interval "
    "(bootstrap over tasks), linear below 1 %, at horizons that all of a line's tasks have. By "
    "goals of the task: a line ends where all goals are in view. Given hands: hands chosen by each "
    "plan, or those of the plan with all goals. Dear joints cost three times as much, by weighted "
    "path length.",
)
def draw_horizon(study: Study) -> Parts:
    """The curves by number of goals, with given hands, and with dear joints."""
    data = horizon(study)
    if not len(data):
        raise missing(study, "no runs of the planner on instances of a family of tasks")
    titles = {"goals": "goals of the task", "hands": "given hands", "costs": "dear joints"}
    groups = [group for group in titles if (data.group == group).any()]
    drawing, panels = style.figure_of((1, len(groups)), (style.TWO, 2.6), sharey=True)
    for axes, group in zip(panels, groups, strict=True):
        parts = data[data.group == group].groupby("value", sort=False)
        for number, (color, (name, rows)) in enumerate(zip(style.PALETTE, parts, strict=False)):
            if group == "goals" and BEYOND not in set(rows.h):
                rows = rows[rows.h != ALL_GOALS]  # that is its last horizon
            rows = rows[rows.h.isin(PLACES) & (rows.tasks == rows.tasks.max())]
            curve(axes, rows, color, 0.08 * number, str(name))
        axes.set_xticks(range(len(PLACES)), PLACES)
        axes.set_xlabel("goals ahead")
        axes.set_title(titles[group])
        axes.legend(loc="upper right")
    first = panels[0]
    first.set_yscale("symlog", linthresh=1, linscale=0.6)
    first.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"])
    first.set_ylim(bottom=-0.1)
    first.set_ylabel("gap (%)")
    style.letters(panels)
    gained = data[(data.group == "all") & data.gain.notna()]
    each = (f"{h} ahead: {gain:.1%}" for h, gain in zip(gained.h, gained.gain, strict=True))
    return drawing, data, f"Gain of each goal ahead where it exists. {'; '.join(each)}.", ()


def curve(axes: Axes, rows: pd.DataFrame, color: str, shift: float, name: str) -> None:
    """Means by horizon with their intervals."""
    places = rows.h.map(PLACES.index) + shift
    line: Any = {"color": color, "marker": "o", "markersize": 3, "linewidth": 1.2}
    axes.vlines(places, 100 * rows.gap_low, 100 * rows.gap_high, color=color, linewidth=0.9)
    axes.plot(places, 100 * rows.gap, **line, label=name)


def gaps_of(data: Data, hands: str = "planned", costs: str = "none") -> pd.DataFrame:
    """Gaps by horizon on the reported tasks, indexed by task."""
    gaps = gaps_by_horizon(data.study)
    places = gaps.index.to_frame()
    judged = places.task.map(lambda name: reported(data, name)).astype(bool)
    chosen = gaps[(places.hands == hands) & (places.costs == costs) & judged].copy()
    chosen = chosen.droplevel(["hands", "costs"])
    runs = data.study.runs
    data.run_ids.extend(runs[(runs.method == PLANNER) & runs.task.isin(chosen.index)].run_id)
    return chosen


def judged_gaps(data: Data, claim: Claim, costs: str = "none") -> tuple[pd.DataFrame, pd.Series]:
    """Gaps by horizon as a claim takes them, and how many goals each task has ahead.

    A claim that is not counted takes goals that a task does not have for goals that gain nothing:
    beyond its last goal its gap is that with all goals in view.
    """
    gaps = gaps_of(data, costs=costs)
    ahead = goals_ahead(data.study, gaps)
    if not claim.uncounted:
        return gaps, ahead
    for h in HORIZONS[:-1]:
        gaps[h] = gaps[h].where(ahead >= h, gaps[ALL_GOALS])
    return gaps, pd.Series(MOST_GOALS, gaps.index)


def first_goal_ahead_gains_most(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the difference of both gains"""
    gaps, ahead = judged_gaps(data, claim)
    gained, left = gaps[0] - gaps[1], gaps[1] - gaps[ALL_GOALS]
    sentence = "The first goal ahead gains {} points more than all others together"
    return finding({sentence: ((gained - left).where(ahead > 1), 0.0, 1)})


def further_goals_gain_little(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks of the gains against {gain:g} %"""
    (gaps, _), least = judged_gaps(data, claim), MARGINS["gain"]
    return finding(
        {
            "The second goal ahead gains {} points": (gaps[1] - gaps[2], least, 1),
            "the fourth gains {} points": (gaps[3] - gaps[4], least, -1),
        }
    )


def most_of_the_loss_is_posture(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the loss with given hands, less a share of \
the loss"""
    planned, given = gaps_of(data)[0], gaps_of(data, hands="optimal")[0]
    share = MARGINS["share_of_loss"]
    sentence = (
        "Without look-ahead the planner with given hands loses {} points more than "
        f"{share:.0%} of what it loses with its own"
    )
    return finding({sentence: (given - share * planned, 0.0, 1)})


def dear_joints_keep_the_horizon(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks of the gains against {gain:g} %, by costs"""
    parts, least = {}, MARGINS["gain"]
    for costs in DEAR:
        gaps, ahead = judged_gaps(data, claim, costs)
        dear = f"with a dear {costs.replace('-', ' ')}"
        parts[f"{dear} the second goal ahead gains {{}} points"] = gaps[1] - gaps[2], least, 1
        beyond = (gaps[4] - gaps[ALL_GOALS]).where(ahead > 4)
        parts[f"{dear} those beyond the fourth gain {{}} points together"] = beyond, least, -1
    return finding(parts)


def learner_behind_one_goal_ahead(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the difference of the gaps"""
    gaps = gaps_of(data)
    instances = sample(data.study)
    assert instances is not None  # or there would be no gaps
    learner = {}
    for name in gaps.index:
        label = most_exploring(data.task(name))
        cell = data.study.cells.get((name, label))
        if cell is not None and len(cell.good):
            share = gap_share(cell.rewards, instances.references[name].reward)
            learner[name] = 100 * float(share.mean())
            data.run_ids.extend(cell.good.run_id)
    behind = pd.Series(learner, dtype=np.float64) - gaps[1]
    sentence = "The learner loses {} points more than the planner with one goal ahead"
    return finding({sentence: (behind, MARGINS["gain"], 1)})


HORIZON = Section(
    "horizon",
    short="Horizon",
    title="How far ahead must a plan look?",
    caption=("Gap of the planner by goals ahead, in per cent of the best known reward"),
    figure="horizon",
    table="horizon",
    note=(
        "Rows are over tasks that have so many goals ahead at their first movement, with the gain"
        " of the last of these goals (5+: of all beyond the fourth); all is over all tasks. With "
        "hands given, and with dear joints, they stand beside those of the plain planner on the "
        "same tasks. Gaps with dear joints are of weighted path lengths. Table horizon-signs has "
        "the signs of coarticulation."
    ),
)
