"""What the findings of ``human.toml`` are put to: one function for each measure.

A measure takes a study of suite ``human`` and a model, and returns its values by task with the
statistic that is made of them. There are none where nothing follows for the model.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from coartic import Trajectory
from coartic.analysis.methods import most_exploring
from coartic.analysis.signatures.subtasks import isolated_reach, postures_before
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.trajectories import Trajectories, postures
from coartic.analysis.words import read_beside
from coartic.robot import Array

STATIONS = 100
"""Points at equal distances along a hand's path."""
NEAR_TIE = 0.05
"""Both hands need the same ticks within this share of the fewer."""
FEWEST_TIES = 30
LONG = 6
"""Goals of a task on which it is asked how far ahead is enough."""
ENOUGH = 1.01
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


PLANNER = "receding-horizon"
_FILE = read_beside(__file__, "human")
MODELS = {name: Model(**row) for name, row in _FILE["models"].items()}
"""What is compared with people, by name."""
GROUPS: dict[str, list[str]] = _FILE["groups"]
"""Names of models that have something in common."""


class Values(NamedTuple):
    """What is measured, ``(n, k)`` with any n, by task, and the statistic of all rows."""

    by_task: Mapping[str, Array]
    statistic: Callable[[Array], float]


Measure = Callable[[Study, Model], Values]


def mean_of(by_task: Mapping[str, float]) -> Values:
    """The mean over tasks of one value each, of those that there are."""
    there = {task: np.array([[value]]) for task, value in by_task.items() if np.isfinite(value)}
    return Values(there, lambda rows: float(rows.mean()))


@cached
def cells_by_method(study: Study) -> dict[str, list[tuple[CellRuns, dict[str, Any]]]]:
    """Cells with a solution and their parameters, by method."""
    by_method: dict[str, list[tuple[CellRuns, dict[str, Any]]]] = {}
    for cell in study.cells.values():
        if len(cell.good):
            parameters = json.loads(str(cell.good.parameters.iloc[0]))
            by_method.setdefault(cell.method, []).append((cell, parameters))
    return by_method


def cells_of(study: Study, model: Model, **others: Any) -> list[CellRuns]:
    """A model's cells; ``others`` are parameters in the place of its own."""
    asked = {**model.parameters, **others}
    ours = dict.fromkeys(map(most_exploring, study.tasks.values()))
    methods = [model.method] if model.method else [*ours]
    return [
        cell
        for method in methods
        for cell, parameters in cells_by_method(study).get(method, [])
        if (model.method or most_exploring(study.tasks[cell.task]) == method)
        and all(parameters.get(name) == value for name, value in asked.items())
    ]


def runs_of(study: Study, model: Model, **others: Any) -> dict[str, Trajectories]:
    """A model's runs by task."""
    executed = study.replays if model.replayed else study.trajectories
    by_task = {
        cell.task: executed(cell.task, cell.label) for cell in cells_of(study, model, **others)
    }
    return {task: runs for task, runs in by_task.items() if runs.runs}


def unmoved_tasks(study: Study, model: Model, arms: int, **others: Any) -> dict[str, Trajectories]:
    """Runs on tasks with so many arms and fewer than six goals, of which none was moved."""
    return {
        name: runs
        for name, runs in runs_of(study, model, **others).items()
        if not _MOVED.match(name) and len(runs.task.hands) == arms and len(runs.task.goals) < LONG
    }


def moved(study: Study, model: Model, goal: int, **others: Any) -> dict[str, list[Trajectories]]:
    """Runs on the tasks in which one goal moves, by the task that they come from, in its order."""
    groups: dict[str, list[Trajectories]] = {}
    for name, runs in runs_of(study, model, **others).items():
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
        model = Model(model.method, {})
    return " ".join(
        str(run)
        for cell in cells_of(study, model)
        if bool(_MOVED.match(cell.task)) == (where == "moved goals")
        and (len(study.tasks[cell.task].goals) >= LONG) == (where == "long tasks")
        for run in cell.good.run_id
    )


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
    for task, group in moved(study, model, at + distance, **others).items():
        square = float(squared_slopes(group, at + distance, at).sum())
        norms[task] = round(float(np.sign(square) * np.sqrt(abs(square))), 6)  # else 0 is 1e-12
    return norms


def slope_norm(study: Study, model: Model, distance: int) -> Values:
    """Mean slope norm over tasks."""
    return mean_of(slope_norms(study, model, distance))


def practice(study: Study, model: Model, statistic: Callable[[Array], float]) -> Values:
    """Slope norms at distances 1 and 2 after all trials and after a hundredth, by task, (1, 4)."""
    if model.method:
        return Values({}, statistic)
    norms = [
        slope_norms(study, model, distance, trials=trials)
        for trials in (PRACTISED, BEGUN)
        for distance in (1, 2)
    ]
    tasks = [task for task in norms[0] if all(task in by_task for by_task in norms)]
    rows = {task: np.array([[by_task[task] for by_task in norms]]) for task in tasks}
    return Values(rows, statistic)


def horizon_rise(rows: Array) -> float:
    """Rise of the slope norm at distance 2 with practice."""
    return float((rows[:, 1] - rows[:, 3]).mean())


def ratio_rise(rows: Array) -> float:
    """Rise of the ratio of the mean slope norms at distance 2 and 1 with practice."""
    near, far, near_before, far_before = rows.mean(axis=0)
    return float(far / near - far_before / near_before)


def benefit_correlation(study: Study, model: Model) -> Values:
    """Kendall's τ of what preparing can save and of the slope norm at distance 1, over tasks.

    What can be saved: ticks with no goal ahead less the fewest of any run, where no goal moved.
    """
    norms = slope_norms(study, model, 1)
    alone = unmoved_tasks(study, MODELS["no goal ahead"], 1)
    highest = study.runs[study.runs.status == "ok"].groupby("task").reward.max()
    rows = {
        task: np.array([[norm, alone[task].runs[0].ticks + float(highest[task])]])
        for task, norm in norms.items()
        if task in alone
    }
    return Values(rows, rank_correlation)


def rank_correlation(pairs: Array) -> float:
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


def bow_slope(study: Study, model: Model) -> Values:
    """Slope of the bow on the next turn, given the last one, over the reaches of all tasks."""
    by_task = {
        task: np.array([row for run in runs.runs for row in bows(run)])
        for task, runs in unmoved_tasks(study, model, 1).items()
    }

    def statistic(rows: Array) -> float:
        bow, to_next, from_last = rows.T
        columns = np.column_stack([to_next, from_last, np.ones(len(bow))])
        return float(np.linalg.lstsq(columns, bow)[0][0])

    return Values(by_task, statistic)


def turn_at_goals(run: Trajectory) -> float:
    """Mean angle by which the hand turns at goals that others follow, 0 to π rad."""
    angles = []
    for goal in range(1, len(run.task.goals)):
        before, after = hand_path(run, goal), hand_path(run, goal + 1)
        into = before[-1] - before[-1 - min(TICKS_OF_A_TURN, len(before) - 1)]
        out = after[min(TICKS_OF_A_TURN, len(after) - 1)] - after[0]
        angles.append(abs(turn(into, out)))
    return float(np.mean(angles))


def turn_saved(study: Study, model: Model) -> Values:
    """Turn at goals under the corrective process alone less that of the model, on one arm."""
    alone = unmoved_tasks(study, MODELS["corrective process"], 1)
    return mean_of({
        task: float(turn_at_goals(alone[task].runs[0]) - np.mean([*map(turn_at_goals, runs.runs)]))
        for task, runs in unmoved_tasks(study, model, 1).items()
        if task in alone
    })  # fmt: skip


def stop_ratio(study: Study, model: Model) -> Values:
    """How far apart hand paths to goal 1 lie before two places of goal 2: stopping by passing."""
    if "stop" not in model.parameters:
        return mean_of({})
    apart = []
    for stop in (1, 0):
        apart.append({
            task: float(np.linalg.norm(ends[0] - ends[1], axis=1).mean())
            for task, group in moved(study, model, 2, stop=stop).items()
            if (ends := [stations(hand_path(group[k].runs[0], 1)) for k in (0, -1)])
        })  # fmt: skip
    both = [task for task in apart[0] if task in apart[1]]
    rows = {task: np.array([[apart[0][task], apart[1][task]]]) for task in both}
    return Values(rows, lambda pairs: float(pairs[:, 0].mean() / pairs[:, 1].mean()))


# Two hands, and long tasks


def first_movement(study: Study, model: Model) -> Values:
    """Ticks to goal 1 beyond the way to it alone, where the other hand hits goal 2."""
    values = {}
    for task, runs in unmoved_tasks(study, model, 2).items():
        excess = []
        for run in runs.runs:
            alone = isolated_reach(run.task, run.task.q0, 1, run.hands[0])
            if run.hands[0] != run.hands[1] and alone is not None:
                excess.append(int(run.execution.ticks_by_goal()[0]) - alone[0])
        if excess:
            values[task] = float(np.mean(excess))
    return mean_of(values)


def near_tie_repeats(study: Study, model: Model) -> Values:
    """Share of near ties in which the hand stays the same."""
    by_task = {}
    for task, runs in unmoved_tasks(study, model, 2).items():
        repeats = [
            run.hands[goal - 1] == run.hands[goal - 2]
            for run in runs.runs
            for goal in near_ties(run)
        ]
        if repeats:
            by_task[task] = np.array(repeats, dtype=np.float64)[:, None]
    enough = sum(map(len, by_task.values())) >= FEWEST_TIES
    return Values(by_task, lambda rows: float(rows.mean()) if enough else math.nan)


def near_ties(run: Trajectory) -> Iterator[int]:
    """Goals but the first that both hands reach in the same ticks from the posture before."""
    befores = postures_before(run.execution, run.task)
    for goal in range(2, len(run.task.goals) + 1):
        reaches = [isolated_reach(run.task, befores[goal - 1], goal, h) for h in run.task.hands]
        ticks = [reach[0] for reach in reaches if reach is not None]
        few, many = min(ticks, default=0), max(ticks, default=0)
        if len(ticks) == 2 and many - few <= NEAR_TIE * few:
            yield goal


def sufficient_horizon(study: Study, model: Model) -> Values:
    """The fewest goals ahead with which the planner is within 1 % of all goals in view."""
    if model != MODELS["all goals ahead"]:
        return mean_of({})
    ticks: dict[str, dict[int, int]] = {}
    for cell, parameters in cells_by_method(study).get(PLANNER, []):
        if len(study.tasks[cell.task].goals) >= LONG:
            horizon = min(parameters["horizon"], len(study.tasks[cell.task].goals) - 1)
            ticks.setdefault(cell.task, {})[horizon] = -int(cell.rewards[0])
    return mean_of({
        task: float(
            min(h for h, of_h in by_h.items() if of_h <= ENOUGH * by_h[max(by_h)])
        )
        for task, by_h in ticks.items()
    })  # fmt: skip


MEASURES: dict[str, Measure] = {
    "slope norm at distance 1": partial(slope_norm, distance=1),
    "slope norm at distance 2": partial(slope_norm, distance=2),
    "slope norm at distance -1": partial(slope_norm, distance=-1),
    "rise of the slope norm at distance 2": partial(practice, statistic=horizon_rise),
    "rise of the ratio of slope norms": partial(practice, statistic=ratio_rise),
    "benefit correlation": benefit_correlation,
    "sufficient horizon": sufficient_horizon,
    "bow slope": bow_slope,
    "turn saved at goals": turn_saved,
    "stop ratio": stop_ratio,
    "first movement against isolated reach": first_movement,
    "near-tie repeats": near_tie_repeats,
}
"""Every measure by the name that ``human.toml`` calls it by."""
