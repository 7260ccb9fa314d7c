"""Movements for the report's player: key frames in joint space, as compact JSON.

``player.js`` interpolates the key frames linearly and runs the forward kinematics of
the robot's geometry, which is part of the data. Every joint is within ``TOLERANCE`` of
where it was at every control tick; hits are kept by tick, exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic import (
    MotionModel,
    Robot,
    Task,
    Trajectory,
    initial_hands,
    trajectory,
)
from coartic.analysis.figures.robot import numbered_below
from coartic.analysis.methods import CONDITIONS, spoken_name
from coartic.analysis.report.document import CellKey
from coartic.analysis.signatures.trajectories import Trajectories, corrective
from coartic.analysis.study import Study
from coartic.errors import NotApplicableError
from coartic.robot import HANDS
from coartic.text import json_text

TOLERANCE = 0.005
"""Length unit by which a joint may be off at any tick."""


def player_json(study: Study, cells: Iterable[CellKey] | None = None) -> str:
    """The movements of the cells, all by default, and the initial solutions they began with.

    Of each cell the run nearest its median reward, the first of several; cells with no
    solved run are left out. Raises KeyError for cells that the study does not have.
    """
    chosen = list(study.trajectories if cells is None else cells)
    tasks = [
        _task(study.tasks[name], study, [cell for cell in chosen if cell[0] == name])
        for name in dict.fromkeys(name for name, _ in chosen)
    ]
    shown = [task for task in tasks if task["movements"]]
    return json_text({"tasks": shown, "first": _first(shown)}, allow_nan=False)


def _first(tasks: list[dict[str, Any]]) -> dict[str, Any]:
    """What is played first: the task and the learner's movement that gained most, as a share."""
    gains = [
        ((task["initials"][0]["ticks"] - movement["ticks"]) / task["initials"][0]["ticks"], at, k)
        for at, task in enumerate(tasks)
        for k, movement in enumerate(task["movements"])
        if task["initials"] and movement["label"] in CONDITIONS
    ]
    _, task, movement = max(gains, default=(0.0, 0, 0), key=lambda found: found[0])
    return {"task": task, "movement": movement}


def nearest_to_median(cell: Trajectories) -> int:
    """Index of the run whose reward is nearest the median, the first of several."""
    rewards = np.array([-run.ticks for run in cell.runs], dtype=np.float64)
    return int(np.abs(rewards - np.median(rewards)).argmin())


def key_frames(run: Trajectory, unit: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows ``(k,)`` and configurations ``(k, dof)`` in multiples of ``unit``.

    Linear interpolation between them keeps every joint within ``TOLERANCE`` of where it
    was in every row. Splits at the worst row (Ramer 1972; Douglas and Peucker 1973).
    """
    robot, q = run.task.robot, run.configurations
    points = np.concatenate([robot.joint_positions(q, hand) for hand in HANDS], axis=1)
    rounded = np.rint(q / unit).astype(np.int64)
    kept = {0, len(q) - 1}
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
            kept.add(split)
            spans += [(first, split), (split, last)]
    rows = np.array(sorted(kept), dtype=np.int64)
    return rows, rounded[rows]


def rounding_unit(robot: Robot) -> float:
    """A power of ten, length unit and rad: rounding to it moves no joint by half of TOLERANCE."""
    levers = [
        math.sqrt(2.0) + sum(math.fsum(links[k:]) for k in range(len(links)))
        for links in (robot.left_links, robot.right_links)
    ]
    return float(10.0 ** math.floor(math.log10(TOLERANCE / max(levers))))


def _task(task: Task, study: Study, cells: list[CellKey]) -> dict[str, Any]:
    """A task with the initial solutions and the movements of the cells."""
    initials: dict[str, Trajectory] = {}
    chosen: list[tuple[dict[str, Any], Trajectory]] = []
    for key in cells:
        cell, good = study.trajectories[key], study.cells[key].good
        if not cell.runs:
            continue
        index = nearest_to_median(cell)
        row = good.iloc[index]
        first = row.initial_hands
        hands = (
            str(first) if isinstance(first, str) and first else _initial_hands(task, study.model)
        )
        head = {
            "label": key[1],
            "name": spoken_name(key[1]),
            "run": str(row.run_id),
            "runs": len(cell.runs),
        }
        if hands and hands not in initials:
            execution = corrective(task, hands, study.model)
            if execution is not None:
                initials[hands] = trajectory(task, execution.movements, study.model)
        if hands in initials:
            head["initial"] = hands
        chosen.append((head, cell.runs[index]))
    unit = rounding_unit(task.robot)
    return {
        "name": task.name,
        "label": task.label,
        "goals": task.goal_array.tolist(),
        "radius": task.radius,
        "below": numbered_below(task),
        "hands": list(task.hands),
        "robot": {
            "base": list(task.robot.base_size),
            "left": _arm(task.robot.left_shoulder, task.robot.left_links),
            "right": _arm(task.robot.right_shoulder, task.robot.right_links),
        },
        "unit": unit,
        "initials": [_movement({"hands": hands}, run, unit) for hands, run in initials.items()],
        "movements": [_movement(head, run, unit) for head, run in chosen],
    }


def _initial_hands(task: Task, model: MotionModel) -> str | None:
    try:
        return initial_hands(task, model=model)
    except NotApplicableError:
        return None


def _arm(shoulder: tuple[float, float], links: tuple[float, ...]) -> dict[str, list[float]]:
    return {"shoulder": list(shoulder), "links": list(links)}


def _movement(head: dict[str, Any], run: Trajectory, unit: float) -> dict[str, Any]:
    """``rows`` and ``frames`` as differences to the frame before, the latter frame by frame."""
    rows, frames = key_frames(run, unit)
    return {
        **head,
        "hands": run.execution.hands,
        "ticks": run.ticks,
        "hits": run.hits.tolist(),
        "rows": np.diff(rows, prepend=0).tolist(),
        "frames": np.diff(frames, axis=0, prepend=0).ravel().tolist(),
    }
