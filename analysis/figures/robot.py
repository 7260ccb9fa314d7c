"""The robot and its goals, by the conventions of the paper's figures.

Open squares mark the left arm, closed circles the right one, open circles the goals
with their number above (paper, Figures 1, 4 and 6).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike

from coartic import Hand, Task
from coartic.analysis.figures.style import GREY, INK, PAPER, entry
from coartic.robot import Array

MARKERS: dict[Hand, dict[str, Any]] = {
    # Squares are larger than circles, so that hands at one place show both.
    "left": {"marker": "s", "markersize": 4.2, "markerfacecolor": PAPER},
    "right": {"marker": "o", "markersize": 2.6},
}
MARGIN = 0.45  # length unit around what is drawn


def draw_robot(axes: Axes, task: Task, q: Array) -> None:
    """Draw base and arms in configuration ``q`` (dof,), their joints marked.

    The limits of ``axes`` are set by whoever draws: patches do not widen them, which takes long.
    """
    outline = task.robot.base_outline(q)
    axes.add_artist(Polygon(outline, facecolor=GREY, alpha=0.25, edgecolor="none", zorder=1.5))
    axes.add_artist(Polygon(outline, fill=False, edgecolor=INK, linewidth=0.6, zorder=1.6))
    for hand in task.hands:
        joints = task.robot.joint_positions(q, hand).T
        axes.plot(*joints, color=INK, linewidth=0.9, markeredgewidth=0.7, **MARKERS[hand])


_CROWDED = 0.6  # length unit: a goal that near above another has its number


def numbered_below(task: Task) -> list[bool]:
    """Whether a goal's number goes below it, since another goal is close above."""
    goals = task.goal_array
    right, up = np.moveaxis(goals[None] - goals[:, None], 2, 0)
    close = (np.abs(right) < _CROWDED / 2) & (up > 0) & (up < _CROWDED)
    return [bool(near) for near in close.any(axis=1)]


def draw_goals(axes: Axes, task: Task) -> None:
    """Draw every goal as an open circle of its radius with its number above, or below."""
    for index, (x, y) in enumerate(task.goals, 1):
        side = -1 if numbered_below(task)[index - 1] else 1
        axes.add_artist(
            Circle((x, y), task.radius, fill=False, edgecolor=INK, linewidth=0.7, zorder=3)
        )
        axes.annotate(
            str(index), (x, y + side * task.radius), (0, 1.5 * side),
            textcoords="offset points", ha="center", va="bottom" if side > 0 else "top",
            color=INK, zorder=4,
            bbox={"boxstyle": "square,pad=0", "facecolor": PAPER, "alpha": 0.8, "linewidth": 0},
        )  # fmt: skip


def legend_entries(hands: Iterable[Hand]) -> list[Line2D]:
    """Handles for the arms of ``hands`` and a goal."""
    hands = set(hands)
    arms = (
        entry(f"{hand} arm", color=INK, linewidth=0.9, **look)
        for hand, look in MARKERS.items()
        if hand in hands
    )
    goal: Any = {"marker": "o", "markersize": 4, "markerfacecolor": "none"}
    return [*arms, entry("goal", linestyle="", color=INK, **goal)]


def box(task: Task, postures: ArrayLike) -> tuple[Array, Array]:
    """Corners of what shows a task with the robot in all these configurations, with a margin.

    ``postures``: shape ``(n, dof)``.
    """
    points = [task.goal_array + np.array([0, 2 * task.radius]), task.robot.base_outline(postures)]
    points += [task.robot.joint_positions(postures, hand) for hand in task.hands]
    cloud = np.concatenate([part.reshape(-1, 2) for part in points])
    return cloud.min(axis=0) - MARGIN, cloud.max(axis=0) + MARGIN
