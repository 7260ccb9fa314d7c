"""Section on the tasks: start configurations, goals (paper, Figure 4) and rewards."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.words import marked, titled_apart
from coartic.motion.solution import initial_reward
from coartic.pictures.drawing import MARKERS, box, circle_goals, draw_robot, number_goals
from coartic.tasks.task import shipped_tasks


@table(
    "Tasks with their initial and best possible rewards (ticks)",
    "task; arms; base; initial .1; best_hands .1; optimum: best known; "
    "source: best known from; bound: proven bound",
)
def list_tasks(study: Study) -> Rows:
    """Yield a row for each task of :func:`.one_by_one` with its best known reward, and the rewards
    of the corrective process alone with the initial and the best hands, negative ticks."""
    for name, task in one_by_one(study).items():
        best, locked = study.optima.get(name), " and ".join(task.locked_base)
        alone = study.sequences(name).reward.dropna()
        row: Row = {
            "task": marked(task),
            "arms": len(task.hands),
            "base": f"locked in {locked}" if locked else "free",
            "initial": initial_reward(task),
            "best_hands": float(alone.max()) if len(alone) else math.nan,
            "optimum": best.reward if best else None,
            "source": best.source if best else None,
            "bound": best.bound if best else None,
            "run_ids": best.run_id if best else "",
        }
        yield name, row


@figure(
    "Tasks",
    "Start configuration and goals of each task. Open circles are the goals, drawn to scale and "
    "hit in the order of their numbers.",
)
def draw_tasks(study: Study) -> Parts | None:
    """Draw start configuration and goals of the tasks of :func:`.one_by_one`, a panel each; None
    without such tasks."""
    shown = list(one_by_one(study).values())
    if not shown:
        return None
    rows: list[dict[str, object]] = []
    for task in shown:
        start = dict(zip(task.robot.joint_names, task.q0.tolist(), strict=True))
        rows.append({"task": task.name, "goal": 0, **start})
        rows += [
            {"task": task.name, "goal": index, "x": x, "y": y, "radius": task.radius}
            for index, (x, y) in enumerate(task.goals, 1)
        ]
    names = ", ".join(task.name for task in shown)
    alt = f"The robot in its start configuration with the goals of the tasks {names}."
    are_papers = {task.name for task in shown} <= shipped_tasks().keys()
    source = " After Figure 4 of Shah, Barto & Fagg (2013)." * are_papers
    return picture_of_tasks(shown), pd.DataFrame(rows), alt, source


@style.styled
def picture_of_tasks(tasks: Sequence[Task]) -> Figure:
    """Return a figure with start configuration and goals of some tasks, a panel for each."""
    tasks = titled_apart(tasks)
    boxes = [box(task, [task.q0]) for task in tasks]
    width, height = (max(corner[1][i] - corner[0][i] for corner in boxes) for i in (0, 1))
    rows, columns = style.grid(len(tasks))
    above, around = 0.75, 0.55  # inches of a panel for title and axes
    scale = min(
        (style.TWO / columns - around) / width,
        (style.TALLEST - 0.3 - rows * above) / rows / height,
        0.42,
    )
    size = ((scale * width + around) * columns, (scale * height + above) * rows + 0.3)
    size = style.ONE if size[0] <= style.ONE else style.TWO, size[1]  # one column, or two
    if style.is_narrow():
        size = style.ONE, size[1] * style.ONE / size[0] + 0.45 * rows
    drawing, panels = style.panels((rows, columns), size, len(tasks), style.LEAST_SMALL_PANEL)
    drawing.set_layout_engine("compressed")  # else a title can stand beyond the edge
    for place, (axes, task, corners) in enumerate(zip(panels, tasks, boxes, strict=True)):
        draw_robot(axes, task, task.q0)
        if len(task.hands) > 1:  # what shows of an arm under the other one
            left = task.robot.joint_positions(task.q0, "left").T
            axes.plot(*left, color=style.GREY, alpha=0.5, linewidth=3.2, zorder=1.7)
        circle_goals(axes, task)
        number_goals(axes, task)
        remarks = [f"{' and '.join(task.reconstructed)} reconstructed"] * bool(task.reconstructed)
        remarks += [f"base locked in {' and '.join(task.locked_base)}"] * bool(task.locked_base)
        fits = int(14 * drawing.get_figwidth() / columns)  # letters
        title = [*textwrap.wrap(task.label, fits), *textwrap.wrap("; ".join(remarks), fits)]
        axes.set_title("\n".join(title))
        x, y = (corners[0] + corners[1]) / 2
        axes.set_xlim(x - width / 2, x + width / 2)
        axes.set_ylim(y - height / 2, y + height / 2)
        axes.set_aspect("equal")
        if not style.is_narrow() or place + columns >= len(tasks):
            axes.set_xlabel("x (length unit)")
        axes.set_ylabel("y (length unit)")
    room = 12 if style.is_narrow() else None  # numbers of goals stand in between
    style.letters(panels if len(tasks) > 1 else (), pad=room)
    hands = {hand for task in tasks for hand in task.hands}
    arms = [
        style.legend_line(f"{hand} arm", color=style.INK, linewidth=0.9, **look)
        for hand, look in MARKERS.items()
        if hand in hands
    ]
    circle: Any = {"marker": "o", "markersize": 4, "markerfacecolor": "none"}
    goal = style.legend_line("goal", linestyle="", color=style.INK, **circle)
    style.legend(drawing, [*arms, goal], 3)
    return drawing
