"""Draw the figures of the report, which :data:`FIGURES` lists by their ids."""

from __future__ import annotations

import itertools
import json
import math
import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from coartic import Task
from coartic.analysis.contrasts import ALL, OPEN, OPPOSITE, SHOWN, UNITS_OF_QUANTITIES
from coartic.analysis.control import contexts_of_control, shared_goal
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import FIGURES as FIGURES
from coartic.analysis.figures.plot import (
    Parts,
    describe_kinds,
    figure,
    looks_by_kind,
    looks_in,
    name_in_figure,
    spoken,
)
from coartic.analysis.methods import (
    BY_TRIAL,
    EC1,
    GROUPS,
    KNOWN_METHODS,
    LEARNERS,
    RANDOM_SEARCH,
    WITHOUT_REWARD,
    are_numbers,
    headline_methods,
    title_of,
    without_settings,
)
from coartic.analysis.running_times import (
    TARGETS,
    interval_by_budget,
    runs_with_targets,
    runtimes,
    target_ranges,
    times_on_tasks,
)
from coartic.analysis.signatures import TwoContexts
from coartic.analysis.standings import ranked_tasks, reference, runs_on, standings
from coartic.analysis.statistics import other_tasks
from coartic.analysis.study import Study, best_after, improvements, shared_cells, solved
from coartic.analysis.tables import (
    gaps_by_family,
    gaps_of_settings,
    instance_runs,
    list_contexts,
    list_parameters,
    list_runtimes,
    list_saved,
    values_of_parameters,
)
from coartic.analysis.words import capital, interval, listed, marked, number, titled_apart
from coartic.estimates import MIN_VALUES, Estimate
from coartic.internal.text import pluralize
from coartic.pictures.drawing import MARKERS, box, circle_goals, draw_robot
from coartic.robot import Array
from coartic.runs.contrasts import bounds_of
from coartic.runs.plan import world_title
from coartic.tasks.task import shipped_tasks


@figure("Gap to the best reward", "Ticks of the mean beyond the {reference}, in per cent of it")
def draw_ranking(study: Study) -> Parts | None:
    """Draw the mean gap of each ranked method, or of each value of the varied parameters.

    If a study varies parameters, and their values can be compared (:func:`.values_of_parameters`),
    the gaps of the values are drawn. Otherwise the gaps of ranked methods are drawn, without
    settings and ablations of methods that are drawn. The result is None if no method is ranked.
    """
    return _draw_parameters(study) or _draw_gaps(study)


def _draw_parameters(study: Study) -> Parts | None:
    """Draw the mean gap of each value of each varied parameter, in a panel for each parameter.

    A panel shows the means of table ``parameters``. If several parameters vary, a panel also shows
    the gaps at the best values of the other parameters. If only one parameter varies, and there are
    two to eight tasks, the panel also shows the gap on each task. :func:`_places_of` says how the
    values are placed on the axis. The result is None if no values can be compared.
    """
    rows, tasks, values = list_parameters(study), ranked_tasks(study), values_of_parameters(study)
    if not len(rows):
        return None
    shown = [*dict.fromkeys(rows.parameter)]
    shape = style.grid(len(shown))
    size = (style.TWO if len(shown) > 1 else style.ONE), 2.1 * shape[0] + 0.2
    drawing, panels = style.panels(shape, size, len(shown), style.MIN_SMALL_PANEL, sharey=True)
    is_alone, is_few = len(values) == 1, False
    thin: Any = {"color": style.GREY, "linewidth": 0.8, "zorder": 1}
    for place, (axes, parameter) in enumerate(zip(panels, shown, strict=True)):
        of_parameter = rows[rows.parameter == parameter]
        at, is_log = _places_of([value.value for value in values[parameter]])
        if is_log:
            axes.set_xscale("log")
        is_default = of_parameter.default != ""
        names = of_parameter.value + ("\n(" + of_parameter.default + ")").where(is_default, "")
        axes.set_xticks(at, names)
        axes.set_xticks([], minor=True)
        axes.margins(x=0.1)
        look: Any = {"color": style.BLUE, "markersize": 5, "linewidth": 1.6}
        style.means(axes, of_parameter.assign(x=at), x="x", y="gap", scale=100, bars=1.6, **look)
        axes.plot(at[is_default], 100 * of_parameter.gap[is_default], "o", markersize=8,
                  markerfacecolor="none", color=style.INK)  # fmt: skip
        if not is_alone:
            axes.plot(at, 100 * of_parameter.at_best, "--", **thin)
        by_value = [gaps_of_settings(study, value.labels) for value in values[parameter]]
        for x, gaps in zip(at, by_value, strict=True):
            few = 1 < int(gaps.groupby("task").size().min()) < MIN_VALUES
            by_run = 100 * gaps.groupby("run").mean() if few else gaps[:0]
            axes.plot([x] * len(by_run), by_run, ".", **_FEW, color=style.BLUE)
            is_few |= few
        if is_alone and 1 < len(tasks) <= 8:
            by_task = pd.DataFrame([100 * gaps.groupby("task").mean() for gaps in by_value])
            axes.plot(at, by_task[[*tasks]], **thin)
            ends = {marked(study.tasks[name]): by_task[name].iloc[-1] for name in tasks}
            _name_lines(axes, at[-1], ends)
        axes.set_ylim(bottom=min(0, axes.get_ylim()[0]))
        axes.set_xlabel(parameter)
        axes.set_ylabel("" if place % shape[1] else f"gap to the {reference(study, tasks)} (%)")
        axes.yaxis.set_tick_params(labelleft=True)  # a phone shows each panel by itself
    style.letters(panels if len(panels) > 1 else ())
    alt = f"Gap to the {reference(study, tasks)} by value of each parameter: " + "; ".join(
        f"{row['parameter']} {row['value']}: {100 * row['gap']:.1f} %"
        for row in rows.to_dict("records")
    )
    has_thin = not is_alone and bool(rows.at_best.notna().any())
    over = (["the values of the other parameters"] if not is_alone else []) + ["runs"]
    over += ["tasks"] if len(tasks) > 1 else []
    more = (
        f", by the values that vary. Points: means over {listed(over)}"
        + (
            f", with their {style.COVERAGE} bootstrap intervals over runs"
            if rows.gap_low.notna().any()
            else ""
        )
        + ". n = {n} runs of a value."
        + (" Dashed: the gap at the best setting of the other parameters." if has_thin else "")
        + (" Thin: the gap on each task." if is_alone and 1 < len(tasks) <= 8 else "")
        + (f" Small points: runs, if there are fewer than {MIN_VALUES}." if is_few else "")
        + (" A circle marks the default." if (rows.default != "").any() else "")
    )
    return drawing, rows, f"{alt}.", more


def _places_of(values: Sequence[Any]) -> tuple[np.ndarray[Any, Any], bool]:
    """Return the positions of values on an axis, and whether the axis is logarithmic.

    ``values`` are the values of a parameter; numbers must be in ascending order. Numbers are placed
    to scale, if they are so far apart that the labels do not overlap. The axis is then logarithmic
    if all numbers are above 0 and span at least a factor of ten. All other values are spaced
    evenly. The positions have shape ``(values,)``.
    """
    places = np.arange(len(values), dtype=np.float64)
    if not are_numbers(values):
        return places, False
    numbers = np.array(values, dtype=np.float64)
    is_log = bool(numbers[0] > 0 and numbers[-1] >= 10 * numbers[0])
    scaled = np.log(numbers) if is_log else numbers
    if np.diff(scaled).min() < np.ptp(scaled) / 12:  # their names would overlap
        return places, False
    return numbers, is_log


def _name_lines(axes: Axes, x: float, ends: Mapping[str, float]) -> None:
    """Write the names of lines to the right of their ends, without overlap.

    All lines end at the same x coordinate, ``x``. ``ends`` maps the name of each line to the y
    coordinate at its end.
    """
    low, high = axes.get_ylim()
    least, last = 0.075 * (high - min(low, 0.0)), -math.inf
    for name, height in sorted(ends.items(), key=lambda item: item[1]):
        last = max(height, last + least)
        axes.annotate(name, (x, last), xytext=(6, 0), textcoords="offset points", va="center",
                      color=style.GREY, annotation_clip=False)  # fmt: skip


_FEW: Any = {"markersize": 3, "alpha": 0.6}
"""Look of points that stand for single runs: arguments of Matplotlib's ``plot``."""


def _gaps_of_few_runs(study: Study, row: Mapping[Any, Any]) -> list[float]:
    """Return the gaps of a method's runs if there are too few runs for an interval.

    ``row`` is the row of the method in :func:`.standings`, with the label in ``method``. The list
    contains a gap for each number of a run, in per cent: the mean over tasks of the gaps of the
    runs with this number. The list is empty if each task has at least five runs, which are enough
    for an interval, or if a task has only one run.
    """
    runs = runs_on(study, str(row["method"]), ranked_tasks(study))
    gaps = 100 * runs.groupby("run").gap.mean()
    return list(gaps) if 1 < runs.groupby("task").size().min() < MIN_VALUES else []


def _draw_gaps(study: Study) -> Parts | None:
    """Draw the mean gap over tasks of each ranked method, with its interval.

    Settings and ablations of methods that are drawn are left out. The result is None if no method
    is ranked.
    """
    rows, tasks = standings(study).query("why == ''"), ranked_tasks(study)
    rows = without_settings(rows).reset_index(names="method")
    if not len(rows):
        return None
    shown = rows.assign(**{name: 100 * rows[name] for name in ("gap", "gap_low", "gap_high")})
    looks, by_group = looks_by_kind(study, rows.method), shown.groupby("information")
    lines: list[Any] = []  # headings of groups, and rows
    for group in [group for group in GROUPS if group in by_group.groups]:
        lines += [capital(group), *by_group.get_group(group).to_dict("records")]
    narrow = style.is_narrow()
    names = ["" if isinstance(line, str) else name_in_figure(study, line["method"])
             for line in lines]  # fmt: skip
    deep = max(name.count("\n") for name in names)
    height = (0.145 if narrow else 0.165) + 0.1 * deep  # inches of a line
    drawing, (axes,) = style.panels((1, 1), (style.TWO, 0.6 + height * len(lines)))
    few = {row["method"]: _gaps_of_few_runs(study, row) for row in shown.to_dict("records")}
    on_tasks = {label: runs_on(study, label, tasks).groupby("task").gap.mean() * 100
                for label in shown.method if 1 < len(tasks) <= 8}  # fmt: skip
    drawn = [shown[["gap", "gap_low", "gap_high"]].to_numpy(), *few.values(), *on_tasks.values()]
    gaps = np.concatenate([np.ravel(np.asarray(values, np.float64)) for values in drawn])
    nearest, farthest = float(np.nanmin(gaps)), max(float(np.nanmax(gaps)), 0.5)
    left = min(nearest, 0.0)
    is_log = farthest >= 10 * nearest
    if is_log:
        left = left if nearest < 0.15 else nearest / 1.3
        axes.set_xscale("symlog", linthresh=0.1, linscale=0.4)
        steps = (1, 2, 5) if farthest < 100 and not narrow else (1,)
        ticks = [0, *(n * 10.0**k for k in range(-1, 5) for n in steps)]
        ticks = [tick for tick in ticks if left <= tick <= 1.1 * farthest]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
    axes.set_xlim(left, 1.1 * farthest)
    axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.5)
    axes.axvline(0, **style.OPTIMUM)
    style.name_rows(axes, names)
    for place, (row, label) in enumerate(zip(lines, axes.get_yticklabels(), strict=True)):
        if isinstance(row, str):
            at: Any = {"transform": axes.get_yaxis_transform(), "va": "center_baseline"}
            axes.text(0.01, -place, row, color=style.GREY, **at)
            continue
        learner, y = row["is_learner"], -place
        look: Any = {"color": looks[row["method"]]["color"], "clip_on": False}
        axes.hlines(y, row["gap_low"], row["gap_high"], linewidth=2.5, alpha=0.6, **look)
        of_runs, of_tasks = few[row["method"]], on_tasks.get(row["method"], ())
        axes.plot(of_tasks, [y] * len(of_tasks), "|", color=style.GREY, markersize=4, zorder=1)
        axes.plot(of_runs, [y] * len(of_runs), ".", **_FEW, **look)
        mark, size = looks[row["method"]]["marker"], looks[row["method"]]["markersize"]
        (dot,) = axes.plot(row["gap"], y, mark, markersize=size, markeredgewidth=0, **look)
        name = row["title"]
        style.tip(
            dot, f"{name}: {interval(row, 'gap', unit=' %')}, {pluralize(row['runs'], 'run')}"
        )
        label.set_fontweight("bold" if learner or not row["built_in"] else "normal")
    axes.spines["left"].set_visible(False)
    to = reference(study, tasks)
    where = "" if len(tasks) > 1 else marked(study.tasks[tasks[0]]) + (":\n" if narrow else ": ")
    axes.set_xlabel(f"{where}gap to the {to} (%)")
    alt = f"Gap to the {to} by method: {spoken(study, shown, '{title} {gap:.1f} %')}."
    bold = ["the paper's learner"] if any(rows.is_learner) else []
    bold += ["methods from files (larger marks)"] if not all(rows.built_in) else []
    more = f": less is better. With its {style.COVERAGE} bootstrap interval over runs."
    more += " Means over all tasks." if len(tasks) > 1 else ""
    more += " Grey lines: the gap on each task." if on_tasks else ""
    more += " The axis is logarithmic from 0.1 % on." if is_log else ""
    more += " Methods that are run once have no interval." if not all(rows.stochastic) else ""
    more += (
        f" Small points: runs, if there are fewer than {MIN_VALUES}." if any(few.values()) else ""
    )
    return drawing, rows, alt, more + (f" Bold: {listed(bold)}." if bold else "")


def _width_of(shape: tuple[int, int]) -> float:
    """Return the usual width (in inches) of a figure, for a shape (rows, columns) of panels."""
    return style.TWO if shape[1] > 1 else style.ONE


ALONE = KNOWN_METHODS["corrective-alone/given"].facts.algorithm


@figure(
    "Ticks saved, goal by goal",
    "Ticks that a movement takes more (up) or fewer (down) than that of the corrective process "
    "alone with the same hands, and their sum: what is paid at one goal is saved at later ones. "
    f"Bars are means over runs, lines their {style.COVERAGE} bootstrap intervals. The methods are "
    "those nearest to the {reference}, the nearest first, and those to compare them with. "
    "n = {n} runs.",
)
def draw_saved(study: Study) -> Parts | None:
    """Draw the ticks of methods for each goal, minus those of the corrective process alone.

    The sum over goals is drawn, too. There is a panel for each individual task. Of the methods that
    represent their algorithms (:func:`.headline_methods`), except the corrective process alone, a
    panel has a row for each of these that solved a run on the task:

    - the learner under the condition that explores most;
    - random search;
    - the first method that uses the reward of each trial, and the first method that uses the reward
      as a formula (in the order of rows);
    - methods from files.

    The order of rows is the same in all panels: methods with solved runs on more tasks come first;
    methods with solved runs on equally many tasks are in ascending order of the mean gap. The
    result is None if there is nothing to draw.
    """
    rows, methods = list_saved(study), study.methods
    single = methods[methods.index.isin(rows.method) & (methods.algorithm != ALONE)]
    rows = rows[rows.method.isin(headline_methods(single))]
    if not len(rows):
        return None
    gaps = [
        solved(shared_cells(study)[cell]).gap.mean()
        for cell in zip(rows.task, rows.method, strict=True)
    ]
    learners = rows.method.map({label: place for place, label in enumerate(LEARNERS)})
    most = learners == learners.groupby(rows.task).transform("max")  # that explores most
    rows = rows.assign(gap=gaps, line=rows.method.mask(most, "learner"))
    by_line = rows.groupby("line").gap.agg(["size", "mean"])
    lines = by_line.sort_values(["size", "mean"], ascending=[False, True]).index
    uses = rows.drop_duplicates("line").set_index("line").method.map(methods.information)
    best = uses[lines].drop_duplicates()
    own = single.index[~single.built_in.astype(bool)]
    kept = {*best.index[best != WITHOUT_REWARD], RANDOM_SEARCH, "learner", *own}
    rows = rows[rows.line.isin(kept)]
    parts = [part.sort_values("line", key=lambda line: line.map(lines.get_loc))
             for _, part in rows.groupby("task", sort=False)]  # fmt: skip
    if not parts:
        return None
    shape, most_rows = style.grid(len(parts)), max(map(len, parts))
    line, size = (0.17, 6) if style.is_narrow() else (0.42, 8)  # inches, points
    height = shape[0] * (0.3 + line * most_rows)
    drawing, panels = style.panels(shape, (_width_of(shape), height), len(parts))
    looks = looks_by_kind(study, rows.method)
    paper: Any = {"facecolor": style.BACKGROUND, "linewidth": 0, "pad": 0.6}
    for axes, part in zip(panels, parts, strict=True):
        task = study.tasks[part.task.iloc[0]]
        goals = range(1, len(task.goals) + 1)
        columns = [*(f"by_goal_{goal}" for goal in goals), "sum"]
        at = np.array([*goals, len(goals) + 1.2])
        ends = [f"{column}{end}" for column in columns for end in ("", "_low", "_high")]
        scale = 0.42 / max(part[ends].abs().max().max(), 1.0)
        for place, row in enumerate(part.to_dict("records")):
            color = looks[row["method"]]["color"]
            ticks = np.array([row[column] for column in columns])
            low, high = (
                scale * np.array([row[f"{column}{end}"] for column in columns]) - place
                for end in ("_low", "_high")
            )
            # Not beside the bars, where a stump would look like a minus sign after a number.
            axes.hlines([-place] * len(at), at - 0.2, at + 0.2, color=style.GREY, linewidth=0.5)
            axes.bar(at, scale * ticks, 0.4, -place, color=color, alpha=0.55, linewidth=0)
            axes.vlines(at, low, high, color=style.INK, linewidth=0.9)
            for x, value in zip(at, ticks.round(), strict=True):
                text = f"{value:+.0f}".replace("-", "−") if value else "0"
                axes.text(x + 0.25, -place, text, va="center", fontsize=size, bbox=paper)
        style.name_rows(axes, [name_in_figure(study, label, 24) for label in part.method])
        axes.set_xticks(at, [*(f"goal {goal}" for goal in goals), "sum"])
        axes.set_xlim(0.6, at[-1] + 0.75)
        axes.tick_params(axis="x", length=0, pad=1)
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.set_title(marked(task))
    style.letters(panels)
    data = pd.concat(parts, ignore_index=True).drop(columns=["run_ids", "gap", "line"])
    words = spoken(study, data, "{task}, {title}: {by_goal_1:+.0f} and {sum:+.0f}")
    alt = f"Ticks more or fewer than by the corrective process, at goal 1 and in sum: {words}."
    return drawing, data, alt, describe_kinds(study, rows.method)


@figure(
    "One goal, two postures",
    "Postures of one method's runs when they hit a goal that two tasks share. Thick: mean posture; "
    "thin: every run. Dashed arrows lead to the next goal. The bar is one length unit.",
)
def draw_postures(study: Study) -> Parts | None:
    """Draw the postures of a method at a goal that two tasks share (:func:`.shared_goal`).

    If the study contains runs of random search to compare with (:func:`.contexts_of_control`), a
    second panel shows their postures. The result is None if there is no shared goal.
    """
    shared = shared_goal(study)
    if shared is None:
        return None
    chance = contexts_of_control(study, shared)
    contexts = [shared, chance] if chance else [shared]
    size = (style.ONE, style.TWO)[len(contexts) - 1], 2.0
    drawing, panels = style.panels((1, len(contexts)), size, sharex=True, sharey=True)
    parts, differences = [], []
    for axes, context in zip(panels, contexts, strict=True):
        title = study.methods.title[context.method]
        difference = number(context.posture_difference, 2)
        axes.set_title(f"{name_in_figure(study, context.method)}: difference {difference}")
        parts += _draw_contexts(axes, context)
        differences.append(f"{title} {context.posture_difference:.2f}")
    hands = [shared.tasks[0].robot.forward_kinematics(runs.mean(axis=0), shared.hand)
             for runs in shared.configurations]  # fmt: skip
    first, second = (task.label for task in shared.tasks)
    alt = (
        f"Two postures of one arm at goal {shared.goal}, which {first} and {second} share. "
        f"Posture difference: {'; '.join(differences)}. The distance of the hands is "
        f"{np.linalg.norm(hands[0] - hands[1]):.2f}."
    )
    compared = (
        " Compared with all runs of random search with as many trials."
        if chance is not None
        else ""
    )
    return drawing, pd.concat(parts, ignore_index=True), alt, compared


DOTS = {
    "distance": "difference\n(length unit and rad)",
    "lean": "lean\n(share of the way)",
    "lean_base": "base\n(share of its way)",
    "lean_joints": "joints\n(share of their way)",
}
"""Maps a column of :func:`list_contexts` to an axis label, for each panel of
:func:`draw_shared_goal`."""


@figure(
    "Postures at the shared goal, by method",
    "Posture difference: the distance between the mean postures at the goal that two tasks share "
    "(length units and rad). Lean: the share of the way to the next posture that is already made "
    "there, by base and arm together (b), by the base alone (c), and by the joints alone (d). All "
    "are 0 if the posture does not depend on the next goal. Lines are "
    f"{style.COVERAGE} bootstrap intervals over runs, if there are five runs.",
)
def draw_shared_goal(study: Study) -> Parts | None:
    """Draw the posture difference and the lean of each method at a shared goal.

    The goal and the hand are those of :func:`.shared_goal`. The four panels show the posture
    difference, the lean, the lean of the base alone, and the lean of the joints alone. A vertical
    line shows the value of random search, if random search has runs at this goal. Settings and
    ablations of methods that are drawn are left out. The result is None if there is no shared goal.
    """
    shared = shared_goal(study)
    if shared is None:
        return None
    rows, (first, second) = list_contexts(study), shared.tasks
    place = rows[rows.place == f"goal {shared.goal} of {first.label} and {second.label}"]
    place = place[[name.endswith(f" {shared.hand}") for name in place.index]]
    kept = without_settings(study.methods[study.methods.index.isin(place.method)]).index
    place = place[place.method.isin(kept)].sort_values("lean", ascending=False, kind="stable")
    looks = looks_by_kind(study, place.method)
    data = place.assign(
        name=[name_in_figure(study, label) for label in place.method],
        color=[looks[label]["color"] for label in place.method],
        marker=[looks[label]["marker"] for label in place.method],
        bold=[not study.methods.built_in[label] or study.methods.is_learner[label]
              for label in place.method],
    )  # fmt: skip
    control = place[place.method == RANDOM_SEARCH]
    lines = {name: float(value) for name in DOTS for value in control[name][:1]}
    drawing = style.dots(data, DOTS, lines)
    words = spoken(study, place, "{title} {distance:.2f}, {lean:.2f}, {lean_base:.2f} and "
                   "{lean_joints:.2f}").replace("nan", "none")  # fmt: skip
    alt = (
        "Posture difference, lean, lean of the base and lean of the joints by method at goal "
        f"{shared.goal}: {words}."
    )
    more = f" Goal {shared.goal} of {marked(first)} and {marked(second)}."
    more += (" Dashed: random search." if lines else "") + describe_kinds(
        study, place.method, with_marks=True
    )
    if place.lean.isna().any():
        more += " No dot: the runs are too few, or the next postures nearly the same."
    names = ["method", "runs", *(f"{name}{end}" for name in DOTS for end in ("", "_low", "_high"))]
    return drawing, place[names].reset_index(drop=True), alt, more


def _draw_contexts(axes: Axes, shared: TwoContexts) -> list[pd.DataFrame]:
    """Draw the postures of runs at a shared goal, and the mean posture on each task.

    The result is a list with a frame for each task. A frame contains a row for each run, with
    columns ``task``, ``method``, ``goal`` and ``hand``, and a column for each coordinate of the
    posture (length units and rad).
    """
    axes.set_axis_off()
    axes.set_aspect("equal")
    robot, radius = shared.tasks[0].robot, shared.tasks[0].radius
    means = [runs.mean(axis=0) for runs in shared.configurations]
    goals = np.array([task.goals[shared.goal] for task in shared.tasks])
    joints = [robot.joint_positions(q, shared.hand) for q in means]
    outlines = [robot.base_outline(q) for q in means]
    drawn = np.vstack([*outlines, goals, *joints])
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    axes.set_xlim(low[0] - 0.2, high[0] + 1.2)
    axes.set_ylim(low[1] - 0.7, high[1] + 0.35)
    at = shared.tasks[0].goals[shared.goal - 1]
    words: Any = {"textcoords": "offset points"}
    parts = []
    for place, (task, runs) in enumerate(zip(shared.tasks, shared.configurations, strict=True)):
        color, following = (style.BLUE, style.VERMILLION)[place], goals[place].tolist()
        faint: Any = {"linewidths": 0.5, "alpha": float(np.clip(4 / len(runs), 0.06, 0.3))}
        arms = [robot.joint_positions(q, shared.hand) for q in runs]
        axes.add_collection(LineCollection(arms, colors=color, **faint, zorder=1), autolim=False)
        base: Any = {"facecolor": color, "alpha": 0.12, "edgecolor": color, "linewidth": 0.8}
        axes.fill(*outlines[place].T, **base)
        around = [withStroke(linewidth=3.2, foreground=style.BACKGROUND)]
        thick: Any = {"linewidth": 1.6, "zorder": 3, "path_effects": around, **MARKERS[shared.hand]}
        axes.plot(*joints[place].T, color=color, **thick)
        arrow = {"arrowstyle": "->", "color": color, "shrinkA": 5, "shrinkB": 4, "linewidth": 0.8}
        axes.annotate("", following, at, zorder=2, arrowprops={**arrow, "linestyle": (0, (3, 2))})
        axes.add_artist(Circle(following, radius, fill=False, edgecolor=color))
        then = f"then goal {shared.goal + 1}\n({marked(task)})"
        axes.annotate(then, following, (5, 0), va="center", ha="left", **words)
        # The base's name is on the side of the next goal.
        x, y = outlines[place].T
        end, off, side = (y.max(), 3, "bottom") if following[1] >= at[1] else (y.min(), -3, "top")
        name = f"base,\n{marked(task)}"
        axes.annotate(name, (x.mean(), end), (0, off), ha="center", va=side, **words)
        angles = dict(zip(robot.joint_names, runs.T, strict=True))
        named = {"task": task.name, "method": shared.method, "goal": shared.goal}
        parts.append(pd.DataFrame({**named, "hand": shared.hand, **angles}))
    axes.add_artist(Circle(at, radius, fill=False, edgecolor=style.INK, linewidth=1.1))
    x, y = low - 0.2
    axes.plot([x, x + 1], [y, y], color=style.INK, linewidth=1.5)
    axes.annotate("1 length unit", (x, y), (0, -2), va="top", **words)
    here = f"goal {shared.goal},\nthe same"
    axes.annotate(here, at, (7, 0), va="center", weight="bold", **words)
    return parts


PANELS = {"trials": "trials", "forward_kinematics": "forward-kinematics evaluations"}
"""Maps a cost (one of :data:`.SPENDS`) to an axis label, for each panel of
:func:`draw_runtimes`."""


@figure(
    "What it costs to come near",
    f"Share of {len(TARGETS)} reward targets reached within a budget. Targets are evenly spaced "
    "from the corrective process alone, with its best hands, to the {reference}; a run counts for "
    f"each target that it reached. Bands: {style.COVERAGE} bootstrap intervals over runs. n = "
    "{n} runs of a method.",
)
def draw_runtimes(study: Study) -> Parts | None:
    """Draw the share of targets that methods reach within a budget.

    The curves are ECDFs of running times (:func:`.runtimes`). In one panel, the budgets are numbers
    of trials; in the other panel, the budgets are numbers of forward-kinematics evaluations, which
    are known only of whole runs. A panel without a curve is left out. The result is None if there
    is no curve.

    Curves are drawn for the following methods among those that represent their algorithms
    (:func:`.headline_methods`), without the corrective process alone:

    - all methods that use the reward of each trial;
    - all methods from files;
    - among the methods that do not use the reward of each trial, the one that reaches the most
      targets.
    """
    if not len(tabled := list_runtimes(study)):
        return None
    rows = study.methods.loc[[*tabled.index]]
    rows = rows.loc[headline_methods(rows)]
    rows = rows[rows.algorithm != "corrective process alone"]
    plans = rows.index[rows.information != BY_TRIAL]
    best = tabled.reached[plans].idxmax() if len(plans) else None
    curves = rows.index[(rows.information == BY_TRIAL) | ~rows.built_in | (rows.index == best)]
    data = runtimes(study)
    shown = data.method.isin(curves) & (data.budget > 0) & (data.budget < math.inf)
    data = data[shown & data.spend.isin(["trials"] if study.after else PANELS)]
    if data.empty:
        return None
    steps = []
    for (label, spend), curve in data.groupby(["method", "spend"], sort=False):
        # More points could not be seen.
        curve = curve.iloc[np.unique(np.linspace(0, len(curve) - 1, 100).round()).astype(int)]
        runs = runs_with_targets(study)[str(label)]
        times = times_on_tasks(study, runs, str(spend))
        low, high = interval_by_budget(times, curve.budget.to_numpy())
        steps.append(curve.assign(share_low=low, share_high=high, runs=len(runs)))
    data = pd.concat(steps, ignore_index=True)
    looks = looks_in(study, data.method.unique())
    spends = [spend for spend in PANELS if (data.spend == spend).any()]
    drawing, panels = style.panels(
        (1, len(spends)), (style.TWO, 1.9 if style.is_narrow() else 2.6), sharey=True
    )
    for axes, spend in zip(panels, spends, strict=True):
        style.log_axis(axes)
        of_spend = data[data.spend == spend]
        edge, most = of_spend.budget.min() / 1.5, of_spend.budget.max()
        most = max(most, 10 ** round(math.log10(most)))  # so that the axis ends at a number
        axes.axhline(50, color=style.GREY, linewidth=0.5)
        for label, rows in of_spend.groupby("method", sort=False):
            x = np.append(rows.budget, most)
            y, low, high = (
                100 * np.append(rows[name], rows[name].iloc[-1])
                for name in ("share", "share_low", "share_high")
            )
            look = looks[str(label)]
            axes.fill_between(
                x, low, high, step="post", color=look["color"], alpha=0.22, linewidth=0
            )
            (drawn,) = axes.step(x, y, where="post", **look)
            name = study.methods.title[str(label)]
            style.tip(drawn, f"{name}: {y[-1]:.0f} % of the targets in the end")
        axes.set_xlim(edge, most)
        axes.set_ylim(-2, 102)
        axes.set_title(f"By {PANELS[spend]}")
        axes.tick_params(labelleft=True)  # a phone shows one panel below the other
        axes.set_xlabel(PANELS[spend])
    panels[0].set_ylabel("targets reached (%)")
    at, grey = panels[0].get_yaxis_transform(), style.GREY
    panels[0].text(0.01, 51, "half of the targets", color=grey, va="bottom", transform=at)
    style.letters(panels)
    ends = data.groupby("method", sort=False).tail(1)
    ends = ends.assign(share=100 * ends.share).sort_values("share")
    # Long names have several lines: on a phone, this panel is as wide as the page.
    names = [name_in_figure(study, label, 18) for label in ends.method]
    half = np.array([name.count("\n") + 1 for name in names]) * (4.5 if style.is_narrow() else 3.3)
    apart, heights = [*(half[:-1] + half[1:]), 0.0], list[float]()
    for share, gap in zip(ends.share, [0.0, *apart], strict=False):
        heights.append(max(share, heights[-1] + gap if heights else -math.inf))
    over = np.cumsum(apart[::-1])[::-1]  # the names below one whose place is the top
    heights = np.minimum(heights, 100 - over).tolist()
    for end, name, height in zip(ends.to_dict("records"), names, heights, strict=True):
        at, look = panels[-1].get_yaxis_transform(), looks[end["method"]]
        mark: Any = {"color": look["color"], "markersize": 4, "markeredgewidth": 0}
        panels[-1].plot(1.03, height, look["marker"], transform=at, clip_on=False, **mark)
        panels[-1].annotate(
            name, (1.03, height), (5, 0), va="center",
            xycoords=at, textcoords="offset points", annotation_clip=False,
            weight="normal" if study.methods.built_in[end["method"]] else "bold",
        )  # fmt: skip
    shares = spoken(study, ends, "{title} {share:.0f} %")
    alt = f"Share of reward targets reached against what was spent. At the end: {shares}."
    more = " Means over all tasks." if len(target_ranges(study)) > 1 else ""
    if "forward_kinematics" in spends:
        more += " Forward-kinematics evaluations are spread evenly over a run's trials."
    return drawing, data, alt, more


CURVES = (*LEARNERS, RANDOM_SEARCH, "hill-climbing", "cma-es/bandit", "policy-gradient")
"""Ids of the built-in methods that have learning curves. Methods from files have learning curves,
too, if rewards of their trials are stored."""


@figure(
    "Learning curves",
    "Mean over runs (band: quartiles) of",
)
def draw_learning_curves(study: Study) -> Parts | None:
    """Draw the best reward so far against the number of trials, in a panel for each task.

    The curves are those of :func:`learning_curves`. In a world with noise, where the best trial so
    far is partly luck, the figure shows the curves of :func:`practice_curves` instead. The result
    is None if there is no curve.
    """
    if study.is_noisy:
        data, shown = practice_curves(study), "mean"
        more = "the mean reward of the trials in each tenth of a run, drawn at its middle."
    else:
        data, shown = learning_curves(study), "best"
        more = "the best reward so far."
    if not len(data):
        return None
    tasks = [study.tasks[name] for name in data.task.unique()]
    drawn = {*data.method}
    labels = [label for label in study.methods.index if label in drawn]
    rows, columns = style.grid(len(tasks))
    size = _width_of((rows, columns)), min(2.2 * rows + 0.5, style.TALLEST)
    if style.is_narrow():
        size = style.ONE, 1.4 * rows + 0.4
    drawing, panels = style.panels((rows, columns), size, len(tasks), style.MIN_SMALL_PANEL)
    looks = looks_in(study, labels)
    for place, (axes, task) in enumerate(zip(panels, tasks, strict=True)):
        of_task = data[data.task == task.name]
        for label, curve in of_task.groupby("method", sort=False):
            look = looks[str(label)]
            band: Any = {"color": look["color"], "alpha": 0.22, "linewidth": 0}
            axes.fill_between(curve.trial, curve[f"{shown}_low"], curve[f"{shown}_high"], **band)
            axes.plot(curve.trial, curve[shown], **look)
        floor, top = of_task[shown].min(), of_task[f"{shown}_high"].max()
        zero, optimum = study.corrective_best[task.name], study.optima.get(task.name)
        if not math.isnan(zero):
            axes.axhline(zero, **style.INITIAL)
            floor, top = min(floor, zero), max(top, zero)
        if optimum is not None:
            axes.axhline(optimum.reward, **style.OPTIMUM)
            top = max(top, optimum.reward)
        reach = max(top - floor, 1.0)  # 1 tick, if nothing is learned and no optimum is known
        axes.set_ylim(floor - 0.04 * reach, top + 0.06 * reach)
        if study.is_noisy:
            axes.set_xlim(0, max(2, of_task.trial.max()))
        else:
            style.log_axis(axes)
            axes.set_xlim(1, max(2, of_task.trial.max()))
        axes.set_title(marked(task))
        axes.set_ylabel("" if place % columns and style.is_narrow() else "reward (ticks)")
        axes.set_xlabel("trial" if place + columns >= len(tasks) else "")
    style.letters(panels)
    handles = [
        style.legend_line(name_in_figure(study, label), **look) for label, look in looks.items()
    ]
    if any(study.corrective_best[task.name] == study.corrective_best[task.name] for task in tasks):
        name = title_of("corrective-alone/best-hands", short=style.is_narrow())
        handles.append(style.legend_line(name, **style.INITIAL))
    if known := [task.name for task in tasks if task.name in study.optima]:
        handles.append(style.legend_line(reference(study, known), **style.OPTIMUM))
    longest = max(len(str(handle.get_label())) for handle in handles)
    style.legend(drawing, handles, 2 if longest <= 40 else 1)
    ends = data.groupby(["task", "method"], sort=False).tail(1)
    words = spoken(study, ends, f"{{task}}, {{title}}: {{{shown}:.0f}}")
    what = "reward" if study.is_noisy else "best reward"
    alt = f"Reward against trial. Mean {what} at the end: {words}."
    return drawing, data, alt, f" {more} n = {{n}} runs of a method on a task."


def learning_curves(study: Study) -> pd.DataFrame:
    """Return the learning curve of each method on each individual task, as means over runs.

    A learning curve is the best reward so far as a function of the number of trials. A run is used
    only if it is solved and the rewards of its trials are stored. The methods with curves are those
    that :func:`.headline_methods` selects from the methods in :data:`CURVES` and the methods from
    files. EC1 has no curve on a task for which EC2, EC3 or EC4 has such runs.

    Returns
    -------
    DataFrame
        If there are no curves, the frame is empty and has no columns. Otherwise the columns are

        - ``task``, ``method`` (label), and ``runs`` (number of runs);
        - ``trial``: number of trials. There are at most 100 numbers, logarithmically spaced from 1
          to the number of trials of the shortest run;
        - ``best``: mean over runs of the best reward so far, in negative ticks. It is NaN until all
          runs have a solution;
        - ``best_low`` and ``best_high``: lower and upper quartile over runs.
    """
    learned, curves = improvements(study), [pd.DataFrame()]
    for task, label, runs in _runs_with_curves(study, learned):
        at = np.unique(np.round(np.geomspace(1, int(runs.trials.min()), 100)).astype(np.int64))
        # Rewards are NaN until a run has a solution, and the mean is NaN until all runs have one.
        best = np.array([best_after(learned[run_id], at) for run_id in runs.run_id])
        if np.isnan(best).any(axis=0).all():
            continue
        low, high = np.quantile(best, [0.25, 0.75], axis=0)
        curve = {"trial": at, "best": best.mean(axis=0), "best_low": low, "best_high": high}
        named = {"task": task, "method": label, "runs": len(runs)}
        curves.append(pd.DataFrame(named | curve))
    return pd.concat(curves[1:] or curves, ignore_index=True)


def practice_curves(study: Study) -> pd.DataFrame:
    """Return the mean reward of the trials in each tenth of a run, in a world with noise.

    Methods and tasks are chosen as in :func:`learning_curves`, but a run is used if it is solved
    and its entry in column ``practice`` of :attr:`.Study.runs` is not missing. Failed trials are
    left out of means.

    Returns
    -------
    DataFrame
        If there are no curves, the frame is empty and has no columns. Otherwise the columns are

        - ``task``, ``method`` (label), and ``runs`` (number of runs);
        - ``trial``: the middle of the tenth, as a number of trials of the shortest run;
        - ``mean``: mean over runs of the mean reward in the tenth, in negative ticks. It is NaN if
          a run completed no trial in this tenth;
        - ``mean_low`` and ``mean_high``: lower and upper quartile over runs.
    """
    practised, curves = study.runs[study.runs.practice.notna()], [pd.DataFrame()]
    for task, label, runs in _runs_with_curves(study, practised.run_id):
        means = -np.array([json.loads(text) for text in runs.practice], dtype=np.float64)
        low, high = np.quantile(means, [0.25, 0.75], axis=0)
        at = (np.arange(10) + 0.5) / 10 * float(runs.trials.min())
        curve = {"trial": at, "mean": means.mean(axis=0), "mean_low": low, "mean_high": high}
        named = {"task": task, "method": label, "runs": len(runs)}
        curves.append(pd.DataFrame(named | curve))
    return pd.concat(curves[1:] or curves, ignore_index=True)


def _runs_with_curves(
    study: Study, run_ids: Collection[str]
) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield the name of the task, the label of the method, and the runs of each learning curve.

    Only solved runs whose ids are in ``run_ids`` are used. :func:`learning_curves` says which
    methods have a curve.
    """
    cells = {
        (task, label): runs
        for (task, label), cell in shared_cells(study).items()
        if task in study.individual_tasks and len(runs := solved(cell[cell.run_id.isin(run_ids)]))
    }
    rows = study.methods[study.methods.index.isin([label for _, label in cells])]
    drawn = headline_methods(rows[rows.method_id.isin(CURVES) | ~rows.built_in])
    for task, label in itertools.product(study.individual_tasks, drawn):
        two_armed = any((task, learner) in cells for learner in LEARNERS[1:])
        if (task, label) in cells and not (two_armed and label == EC1):
            yield task, label, cells[task, label]


@figure(
    "Gap by family",
    "Dots: instances (mean over runs), on an axis that is linear up to 2 % and logarithmic beyond. "
    "Diamonds: mean over instances with its "
    f"{style.COVERAGE} interval about other tasks of the family (bootstrap over instances and "
    "runs), for methods that solved every run.",
)
def draw_gaps_by_family(study: Study) -> Parts | None:
    """Draw the gaps to the best known rewards of instances, for each family and method.

    There is a panel for each family, and a row for each method. A dot is the mean over runs on an
    instance on which all runs of the method are solved. A diamond is the mean over the instances of
    the family, if all runs on all of them are solved. Settings and ablations of methods that are
    drawn are left out. The result is None if there is nothing to draw.
    """
    runs, rows = instance_runs(study), study.methods
    methods = without_settings(rows[rows.index.isin(runs.method)])
    runs = runs[runs.method.isin(methods.index)]
    if not len(runs):
        return None
    parts = []
    for (method, family), part in runs.groupby(["method", "family"], sort=False):
        scores = gaps_by_family(study, part)
        mean = (other_tasks(scores) if scores else Estimate(math.nan)).columns("mean")
        dots = part.groupby("task", sort=False).gap.mean().reset_index()
        dots = dots.assign(method=str(method), family=str(family), **mean, instances=len(dots))
        parts.append(dots)
    data = pd.concat(parts, ignore_index=True).astype({"gap": float})
    order = data.groupby("method").gap.mean().sort_values().index.tolist()
    looks = looks_by_kind(study, order)
    families = list(dict.fromkeys(data.family))
    size = style.TWO, 0.9 + 0.19 * len(order)
    drawing, panels = style.panels((1, len(families)), size, sharey=True)
    for axes, family in zip(panels, families, strict=True):
        for label, rows in data[data.family == family].groupby("method"):
            place = order.index(label)
            heights = -place + 0.11 * (np.arange(len(rows)) % 3 - 1)
            size = looks[label]["markersize"]
            dot: Any = {"color": looks[label]["color"], "markersize": size / 2, "alpha": 0.5}
            gaps = rows.gap.clip(upper=1.0)
            axes.plot(gaps, heights, "o", linestyle="", markeredgewidth=0, **dot)
            mean = rows.iloc[0]
            ends = [mean.mean_low, mean.mean_high]
            axes.plot(ends, [-place, -place], color=style.INK, linewidth=1)
            diamond: Any = {"markersize": size, "markerfacecolor": style.BACKGROUND, "zorder": 4}
            axes.plot(mean["mean"], -place, "D", color=style.INK, **diamond)
        axes.set_xscale("symlog", linthresh=0.02, linscale=0.5)
        axes.set_xlim(min(-0.004, 1.1 * data.gap.min()), 1.15)  # in noise a gap can be negative
        axes.set_xticks([0, 0.02, 0.1, 0.5], ["0", "2", "10", "50"])
        axes.minorticks_off()
        axes.set_title(family.partition("/")[0])
    style.name_rows(panels[0], [name_in_figure(study, label) for label in order])
    for label, method in zip(panels[0].get_yticklabels(), order, strict=True):
        label.set_fontweight("normal" if methods.built_in[method] else "bold")
    panels[len(panels) // 2].set_xlabel(f"gap to the {reference(study, study.optima)} (%)")
    style.letters(panels)
    rows_with_mean = data.drop_duplicates(["method", "family"]).dropna(subset="mean")
    means = spoken(study, rows_with_mean, "{title}, {family}: {mean:.1%}")
    words = f" {means}." if means else ""
    alt = f"Gaps of instances by method and family.{words}"
    more = " Gaps above 100 % stand at the right end." if any(data.gap > 1) else ""
    return drawing, data, alt, more + describe_kinds(study, order)


_DISC = 10.5  # diameter of the disc of a goal, in points
_DISC_LOOK: Any = {
    "markersize": _DISC, "markerfacecolor": style.BACKGROUND, "markeredgecolor": style.BLUE,
    "markeredgewidth": 1.0,
}  # fmt: skip


@figure(
    "Tasks",
    "Start configuration (grey) and goals of each task, in the order of their numbers. Discs of "
    "close goals are moved apart. A goal that is larger than its disc is a circle around it.",
)
def draw_tasks(study: Study) -> Parts | None:
    """Draw the start configuration and the goals of each individual task, in a panel each.

    The result is None if the study has no individual tasks.
    """
    shown = list(study.individual_tasks.values())
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
    source = " After Figure 4 of Shah, Barto & Fagg (2013)." if are_papers else ""
    return picture_of_tasks(shown), pd.DataFrame(rows), alt, source


@style.styled
def picture_of_tasks(tasks: Sequence[Task]) -> Figure:
    """Return a figure with a panel for each task: its start configuration and its goals."""
    tasks = titled_apart(tasks)
    boxes = [box(task, [task.q0]) for task in tasks]
    width, height = (max(corner[1][i] - corner[0][i] for corner in boxes) for i in (0, 1))
    rows, columns = style.grid(len(tasks))
    above = 0.4  # inches of a panel for its title
    scale = min(
        style.TWO / columns / width, (style.TALLEST - 0.3 - rows * above) / rows / height, 0.42
    )
    size = scale * width * columns, (scale * height + above) * rows + 0.3
    size = style.ONE if size[0] <= style.ONE else style.TWO, size[1]  # one column, or two
    if style.is_narrow():
        size = style.ONE, size[1] * style.ONE / size[0] + 0.4 * rows
    drawing, panels = style.panels((rows, columns), size, len(tasks), style.MIN_SMALL_PANEL)
    drawing.set_layout_engine("compressed")  # otherwise a title can extend beyond the edge
    for axes, task, corners in zip(panels, tasks, boxes, strict=True):
        draw_robot(axes, task, task.q0, colour=style.GREY)
        if len(task.hands) > 1:  # the part of an arm under the other one that can be seen
            left = task.robot.joint_positions(task.q0, "left").T
            axes.plot(*left, color=style.GREY, alpha=0.5, linewidth=3.2, zorder=1.7)
        for circle in circle_goals(axes, task):
            circle.set_edgecolor(style.BLUE)
        remarks = (
            [f"{' and '.join(task.reconstructed)} reconstructed"] if task.reconstructed else []
        )
        remarks += [f"base locked in {' and '.join(task.locked_base)}"] if task.locked_base else []
        fits = int(14 * drawing.get_figwidth() / columns)  # letters
        title = [*textwrap.wrap(task.label, fits), *textwrap.wrap("; ".join(remarks), fits)]
        axes.set_title("\n".join(title))
        x, y = (corners[0] + corners[1]) / 2
        axes.set_xlim(x - width / 2, x + width / 2)
        axes.set_ylim(y - height / 2, y + height / 2)
        axes.set_aspect("equal")
        axes.set_axis_off()
        length_unit = 72 * drawing.get_figwidth() / columns / width  # points
        _draw_order(axes, task.goal_array, 1.15 * _DISC / length_unit)
    style.letters(panels if len(tasks) > 1 else ())
    hands = {hand for task in tasks for hand in task.hands}
    arms = [
        style.legend_line(f"{hand} arm", color=style.GREY, linewidth=0.9, **look)
        for hand, look in MARKERS.items()
        if hand in hands
    ]
    goal = style.legend_line("goal", marker="o", linestyle="", **_DISC_LOOK)
    style.legend(drawing, [*arms, goal], 3)
    return drawing


def _draw_order(axes: Axes, goals: Array, apart: float) -> None:
    """Draw goals as numbered discs, and an arrow from each goal to the next.

    ``goals`` contains the centres of the goals in length units, shape ``(G, 2)``. Discs that would
    be closer together than ``apart``, in length units, are moved away from each other.
    """
    places = goals.copy()
    for _ in range(100):
        for first, second in itertools.combinations(range(len(places)), 2):
            way = places[second] - places[first]
            distance = float(np.hypot(*way))
            if distance < apart:
                way = way / distance if distance else np.array([1.0, 0.0])
                places[first] -= way * (apart - distance) / 2
                places[second] += way * (apart - distance) / 2
    ends: Any = {"shrinkA": 0.6 * _DISC, "shrinkB": 0.6 * _DISC, "color": style.BLUE}
    for start, end in itertools.pairwise(places):
        axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "linewidth": 0.8, **ends})
    axes.plot(*places.T, "o", clip_on=False, zorder=4, **_DISC_LOOK)
    for goal, (x, y) in enumerate(places, 1):
        text: Any = {"ha": "center", "va": "center_baseline", "fontsize": 8, "zorder": 5}
        axes.text(x, y, str(goal), **text)


_LOOKS = {SHOWN: (style.GREEN, "o"), OPPOSITE: (style.VERMILLION, "D"), OPEN: (style.GREY, "s")}
"""Colour and marker of each verdict in the forest plot."""


@figure(
    "Estimates of the contrasts",
    "Rows: families and worlds. Markers: median over tasks with its "
    f"{style.COVERAGE} interval; of a task without a family, the mean with its interval over runs. "
    "Green circles: shown; red diamonds: opposite shown; grey squares: neither. "
    "Dashed lines: bounds of the expectations.",
    of_folder=True,
)
def draw_contrasts(study: Study) -> Parts | None:
    """Draw the estimate of each cell of each contrast, with a panel for each contrast.

    The result is None if the folder has no contrasts with an estimate.
    """
    data = study.contrasts.drop(columns="run_ids")
    data = data.assign(
        value=data["median"].where(data["median"].notna(), data["mean"]).astype(float),
        low=data.median_low.where(data["median"].notna(), data.mean_low).astype(float),
        high=data.median_high.where(data["median"].notna(), data.mean_high).astype(float),
    )
    data = data[data.value.notna() & (data.family != ALL)]
    if not len(data):
        return None
    groups = [rows for _, rows in data.groupby("contrast", sort=False)]
    heights = [0.75 + 0.17 * len(rows) for rows in groups]
    drawing = Figure(figsize=(style.TWO, sum(heights)), layout="constrained")
    panels = drawing.subplots(len(groups), 1, height_ratios=heights, squeeze=False)[:, 0]
    several = len({*data.world}) > 1
    for axes, rows in zip(panels, groups, strict=True):
        for place, row in enumerate(rows.to_dict("records")):
            color, marker = _LOOKS.get(row["verdict"], _LOOKS[OPEN])
            axes.plot([row["low"], row["high"]], [-place, -place], color=color, linewidth=1.2)
            axes.plot(row["value"], -place, marker, color=color, markersize=4)
        for bound in bounds_of(str(rows.expected.iloc[0])):
            axes.axvline(bound, **style.INITIAL)
        names = [
            f"{family}".split("/")[0] + (f", {world_title(f'{world}')}" if several else "")
            for family, world in zip(rows.family, rows.world, strict=True)
        ]
        style.name_rows(axes, names)
        axes.set_title("\n".join(textwrap.wrap(str(rows.says.iloc[0]), 80)), loc="left")
        axes.set_xlabel(UNITS_OF_QUANTITIES[str(rows.quantity.iloc[0])])
    words = "; ".join(
        f"{row['says']} {row['family']}: {number(row['value'])}, {row['verdict'] or 'described'}"
        for row in data.to_dict("records")
    )
    return drawing, data, words, ""
