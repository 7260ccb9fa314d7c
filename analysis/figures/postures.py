"""What coarticulation is: one goal, hit in another posture when another goal comes next."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import NO_CONTEXTS, missing
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.figures.robot import MARKERS, box
from coartic.analysis.methods import name_of
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.shared_goal import shared_goal
from coartic.analysis.study import Study
from coartic.robot import Array

_COLORS = (style.BLUE, style.VERMILLION)
_LETTERS = 9  # points: beside others on the first screen it is small
_RUNS: Any = {"linewidth": 0.4, "alpha": 0.25, "zorder": 1}


@style.styled
def postures(study: Study) -> Plot:
    """The postures at one goal before two others, overlaid: all runs faint, their means strong.

    Raises CoarticError where no method has solved runs on two tasks that share their first goals.
    """
    found = shared_goal(study)
    if found is None:
        raise missing(study, NO_CONTEXTS)
    figure = Figure(figsize=(style.ONE, 1.6), layout="constrained")
    _draw(figure.subplots(), found)
    method = name_of(found.method)
    return worded("postures", figure, _data(found), found.tasks, found=found, method=method)


def _draw(axes: Axes, found: TwoContexts) -> None:
    axes.set_axis_off()
    axes.set_aspect("equal")
    shown = np.concatenate([q.mean(axis=0)[None] for q in found.postures])
    low, high = box(found.tasks[0], shown)
    goals = [np.array(task.goals[found.goal]) for task in found.tasks]
    low, high = (
        np.minimum(low, np.min(goals, axis=0) - 0.6),
        np.maximum(high, np.max(goals, 0) + 0.6),
    )
    axes.set_xlim(low[0], high[0] + 1.5)
    axes.set_ylim(low[1], high[1])
    shared = found.tasks[0].goals[found.goal - 1]
    for task, color, runs, (x, y) in zip(found.tasks, _COLORS, found.postures, goals, strict=True):
        for q in runs:
            axes.plot(*task.robot.joint_positions(q, found.hand).T, color=color, **_RUNS)
        following = float(x), float(y)
        mean = runs.mean(axis=0)
        outline = task.robot.base_outline(mean)
        axes.fill(*outline.T, facecolor=color, alpha=0.12, edgecolor=color, linewidth=0.8)
        look = MARKERS[found.hand]
        joints = task.robot.joint_positions(mean, found.hand).T
        axes.plot(*joints, color=color, linewidth=1.6, zorder=3, **look)
        axes.annotate(
            "", following, shared, zorder=2,
            arrowprops={"arrowstyle": "->", "color": color, "shrinkA": 5, "shrinkB": 4,
                        "linewidth": 0.8, "linestyle": (0, (3, 2))},
        )  # fmt: skip
        axes.add_artist(Circle(following, task.radius, fill=False, edgecolor=color))
        up = following[1] >= shared[1]
        axes.annotate(
            f"then goal {found.goal + 1}\n({task.label.lower()})", following, (5, 0),
            textcoords="offset points", va="center", ha="left", fontsize=_LETTERS,
        )  # fmt: skip
        _base(axes, task, mean, above=up)
    axes.add_artist(
        Circle(shared, found.tasks[0].radius, fill=False, edgecolor=style.INK, linewidth=1.1)
    )
    axes.annotate(
        f"goal {found.goal},\nthe same", shared, (7, 0), textcoords="offset points",
        va="center", weight="bold", fontsize=_LETTERS,
    )  # fmt: skip


def _base(axes: Axes, task: Task, q: Array, *, above: bool) -> None:
    """Which posture is which, at its base."""
    outline = task.robot.base_outline(q)
    place = outline.mean(axis=0)[0], outline[:, 1].max() if above else outline[:, 1].min()
    axes.annotate(
        f"base,\n{task.label.lower()}", place, (0, 3 if above else -3), textcoords="offset points",
        ha="center", va="bottom" if above else "top", fontsize=_LETTERS,
    )  # fmt: skip


def _data(found: TwoContexts) -> pd.DataFrame:
    """One row a run: task and posture at the shared goal."""
    parts = []
    for task, runs in zip(found.tasks, found.postures, strict=True):
        joints = dict(zip(task.robot.joint_names, runs.T, strict=True))
        named = {"task": task.name, "method": found.method, "goal": found.goal}
        parts.append(pd.DataFrame({**named, "hand": found.hand, **joints}))
    return pd.concat(parts, ignore_index=True)
