"""What the findings of ``human.toml`` are put to: one function for each measure.

A measure takes a study of suite ``human`` and a model, and returns its values by task: a number, a
row ``(k,)`` or rows ``(n, k)``. There are none where nothing follows for the model. A statistic is
made of the rows of all tasks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic import Trajectory
from coartic.analysis.methods import most_exploring
from coartic.analysis.signatures.subtasks import hand_numbers, isolated_reaches, ticks_alone
from coartic.analysis.study import CellRuns, Study
from coartic.analysis.topics.random_tasks import RECEDING_HORIZON, solved_cells
from coartic.analysis.trajectories import Trajectories, postures
from coartic.analysis.words import read_beside
from coartic.robot import Array

STATIONS = 100
"""Points at equal distances along a hand's path."""
NEAR_TIE = 0.05
"""Both hands need the same ticks within this share of the fewer."""
FEWEST_TIES = 30
GOALS_OF_LONG = 6
"""Goals of a task on which it is asked how far ahead is enough."""
ENOUGH_TICKS = 1.01
"""Ticks of a horizon that is enough, as a multiple of those with all goals in view."""
TICKS_OF_A_TURN = 5
"""Ticks before a hit, and after it, over which the direction of a hand is measured."""
PRACTISED, BEGUN = 10_000, 100
"""Trials of the learner after practice, and after a hundredth of it."""
_MOVED = re.compile(r"(?P<task>.+)\.goal(?P<goal>\d+)_.+")


class Model(NamedTuple):
    """One model: a method with its parameters; no id for the learner that explores most."""

    method: str
    parameters: Mapping[str, Any] = {}
    replayed: bool = False
    """What was learned is replayed without noise, in the place of the best trial."""


MODELS = {name: Model(**row) for name, row in read_beside(__file__, "human")["models"].items()}
"""What is compared with people, by name."""
ByTask = Mapping[str, ArrayLike]
Measure = Callable[[Study, Model], ByTask]
Statistic = Callable[[Array], float]


def cells_of(study: Study, model: Model, **others: Any) -> list[CellRuns]:
    """A model's cells; ``others`` are parameters in the place of its own."""
    asked = {**model.parameters, **others}
    return [
        cell
        for method, cells in solved_cells(study).items()
        for cell, parameters in cells
        if method == (model.method or most_exploring(study.tasks[cell.task]))
        and asked.items() <= parameters.items()
    ]


def runs_by_task(study: Study, model: Model, **others: Any) -> dict[str, Trajectories]:
    """A model's runs by task."""
    executed = study.replays if model.replayed else study.trajectories
    by_task = {
        cell.task: executed(cell.task, cell.label) for cell in cells_of(study, model, **others)
    }
    return {task: runs for task, runs in by_task.items() if runs.runs}


def unmoved_tasks(study: Study, model: Model, arms: int) -> dict[str, Trajectories]:
    """Runs on tasks with so many arms and fewer than six goals, of which none was moved."""
    return {
        name: runs
        for name, runs in runs_by_task(study, model).items()
        if not _MOVED.match(name)
        and len(runs.task.hands) == arms
        and len(runs.task.goals) < GOALS_OF_LONG
    }


def moved_tasks(
    study: Study, model: Model, goal: int, **others: Any
) -> dict[str, list[Trajectories]]:
    """Runs on the tasks in which one goal moves, by the task that they come from, in its order."""
    groups: dict[str, list[Trajectories]] = {}
    for name, runs in runs_by_task(study, model, **others).items():
        parts = _MOVED.match(name)
        if parts and int(parts["goal"]) == goal:
            groups.setdefault(parts["task"], []).append(runs)
    for group in groups.values():
        group.sort(key=lambda runs: runs.task.goals[goal - 1])
    return {task: group for task, group in groups.items() if len(group) > 2}


def run_ids(study: Study, name: str, where: str) -> str:
    """The ids of a model's runs in a block of the suite: moved goals, tasks or long tasks."""
    model = MODELS[name]
    if where == "long tasks":  # all horizons together make one value
        model = Model(model.method)
    return " ".join(
        str(run)
        for cell in cells_of(study, model)
        if bool(_MOVED.match(cell.task)) == (where == "moved goals")
        and (len(study.tasks[cell.task].goals) >= GOALS_OF_LONG) == (where == "long tasks")
        for run in cell.good.run_id
    )


def mean_of_rows(rows: Array) -> float:
    """The mean of all values."""
    return float(rows.mean())


# Postures that follow a goal that moves


def squared_slopes(group: list[Trajectories], moving: int, at: int) -> Array:
    """Squared slope of each joint on the place of the goal that moves, shape ``(dof,)``.

    The posture at goal ``at``, in rad or length unit per length unit. Of several runs the products
    of different ones, whose mean is right however much runs differ; below 0 by chance only.
    """
    places = np.array([runs.task.goals[moving - 1][1] for runs in group])
    weights = (places - places.mean()) / ((places - places.mean()) ** 2).sum()
    count = min(len(runs.runs) for runs in group)
    by_run = np.array([postures(runs.runs[:count], at) for runs in group])
    slopes = np.einsum("p,prj->rj", weights, by_run)
    if count == 1:
        return np.asarray(slopes[0] ** 2)
    total = slopes.sum(axis=0) ** 2 - (slopes**2).sum(axis=0)
    return np.asarray(total / (count * (count - 1)))


def slope_norms(study: Study, model: Model, distance: int, **others: Any) -> dict[str, float]:
    """Length of the vector of slopes by task; with the sign of its square, which chance can turn.

    Distance 1 and 2: the posture at goal 1 follows goal 2 or 3; -1: that at goal 2 follows goal 1.
    """
    at = 1 if distance > 0 else 2
    norms = {}
    for task, group in moved_tasks(study, model, at + distance, **others).items():
        square = float(squared_slopes(group, at + distance, at).sum())
        norms[task] = round(float(np.sign(square) * np.sqrt(abs(square))), 6)  # else 0 is 1e-12
    return norms


def norms_by_practice(study: Study, model: Model) -> ByTask:
    """Slope norms at distances 1 and 2 after all trials and after a hundredth, shape ``(4,)``."""
    if model.method:
        return {}
    norms = [
        slope_norms(study, model, distance, trials=trials)
        for trials in (PRACTISED, BEGUN)
        for distance in (1, 2)
    ]
    tasks = [task for task in norms[0] if all(task in by_task for by_task in norms)]
    return {task: [by_task[task] for by_task in norms] for task in tasks}


def horizon_rise(rows: Array) -> float:
    """Rise of the slope norm at distance 2 with practice."""
    return float((rows[:, 1] - rows[:, 3]).mean())


def ratio_rise(rows: Array) -> float:
    """Rise of the ratio of the mean slope norms at distance 2 and 1 with practice."""
    near, far, near_before, far_before = rows.mean(axis=0)
    return float(far / near - far_before / near_before)


def norms_and_benefits(study: Study, model: Model) -> ByTask:
    """Slope norm at distance 1, and what preparing can save, shape ``(2,)``.

    What can be saved: ticks with no goal ahead less the fewest of any run, where no goal moved.
    """
    alone = unmoved_tasks(study, MODELS["no goal ahead"], 1)
    highest = study.runs[study.runs.status == "ok"].groupby("task").reward.max()
    return {
        task: [norm, alone[task].runs[0].ticks + float(highest[task])]
        for task, norm in slope_norms(study, model, 1).items()
        if task in alone
    }


def kendalls_tau(pairs: Array) -> float:
    """Kendall's τ (b, for ties); 0 where one of both is the same on all tasks."""
    first, second = (np.sign(column[:, None] - column) for column in pairs.T)
    ordered = np.abs(first).sum() * np.abs(second).sum()
    return float((first * second).sum() / np.sqrt(ordered)) if ordered else 0.0


# Paths of the hand


def hand_path(run: Trajectory, goal: int) -> Array:
    """Positions of the hitting hand from the goal before to this one, shape ``(k, 2)``."""
    return np.asarray(run.task.robot.forward_kinematics(run.subtask(goal), run.hands[goal - 1]))


def stations(path: Array) -> Array:
    """Points at equal distances along a path, shape ``(STATIONS, 2)``."""
    lengths = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
    at = np.linspace(0, lengths[-1], STATIONS)
    return np.column_stack([np.interp(at, lengths, coordinate) for coordinate in path.T])


def turn(first: Array, second: Array) -> float:
    """Angle from one direction to another, left positive, -π to π rad."""
    cross = first[0] * second[1] - first[1] * second[0]
    return float(np.arctan2(cross, first @ second))


def bows(run: Trajectory) -> Iterator[tuple[float, float, float]]:
    """Bow of each way between two others, turn to the next, turn from the last (left positive)."""
    ends = [
        np.array(run.task.robot.forward_kinematics(run.task.q0, run.hands[0])),
        *run.task.goal_array,
    ]
    chords = np.diff(ends, axis=0)
    for k in range(1, len(chords) - 1):
        path = stations(hand_path(run, k + 1))
        chord = path[-1] - path[0]
        away = path - path[0]
        bow = (chord[0] * away[:, 1] - chord[1] * away[:, 0]) / np.linalg.norm(chord)
        yield float(bow.mean()), turn(chords[k], chords[k + 1]), turn(chords[k - 1], chords[k])


def bows_by_task(study: Study, model: Model) -> ByTask:
    """The rows of :func:`bows` of all runs, shape ``(n, 3)``."""
    return {
        task: [row for run in runs.runs for row in bows(run)]
        for task, runs in unmoved_tasks(study, model, 1).items()
    }


def slope_of_bows(rows: Array) -> float:
    """Slope of the bow on the next turn, given the last one."""
    bow, to_next, from_last = rows.T
    columns = np.column_stack([to_next, from_last, np.ones(len(bow))])
    return float(np.linalg.lstsq(columns, bow)[0][0])


def turn_at_goals(run: Trajectory) -> float:
    """Mean angle by which the hand turns at goals that others follow, 0 to π rad."""
    angles = []
    for goal in range(1, len(run.task.goals)):
        before, after = hand_path(run, goal), hand_path(run, goal + 1)
        into = before[-1] - before[-1 - min(TICKS_OF_A_TURN, len(before) - 1)]
        out = after[min(TICKS_OF_A_TURN, len(after) - 1)] - after[0]
        angles.append(abs(turn(into, out)))
    return float(np.mean(angles))


def turn_saved(study: Study, model: Model) -> ByTask:
    """Turn at goals under the corrective process alone less that of the model, on one arm."""
    alone = unmoved_tasks(study, MODELS["corrective process alone"], 1)
    return {
        task: turn_at_goals(alone[task].runs[0]) - np.mean([*map(turn_at_goals, runs.runs)])
        for task, runs in unmoved_tasks(study, model, 1).items()
        if task in alone
    }


def apart_by_stop(study: Study, model: Model) -> ByTask:
    """How far apart hand paths to goal 1 lie before two places of goal 2: stopping, passing."""
    if "stop" not in model.parameters:
        return {}
    stopping, passing = (
        {
            task: path_distance(group[0].runs[0], group[-1].runs[0])
            for task, group in moved_tasks(study, model, 2, stop=stop).items()
        }
        for stop in (1, 0)
    )
    return {task: [stopping[task], passing[task]] for task in stopping if task in passing}


def path_distance(first: Trajectory, second: Trajectory) -> float:
    """Mean distance of the hand's paths to goal 1, station by station."""
    apart = stations(hand_path(first, 1)) - stations(hand_path(second, 1))
    return float(np.linalg.norm(apart, axis=1).mean())


def ratio_of_means(pairs: Array) -> float:
    """Mean of the first column by that of the second."""
    return float(pairs[:, 0].mean() / pairs[:, 1].mean())


# Two hands, and long tasks


def excess_of_first(study: Study, model: Model) -> ByTask:
    """Ticks to goal 1 beyond the way to it alone, where the other hand hits goal 2."""
    values = {}
    for task, runs in unmoved_tasks(study, model, 2).items():
        hands = hand_numbers(runs.task, runs.runs)
        starts = np.tile(runs.task.q0, (len(hands), 1))
        alone, _ = isolated_reaches(runs.task, starts, np.array(1), hands[:, 0])
        excess = [
            run.execution.ticks_by_goal()[0] - ticks
            for run, ticks in zip(runs.runs, alone, strict=True)
            if run.hands[0] != run.hands[1] and not math.isnan(ticks)
        ]
        if excess:
            values[task] = float(np.mean(excess))
    return values


def near_tie_repeats(study: Study, model: Model) -> ByTask:
    """Whether the hand stays the same in each near tie, ``(n, 1)``; NaN if all tasks have few."""
    by_task = {}
    for task, runs in unmoved_tasks(study, model, 2).items():
        hands, ties = hand_numbers(runs.task, runs.runs), near_ties(runs)
        repeats = (hands[:, 1:] == hands[:, :-1])[ties[:, 1:]]
        if len(repeats):
            by_task[task] = repeats[:, None].astype(float)
    enough = sum(map(len, by_task.values())) >= FEWEST_TIES
    return {task: repeats if enough else math.nan * repeats for task, repeats in by_task.items()}


def near_ties(runs: Trajectories) -> NDArray[np.bool_]:
    """Whether both hands reach a goal in the same ticks from the posture before, ``(n, G)``."""
    few, many = np.sort(ticks_alone(runs.task, runs.runs), axis=0)
    return np.asarray((many < math.inf) & (many <= (1 + NEAR_TIE) * few))


def sufficient_horizon(study: Study, model: Model) -> ByTask:
    """The fewest goals ahead with which the planner is within 1 % of all goals in view."""
    if model != MODELS["all goals ahead"]:
        return {}
    ticks: dict[str, dict[int, int]] = {}
    for cell, parameters in solved_cells(study).get(RECEDING_HORIZON, ()):
        last = len(study.tasks[cell.task].goals) - 1
        if last + 1 >= GOALS_OF_LONG:
            horizon = min(parameters["horizon"], last)
            ticks.setdefault(cell.task, {})[horizon] = -int(cell.rewards[0])
    return {
        task: min(h for h, of_h in by_h.items() if of_h <= ENOUGH_TICKS * by_h[max(by_h)])
        for task, by_h in ticks.items()
    }


MEASURES: dict[str, tuple[Measure, Statistic]] = {
    "slope norm at distance 1": (partial(slope_norms, distance=1), mean_of_rows),
    "slope norm at distance 2": (partial(slope_norms, distance=2), mean_of_rows),
    "slope norm at distance -1": (partial(slope_norms, distance=-1), mean_of_rows),
    "rise of the slope norm at distance 2": (norms_by_practice, horizon_rise),
    "rise of the ratio of slope norms": (norms_by_practice, ratio_rise),
    "benefit correlation": (norms_and_benefits, kendalls_tau),
    "sufficient horizon": (sufficient_horizon, mean_of_rows),
    "bow slope": (bows_by_task, slope_of_bows),
    "turn saved at goals": (turn_saved, mean_of_rows),
    "stop ratio": (apart_by_stop, ratio_of_means),
    "first movement against isolated reach": (excess_of_first, mean_of_rows),
    "near-tie repeats": (near_tie_repeats, mean_of_rows),
}
"""Every measure with the statistic of all tasks, by the name that ``human.toml`` calls it by."""
