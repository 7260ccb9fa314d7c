"""Draw the robot and its goals by the conventions of the paper's figures.

Open squares mark the left arm, closed circles the right arm, and open circles with a number the
goals (paper, Figures 1, 4 and 6).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike

from coartic.robot import Array, Hand
from coartic.tasks.task import Task

_BLACK, _BASE_GREY, _WHITE = "#000000", "#7a7a7a", "#ffffff"
_HIT = "#009e73"  # colour of a goal that is hit
MARKERS: dict[Hand, dict[str, Any]] = {
    # Squares are larger than circles, so that both are visible at the same position.
    "left": {"marker": "s", "markersize": 4.2, "markerfacecolor": _WHITE},
    "right": {"marker": "o", "markersize": 2.6},
}
_CROWDED = 0.6  # times the robot's scale: a goal this close above another would cover its number


def draw_robot(
    axes: Axes,
    task: Task,
    q: Array,
    *,
    weight: float = 1.0,
    alpha: float = 1.0,
    colour: str = _BLACK,
) -> Callable[[Array], None]:
    """Draw the base, and the arms whose hands the task uses, in a configuration.

    The caller sets the limits of ``axes``, because drawing the base does not widen them.

    Parameters
    ----------
    axes : matplotlib Axes
    task : Task
    q : ndarray, shape (dof,)
        The configuration, in length units and rad.
    weight : float
        Factor for the width of lines.
    alpha : float
        Opacity, from 0 to 1.
    colour : str
        Colour of the lines. The base is filled with grey.

    Returns
    -------
    callable
        A function that moves the drawing to the configuration that is passed to it.
    """
    base = Polygon(
        task.robot.base_outline(q),
        facecolor=(_BASE_GREY, 0.25 * alpha),
        edgecolor=(colour, alpha),
        linewidth=0.6 * weight,
        zorder=1.5,
    )
    axes.add_artist(base)
    style: Any = {
        "color": colour,
        "linewidth": 0.9 * weight,
        "markeredgewidth": 0.7 * weight,
        "alpha": alpha,
    }
    arms = {
        hand: axes.plot(*task.robot.joint_positions(q, hand).T, **style, **MARKERS[hand])[0]
        for hand in task.hands
    }

    def move(q: Array) -> None:
        base.set_xy(task.robot.base_outline(q))
        for hand, arm in arms.items():
            arm.set_data(*task.robot.joint_positions(q, hand).T)

    return move


def circle_goals(axes: Axes, task: Task, *, weight: float = 1.0) -> list[Circle]:
    """Draw every goal as an open circle, and return the circles in goal order.

    The circles have the radius of the goals; ``weight`` is a factor for the width of lines.
    """
    options: Any = {"fill": False, "edgecolor": _BLACK, "linewidth": 0.7 * weight, "zorder": 3}
    circles = [Circle(goal, task.radius, **options) for goal in task.goals]
    for circle in circles:
        axes.add_artist(circle)
    return circles


def fill_goals(circles: list[Circle], hit: ArrayLike) -> None:
    """Fill the circles of goals that are hit, and clear all other circles.

    ``hit`` contains a bool for each circle.
    """
    for circle, is_hit in zip(circles, np.asarray(hit), strict=True):
        circle.set(fill=bool(is_hit), facecolor=_HIT)


def number_goals(axes: Axes, task: Task, *, weight: float = 1.0, **text: Any) -> None:
    """Write the number of each goal (from 1) above the goal.

    The number is below the goal if another goal is close above it. ``weight`` is a factor for the
    distance between the number and the circle of the goal. ``text`` are further options of
    ``Axes.annotate``, such as ``fontsize``.
    """
    goals = task.goal_array
    right, up = np.moveaxis(goals[None] - goals[:, None], 2, 0)
    crowded = _CROWDED * task.robot.scale
    close = (np.abs(right) < crowded / 2) & (up > 0) & (up < crowded)
    for index, ((x, y), below) in enumerate(zip(task.goals, close.any(axis=1), strict=True), 1):
        side = -1 if below else 1
        axes.annotate(
            str(index), (x, y + side * task.radius), (0, 1.5 * weight * side),
            textcoords="offset points", ha="center", va="top" if below else "bottom",
            color=_BLACK, zorder=4,
            bbox={"boxstyle": "square,pad=0", "facecolor": _WHITE, "alpha": 0.8, "linewidth": 0},
            **text,
        )  # fmt: skip


def box(task: Task, configurations: ArrayLike, margin: float = 0.45) -> tuple[Array, Array]:
    """Return the corners of a box around the goals, the base and the arms.

    Parameters
    ----------
    task : Task
    configurations : array_like, shape (..., dof)
        Configurations of the robot, in length units and rad. Only the arms whose hands the task
        uses count.
    margin : float
        Width of the free border (in length units) if the shorter arm has length 4, as the paper's
        arms have. For other arms the width is proportional to the length of the shorter arm.
        Circles of goals may extend into the border.

    Returns
    -------
    low, high : ndarray, shape (2,)
        The lower left and the upper right corner (in length units).
    """
    margin *= task.robot.scale
    points = [
        task.goal_array + np.array([0, 2 * task.radius]),
        task.robot.base_outline(configurations),
    ]
    points += [task.robot.joint_positions(configurations, hand) for hand in task.hands]
    cloud = np.concatenate([part.reshape(-1, 2) for part in points])
    low, high = task.goal_array.min(axis=0), task.goal_array.max(axis=0)
    return (
        np.minimum(cloud.min(axis=0) - margin, low - task.radius),
        np.maximum(cloud.max(axis=0) + margin, high + task.radius),
    )
