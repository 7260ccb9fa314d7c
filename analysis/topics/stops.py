"""What of coarticulation a stop at the goals leaves, in posture and in velocity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic import Task, Trajectory
from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.section import Section
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import turning_angles
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import random_tasks
from coartic.analysis.words import interval_in_words
from coartic.robot import Array

SMOOTH = "trajectory-optimisation/"
STOPPING = f"{SMOOTH}jerk"
"""The plan that claims and sentence are about."""
NEAR = 3
"""Ticks before and after a hit between which the path's turn at the goal is measured."""
SHARED = ("ascending", "descending")
"""The paper's tasks that differ after the first goal."""
KEYS = ["group", "method", "timing", "stop", "goals_per_stop"]
"""What a row of the table is about: kind of task, and how a plan stops."""


@cached
def stop_values(study: Study) -> pd.DataFrame:
    """What plans that stop at goals, and those that stand beside them, show on each task.

    Columns :data:`KEYS`, ``task``, ``cell``; ``nearer``, ``first``: signs of coarticulation in
    ticks; ``turn``: mean turn of the path at goals that others follow, rad; ``posture`` at the
    first goal. Empty where nothing stops.
    """
    rows: list[Row] = []
    for method, cells in random_tasks.solved_cells(study).items():
        for cell, parameters in cells:
            if method.startswith((SMOOTH, random_tasks.RECEDING_HORIZON)):
                runs = study.trajectories(cell.task, cell.label)
                rows.append(
                    {
                        "group": kind_of(study.tasks[cell.task]),
                        "method": method,
                        "timing": parameters.get("timing", ""),
                        "stop": float(parameters.get("stop", math.nan)),
                        "goals_per_stop": parameters.get("stop_every", 1),
                        "task": cell.task,
                        "cell": cell,
                        "nearer": random_tasks.mean_or_nan(SIGNS["arm"].of(runs)),
                        "first": random_tasks.mean_or_nan(SIGNS["first"].of(runs)),
                        "turn": random_tasks.mean_or_nan(
                            np.concatenate(list(map(turns, runs.runs)))
                        ),
                        "posture": runs.runs[0].execution.configurations[0],
                    }
                )
    labels = list(dict.fromkeys(label for _, label in study.cells))
    rows.sort(key=lambda row: labels.index(row["cell"].label))
    columns = [*KEYS, "task", "cell", "nearer", "first", "turn", "posture"]
    return pd.DataFrame(rows if any(row["stop"] > 0 for row in rows) else [], columns=columns)


def kind_of(task: Task) -> str:
    """Random tasks by their arms, the paper's one-armed ones together, others by name."""
    if task.family is not None:
        return ("random, one arm", "random, two arms")[len(task.hands) - 1]
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
    frame = stop_values(study)
    for at, rows in frame.groupby(KEYS, sort=False, dropna=False):
        row: Row = {**dict(zip(KEYS, at, strict=True)), "tasks": len(rows)}
        for name in ("nearer", "first", "turn"):
            row |= random_tasks.mean_of(name, rows[name])
        by_task = rows.set_index("task")
        if row["stop"] > 0:
            passing = frame[(frame[KEYS[:3]] == list(at[:3])).all(axis=1) & (frame.stop == 0)]
            row |= random_tasks.mean_of("less", passing.set_index("task").nearer - by_task.nearer)
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
    f"of random ones with their {style.COVERAGE} interval. a: ticks by which postures leave the "
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
            style.means(axes, places, part, name, **line, label=f"{group}: {cost}, {words}")
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


def finding_of_stops(study: Study) -> str:
    """By how much postures leave the next goal nearer when passing and with a full stop.

    Of minimum-jerk plans on random tasks with one arm.
    """
    data = stops(study)
    data = data[(data.group == "random, one arm") & (data.method == STOPPING)]
    sentences = []
    for timing, words in (("free", "free"), ("fixed", "equal")):
        rows = data[(data.timing == timing) & (data.goals_per_stop == 1)]
        by_stop = rows.set_index("stop").to_dict("index")
        if {0.0, 1.0} <= by_stop.keys():
            passing = interval_in_words(by_stop[0.0], "nearer", " ticks")
            stopping = interval_in_words(by_stop[1.0], "nearer")
            sentences.append(
                f"At {words} times postures of minimum-jerk plans leave the next goal nearer by "
                f"{passing} when passing and by {stopping} with a full stop."
            )
    return " ".join(sentences)


def next_goal_nearer(data: Data, timing: str, stop: int) -> pd.Series:
    """Ticks by which postures leave the next goal nearer, on each random task that is judged."""
    rows = stop_values(data.study)
    asked = [STOPPING, timing, stop, 1]
    rows = rows[(rows[KEYS[1:]] == asked).all(axis=1)]
    return random_tasks.judged(data, rows).set_index("task").nearer.astype(np.float64)


@judges(
    "postures-serve-after-a-stop",
    test="one-tailed bootstrap tests over random tasks: from the posture of base and chosen arm "
    "the corrective process reaches the next goal more than {ticks:g} tick sooner than from the "
    "posture in which it would itself have hit the goal. That velocity is 0 at a full stop is so "
    "by construction: nothing is claimed of it",
)
def postures_serve_after_a_stop(data: Data) -> Finding:
    """Of full stops, at free and at equal times."""
    sentence = "Ticks by which postures leave the next goal nearer, {} times: {{}}"
    return random_tasks.means_over_tasks({
        sentence.format(timing): (next_goal_nearer(data, timing, 1), MARGINS["ticks"], 1)
        for timing in ("free", "fixed")
    })  # fmt: skip


@judges(
    "stop-at-equal-times",
    test="one-tailed bootstrap test over random tasks of the difference in ticks, passing less "
    "full stop. At free times development instances show no direction (-4.8 ticks, SD 29, on 8), "
    "and nothing is claimed",
)
def stop_at_equal_times(data: Data) -> Finding:
    """Of passing less that of a full stop."""
    passing, stopping = (next_goal_nearer(data, "fixed", stop) for stop in (0, 1))
    sentence = (
        "Ticks by which postures leave the next goal nearer when passing than with "
        "a full stop, at equal times: {}"
    )
    return random_tasks.means_over_tasks({sentence: (passing - stopping, 0.0, 1)})


STOPS = Section(
    "stops",
    short="Stops",
    title="What does a stop at the goals leave of coarticulation?",
    caption="Plans that stop at goals: posture and velocity, means over tasks",
    finding=finding_of_stops,
    figure="stops",
    table="stops",
    note=(
        "Next goal nearer: how much sooner the corrective process reaches it than from the "
        "posture in which it would have hit the goal itself. Movements have a constant speed in "
        "this model, so that a plan's velocity shows in the direction of its path alone. The "
        "model has no forces and no delays: it cannot say whether or when a body should stop."
    ),
)
