"""Define the measures by which models are compared with the findings of human.toml.

A measure is a function of the runs of all models (:func:`study.tidy`) and the name of a model. It
returns the model's values with tasks as index: a Series or, if a value has several numbers, a
frame. A task can have several rows. A statistic is a function of the rows of all tasks, shape
``(n, k)``.
"""

from functools import partial

import numpy as np
import pandas as pd

from coartic import Task, corrective_trial

STATIONS = 100
"""Number of points at equal distances along a hand's path."""
NEAR_TIE, MIN_TIES = 0.05, 30
"""Largest difference between the ticks of both hands in a near tie, as a share of the fewer ticks,
and the smallest number of near ties for which repeats are measured."""
LONG, ENOUGH_TICKS = 6, 1.01
"""Smallest number of goals of a task on which the sufficient horizon is measured, and the largest
number of ticks of a sufficient horizon, as a multiple of those with all goals in view."""
TICKS_OF_A_TURN = 5
"""Ticks before a hit, and after it, over which the direction of a hand is measured."""


def unmoved(runs, model, arms):
    """Return a model's paths by task, on tasks with this number of arms.

    Tasks with a moved goal, and tasks with :data:`LONG` or more goals, are left out.
    """
    short = (runs.moved == 0) & (runs.goals < LONG)
    ours = runs[short & (runs.model == model) & (runs.arms == arms)]
    return ours.set_index("task").path


def moving(runs, model, goal):
    """Return a model's paths on tasks in which ``goal`` (from 1) is moved, by task.

    A value is a Series of lists of paths. Its index is the position of the goal (y, in length
    units). Tasks with fewer than three positions are left out.
    """
    ours = runs[(runs.model == model) & (runs.moved == goal)]
    tasks = ours.groupby("origin", sort=False)
    by_task = {task: rows.groupby("place").path.agg(list) for task, rows in tasks}
    return {task: by_place for task, by_place in by_task.items() if len(by_place) > 2}


def mean_by_task(values):
    """Return the mean of values by task, their index. Tasks without a value are left out."""
    return values.astype(float).groupby(level=0, sort=False).mean().dropna()


# Postures that follow a goal that moves


def slope_norms(runs, model, distance):
    """Return by task how strongly a posture depends on the position of a moved goal.

    The slopes of the joints on the position of the goal are a vector; the result is its norm. With
    ``distance`` 1 or 2, the posture is that at goal 1, and goal 2 or 3 is moved. With -1, the
    posture is that at goal 2, and goal 1 is moved. Slopes are in rad, or length units, per length
    unit.

    The squared norm is the mean product of the slopes of different runs, which is unbiased however
    much runs differ. By chance it can be negative. The result then has a negative sign.
    """
    at, norms = (1 if distance > 0 else 2), {}
    for task, by_place in moving(runs, model, at + distance).items():
        count = by_place.map(len).min()
        postures = [
            [path.execution.configurations[at - 1] for path in paths[:count]] for paths in by_place
        ]
        away = np.array(by_place.index) - np.mean(by_place.index)
        slopes = np.einsum("p,prj->rj", away / (away**2).sum(), postures)
        slopes = slopes if count > 1 else slopes.repeat(2, axis=0)  # a single deterministic run
        products = slopes.sum(axis=0) ** 2 - (slopes**2).sum(axis=0)
        square = products.sum() / (len(slopes) * (len(slopes) - 1))
        norms[task] = round(float(np.sign(square) * np.sqrt(abs(square))), 6)  # 0, not 1e-12
    return pd.Series(norms, dtype=float)


def norms_by_practice(runs, model):
    """Return slope norms at distances 1 and 2, with a row for each task.

    The first two columns are for the end of practice, the last two for a hundredth of the practice.
    """
    norms = [slope_norms(runs, model + when, k) for when in ("", ", begun") for k in (1, 2)]
    return pd.concat(norms, axis=1, join="inner")


def ratio_rise(rows):
    """Return by how much the ratio of mean slope norms at distances 2 and 1 rises with practice."""
    return ratio_of_means(rows[:, [1, 0]]) - ratio_of_means(rows[:, [3, 2]])


def ratio_of_means(pairs):
    """Return the mean of the first column divided by that of the second."""
    return pairs[:, 0].mean() / pairs[:, 1].mean()


def norms_and_benefits(runs, model):
    """Return by task the slope norm at distance 1, and the ticks that preparation can save.

    What can be saved are the ticks of the planner with no goal ahead, less the fewest ticks of any
    run. Only tasks without a moved goal count.
    """
    alone = mean_by_task(unmoved(runs, "no goal ahead", arms=1).map(lambda path: path.ticks))
    saved = alone + runs.groupby("task").best.first()[alone.index]
    return pd.concat([slope_norms(runs, model, 1), saved], axis=1, join="inner")


def kendalls_tau(pairs):
    """Return Kendall's τ_b of two columns; 0 if one of them is the same on all tasks."""
    first, second = (np.sign(column[:, None] - column) for column in pairs.T)
    ordered = np.abs(first).sum() * np.abs(second).sum()
    return (first * second).sum() / np.sqrt(ordered) if ordered else 0.0


# Paths of the hand


def hand_path(path, goal):
    """Return the path to a goal (from 1) of the hand that hits it, shape ``(k, 2)``.

    The path begins at the hit of the previous goal.
    """
    return path.task.robot.forward_kinematics(path.subtask(goal), path.hands[goal - 1])


def stations(places):
    """Return points at equal distances along a path, shape ``(STATIONS, 2)``."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    lengths = np.concatenate([[0.0], steps.cumsum()])
    at = np.linspace(0, lengths[-1], STATIONS)
    return np.column_stack([np.interp(at, lengths, coordinate) for coordinate in places.T])


def turn(first, second):
    """Return the angle from one direction to another, -π to π rad; positive to the left."""
    return np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second)


def bows(runs, model):
    """Return the bow of each path that has a path before it and a path after it, by task.

    A row has the bow (the mean distance from the chord, in length units), the turn to the next path
    and the turn from the previous path (in rad). All are positive to the left.
    """
    rows = unmoved(runs, model, arms=1).map(bows_of_path).explode()
    return pd.DataFrame([*rows], rows.index)


def bows_of_path(path):
    """Return the rows of :func:`bows` for one run, as a list."""
    chords = np.diff([hand_path(path, 1)[0], *path.task.goal_array], axis=0)
    rows = []
    for k in range(1, len(chords) - 1):
        points = stations(hand_path(path, k + 1))
        chord, away = points[-1] - points[0], points - points[0]
        bow = (chord[0] * away[:, 1] - chord[1] * away[:, 0]) / np.linalg.norm(chord)
        rows.append([bow.mean(), turn(chords[k], chords[k + 1]), turn(chords[k - 1], chords[k])])
    return rows


def slope_of_bows(rows):
    """Return the slope of the bow on the turn to the next path.

    The turn from the previous path is a further regressor.
    """
    bow, to_next, from_last = rows.T
    columns = np.column_stack([to_next, from_last, np.ones(len(bow))])
    return np.linalg.lstsq(columns, bow)[0][0]


def turn_saved(runs, model):
    """Return how much less a model turns at goals than the corrective process alone, in rad.

    There is a value for each task with one arm (:func:`turn_at_goals`).
    """
    alone, ours = (
        mean_by_task(unmoved(runs, name, arms=1).map(turn_at_goals))
        for name in ("corrective process alone", model)
    )
    return (alone.reindex(ours.index) - ours).dropna()


def turn_at_goals(path):
    """Return the mean angle by which the hand turns at all goals but the last, 0 to π rad."""
    angles = []
    for goal in range(1, len(path.task.goals)):
        before = hand_path(path, goal)[-1 - TICKS_OF_A_TURN :]
        after = hand_path(path, goal + 1)[: 1 + TICKS_OF_A_TURN]
        angles.append(abs(turn(before[-1] - before[0], after[-1] - after[0])))
    return np.mean(angles)


def apart_by_stop(runs, model):
    """Return the distance of hand paths to goal 1 with two positions of goal 2, by task.

    Distances are in length units. The first column is for the model that stops at goals, the second
    for the model itself.
    """
    apart = [
        {task: distance_of_ends(by_place) for task, by_place in moving(runs, name, 2).items()}
        for name in (f"{model}, stopping", model)
    ]
    return pd.concat([pd.Series(each, dtype=float) for each in apart], axis=1, join="inner")


def distance_of_ends(by_place):
    """Return the mean distance between two paths of the hand to goal 1, station by station.

    They are the paths of the first run at the first and at the last position in ``by_place``
    (:func:`moving`).
    """
    first, last = (stations(hand_path(by_place.iloc[k][0], 1)) for k in (0, -1))
    return np.linalg.norm(first - last, axis=1).mean()


# Two hands, and long tasks


def ticks_alone(path, goal, hand):
    """Return the ticks that the corrective process alone needs for a goal (from 1) with a hand.

    The movement starts where ``path`` hit the previous goal. ``hand`` is ``left`` or ``right``. The
    result is NaN if the corrective process does not hit the goal.
    """
    same = {name: getattr(path.task, name) for name in ("robot", "hands", "radius", "locked_base")}
    alone = Task(goals=[path.task.goals[goal - 1]], q0=path.subtask(goal)[0], **same)
    trial = corrective_trial(alone, hand[0].upper())
    return trial.ticks if trial.completed else np.nan


def excess_of_first(runs, model):
    """Return by task the ticks to goal 1 in excess of those of the corrective process alone.

    Only runs count in which the other hand hits goal 2.
    """
    paths = unmoved(runs, model, arms=2)
    paths = paths[[path.hands[0] != path.hands[1] for path in paths]]
    alone = paths.map(lambda path: ticks_alone(path, 1, path.hands[0]))
    return mean_by_task(paths.map(lambda path: path.execution.ticks_by_goal()[0]) - alone)


def near_tie_repeats(runs, model):
    """Return by task, for each near tie, 1 if the hand stays the same, and otherwise 0.

    All values are NaN if all tasks together have fewer than :data:`MIN_TIES` near ties.
    """
    repeats = unmoved(runs, model, arms=2).map(repeats_of_path).explode().dropna().astype(float)
    return repeats if len(repeats) >= MIN_TIES else repeats * np.nan


def repeats_of_path(path):
    """Return, for each near tie of a run, whether the hand stays the same.

    A goal, from the second on, is a near tie if the corrective process alone hits it with either
    hand in nearly the same number of ticks (:data:`NEAR_TIE`).
    """
    repeats = []
    for goal in range(2, len(path.hands) + 1):
        few, many = np.sort([ticks_alone(path, goal, hand) for hand in ("left", "right")])
        if many <= (1 + NEAR_TIE) * few:
            repeats.append(path.hands[goal - 1] == path.hands[goal - 2])
    return repeats


def sufficient_horizon(runs, model):
    """Return by task the fewest goals ahead with which the planner needs at most 1 % more ticks.

    The comparison is with all goals in view. The result is empty for models other than ``all goals
    ahead``.
    """
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
"""Measures and their statistics over all tasks, by the name that ``human.toml`` uses."""
