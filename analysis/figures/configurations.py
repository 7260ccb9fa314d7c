"""Configurations at each goal, initial and learned (paper, Figures 5 to 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coartic import Execution, Task
from coartic.analysis.cells import common_sequences, typical_run
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.figures.robot import box, draw_goals, draw_robot, legend_entries
from coartic.analysis.methods import CONDITIONS, name_of
from coartic.analysis.study import Study
from coartic.analysis.trajectories import initial_solution
from coartic.analysis.words import number
from coartic.robot import Array
from coartic.tasks.task import hands_of

_CAPTION = (
    "Configuration when each goal was hit (black; joints of the chosen arm are marked: open "
    "squares left, closed circles right) and the one before (grey). Above each panel: goal, chosen "
    "hand and reward of the movement; at the end of a row: the total. Each method is shown by up "
    "to two hand sequences that at least a fifth of its runs find, each by the run nearest to "
    "their median reward. In brackets: in how many of the method's runs the hand sequence was "
    "found. After {} of Shah, Barto & Fagg (2013)."
)


@figure(
    "configurations-one-armed",
    "Configurations at each goal: one arm",
    _CAPTION.format("Figure 5"),
)
def one_armed(study: Study) -> Parts:
    """The paper's Figure 5, as far as the runs allow."""
    return configurations(study, {"ascending": CONDITIONS[:1], "descending": CONDITIONS[:1]})


@figure(
    "configurations-two-armed-1",
    "Configurations at each goal: two-armed 1",
    _CAPTION.format("Figure 6"),
)
def two_armed_1(study: Study) -> Parts:
    """The paper's Figure 6, as far as the runs allow."""
    return configurations(study, {"two-armed-1": CONDITIONS[1:]})


@figure(
    "configurations-two-armed-2",
    "Configurations at each goal: two-armed 2",
    _CAPTION.format("Figure 7"),
)
def two_armed_2(study: Study) -> Parts:
    """The paper's Figure 7, as far as the runs allow."""
    return configurations(study, {"two-armed-2": CONDITIONS[2:]})


@dataclass(frozen=True)
class Solution:
    """One row of panels."""

    task: Task
    method: str
    """Label; empty for the initial solution."""
    run_id: str
    execution: Execution
    share: str = ""
    """In how many runs of the method its hand sequence was found: `` (5 of 20)``."""

    @property
    def name(self) -> str:
        """As the row is headed."""
        name = name_of(self.method) if self.method else "initial solution"
        return f"{name}, {self.execution.hands}{self.share}"


def configurations(study: Study, rows: dict[str, Sequence[str]]) -> Parts:
    """One panel for each goal, one row for each solution: the initial one, then each method's.

    ``rows`` has the methods of each task; those without a solved run are left out. A method has
    a row for each of its common hand sequences, at most two.
    """
    solutions: list[Solution] = []
    for name, labels in rows.items():
        cells = {label: study.cells.get((name, label)) for label in labels}
        solved = {label: cell for label, cell in cells.items() if cell and len(cell.good)}
        if not solved:
            continue
        task = study.tasks[name]
        initial = initial_solution(task, study.model)
        solutions += [Solution(task, "", "", initial)] if initial is not None else []
        for label, cell in solved.items():
            runs = study.trajectories(name, label)
            for hands in common_sequences(cell)[:2]:
                index = typical_run(cell, hands)
                count = (cell.good.hands == hands).sum()
                share = f" ({count} of {len(cell.good)})" if len(cell.good) > 1 else ""
                run_id, execution = str(cell.good.run_id.iloc[index]), runs.runs[index].execution
                solutions.append(Solution(task, label, run_id, execution, share))
    if not solutions:
        raise missing(study, f"no solved runs of the paper's conditions on {' or '.join(rows)}")
    totals = "; ".join(
        f"{s.task.label}, {s.name}, total {number(-s.execution.ticks)}" for s in solutions
    )
    alt = f"Robot configurations at every goal. {totals}."
    return draw(solutions), data_of(solutions), alt, [s.task for s in solutions]


def draw(solutions: Sequence[Solution]) -> Figure:
    """All rows, to one scale."""
    end, gap, head, foot = 0.46, 0.08, 0.34, 0.3  # inches
    wide = (style.TWO - end) / max(len(solution.task.goals) for solution in solutions)
    postures: dict[str, list[Array]] = {}
    for s in solutions:
        postures.setdefault(s.task.name, [s.task.q0]).extend(s.execution.configurations)
    corners = {s.task.name: box(s.task, postures[s.task.name]) for s in solutions}
    extents = {name: high - low for name, (low, high) in corners.items()}
    scale = (wide - gap) / max(extent[0] for extent in extents.values())
    sizes = [scale * extents[s.task.name] for s in solutions]
    height = sum(size[1] for size in sizes) + head * len(solutions) + foot
    drawing = Figure(figsize=(style.TWO, height))
    top = height
    bold: Any = {"va": "top", "fontsize": style.NORMAL, "weight": "bold"}
    for solution, (width, tall) in zip(solutions, sizes, strict=True):
        task = solution.task
        title = f"{task.label}: {solution.name}" if len(extents) > 1 else solution.name
        drawing.text(0.004, (top - 0.03) / height, title, **bold)
        top -= head + tall
        across, up = width / style.TWO, tall / height
        lefts = ((k * wide + gap / 2) / style.TWO for k in range(len(task.goals)))
        panels = [drawing.add_axes((left, top / height, across, up)) for left in lefts]
        draw_panels(panels, solution, *corners[task.name])
        total = f"total\n{number(-solution.execution.ticks)}"
        place = 1 - 0.02 / style.TWO, (top + tall / 2) / height
        drawing.text(*place, total, ha="right", va="center", fontsize=style.NORMAL)
    before = style.entry("before", color=style.GREY, linewidth=0.9)
    handles = legend_entries(hand for solution in solutions for hand in solution.task.hands)
    place_of: Any = {"loc": "lower center", "ncols": 4, "borderaxespad": 0.2}
    drawing.legend(handles=[*handles, before], **place_of)
    bar = np.array([0.08, 0.08 + scale]) / style.TWO
    drawing.add_artist(Line2D(bar, [0.13 / height] * 2, color=style.INK, linewidth=1.2))
    drawing.text(bar[1] + 0.04 / style.TWO, 0.13 / height, "1 length unit", va="center")
    return drawing


def draw_panels(panels: Sequence[Axes], solution: Solution, low: Array, high: Array) -> None:
    """One for each goal: the posture that hits it and the one before."""
    task, execution = solution.task, solution.execution
    hands, ticks = hands_of(execution.hands), execution.ticks_by_goal()
    before = task.q0
    for k, (axes, q) in enumerate(zip(panels, execution.configurations, strict=True)):
        axes.set_axis_off()
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        draw_robot(axes, task, before, color=style.GREY)
        draw_goals(axes, task, current=k + 1)
        draw_robot(axes, task, q, marked=(hands[k],))
        title = f"goal {k + 1}: {hands[k]}, {number(-ticks[k])}"
        axes.set_title(title, fontsize=style.SMALL, pad=1)
        before = q


def data_of(solutions: Sequence[Solution]) -> pd.DataFrame:
    """One row for each goal and one for the start (goal 0), with the configuration."""
    parts = []
    for solution in solutions:
        task, execution = solution.task, solution.execution
        postures = np.array([task.q0, *execution.configurations])
        columns = {
            "task": task.name,
            "method": solution.method or "initial",
            "run_id": solution.run_id,
            "hands": execution.hands,
            "total": -execution.ticks,
            "goal": range(len(postures)),
            "hand": ["", *hands_of(execution.hands)],
            "reward": [0, *(-ticks for ticks in execution.ticks_by_goal())],
            **dict(zip(task.robot.joint_names, postures.T, strict=True)),
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)
