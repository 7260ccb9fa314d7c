"""What of coarticulation a stop at the goals leaves, in posture and in velocity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic import Task, Trajectory
from coartic.analysis.claims.data import Data
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.section import Section
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import turning_angles
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.horizon import KINDS, PLANNER
from coartic.analysis.topics.random_tasks import (
    finding,
    mean_of,
    mean_or_nan,
    reported,
    solved_cells,
)
from coartic.robot import Array

STOPPING = "trajectory-optimisation/jerk"
"""What stops at goals, without words for its parameters."""
SMOOTH = "trajectory-optimisation/"
NEAR = 3
"""Ticks before and after a hit between which the path's turn at the goal is measured."""
SHARED = ("ascending", "descending")
"""The paper's tasks that differ after the first goal."""


@cached
def stop_values(study: Study) -> pd.DataFrame:
    """What plans that stop at goals, and what stands beside them, show on each task.

    Columns ``group`` (kind of task), ``method``, ``timing``, ``stop``, ``goals_per_stop``,
    ``task``, ``cell``; ``nearer``, ``first``: signs of coarticulation in ticks; ``turn``: mean
    turn of the path at goals that others follow, rad; ``posture`` at the first goal. Empty where
    nothing stops.
    """
    rows: list[Row] = []
    for method in dict.fromkeys(method for _, method in study.cells):
        if not method.startswith((SMOOTH, PLANNER)):
            continue
        for cell, parameters in solved_cells(study, method.partition(" ")[0]):
            if cell.label == method:
                runs = study.trajectories(cell.task, cell.label)
                rows.append(
                    {
                        "group": group_of(study.tasks[cell.task]),
                        "method": cell.method,
                        "timing": parameters.get("timing", ""),
                        "stop": float(parameters.get("stop", math.nan)),
                        "goals_per_stop": parameters.get("stop_every", 1),
                        "task": cell.task,
                        "cell": cell,
                        "nearer": mean_or_nan(SIGNS["arm"].of(runs)),
                        "first": mean_or_nan(SIGNS["first"].of(runs)),
                        "turn": mean_or_nan(np.concatenate(list(map(turns, runs.runs)))),
                        "posture": runs.runs[0].execution.configurations[0],
                    }
                )
    frame = pd.DataFrame(rows)
    return frame if len(frame) and (frame.stop > 0).any() else frame[:0]


def group_of(task: Task) -> str:
    """Kind of a task: random ones by their arms, the paper's one-armed ones together."""
    if task.family is not None:
        return f"random, {KINDS['arms'](task)} arm{'s' * (len(task.hands) - 1)}"
    return "ascending, descending" if task.name in SHARED else task.name


def turns(run: Trajectory) -> Array:
    """Angles by which the path in joint space turns at goals that others follow, rad, (G - 1,).

    0 passes smoothly, NaN beside a movement of no length. Movements have a constant speed in this
    model, so that of a plan's velocities their direction alone is left.
    """
    last = len(run.configurations) - 1
    around = ((max(hit - NEAR, 0), hit, min(hit + 1 + NEAR, last)) for hit in run.hits[:-1])
    return np.array([turning_angles(run.configurations[list(rows)])[0] for rows in around])


@table(
    "group, method, timing, stop, goals_per_stop, tasks, nearer[], less[], first[], turn[], apart",
)
def stops(study: Study) -> Rows:
    """What of coarticulation is left where a smooth plan stops at goals: means over tasks."""
    keys = ["group", "method", "timing", "stop", "goals_per_stop"]
    frame = stop_values(study)
    for at, rows in frame.groupby(keys, sort=False, dropna=False) if len(frame) else ():
        row: Row = {**dict(zip(keys, at, strict=True)), "tasks": len(rows)}
        for name in ("nearer", "first", "turn"):
            row |= mean_of(name, rows[name])
        by_task = rows.set_index("task")
        if row["stop"] > 0:
            passing = frame[(frame[keys[:3]] == list(at[:3])).all(axis=1) & (frame.stop == 0)]
            row |= mean_of("less", passing.set_index("task").nearer - by_task.nearer)
        if set(SHARED) <= set(by_task.index):
            first, second = (by_task.posture[name] for name in SHARED)
            row["apart"] = float(np.linalg.norm(first - second))
        stop = "" if math.isnan(row["stop"]) else f" stop={row['stop']:g}"
        every = f" every {row['goals_per_stop']}" if row["goals_per_stop"] > 1 else ""
        name = f"{row['group']} {row['method']} {row['timing']}".strip() + stop + every
        yield name, row | runs_of(*rows.cell)


STOP_LOOKS = {
    ("ascending, descending", "jerk"): (style.BLUE, "o"),
    ("ascending, descending", "acceleration"): (style.VERMILLION, "o"),
    ("random, one arm", "jerk"): (style.GREEN, "D"),
    ("random, two arms", "jerk"): (style.PURPLE, "s"),
}
"""Colour and mark by tasks and cost, of what is drawn."""
TIMES = {"free": ("free times", style.SOLID), "fixed": ("equal times", style.DASHED)}


@figure(
    "stops",
    "What a stop at the goals leaves of coarticulation",
    "Smooth plans from passing through the goals (0) to a full stop at each (1), means over tasks, "
    f"of random ones with their {style.CONFIDENCE} interval. a: ticks by which postures leave the "
    "next goal nearer, against the corrective process's. b: the angle by "
    "which the path turns at goals, which passing makes 0. Movements have a constant speed here, "
    "so that the direction is all that is left of a plan's velocity.",
)
def draw_stops(study: Study) -> Parts:
    """Posture and velocity by how much a plan stops."""
    data = stops(study)
    if not len(data):
        raise missing(study, "no runs that stop at goals")
    costs = data.method.str.removeprefix(SMOOTH)
    shown = np.array([pair in STOP_LOOKS for pair in zip(data.group, costs, strict=True)])
    drawn = data.assign(cost=costs)[shown & (data.goals_per_stop == 1)]
    drawing, panels = style.figure_of((1, 2), (style.TWO, 3.0))
    for number, ((group, cost, timing), part) in enumerate(
        drawn.groupby(["group", "cost", "timing"], sort=False)
    ):
        color, marker = STOP_LOOKS[str(group), str(cost)]
        words, dash = TIMES[str(timing)]
        line: Any = {"color": color, "linestyle": dash, "marker": marker, "markersize": 3.5}
        places = part.stop + 0.008 * number
        for axes, name in zip(panels, ("nearer", "turn"), strict=True):
            axes.vlines(places, part[f"{name}_low"], part[f"{name}_high"], color, linewidth=0.8)
            axes.plot(places, part[name], **line, label=f"{group}: {cost}, {words}")
    panels[0].set_ylabel("next goal nearer (ticks)")
    panels[1].set_ylabel("turn at goals (rad)")
    for axes, title in zip(panels, ("posture", "velocity"), strict=True):
        axes.set_title(title)
        axes.set_xlabel("stop")
        axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["0", "¼", "½", "¾", "1"])
        axes.set_ylim(bottom=0)
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 2)
    rows = drawn.reset_index().to_dict("records")
    each = (f"{row['row']}: {row['nearer']:.1f} ticks, {row['turn']:.2f} rad" for row in rows)
    return drawing, drawn, f"Posture and velocity by stop. {'; '.join(each)}.", ()


def served_next_goal(data: Data, timing: str, stop: int) -> pd.Series:
    """Ticks by which postures leave the next goal nearer, on each reported random task."""
    values = {}
    for cell, parameters in solved_cells(data.study, STOPPING):
        asked = (parameters["timing"], parameters["stop"], parameters["stop_every"])
        drawn = data.task(cell.task).family is not None
        if drawn and reported(data, cell.task) and asked == (timing, stop, 1):
            nearer = SIGNS["arm"].of(data.study.trajectories(cell.task, cell.label))
            data.run_ids.extend(cell.good.run_id)
            if len(nearer):
                values[cell.task] = float(nearer.mean())
    return pd.Series(values, dtype=np.float64)


def postures_serve_after_a_stop(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks, with free and with equal times"""
    least = MARGINS["ticks"]
    return finding({
        f"Ticks by which postures leave the next goal nearer, {timing} times: {{}}": (
            served_next_goal(data, timing, 1), least, 1
        )
        for timing in ("free", "fixed")
    })  # fmt: skip


def stop_at_equal_times(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the difference, passing less full stop"""
    passing, stopping = (served_next_goal(data, "fixed", stop) for stop in (0, 1))
    return finding(
        {
            "Ticks by which postures leave the next goal nearer when passing than with "
            "a full stop, at equal times: {}": (passing - stopping, 0.0, 1),
        }
    )


STOPS = Section(
    "stops",
    short="Stops",
    title="What does a stop at the goals leave of coarticulation?",
    caption="Plans that stop at goals: posture and velocity, means over tasks",
    figure="stops",
    table="stops",
    note=(
        "Next goal nearer: how much sooner the corrective process reaches it than from the "
        "posture in which it would have hit the goal itself. Movements have a constant speed in "
        "this model, so that a plan's velocity shows in the direction of its path alone. The "
        "model has no forces and no delays: it cannot say whether or when a body should stop."
    ),
)
