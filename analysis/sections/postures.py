"""Figure of solutions goal by goal, as in Figures 5 to 7 of the paper."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic import Execution, Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure
from coartic.analysis.methods import CONDITION_OF
from coartic.analysis.published import published_cell
from coartic.analysis.solutions import initial_solution
from coartic.analysis.study import Study, typical_run
from coartic.drawing import BASE_GREY, MARKERS, box, draw_goals, number_goals
from coartic.robot import HANDS


@figure(
    "Postures goal by goal",
    "Initial and learned solutions in the posture that hits each goal (black) and the one before "
    "(grey), as in Figures 5 to 7 of the paper; of a condition the run with the reward nearest to "
    "the median. Marked: the arm that hits the goal, open squares the left, filled circles the "
    "right one. Numbers: reward of the movement.",
)
def draw_solutions(study: Study) -> Parts | None:
    """Draw the initial solution and each condition's median run, goal by goal."""
    rows = list[tuple[Task, str, Execution]]()
    for name, task in study.tasks.items():
        cells = {
            CONDITION_OF[label]: cell
            for (on, label), cell in study.cells.items()
            if on == name
            and label in CONDITION_OF
            and len(cell.good)
            and published_cell(name, CONDITION_OF[label]) is not None
        }
        if cells and (initial := initial_solution(task)) is not None:
            rows.append((task, "initial", initial))
        for condition, cell in sorted(cells.items()):
            executed = study.executed(name, cell.label)
            number = executed.run_ids.index(typical_run(cell.good))
            rows.append((task, condition, executed.runs[number]))
    if not rows:
        return None
    most = max(len(task.goals) for task, *_ in rows)
    drawing, axes = style.panels(
        (len(rows), most), (style.TWO, min(style.TALLEST, 0.82 * len(rows)))
    )
    parts = []
    for place, (task, condition, run) in enumerate(rows):
        of_task = [each for on, _, each in rows if on is task]
        low, high = box(task, np.vstack([task.q0, *(each.configurations for each in of_task)]), 0.2)
        panels = axes[place * most : (place + 1) * most]
        for panel in panels:
            panel.set_axis_off()
            panel.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        words = f"{task.label}\n{condition}, {run.hands}\n−{run.ticks}"
        panels[0].text(-0.05, 0.5, words, transform=panels[0].transAxes, ha="right", va="center")
        before = task.q0
        for goal, (q, ticks) in enumerate(
            zip(run.configurations, run.ticks_by_goal(), strict=True)
        ):
            draw_hit(panels[goal], task, before, q, HANDS["LR".index(run.hands[goal])], f"−{ticks}")
            named = {"task": task.name, "condition": condition, "goal": goal + 1}
            angles = dict(zip(task.robot.joint_names, q.tolist(), strict=True))
            parts.append({**named, "hand": run.hands[goal], "reward": -ticks, **angles})
            before = q
    alt = "Postures of the robot at each goal, before and after learning. " + "; ".join(
        f"{task.label}, {condition}: {run.hands}, reward −{run.ticks}"
        for task, condition, run in rows
    )
    return drawing, pd.DataFrame(parts), f"{alt}.", [task for task, *_ in rows]


def draw_hit(axes: Axes, task: Task, before: Any, q: Any, hand: Any, reward: str) -> None:
    """Draw the posture that hits a goal, with the arm of the hand marked, and the one before."""
    robot = task.robot
    for posture, colour in ((before, BASE_GREY), (q, style.INK)):
        outline = robot.base_outline(posture)
        axes.fill(*outline.T, facecolor="none", edgecolor=colour, linewidth=0.5)
        for side in task.hands:
            marks = MARKERS[hand] if side == hand and posture is q else {}
            small: Any = {**marks, "markersize": 2.0, "markeredgewidth": 0.5}
            joints = robot.joint_positions(posture, side).T
            axes.plot(*joints, color=colour, linewidth=0.7, **small)
    draw_goals(axes, task, weight=0.6)
    number_goals(axes, task, weight=0.6, fontsize=5)
    axes.text(0.4, -0.02, reward, transform=axes.transAxes, ha="center", va="top")
