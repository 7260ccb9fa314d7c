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
from coartic.motion.costs import joint_costs, segment_lengths

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
def plans_by_horizon(
    study: Study,
) -> dict[tuple[str, str, str], dict[int, tuple[float, CellRuns]]]:
    """Length of what the planner made of every random task, and its cell, by goals ahead.

    Keys are task, ``hands`` and ``costs``. Lengths are ticks; with costly joints the weighted path
    length that was executed. All goals in view are as many as follow the first.
    """
    seen: dict[tuple[str, str, str], dict[int, tuple[float, CellRuns]]] = {}
    for cell, parameters in random_tasks.solved_cells(study).get(random_tasks.RECEDING_HORIZON, ()):
        task, costly = study.tasks[cell.task], parameters["costs"]
        if task.family is None:
            continue
        length = -float(cell.rewards[0])
        if costly != "none":
            costs = joint_costs(task.robot, costly, parameters["cost_factor"])
            (executed,) = study.trajectories(cell.task, cell.label).runs
            length = float(segment_lengths(executed.configurations, costs).sum())
        at = min(parameters["horizon"], len(task.goals) - 1)
        seen.setdefault((cell.task, parameters["hands"], costly), {})[at] = length, cell
    return seen


@cached
def gaps_by_horizon(study: Study) -> pd.DataFrame:
    """Gaps of the planner on every random task, a row for each: per cent of the shortest.

    Indexed by task, ``hands`` and ``costs``; columns :data:`HORIZONS`, missing where nothing was
    run and where the task has not so many goals ahead; ``ahead``: goals ahead at the first
    movement, four of five; ``cells`` behind the gaps by horizon. Of ticks, over the best known of
    the task; with costly joints over the shortest of all runs with the same costs.
    """
    references = sample(study).references
    seen = plans_by_horizon(study)
    rows = {}
    for (name, hands, costly), plans in seen.items():
        last = len(study.tasks[name].goals) - 1
        planned = seen.get((name, "planned", costly), {})
        by_horizon = dict(plans)
        if hands == "optimal" and last in planned:  # with all goals in view it is the same plan
            by_horizon.setdefault(last, planned[last])
        lengths = {at: length for at, (length, _) in by_horizon.items()}
        shortest = -float(references[name].reward) if costly == "none" else min(lengths.values())
        ticks = [lengths.get(last if h == ALL_GOALS else int(h), math.nan) for h in HORIZONS]
        cells = {at: cell for at, (_, cell) in by_horizon.items()}
        rows[name, hands, costly] = [*(100 * (np.array(ticks) / shortest - 1)), last, cells]
    index = pd.MultiIndex.from_tuples(list(rows), names=["task", "hands", "costs"])
    return pd.DataFrame(list(rows.values()), index, [*HORIZONS, "ahead", "cells"])


def cells_at(gaps: pd.DataFrame, horizon: int | str) -> list[CellRuns]:
    """The planner's cells behind a column of gaps."""
    rows = zip(gaps.ahead, gaps.cells, strict=True)
    places = ((ahead if horizon == ALL_GOALS else horizon, cells) for ahead, cells in rows)
    return [cells[at] for at, cells in places if at in cells]


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
    gaps = gaps_by_horizon(study).query("hands == 'planned' and costs == 'none'")
    cells = {h: {cell.task: cell for cell in cells_at(gaps, h)} for h in HORIZONS}
    ahead = gaps.ahead.droplevel(["hands", "costs"])
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
            values = values[ahead[values.index] > (0 if h == ALL_GOALS else h)]
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
    shown = [group for group in titles if (data.group == group).any()]
    drawing, panels = style.figure_of((1, len(shown)), (style.TWO, 2.6), sharey=True)
    for axes, group in zip(panels, shown, strict=True):
        parts = data[data.group == group].groupby("value", sort=False)
        for number, (color, (name, rows)) in enumerate(zip(style.PALETTE, parts, strict=False)):
            if group == "goals" and BEYOND not in set(rows.h):
                rows = rows[rows.h != ALL_GOALS]  # that is its last horizon
            rows = rows[rows.h.isin(PLACES) & (rows.tasks == rows.tasks.max())]
            at = rows.h.map(PLACES.index) + 0.08 * number
            line: Any = {"color": color, "linewidth": 1.2, "bars": 0.9, "scale": 100}
            style.means(axes, at, rows, "gap", **line, label=str(name))
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


def gaps_of(data: Data, hands: str = "planned", costs: str = "none") -> pd.DataFrame:
    """Gaps by horizon on the tasks that methods were not tuned on, indexed by task."""
    gaps = gaps_by_horizon(data.study).query("hands == @hands and costs == @costs")
    gaps = gaps.droplevel(["hands", "costs"])
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
    "most-of-the-loss-is-posture",
    test="one-tailed bootstrap test over random tasks, with no goal ahead: the gap with given "
    "hands less {share_of_loss:g} of the gap with planned hands is above 0",
)
def most_of_the_loss_is_posture(data: Data) -> Finding:
    """Loss without look-ahead, with given hands less a share of that with planned ones."""
    planned, given = gaps_of(data)[0], gaps_of(data, hands="optimal")[0]
    share = MARGINS["share_of_loss"]
    sentence = (
        "Without look-ahead the planner with given hands loses {} points more than "
        f"{share:.0%} of what it loses with its own"
    )
    return random_tasks.means_over_tasks({sentence: (given - share * planned, 0.0, 1)})


@judges(
    "dear-joints-keep-the-horizon-where-goals-are",
    test="one-tailed bootstrap tests over random tasks, of the weighted path length that was "
    "executed: from one goal ahead to two the gap falls by more than {gain:g} % on tasks with "
    "four goals or six, and from four to all by less on those with six, with either dear",
)
def dear_joints_keep_the_horizon(data: Data) -> Finding:
    """Gains of the second goal ahead, and of those beyond the fourth, with dear joints."""
    parts, least = {}, MARGINS["gain"]
    for costs in ("base", "right-arm"):
        gaps = gaps_of(data, costs=costs)
        dear = f"with a dear {costs.replace('-', ' ')}"
        parts[f"{dear} the second goal ahead gains {{}} points"] = gaps[1] - gaps[2], least, 1
        beyond = (gaps[4] - gaps[ALL_GOALS]).where(gaps.ahead > 4)
        parts[f"{dear} those beyond the fourth gain {{}} points together"] = beyond, least, -1
    return random_tasks.means_over_tasks(parts)


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
        " of the last of these goals (5+: of all beyond the fourth); all is over all tasks. With "
        "hands given, and with dear joints, they stand beside those of the plain planner on the "
        "same tasks. Gaps with dear joints are of weighted path lengths. Table horizon-signs has "
        "the signs of coarticulation."
    ),
)
