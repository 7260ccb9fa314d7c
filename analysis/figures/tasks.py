"""The tasks: start configurations and goals (paper, Figure 4)."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.figures.robot import box, draw_goals, draw_robot, legend_entries
from coartic.analysis.study import Study


def tasks(study: Study) -> Plot:
    """:func:`tasks_plot` of a folder's tasks."""
    return tasks_plot(list(study.tasks.values()))


@style.styled
def tasks_plot(tasks: Sequence[Task]) -> Plot:
    """Start configuration and goals of each task in one panel each.

    Raises ValueError without a task.
    """
    if not tasks:
        raise ValueError("no task to draw")
    boxes = [box(task, [task.q0]) for task in tasks]
    width, height = (max(corner[1][i] - corner[0][i] for corner in boxes) for i in (0, 1))
    rows, columns = style.grid(len(tasks))
    above, around = 0.62, 0.55  # inches of a panel for title and axes
    scale = min(
        (style.TWO / columns - around) / width,
        (style.TALLEST - 0.3 - rows * above) / rows / height,
        0.42,
    )
    size = ((scale * width + around) * columns, (scale * height + above) * rows + 0.3)
    figure, panels = style.figure_of((rows, columns), (style.column_width(size[0]), size[1]))
    for axes, task, corners in zip(panels, tasks, boxes, strict=False):
        draw_robot(axes, task, task.q0, marked=task.hands)
        draw_goals(axes, task)
        twice = [other.label for other in tasks].count(task.label) > 1
        name = task.name if twice else task.label
        axes.set_title(_title(task, name))
        x, y = (corners[0] + corners[1]) / 2
        axes.set_xlim(x - width / 2, x + width / 2)
        axes.set_ylim(y - height / 2, y + height / 2)
        axes.set_aspect("equal")
        axes.set_xlabel("x (length unit)")
        axes.set_ylabel("y (length unit)")
    for axes in panels[len(tasks) :]:
        axes.set_axis_off()
    style.legend(figure, legend_entries(hand for task in tasks for hand in task.hands), 3)
    names = ", ".join(task.name for task in tasks)
    return worded("tasks", figure, _data(tasks), tasks=names)


def _title(task: Task, name: str) -> str:
    """Name, what is reconstructed, and what is locked; two lines where there is more."""
    remarks = []
    if task.reconstructed:
        remarks.append(f"{' and '.join(task.reconstructed)} reconstructed")
    if task.locked_base:
        remarks.append(f"base locked in {' and '.join(task.locked_base)}")
    return "\n".join([name, "; ".join(remarks)]).strip()


def _data(tasks: Sequence[Task]) -> pd.DataFrame:
    """One row a goal, after one for the start with its configuration."""
    rows: list[dict[str, object]] = []
    for task in tasks:
        start = dict(zip(task.robot.joint_names, task.q0.tolist(), strict=True))
        rows.append({"task": task.name, "goal": 0, **start})
        rows += [
            {"task": task.name, "goal": index, "x": x, "y": y, "radius": task.radius}
            for index, (x, y) in enumerate(task.goals, 1)
        ]
    return pd.DataFrame(rows)
