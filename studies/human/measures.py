"""Measures by which models are compared with the findings of human.toml, a function each.

A measure takes the runs of all models (:func:`study.tidy`) and the name of one, and returns its
values by task, as a Series or, of several numbers, a frame; tasks can have several rows. A
statistic is made of the rows of all tasks, shape ``(n, k)``.
"""

from functools import partial

import numpy as np
import pandas as pd

from coartic import Task, corrective_trial

STATIONS = 100
"""Points at equal distances along a hand's path."""
NEAR_TIE, FEWEST_TIES = 0.05, 30
"""Both hands need the same ticks within this share of the fewer; cases that are asked for."""
LONG, ENOUGH_TICKS = 6, 1.01
"""Goals of a task on which it is asked how far ahead is enough; ticks of a horizon that is, as a
multiple of those with all goals in view."""
TICKS_OF_A_TURN = 5
"""Ticks before a hit, and after it, over which the direction of a hand is measured."""


def unmoved(runs, model, arms):
    """Return a model's paths by task, on tasks with this number of arms and fewer than :data:`LONG`
    goals, all of them in their places."""
    short = (runs.moved == 0) & (runs.goals < LONG)
    ours = runs[short & (runs.model == model) & (runs.arms == arms)]
    return ours.set_index("task").path


def moving(runs, model, goal):
    """Return a dictionary by task of a model's paths where ``goal`` (from 1) is moved: Series of
    lists of paths by place (y of the goal, length unit). Tasks with fewer than three places are
    left out."""
    ours = runs[(runs.model == model) & (runs.moved == goal)]
    tasks = ours.groupby("origin", sort=False)
    by_task = {task: rows.groupby("place").path.agg(list) for task, rows in tasks}
    return {task: by_place for task, by_place in by_task.items() if len(by_place) > 2}


def mean_by_task(values):
    """Means of values that have tasks as index; a task without any is left out."""
    return values.astype(float).groupby(level=0, sort=False).mean().dropna()


# Postures that follow a goal that moves


def slope_norms(runs, model, distance):
    """Return by task the length of the vector of slopes of a posture's joints on the place of a
    goal; with the sign of its square, which chance can turn.

    Distance 1 and 2: the posture at goal 1 follows goal 2 or 3; -1: that at goal 2 follows goal 1.
    Slopes of joints are in rad or length unit per length unit. Their squares are mean products of
    the slopes of different runs, whose mean is right however much runs differ.
    """
    at, norms = (1 if distance > 0 else 2), {}
    for task, by_place in moving(runs, model, at + distance).items():
        count = by_place.map(len).min()
        postures = [
            [path.execution.configurations[at - 1] for path in paths[:count]] for paths in by_place
        ]
        away = np.array(by_place.index) - np.mean(by_place.index)
        slopes = np.einsum("p,prj->rj", away / (away**2).sum(), postures)
        slopes = slopes if count > 1 else slopes.repeat(2, axis=0)  # one run that draws nothing
        products = slopes.sum(axis=0) ** 2 - (slopes**2).sum(axis=0)
        square = products.sum() / (len(slopes) * (len(slopes) - 1))
        norms[task] = round(float(np.sign(square) * np.sqrt(abs(square))), 6)  # else 0 is 1e-12
    return pd.Series(norms, dtype=float)


def norms_by_practice(runs, model):
    """Return slope norms at distances 1 and 2 after practice, then after a hundredth of it: four
    columns, a row for each task."""
    norms = [slope_norms(runs, model + when, k) for when in ("", ", begun") for k in (1, 2)]
    return pd.concat(norms, axis=1, join="inner")


def ratio_rise(rows):
    """Rise of the ratio of the mean slope norms at distance 2 and 1 with practice."""
    return ratio_of_means(rows[:, [1, 0]]) - ratio_of_means(rows[:, [3, 2]])


def ratio_of_means(pairs):
    """Mean of the first column by that of the second."""
    return pairs[:, 0].mean() / pairs[:, 1].mean()


def norms_and_benefits(runs, model):
    """Return by task the slope norm at distance 1, and the ticks that preparing can save. These are
    ticks with no goal ahead less the fewest of any run, where no goal moved."""
    alone = mean_by_task(unmoved(runs, "no goal ahead", arms=1).map(lambda path: path.ticks))
    saved = alone + runs.groupby("task").best.first()[alone.index]
    return pd.concat([slope_norms(runs, model, 1), saved], axis=1, join="inner")


def kendalls_tau(pairs):
    """Kendall's τ (b, for ties) of two columns; 0 where one of them is the same on all tasks."""
    first, second = (np.sign(column[:, None] - column) for column in pairs.T)
    ordered = np.abs(first).sum() * np.abs(second).sum()
    return (first * second).sum() / np.sqrt(ordered) if ordered else 0.0


# Paths of the hand


def hand_path(path, goal):
    """Places of the hand that hits a goal (from 1), from the goal before to this one, shape
    ``(k, 2)``."""
    return path.task.robot.forward_kinematics(path.subtask(goal), path.hands[goal - 1])


def stations(places):
    """Points at equal distances along a path, shape ``(STATIONS, 2)``."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    lengths = np.concatenate([[0.0], steps.cumsum()])
    at = np.linspace(0, lengths[-1], STATIONS)
    return np.column_stack([np.interp(at, lengths, coordinate) for coordinate in places.T])


def turn(first, second):
    """Angle from one direction to another, left positive, -π to π rad."""
    return np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second)


def bows(runs, model):
    """Return a row for each path from goal to goal between two others, by task: its bow (mean
    distance from the chord, length unit), the turn to the next and the turn from the last, rad
    (left positive)."""
    rows = unmoved(runs, model, arms=1).map(bows_of_path).explode()
    return pd.DataFrame([*rows], rows.index)


def bows_of_path(path):
    """Return the rows of :func:`bows` of one run, a list without the task."""
    chords = np.diff([hand_path(path, 1)[0], *path.task.goal_array], axis=0)
    rows = []
    for k in range(1, len(chords) - 1):
        points = stations(hand_path(path, k + 1))
        chord, away = points[-1] - points[0], points - points[0]
        bow = (chord[0] * away[:, 1] - chord[1] * away[:, 0]) / np.linalg.norm(chord)
        rows.append([bow.mean(), turn(chords[k], chords[k + 1]), turn(chords[k - 1], chords[k])])
    return rows


def slope_of_bows(rows):
    """Slope of the bow on the turn to the next path, given the turn from the last one."""
    bow, to_next, from_last = rows.T
    columns = np.column_stack([to_next, from_last, np.ones(len(bow))])
    return np.linalg.lstsq(columns, bow)[0][0]


def turn_saved(runs, model):
    """Turn at goals (:func:`turn_at_goals`) of the corrective process alone less that of the model,
    by task with one arm, rad."""
    alone, ours = (
        mean_by_task(unmoved(runs, name, arms=1).map(turn_at_goals))
        for name in ("corrective process alone", model)
    )
    return (alone.reindex(ours.index) - ours).dropna()


def turn_at_goals(path):
    """Mean angle by which the hand turns at all goals but the last, 0 to π rad."""
    angles = []
    for goal in range(1, len(path.task.goals)):
        before = hand_path(path, goal)[-1 - TICKS_OF_A_TURN :]
        after = hand_path(path, goal + 1)[: 1 + TICKS_OF_A_TURN]
        angles.append(abs(turn(before[-1] - before[0], after[-1] - after[0])))
    return np.mean(angles)


def apart_by_stop(runs, model):
    """How far apart hand paths to goal 1 lie before two places of goal 2, by task, length unit: in
    the first column of the model that stops at goals, in the second of the model itself."""
    apart = [
        {task: distance_of_ends(by_place) for task, by_place in moving(runs, name, 2).items()}
        for name in (f"{model}, stopping", model)
    ]
    return pd.concat([pd.Series(each, dtype=float) for each in apart], axis=1, join="inner")


def distance_of_ends(by_place):
    """Mean distance of the hand's paths to goal 1, station by station, of the first runs at the
    first and at the last place of ``by_place`` (:func:`moving`)."""
    first, last = (stations(hand_path(by_place.iloc[k][0], 1)) for k in (0, -1))
    return np.linalg.norm(first - last, axis=1).mean()


# Two hands, and long tasks


def ticks_alone(path, goal, hand):
    """Ticks in which the corrective process alone reaches a goal (from 1) with a hand (``left`` or
    ``right``) from where the path hit the goal before; NaN if it does not."""
    same = {name: getattr(path.task, name) for name in ("robot", "hands", "radius", "locked_base")}
    alone = Task(goals=[path.task.goals[goal - 1]], q0=path.subtask(goal)[0], **same)
    trial = corrective_trial(alone, hand[0].upper())
    return trial.ticks if trial.completed else np.nan


def excess_of_first(runs, model):
    """Ticks to goal 1 beyond those of the corrective process alone, by task, where the other hand
    hits goal 2."""
    paths = unmoved(runs, model, arms=2)
    paths = paths[[path.hands[0] != path.hands[1] for path in paths]]
    alone = paths.map(lambda path: ticks_alone(path, 1, path.hands[0]))
    return mean_by_task(paths.map(lambda path: path.execution.ticks_by_goal()[0]) - alone)


def near_tie_repeats(runs, model):
    """Return by task, for each near tie, whether the hand stays the same, 0 or 1; all NaN if all
    tasks together have fewer than :data:`FEWEST_TIES`."""
    repeats = unmoved(runs, model, arms=2).map(repeats_of_path).explode().dropna().astype(float)
    return repeats if len(repeats) >= FEWEST_TIES else repeats * np.nan


def repeats_of_path(path):
    """Return, for each goal from the second on that either hand alone reaches in nearly the same
    ticks (:data:`NEAR_TIE`), whether the hand stays the same."""
    repeats = []
    for goal in range(2, len(path.hands) + 1):
        few, many = np.sort([ticks_alone(path, goal, hand) for hand in ("left", "right")])
        if many <= (1 + NEAR_TIE) * few:
            repeats.append(path.hands[goal - 1] == path.hands[goal - 2])
    return repeats


def sufficient_horizon(runs, model):
    """Return by task the fewest goals ahead with which the planner is within 1 % of all goals in
    view; empty for other models than ``all goals ahead``."""
    values = {}
    planner = runs[(runs.model == "any goals ahead") & (runs.goals >= LONG)]
    for task, rows in planner.groupby("task", sort=False):
        ahead = rows.horizon.clip(upper=rows.goals - 1)
        ticks = pd.Series([path.ticks for path in rows.path], ahead).sort_index()
        values[task] = ticks.index[ticks <= ENOUGH_TICKS * ticks.iloc[-1]].min()
    return pd.Series(values if model == "all goals ahead" else {}, dtype=float)


MEASURES = {
    "slope norm at distance 1": (partial(slope_norms, distance=1), np.mean),
    "slope norm at distance 2": (partial(slope_norms, distance=2), np.mean),
    "slope norm at distance -1": (partial(slope_norms, distance=-1), np.mean),
    "rise of the slope norm at distance 2": (
        norms_by_practice, lambda rows: (rows[:, 1] - rows[:, 3]).mean()
    ),
    "rise of the ratio of slope norms": (norms_by_practice, ratio_rise),
    "benefit correlation": (norms_and_benefits, kendalls_tau),
    "sufficient horizon": (sufficient_horizon, np.mean),
    "bow slope": (bows, slope_of_bows),
    "turn saved at goals": (turn_saved, np.mean),
    "stop ratio": (apart_by_stop, ratio_of_means),
    "first movement against isolated reach": (excess_of_first, np.mean),
    "near-tie repeats": (near_tie_repeats, np.mean),
}  # fmt: skip
"""Every measure with the statistic of all tasks, by the name that ``human.toml`` calls it by."""
