"""The figure to touch: a goal is moved, and the posture at the goal before it is looked at.

Suite ``locus`` moves a goal from run to run. :func:`locus_postures` reads its data from the
runs of that suite; folders of other suites show ``next_goal.csv``, which is made by the same
function. The page draws every position of each goal, and ``next_goal.js`` chooses one of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from coartic import CoarticError, Task, load_task
from coartic.analysis.methods import EC1, INITIAL, name_of
from coartic.analysis.report.text import environment
from coartic.analysis.study import Study
from coartic.analysis.words import number
from coartic.drawing import box
from coartic.robot import Array

TASK = "ascending"
MOVED = (2, 3)
"""The goals that are moved, one at a time, counted from 1. The page begins with the last: the
learned posture follows goal 2 little, goal 3 clearly."""
METHODS = {INITIAL: "One goal at a time", EC1: "Learned"}
"""The methods side by side, with their headings."""
HANDLE = 0.45
"""Length unit around the goal where a pointer takes hold of it."""
STORED = Path(__file__).with_name("next_goal.csv")
"""Postures of a folder of suite ``locus``, for folders of other suites."""


def locus_postures(study: Study) -> pd.DataFrame:
    """Which goal is moved and where it is, and the posture at the goal before it: a row a run.

    Of the positions at which every method of the figure has solved runs; empty where a goal has
    fewer than two.
    """
    rows = []
    for name, moved in ((name, goal) for goal in MOVED for name in study.tasks):
        cells = [study.cells.get((name, label)) for label in METHODS]
        solved = [cell for cell in cells if cell is not None and len(cell.good)]
        if not name.startswith(f"{TASK}.goal{moved}_") or len(solved) < len(METHODS):
            continue
        for cell in solved:
            runs = study.trajectories(name, cell.label).runs
            for run_id, run in zip(cell.good.run_id, runs, strict=False):
                x, y = run.task.goals[moved - 1]
                q = run.execution.configurations[moved - 2]
                posture = {"moved": moved, "method": cell.label, "run_id": run_id, "x": x, "y": y}
                rows.append(posture | dict(zip(run.task.robot.joint_names, q, strict=True)))
    positions = [len({(row["x"], row["y"]) for row in rows if row["moved"] == k}) for k in MOVED]
    frame = pd.DataFrame(rows if min(positions) > 1 else [])
    return frame.assign(suite=study.suite, seed=study.plan.seed, version=study.made_with["coartic"])


def store(study: Study) -> None:
    """Keep the postures of a folder of suite ``locus`` for folders of other suites."""
    kept = locus_postures(study)
    if kept.empty:
        raise CoarticError(f"{study.folder} lacks runs of {TASK} with goals moved")
    kept.to_csv(STORED, index=False, float_format="%.4f", lineterminator="\n")


def next_goal(study: Study | None = None) -> str:
    """The figure as HTML, from a folder's own runs or from the stored ones."""
    shown = pd.DataFrame() if study is None else locus_postures(study)
    is_example = shown.empty
    shown = pd.read_csv(STORED) if is_example else shown
    task = load_task(TASK)
    low, high = box(task, shown[[*task.robot.joint_names]].to_numpy())
    high[1] = max(high[1], shown.y.max() + HANDLE)
    template = environment(escape=True).get_template("next_goal.html.jinja")
    return template.render(
        moves=[move_of(task, moved, runs) for moved, runs in shown.groupby("moved")],
        is_example=is_example,
        radius=task.radius,
        handle=HANDLE,
        sight=[round(value, 2) for value in (low[0], -high[1], *(high - low))],
        task=task.label,
        runs={name_of(label): sum(shown.method == label) for label in METHODS},
        **shown[["suite", "seed", "version"]].iloc[0],
    )


def move_of(task: Task, moved: Any, shown: pd.DataFrame) -> dict[str, Any]:
    """The pictures of one goal that moves, a panel a method."""
    panels: list[dict[str, Any]] = []
    for label, name in METHODS.items():
        rows = shown[shown.method == label]
        places = [place_of(task, runs) for _, runs in rows.groupby(["x", "y"])]
        rise = number(places[-1]["base"] - places[0]["base"], 2)
        spread = number(rows.groupby(["x", "y"]).base_y.var().mean() ** 0.5, 2)
        panels.append({"name": name, "places": places, "rise": rise, "spread": spread})
    goals = [place["goal"] for place in panels[0]["places"]]
    return {
        "goal": moved,
        "panels": panels,
        "goals": goals,
        "others": [(k, x, y) for k, (x, y) in enumerate(task.goals, 1) if k != moved],
        "start": int(np.square(np.subtract(goals, task.goals[moved - 1])).sum(axis=1).argmin()),
    }


def place_of(task: Task, runs: pd.DataFrame) -> dict[str, Any]:
    """One position of the goal with the postures of one method's runs there, and their mean."""
    configurations = runs[[*task.robot.joint_names]].to_numpy()
    mean = configurations.mean(axis=0)
    return {
        "goal": (float(runs.x.iloc[0]), float(runs.y.iloc[0])),
        "runs": [robot(task, q) for q in configurations],
        "mean": robot(task, mean),
        "base": float(mean[1]),
    }


def robot(task: Task, q: Array) -> dict[str, Any]:
    """A posture as SVG wants it, with y downwards: corners of the base, joints of each arm."""

    def points(of: Array) -> list[str]:
        return [f"{x:.3f},{-y:.3f}" for x, y in np.asarray(of)]

    arms = [points(task.robot.joint_positions(q, hand)) for hand in task.hands]
    return {"base": points(task.robot.base_outline(q)), "arms": arms}
