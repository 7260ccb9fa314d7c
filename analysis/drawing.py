"""Drawings of the robot on its tasks, by the conventions of the paper's figures.

Open squares mark the left arm, closed circles the right one, open circles the goals
with their number above (paper, Figures 1 and 4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from coartic import Hand, Task
from coartic.robot import Array

MARKERS: dict[Hand, dict[str, Any]] = {
    # Squares are larger than circles, so that hands at one place show both.
    "left": {"marker": "s", "markersize": 7, "markerfacecolor": "white"},
    "right": {"marker": "o", "markersize": 4},
}
FORMATS = (".png", ".svg", ".pdf")
_INCH = 0.42  # inches per length unit


def draw_robot(axes: Any, task: Task, q: Array, *, color: str = "black") -> None:
    """Draw base and arms in configuration ``q`` (dof,); absent hands have no arm."""
    from matplotlib.patches import Polygon

    outline = task.robot.base_outline(q)
    axes.add_patch(Polygon(outline, closed=True, facecolor="0.85", edgecolor=color, linewidth=1))
    for hand in task.hands:
        points = task.robot.joint_positions(q, hand)
        axes.plot(
            *points.T,
            color=color,
            linewidth=1.4,
            markeredgecolor=color,
            label=f"{hand} arm",
            **MARKERS[hand],
        )


def draw_goals(axes: Any, task: Task) -> None:
    """Draw every goal as an open circle of its radius with its number above."""
    from matplotlib.patches import Circle

    for number, (x, y) in enumerate(task.goals, 1):
        axes.add_patch(Circle((x, y), task.radius, fill=False, edgecolor="black", linewidth=1))
        axes.annotate(
            str(number), (x, y + task.radius), (0, 3), textcoords="offset points",
            ha="center", va="bottom", fontsize=9,
        )  # fmt: skip


def draw_tasks(tasks: Sequence[Task], path: Path) -> None:
    """Start configuration and goals of each task in one panel each, to ``path``.

    The format follows the file's ending (png, svg, pdf). Raises ValueError for one
    that Matplotlib does not know and OSError where the file cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    boxes = [_box(task) for task in tasks]
    width, height = (max(box[1][i] - box[0][i] for box in boxes) for i in (0, 1))
    columns = min(2, len(tasks))
    rows = math.ceil(len(tasks) / columns)
    scale = min(_INCH, 14 / (width * columns), 14 / (height * rows))
    # A fixed salt and no date: the same tasks give the same file.
    with rc_context({"svg.hashsalt": "coartic"}):
        size = (scale * width * columns + 0.8, (scale * height + 0.75) * rows + 0.4)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, task, box in zip(panels, tasks, boxes, strict=False):
            draw_robot(axes, task, task.q0)
            draw_goals(axes, task)
            axes.set_title(_title(task), fontsize=9, loc="left", parse_math=False, wrap=True)
            centre = (box[0] + box[1]) / 2
            axes.set_xlim(centre[0] - width / 2, centre[0] + width / 2)
            axes.set_ylim(centre[1] - height / 2, centre[1] + height / 2)
            axes.set_aspect("equal")
            axes.tick_params(labelsize=8)
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_xlabel("x (length unit)", fontsize=8)
            axes.set_ylabel("y (length unit)", fontsize=8)
        for axes in panels[len(tasks) :]:
            axes.set_axis_off()
        _legend(figure)
        date = {"Date": None} if path.suffix.lower() == ".svg" else None
        figure.savefig(path, dpi=150, metadata=date)


def _title(task: Task) -> str:
    """Name, what is reconstructed, and what is locked; two lines where there is more."""
    remarks = []
    if task.reconstructed:
        remarks.append(f"{' and '.join(task.reconstructed)} reconstructed")
    if task.locked_base:
        remarks.append(f"base locked in {' and '.join(task.locked_base)}")
    return "\n".join([task.label, "; ".join(remarks)]).strip()


def _legend(figure: Any) -> None:
    from matplotlib.lines import Line2D

    entries = [
        Line2D([], [], color="black", markeredgecolor="black", label=f"{hand} arm", **style)
        for hand, style in MARKERS.items()
    ]
    goal: dict[str, Any] = {"marker": "o", "markersize": 6, "markerfacecolor": "none"}
    entries.append(Line2D([], [], linestyle="", markeredgecolor="black", label="goal", **goal))
    figure.legend(handles=entries, loc="outside lower center", ncols=3, frameon=False, fontsize=9)


def _box(task: Task) -> tuple[Array, Array]:
    """Corners of what a panel must show, with a margin."""
    points = [task.robot.base_outline(task.q0), task.goal_array]
    points += [task.robot.joint_positions(task.q0, hand) for hand in task.hands]
    cloud = np.concatenate(points)
    return cloud.min(axis=0) - 0.6, cloud.max(axis=0) + 0.6
