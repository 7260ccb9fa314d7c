"""Sections on coarticulation: postures at a shared goal, and signatures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from coartic.analysis.control import (
    contexts_of_control,
    control_of,
    explores_idle_arm,
    selects,
    with_control,
)
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, name_in_figure, spoken
from coartic.analysis.method_frame import WITHOUT_REWARD, headline_methods
from coartic.analysis.methods import KNOWN_METHODS, LEARNERS, RANDOM_SEARCH
from coartic.analysis.signatures.measures import SIGNATURES
from coartic.analysis.signatures.two_contexts import SAME, TwoContexts, context_pairs
from coartic.analysis.statistics.hypotheses import exchange_test, holm, smallest_p
from coartic.analysis.study import Study, cached, one_by_one, solved
from coartic.analysis.table import Row, Rows, row_of_cell, run_ids, table
from coartic.analysis.words import marked, number
from coartic.estimates import LEVEL, difference_of_means, mean
from coartic.pictures.drawing import MARKERS
from coartic.robot import HANDS

ALONE = KNOWN_METHODS["corrective-alone/given"].algorithm
ROUNDING = 1e-9
"""Largest posture difference that counts as rounding, length unit and rad mixed."""


def _shared_goals(study: Study, label: str) -> Iterator[TwoContexts]:
    """Yield the first 500 solved runs of a method (label) on two tasks at each first goal that the
    tasks share (:func:`.context_pairs`), for each hand that hits this goal on both tasks."""
    for first, second, shared in context_pairs(one_by_one(study)):
        keys = (first, label), (second, label)
        if study.cells.keys() >= {*keys}:
            runs = study.executed(first, label), study.executed(second, label)
            for goal in range(1, shared + 1):
                for hand in HANDS:
                    contexts = TwoContexts(*runs, goal, hand)
                    if contexts.in_both:
                        yield contexts


@cached
def shared_goal(study: Study) -> TwoContexts | None:
    """Return the runs at the first goal that two tasks share and that runs on both hit with the
    same hand, of the first method with such runs, in this order: the paper's learner, methods from
    files, methods that represent their algorithms, other methods.

    None if no method has such runs.
    """
    rows = study.methods
    subjects = rows.index[rows.is_learner], rows.index[~rows.built_in]
    order = [*LEARNERS, *itertools.chain(*subjects), *headline_methods(rows), *rows.index]
    every = (_shared_goals(study, label) for label in dict.fromkeys(order))
    return next(itertools.chain.from_iterable(every), None)


@table(
    "Postures at a goal that two tasks share",
    "method; place: shared goal; verdict; runs; distance: posture difference .2; "
    "standardised_difference: standardised posture difference (SD of the runs) .1; "
    "p_holm: p (corrected) .p; control: random search .2; control_runs: its runs; "
    "p_random_search: p beyond random search .p; "
    "equivalent: difference that keeps the hand in place (null space, per dimension) .3; "
    "other: difference that moves the hand (per dimension) .3",
)
def list_contexts(study: Study) -> Rows:
    """Yield a row for each method, pair of tasks, goal that both share, and hand: the posture
    difference between the tasks, its verdict, and the posture difference of random search; p is
    corrected over a method's rows (Holm)."""
    for label in study.methods.index:
        every = list(_shared_goals(study, label))
        spreads = [shared.standardised_posture_difference for shared in every]
        tested = zip(every, np.isnan(spreads).tolist(), strict=True)
        p = holm([math.nan if no_spread else shared.p for shared, no_spread in tested])
        for shared, adjusted in zip(every, p, strict=True):
            first, second = shared.tasks
            row: Row = {
                "method": label,
                "place": f"goal {shared.goal} of {first.label} and {second.label}",
                "runs": shared.n,
                "distance": shared.posture_difference,
                "standardised_difference": shared.standardised_posture_difference,
                "p_holm": adjusted,
                "equivalent": shared.parts[0],
                "other": shared.parts[1],
                **run_ids(*(study.cells[task.name, label] for task in shared.tasks)),
            }
            if (control := contexts_of_control(study, shared)) is not None:
                row["control"], row["control_runs"] = control.posture_difference, control.n
                row["p_random_search"] = shared.p_beyond(control)
            row["verdict"] = _verdict_of(study, shared, row)
            yield f"{first.name} {second.name} {label} goal {shared.goal} {shared.hand}", row


@table(
    "Signatures of coarticulation, means over runs, next to random search",
    "task; method; hands; runs; control_runs: runs of random search; "
    "control_idle_arm: idle arm in random search; "
    + "; ".join(
        f"{column}[]: {words} .{digits}; {column}_control: random search .{digits}; "
        f"{column}_difference[]: -; {column}_p: p .p; {column}_control_runs: -"
        for column, words, digits in (
            ("first", "first movement slower by (ticks)", 1),
            ("whole", "whole task faster by (ticks)", 1),
            ("arm", "next goal nearer by (ticks)", 1),
            ("other_arm", "idle hand nearer to its next goal (share)", 2),
            ("hand", "goals with the slower hand for them alone (share)", 2),
        )
    ),
)
def list_signatures(study: Study) -> Rows:
    """Yield rows with the signatures of every method, except searches, on every task of
    :func:`.one_by_one`, and of random search there for methods that select among trials.

    A row for each hand sequence of :func:`.with_control`, which a tenth of the solved runs or more
    have, and a row for the choice of hands (``hands`` empty) on a task for two with two goals or
    more. Means over runs; p is of the one-tailed exchange test and uncorrected.
    ``control_idle_arm``: ``with noise``, or ``still`` as under EC3.
    """
    labels = study.methods.index[~study.methods.is_search]
    for name, label in itertools.product(one_by_one(study), labels):
        cell = study.cells.get((name, label))
        if cell is None or not len(solved(cell)):
            continue
        rows, of_cell = dict[str, Row](), row_of_cell(study, cell)
        for signature in SIGNATURES:
            column = signature.replace(" ", "_")
            for hands, (values, control) in with_control(study, signature, name, label).items():
                row = rows.setdefault(hands, {"runs": len(values), "control_runs": len(control)})
                row |= mean(values).columns(column) | {f"{column}_control_runs": len(control)}
                if len(control) and selects(study, label):
                    row |= {
                        f"{column}_control": control.mean(),
                        **difference_of_means(values, control).columns(f"{column}_difference"),
                        f"{column}_p": exchange_test(values, control).p,
                    }
        for hands, row in rows.items():
            key = " ".join(filter(None, (name, label, hands)))
            search = control_of(study, name, label, hands) if selects(study, label) else ""
            if search and len(study.tasks[name].hands) > 1:
                explored = explores_idle_arm(study, name, search)
                row["control_idle_arm"] = "with noise" if explored else "still"
            yield key, of_cell | row | {"hands": hands}


def _verdict_of(study: Study, shared: TwoContexts, row: Row) -> str:
    """Return a verdict on whether the posture at a shared goal depends on later goals, such as
    ``different postures``, ``the same posture`` or ``too few runs``.

    Of stochastic methods, the permutation test distinguishes postures, and the bootstrap test that
    the difference is below :data:`.SAME` shows that postures are the same; of others the difference
    itself does both. Different postures of methods that select their solution from trials are
    compared with random search, too. ``row``: other columns of :func:`list_contexts`.
    """
    method: Any = study.methods.loc[shared.method]
    if method.stochastic:
        few = smallest_p(*map(len, shared.configurations)) >= LEVEL
        if few or math.isnan(shared.p):
            return "too few runs"
        differs = (shared.p if math.isnan(row["p_holm"]) else row["p_holm"]) < LEVEL
        is_same = shared.p_same < LEVEL
    else:
        differs = shared.posture_difference > ROUNDING
        is_same = shared.posture_difference < SAME
    if is_same:
        return "different, negligible" if differs else "the same posture"
    if not differs:
        return "no significant difference"
    if not selects(study, shared.method):
        return "different postures"
    if "control" not in row:
        return "undecided: no random search of as many trials"
    if math.isnan(row["p_random_search"]):
        return "undecided: too few runs of random search"
    is_beyond = row["p_random_search"] < LEVEL
    return "different postures" if is_beyond else "no more than random search"


@table(
    "Ticks of each movement less those of the corrective process alone with the same hands, means "
    "over runs",
    "task; method; runs; by_goal_[*]: goal {} .1",
)
def list_saved(study: Study) -> Rows:
    """Yield a row for each task of :func:`.one_by_one` and method, except searches, that solved a
    run, with the mean difference of ticks at each goal, ``by_goal_1`` and so on: ticks of the run
    less the ticks of the corrective process alone with the same hands. Runs with hands with which
    this process fails are left out, and so are rows without other runs."""
    for (task, label), runs in study.cells.items():
        if task not in one_by_one(study) or study.methods.is_search[label] or not len(solved(runs)):
            continue
        changes = study.executed(task, label).against_same_hands
        changes = changes[~np.isnan(changes).any(axis=1)]
        if len(changes):
            row: Row = {"task": task, "method": label, "runs": len(changes)}
            for goal, ticks in enumerate(changes.T, 1):
                row |= mean(ticks).columns(f"by_goal_{goal}")
            yield f"{task} {label}", row | run_ids(runs)


@figure(
    "Ticks saved, goal by goal",
    "Ticks that a movement takes more (up) or less (down) than that of the corrective process "
    "alone with the same hands: what is paid at one goal is saved at later ones. Means over runs. "
    "Shown are the methods nearest to the {reference}, and those to compare them with. "
    "n = {n} runs.",
)
def draw_saved(study: Study) -> Parts | None:
    """Draw for each task a row for each of some methods (the learner that explores most, random
    search, the best of each kind that uses the reward, methods from files), the smallest mean gap
    first. A row has a bar for each goal: mean ticks of the runs less the ticks of the corrective
    process alone with the same hands. None if there is nothing to draw."""
    rows, methods = list_saved(study), study.methods
    single = methods[methods.index.isin(rows.method) & (methods.algorithm != ALONE)]
    drawn, parts = {*headline_methods(single)}, []
    for _, part in rows[rows.method.isin(drawn)].groupby("task", sort=False):
        gaps = [
            solved(study.cells[cell]).gap.mean()
            for cell in zip(part.task, part.method, strict=True)
        ]
        part = part.assign(gap=gaps, use=[methods.information[each] for each in part.method])
        part = part.sort_values("gap")
        best = part.drop_duplicates("use").method[part.use != WITHOUT_REWARD]
        learners = [each for each in LEARNERS if each in {*part.method}]
        kept = {*best, RANDOM_SEARCH, *learners[-1:], *single.index[~single.built_in.astype(bool)]}
        part = part[part.method.isin(kept)]
        if len(part):
            parts.append(part)
    if not parts:
        return None
    shape, most = style.grid(len(parts)), max(map(len, parts))
    line, size = (0.17, 6) if style.is_narrow() else (0.3, 7)  # inches, points
    height = shape[0] * (0.3 + line * most)
    drawing, panels = style.panels(shape, (style.TWO, height), len(parts))
    paper: Any = {"facecolor": style.BACKGROUND, "linewidth": 0, "pad": 0.6}
    for axes, part in zip(panels, parts, strict=True):
        task = study.tasks[part.task.iloc[0]]
        goals = np.arange(1, len(task.goals) + 1)
        ticks = part[[f"by_goal_{goal}" for goal in goals]].to_numpy(np.float64)
        scale = 0.42 / max(np.abs(ticks).max(), 1.0)
        for place, of_goals in enumerate(ticks):
            axes.axhline(-place, color=style.GREY, linewidth=0.5)
            colors = np.where(of_goals > 0, style.VERMILLION, style.BLUE)
            axes.bar(goals, scale * of_goals, 0.5, -place, color=colors, linewidth=0)
            for goal, value in zip(goals, of_goals.round(), strict=True):
                text = f"{value:+.0f}".replace("-", "−") if value else "0"
                axes.text(goal + 0.29, -place, text, va="center", fontsize=size, bbox=paper)
        style.name_rows(axes, [name_in_figure(study, label) for label in part.method])
        axes.set_xticks(goals, [f"goal {goal}" for goal in goals])
        axes.set_xlim(0.6, len(goals) + 0.75)
        axes.tick_params(axis="x", length=0, pad=1)
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.set_title(marked(task))
    style.letters(panels)
    data = pd.concat(parts, ignore_index=True).drop(columns=["run_ids", "gap", "use"])
    words = spoken(study, data, "{task}, {title}: {by_goal_1:+.0f}")
    alt = f"Ticks more or less than by the corrective process, at goal 1: {words}."
    return drawing, data, alt, ""


@figure(
    "One goal, two postures",
    "Postures of one method's runs when they hit a goal that two tasks share. Thick: mean posture; "
    "thin: every run. Dashed arrows lead to the next goal. The bar is one length unit.",
)
def draw_postures(study: Study) -> Parts | None:
    """Draw the postures of the method of :func:`shared_goal` at this goal on both tasks, and the
    postures of random search, its control, if it has one; None without a shared goal."""
    shared = shared_goal(study)
    if shared is None:
        return None
    chance = contexts_of_control(study, shared)
    contexts = [shared, chance] if chance else [shared]
    size = (style.ONE, style.TWO)[len(contexts) - 1], 2.0
    drawing, panels = style.panels((1, len(contexts)), size, sharex=True, sharey=True)
    parts, differences = [], []
    for axes, each in zip(panels, contexts, strict=True):
        title = study.methods.title[each.method]
        difference = number(each.posture_difference, 2)
        axes.set_title(f"{name_in_figure(study, each.method)}: difference {difference}")
        parts += _draw_contexts(axes, each)
        differences.append(f"{title} {each.posture_difference:.2f}")
    hands = [shared.tasks[0].robot.forward_kinematics(runs.mean(axis=0), shared.hand)
             for runs in shared.configurations]  # fmt: skip
    first, second = (task.label for task in shared.tasks)
    alt = (
        f"Two postures of one arm at goal {shared.goal}, which {first} and {second} share. "
        f"Posture difference: {'; '.join(differences)}. The distance of the hands is "
        f"{np.linalg.norm(hands[0] - hands[1]):.2f}."
    )
    compared = " Compared with all runs of random search with as many trials." * (
        chance is not None
    )
    return drawing, pd.concat(parts, ignore_index=True), alt, compared


def _draw_contexts(axes: Axes, shared: TwoContexts) -> list[pd.DataFrame]:
    """Draw the postures of runs at a shared goal, runs thin and their mean on each task thick;
    return two frames, one for each task, with a row for each run: ``task``, ``method``, ``goal``,
    ``hand`` and the posture, a column for each of its entries."""
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
        # The base's name stands on the side of the next goal.
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
