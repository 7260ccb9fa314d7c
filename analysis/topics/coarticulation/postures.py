"""Coarticulation: one goal is hit in different postures before different goals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure
from coartic.analysis.methods import is_variant, name_of
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.study import Study
from coartic.analysis.topics.coarticulation.placebo import difference
from coartic.analysis.topics.coarticulation.shared_goals import shared_goal
from coartic.analysis.topics.coarticulation.tables import contexts
from coartic.analysis.topics.failed import failed_runs
from coartic.analysis.words import number, p_value
from coartic.drawing import MARKERS
from coartic.text import counted

_OUTLINE = [withStroke(linewidth=3.2, foreground=style.BACKGROUND)]


@figure(
    "One goal, two postures",
    "Postures of one method's runs when they hit a goal that two tasks share. Thick: mean posture; "
    "thin: every run. Dashed arrows lead to the next goal. The bar is one length unit.",
)
def draw_postures(study: Study) -> Parts | None:
    """Draw postures at one goal before two others: thin every run, thick their means."""
    shared = shared_goal(study)
    if shared is None:
        return None
    drawing, (axes,) = style.panels((1, 1), (style.ONE, 2.0))
    draw_both(axes, shared)
    parts = []
    for task, runs in zip(shared.tasks, shared.postures, strict=True):
        joints = dict(zip(task.robot.joint_names, runs.T, strict=True))
        named = {"task": task.name, "method": shared.method, "goal": shared.goal}
        parts.append(pd.DataFrame({**named, "hand": shared.hand, **joints}))
    first, second = (task.label for task in shared.tasks)
    alt = (
        f"Two postures of one arm at goal {shared.goal}, which {first} and {second} share "
        f"({name_of(shared.method)}): {shared.apart:.2f} apart in joint space, while the hand is "
        f"at almost the same place ({shared.hands_apart:.2f} apart)."
    )
    return drawing, pd.concat(parts, ignore_index=True), alt, shared.tasks


def draw_both(axes: Axes, shared: TwoContexts) -> None:
    """Both tasks' postures with the shared goal and the next ones."""
    axes.set_axis_off()
    axes.set_aspect("equal")
    means = [runs.mean(axis=0) for runs in shared.postures]
    goals = np.array([task.goals[shared.goal] for task in shared.tasks])
    robot = shared.tasks[0].robot
    drawn = [*(robot.base_outline(q) for q in means), goals]
    drawn += [robot.joint_positions(q, shared.hand) for q in means]
    low, high = np.vstack(drawn).min(axis=0), np.vstack(drawn).max(axis=0)
    axes.set_xlim(low[0] - 0.2, high[0] + 1.2)
    axes.set_ylim(low[1] - 0.7, high[1] + 0.35)
    at, radius = shared.tasks[0].goals[shared.goal - 1], shared.tasks[0].radius
    words: Any = {"textcoords": "offset points"}
    colors = (style.BLUE, style.VERMILLION)
    rows = zip(shared.tasks, colors, shared.postures, means, goals.tolist(), strict=True)
    for task, color, runs, mean, following in rows:
        faint: Any = {"linewidth": 0.5, "alpha": float(np.clip(4 / len(runs), 0.06, 0.3))}
        for q in runs:
            axes.plot(*task.robot.joint_positions(q, shared.hand).T, color=color, **faint, zorder=1)
        outline = task.robot.base_outline(mean)
        axes.fill(*outline.T, facecolor=color, alpha=0.12, edgecolor=color, linewidth=0.8)
        joints = task.robot.joint_positions(mean, shared.hand).T
        axes.plot(
            *joints,
            color=color,
            linewidth=1.6,
            zorder=3,
            path_effects=_OUTLINE,
            **MARKERS[shared.hand],
        )
        arrow = {"arrowstyle": "->", "color": color, "shrinkA": 5, "shrinkB": 4, "linewidth": 0.8}
        axes.annotate("", following, at, zorder=2, arrowprops={**arrow, "linestyle": (0, (3, 2))})
        axes.add_artist(Circle(following, radius, fill=False, edgecolor=color))
        next_goal = f"then goal {shared.goal + 1}\n({task.label})"
        axes.annotate(next_goal, following, (5, 0), va="center", ha="left", **words)
        # The base's name stands on the side of the next goal.
        above = following[1] >= at[1]
        place = outline.mean(axis=0)[0], outline[:, 1].max() if above else outline[:, 1].min()
        axes.annotate(
            f"base,\n{task.label}", place, (0, 3 if above else -3),
            ha="center", va="bottom" if above else "top", **words,
        )  # fmt: skip
    axes.add_artist(Circle(at, radius, fill=False, edgecolor=style.INK, linewidth=1.1))
    x, y = low - 0.2
    axes.plot([x, x + 1], [y, y], color=style.INK, linewidth=1.5)
    axes.annotate("1 length unit", (x, y), (0, -2), va="top", **words)
    here = f"goal {shared.goal},\nthe same"
    axes.annotate(here, at, (7, 0), va="center", weight="bold", **words)


def next_goal(study: Study) -> str:
    """Whether the posture at the goal that two tasks share depends on the next goal."""
    contrast = difference(study)
    if contrast is None:
        return ""
    shared, placebo = contrast.contexts, contrast.placebo
    goal, runs = shared.goal, counted(shared.n, "run")
    who = f"{name_of(shared.method)} hits goal {goal} in postures"
    spreads = "" if math.isnan(shared.spreads) else f"{number(shared.spreads, 1)} SD or "
    p = ", ".join(filter(None, (runs, p_value(shared.p))))
    apart = f"{spreads}{number(shared.apart, 2)} (length units, rad) apart ({p})"
    guesses = placebo and f"{number(placebo.apart, 2)} apart ({p_value(contrast.beyond_p)})"
    if contrast.too_few:
        text = (
            f"Too few runs to tell whether the next goal changes postures at goal {goal} ({runs})."
        )
    elif not contrast.differ:
        text = f"No significant difference: before different goals, the {who} {apart}."
    elif contrast.seen:
        beside = f"; random guesses lie {guesses}" if guesses else ""
        text = f"Yes. Depending on the next goal, the {who} that clearly differ: {apart}{beside}."
    elif guesses:
        text = f"Not shown: the {who} {apart}; random guesses lie {guesses}."
    else:
        text = (
            f"Undecided: the {who} {apart}, and no placebo with as many trials ran. Add the method "
            "placebo/guesses."
        )
    cells = [(task.name, shared.method) for task in shared.tasks]
    return text + failed_runs(study, cells, " and are not counted")


def joints_or_hand(study: Study) -> str:
    """Number of methods in which the next goal moves the joints more than the hand."""
    rows = contexts(study)
    rows = rows[~rows.method.map(is_variant).astype(bool) & (rows.distance > 0.01)]
    if not len(rows):
        return ""
    larger = int((rows.equivalent > rows.other).sum())
    which = f"all {len(rows)}" if larger == len(rows) else f"{larger} of {len(rows)}"
    return f"In {which} methods the next goal moves the joints more than the hand."
