"""Movements for the report's player: key frames in joint space, as compact JSON.

``player.js`` interpolates the key frames linearly and runs the forward kinematics of the robot's
geometry, which is part of the data. Every joint is within ``TOLERANCE`` of where it was at every
control tick; hits are kept by tick, exactly.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic import Robot, Task, Trajectory, trajectory
from coartic.analysis.methods import CONDITIONS, in_order, main_methods, name_of
from coartic.analysis.study import Study, one_by_one, typical_run
from coartic.analysis.topics.coarticulation.values import shared_goal
from coartic.analysis.topics.comparison.sentences import most_improved
from coartic.analysis.trajectories import initial_solution
from coartic.drawing import numbered_below
from coartic.robot import HANDS

TOLERANCE = 0.005
"""Length unit by which a joint may be off at any tick."""


def player_data(study: Study) -> dict[str, Any] | None:
    """Tasks, movements and views of the player; None where no run has a solution.

    Of each task the initial solution and, for each main method, the run nearest its median
    reward. A view names one or two movements to begin with and says what to watch.
    """
    tasks: list[dict[str, Any]] = []
    movements: list[dict[str, Any]] = []
    for name in (name for name in study.tasks if name in one_by_one(study)):
        task, unit = study.tasks[name], rounding_unit(study.tasks[name].robot)
        labels = [label for on, label in study.cells if on == name]
        shown = in_order([k for k in labels if k in (*CONDITIONS, *main_methods(labels))])
        on_task = []
        if (initial := initial_solution(task, study.model)) is not None:
            run = trajectory(task, initial.movements, study.model)
            on_task.append(movement_of(len(tasks), "", "initial solution", "", run, unit))
        for label in shown:
            runs = study.trajectories(name, label).runs
            if runs:
                good = study.cells[name, label].good[: len(runs)]
                k = typical_run(replace(study.cells[name, label], runs=good))
                about = label, name_of(label), str(good.run_id.iloc[k])
                on_task.append(movement_of(len(tasks), *about, runs[k], unit))
        if on_task:
            tasks.append(geometry_of(task, unit))
            movements += on_task
    views = views_of(study, movements)
    return {"tasks": tasks, "movements": movements, "views": views} if movements else None


def player_json(study: Study) -> str:
    """:func:`player_data` as JSON; empty where there is nothing to play."""
    data = player_data(study)
    return "" if data is None else json.dumps(data, allow_nan=False, separators=(",", ":"))


def views_of(study: Study, movements: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the player offers first: the same goal before two successors, before and after."""
    place = {(movement["on"], movement["label"]): k for k, movement in enumerate(movements)}
    views: list[dict[str, Any]] = []
    shared, most = shared_goal(study), most_improved(study)
    if shared is not None:
        views.append(
            {
                "name": "One goal, two successors",
                "watch": f"Both robots hit the same goal {shared.goal} first. Watch how their "
                "joints differ when it is hit, because the next goal lies elsewhere.",
                "show": [place.get((task.name, shared.method)) for task in shared.tasks],
                "pause": shared.goal,
            }
        )
    if most is not None:
        task, label = most[0]
        views.append(
            {
                "name": "Before and after learning",
                "watch": "The same task before and after learning. Watch how the learner "
                "prepares for a goal while it moves to the one before.",
                "show": [place.get((task, of)) for of in ("", label)],
            }
        )
    views = [view for view in views if None not in view["show"]]
    return views or [{"name": "Movements", "watch": "", "show": [0]}]


def key_frames(run: Trajectory, unit: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows ``(k,)`` and configurations ``(k, dof)`` in multiples of ``unit``.

    Linear interpolation between them keeps every joint within ``TOLERANCE`` of where it
    was in every row. Splits at the worst row (Ramer 1972; Douglas and Peucker 1973).
    """
    robot, q = run.task.robot, run.configurations
    points = np.concatenate([robot.joint_positions(q, hand) for hand in HANDS], axis=1)
    rounded = np.rint(q / unit).astype(np.int64)
    chosen = {0, len(q) - 1}
    spans = [(0, len(q) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        share = (np.arange(first, last + 1) - first)[:, None] / (last - first)
        between = unit * (rounded[first] + share * (rounded[last] - rounded[first]))
        drawn = np.concatenate([robot.joint_positions(between, hand) for hand in HANDS], axis=1)
        off = np.linalg.norm(drawn - points[first : last + 1], axis=2).max(axis=1)[1:-1]
        worst = int(off.argmax())
        if off[worst] > TOLERANCE:
            split = first + 1 + worst
            chosen.add(split)
            spans += [(first, split), (split, last)]
    rows = np.array(sorted(chosen), dtype=np.int64)
    return rows, rounded[rows]


def rounding_unit(robot: Robot) -> float:
    """A power of ten, length unit and rad: rounding to it moves no joint by half of TOLERANCE."""
    levers = [
        math.sqrt(2.0) + sum(math.fsum(links[k:]) for k in range(len(links)))
        for links in (robot.left_links, robot.right_links)
    ]
    return float(10.0 ** math.floor(math.log10(TOLERANCE / max(levers))))


def geometry_of(task: Task, unit: float) -> dict[str, Any]:
    """Goals of a task, and the geometry of its robot."""
    robot = task.robot
    return {
        "label": task.label,
        "goals": task.goal_array.tolist(),
        "radius": task.radius,
        "below": numbered_below(task),
        "hands": list(task.hands),
        "robot": {
            "base": list(robot.base_size),
            "left": {"shoulder": list(robot.left_shoulder), "links": list(robot.left_links)},
            "right": {"shoulder": list(robot.right_shoulder), "links": list(robot.right_links)},
        },
        "unit": unit,
    }


def movement_of(
    task: int, label: str, name: str, run_id: str, run: Trajectory, unit: float
) -> dict[str, Any]:
    """``rows`` and ``frames`` as differences to the frame before, the latter frame by frame."""
    rows, frames = key_frames(run, unit)
    return {
        "task": task,
        "on": run.task.name,
        "label": label,
        "name": name,
        "run": run_id,
        "hands": run.execution.hands,
        "ticks": run.ticks,
        "hits": run.hits.tolist(),
        "rows": np.diff(rows, prepend=0).tolist(),
        "frames": np.diff(frames, axis=0, prepend=0).ravel().tolist(),
    }
