"""Configurations at each goal, initial and learned (paper, Figures 5 to 7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coartic import Execution, Task
from coartic.analysis import trajectories
from coartic.analysis.figures import style
from coartic.analysis.figures.choice import missing, solved
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.figures.robot import box, draw_goals, draw_robot, legend_entries
from coartic.analysis.methods import CONDITIONS, name_of
from coartic.analysis.study import Study
from coartic.analysis.words import number
from coartic.robot import Array
from coartic.tasks.task import hands_of

Rows = Sequence[tuple[str, Sequence[str]]]
PAPER: dict[str, tuple[str, Rows]] = {
    "configurations-one-armed": (
        "Figure 5",
        (("ascending", CONDITIONS[:1]), ("descending", CONDITIONS[:1])),
    ),
    "configurations-two-armed-1": ("Figure 6", (("two-armed-1", CONDITIONS[1:]),)),
    "configurations-two-armed-2": ("Figure 7", (("two-armed-2", CONDITIONS[2:]),)),
}
"""Figures like the paper's: which one, and methods by task."""
ROWS = 2
"""Hand sequences of a method in the paper's figures, at most."""
COMMON = 0.2
"""Share of a method's runs that have a hand sequence which is drawn."""
_TYPICAL = (
    "Each method is shown by the run with its commonest hand sequence whose reward is nearest to "
    "the method's median"
)
_BY_SEQUENCE = (
    f"Each method is shown by up to {ROWS} hand sequences that at least a fifth of its runs find, "
    "each by the run nearest to their median reward"
)


@dataclass(frozen=True)
class Solution:
    """One row of panels."""

    task: Task
    method: str
    """Label; empty for the initial solution."""
    run_id: str
    execution: Execution
    share: str = ""
    """In how many runs of the method its hand sequence was found: ``5 of 20``."""

    @property
    def name(self) -> str:
        """As the row is headed."""
        name = name_of(self.method) if self.method else "initial solution"
        found = f" ({self.share})" if self.share else ""
        return f"{name}, {self.execution.hands}{found}"


def initial_solution(study: Study, task: str) -> Solution:
    """The corrective process alone with the task's initial hands.

    Raises CoarticError where that does not complete the task.
    """
    execution = trajectories.initial_solution(study.tasks[task], study.model)
    if execution is None:
        raise missing(study, f"the corrective process alone does not complete {task}")
    return Solution(study.tasks[task], "", "", execution)


def common_sequences(study: Study, task: str, label: str, most: int) -> list[str]:
    """The ``most`` commonest hand sequences that :data:`COMMON` of a cell's runs have.

    The commonest first, as common ones in the order of the alphabet; at least one.
    """
    counts = solved(study, task, label).good.hands.value_counts()
    ordered = sorted(counts.items(), key=lambda item: (-int(item[1]), str(item[0])))
    least = COMMON * int(counts.sum())
    common = [str(hands) for hands, count in ordered if count >= least]
    return (common or [str(ordered[0][0])])[:most]


def typical_run(study: Study, task: str, label: str, hands: str | None = None) -> str:
    """Id of the run that stands for a cell, or for its runs with one hand sequence.

    Of the runs with ``hands`` that whose reward is nearest to their median. Without
    ``hands`` of those with the commonest sequence (the first of them in the alphabet where
    several are as common) that whose reward is nearest to the median of the cell.
    """
    cell = solved(study, task, label)
    own = common_sequences(study, task, label, 1)[0] if hands is None else hands
    candidates = (cell.good.hands == own).to_numpy(bool)
    rewards = cell.rewards[candidates]
    off = np.abs(rewards - np.median(cell.rewards if hands is None else rewards))
    return str(cell.good.run_id[candidates].iloc[int(off.argmin())])


def learned_solution(study: Study, task: str, label: str, run_id: str) -> Solution:
    """A stored run's solution. Raises CoarticError for a run that is no solved one of the cell."""
    good = solved(study, task, label).good
    ids = good.run_id.tolist()
    if run_id not in ids:
        raise missing(study, f"{run_id} is no solved run of {label} on {task}")
    execution = study.trajectories(task, label).runs[ids.index(run_id)].execution
    alike = int((good.hands == execution.hands).sum())
    share = f"{alike} of {len(good)}" if len(good) > 1 else ""
    return Solution(study.tasks[task], label, run_id, execution, share)


@style.styled
def configurations(
    study: Study,
    rows: Rows,
    *,
    id: str = "configurations",  # noqa: A002
    runs: Mapping[tuple[str, str], str] | None = None,
    like: str = "Figures 5 to 7",
    sequences: int = 1,
) -> Plot:
    """One panel a goal, one row a solution: the initial one, then each method's.

    ``rows`` names the methods of each task. ``runs`` names runs by task and method instead
    of the typical ones (:func:`typical_run`). With more than one of ``sequences`` a method
    has a row for each of so many :func:`common_sequences`. Raises CoarticError for what the
    folder lacks.
    """
    unknown = [task for task, _ in rows if task not in study.tasks]
    if unknown:
        raise missing(study, f"no task {', '.join(unknown)}")
    shown: list[Solution] = []
    for task, methods in rows:
        shown.append(initial_solution(study, task))
        for label in methods:
            asked = (runs or {}).get((task, label))
            if asked is not None or sequences == 1:
                found = [asked or typical_run(study, task, label)]
            else:
                common = common_sequences(study, task, label, sequences)
                found = [typical_run(study, task, label, hands) for hands in common]
            shown += [learned_solution(study, task, label, run) for run in found]
    figure = _draw(shown)
    tasks = {solution.task.name: solution.task for solution in shown}
    totals = "; ".join(
        f"{s.task.label}, {s.name}, total {number(-s.execution.ticks)}" for s in shown
    )
    labels = ", ".join(task.label for task in tasks.values())
    of = {"tasks": labels, "which": _TYPICAL if sequences == 1 else _BY_SEQUENCE, "like": like}
    of |= {"totals": totals}
    return worded("configurations", figure, _data(shown), tasks.values(), id=id, **of)


def paper_configurations(name: str, study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """One of the paper's Figures 5 to 7 by its name in :data:`PAPER`, as far as runs allow.

    It shows the paper's conditions or ``methods``, and up to :data:`ROWS` hand sequences of
    each. Methods that the folder lacks are left out where another one of the task remains.
    Raises CoarticError where nothing is left.
    """
    figure, printed = PAPER[name]
    rows = [(task, own if methods is None else methods) for task, own in printed]
    kept = [(task, [label for label in own if (task, label) in study.cells]) for task, own in rows]
    kept = [(task, own) for task, own in kept if own]
    if not kept:
        wanted = " or ".join(f"{', '.join(own)} on {task}" for task, own in rows)
        raise missing(study, f"no runs of {wanted}")
    return configurations(study, kept, id=name, like=figure, sequences=ROWS)


def _draw(shown: Sequence[Solution]) -> Figure:
    end, gap, head, foot = 0.46, 0.08, 0.34, 0.3  # inches
    wide = (style.TWO - end) / max(len(solution.task.goals) for solution in shown)
    postures: dict[str, list[Array]] = {}
    for s in shown:
        postures.setdefault(s.task.name, [s.task.q0]).extend(s.execution.configurations)
    corners = {s.task.name: box(s.task, postures[s.task.name]) for s in shown}
    extents = {name: high - low for name, (low, high) in corners.items()}
    scale = (wide - gap) / max(extent[0] for extent in extents.values())
    sizes = [scale * extents[s.task.name] for s in shown]
    height = sum(size[1] for size in sizes) + head * len(shown) + foot
    figure = Figure(figsize=(style.TWO, height))
    top = height
    bold: Any = {"va": "top", "fontsize": style.NORMAL, "weight": "bold"}
    for solution, (width, tall) in zip(shown, sizes, strict=True):
        task = solution.task
        title = f"{task.label}: {solution.name}" if len(extents) > 1 else solution.name
        figure.text(0.004, (top - 0.03) / height, title, **bold)
        top -= head + tall
        across, up = width / style.TWO, tall / height
        lefts = ((k * wide + gap / 2) / style.TWO for k in range(len(task.goals)))
        panels = [figure.add_axes((left, top / height, across, up)) for left in lefts]
        _panels(panels, solution, *corners[task.name])
        total = f"total\n{number(-solution.execution.ticks)}"
        place = 1 - 0.02 / style.TWO, (top + tall / 2) / height
        figure.text(*place, total, ha="right", va="center", fontsize=style.NORMAL)
    before = style.entry("before", color=style.GREY, linewidth=0.9)
    handles = legend_entries(hand for solution in shown for hand in solution.task.hands)
    place_of: Any = {"loc": "lower center", "ncols": 4, "borderaxespad": 0.2}
    figure.legend(handles=[*handles, before], **place_of)
    bar = np.array([0.08, 0.08 + scale]) / style.TWO
    figure.add_artist(Line2D(bar, [0.13 / height] * 2, color=style.INK, linewidth=1.2))
    figure.text(bar[1] + 0.04 / style.TWO, 0.13 / height, "1 length unit", va="center")
    return figure


def _panels(panels: Sequence[Axes], solution: Solution, low: Array, high: Array) -> None:
    """One a goal: the posture that hits it and the one before."""
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
        axes.set_title(
            f"goal {k + 1}: {hands[k]}, {number(-ticks[k])}", fontsize=style.SMALL, pad=1
        )
        before = q


def _data(shown: Sequence[Solution]) -> pd.DataFrame:
    """One row a goal and one for the start (goal 0), with the configuration."""
    parts = []
    for solution in shown:
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
