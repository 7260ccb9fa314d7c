"""What makes a random task hard, and for whom: rank correlations of features of tasks and gaps."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pandas as pd

from coartic import Task
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.methods import is_variant, name_of
from coartic.analysis.section import Section
from coartic.analysis.statistics.correlations import rank_correlation_estimate
from coartic.analysis.statistics.estimates import interval
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.words import interval_in_words
from coartic.robot import BASE_DOF

FEATURES = "goals", "way between goals", "turns", "spare joints"
"""Features of a task."""
LEAST_TASKS = 10
"""Fewer tasks than this have no correlation."""


def features_of(task: Task) -> dict[str, float]:
    """Features of a task, by the names of :data:`FEATURES`.

    Goals; mean way from goal to goal, of the reach of an arm; mean turn between these ways and that
    from the hand that starts nearest, rad (0 to π); free coordinates of base and one arm beyond the
    two that a hand's place takes.
    """
    goals, (hand, *_) = task.goal_array, task.hands
    starts = np.array([task.robot.forward_kinematics(task.q0, hand) for hand in task.hands])
    first = starts[np.linalg.norm(starts - goals[0], axis=1).argmin()]
    ways = np.diff(np.vstack([first, goals]), axis=0)
    headings = ways @ np.array([1, 1j])
    joints = task.robot.joints(hand)
    reach = float(np.abs(headings[1:]).mean()) / task.robot.reach(hand)[1]
    turns = float(np.abs(np.angle(headings[1:] / headings[:-1])).mean())
    spare = BASE_DOF - len(task.locked_base) + (joints.stop - joints.start) - 2
    return dict(zip(FEATURES, (len(goals), reach, turns, spare), strict=True))


@cached
def features_and_gaps(study: Study) -> pd.DataFrame:
    """Features of every instance and, by method that was run on all of them, its mean gap."""
    instances, rows = sample(study), {}
    for name in instances.references:
        task = instances.tasks[name]
        gaps = {label: instances.gap(name, label) for label in ("learner", *instances.labels)}
        means = {label: gap.mean() for label, gap in gaps.items() if gap is not None}
        rows[name] = {"family": task.family, **features_of(task), **means}
    frame = pd.DataFrame.from_dict(rows, orient="index").dropna(axis="columns")
    return frame[[name for name in frame.columns if name == "learner" or not is_variant(name)]]


@table("method, feature, tasks, correlation[], in *")
def hardness(study: Study) -> Rows:
    """Rank correlation of each feature and the gap of each method over all tasks, and in each
    family where both vary."""
    frame = features_and_gaps(study)
    for method, feature in itertools.product(frame.columns[len(FEATURES) + 1 :], FEATURES):
        row: Row = {"method": method, "feature": feature, "tasks": len(frame)}
        for family, rows in (("", frame), *frame.groupby("family")):
            if len(rows) >= LEAST_TASKS and np.ptp(rows[feature]) and np.ptp(rows[method]):
                pair = rows[feature].to_numpy(), rows[method].to_numpy()
                seen = rank_correlation_estimate(*pair)
                row |= {f"in {family}": seen.value} if family else interval("correlation", seen)
        if "correlation" in row:
            yield f"{method} {feature}", row


@figure(
    "hardness",
    "What makes a task hard, and for whom",
    "(a) Tasks by number of goals and mean way between them, of an arm's reach: which families can "
    "tell what. (b) Rank correlation of features of tasks and the gap of each method, over all "
    f"tasks, with {style.COVERAGE} intervals: to the right, more of it makes a task harder.",
)
def draw_hardness(study: Study) -> Parts:
    """Features by family, and their correlations with gaps."""
    data, frame = hardness(study), features_and_gaps(study)
    if not len(data):
        raise missing(study, f"fewer than {LEAST_TASKS} instances with solved runs")
    drawing, (tasks, axes) = style.figure_of((1, 2), (style.TWO, 3.2))
    families = enumerate(frame.groupby("family"))
    for color, (number, (family, rows)) in zip(itertools.cycle(style.PALETTE), families):
        dots: Any = {"color": color, "markersize": 3, "label": str(family).partition("/")[0]}
        tasks.plot(rows.goals + 0.12 * (number - 2), rows[FEATURES[1]], "o", **dots)
    tasks.set_xlabel(FEATURES[0])
    tasks.set_ylabel(FEATURES[1])
    tasks.legend()
    methods = list(dict.fromkeys(data.method))
    looks = style.looks(methods)
    for place, (method, marker) in enumerate(zip(methods, itertools.cycle("osD^v<>"))):
        rows, color = data[data.method == method], looks[method]["color"]
        heights = 0.4 - rows.feature.map(FEATURES.index) - 0.8 * (place + 0.5) / len(methods)
        axes.hlines(heights, rows.correlation_low, rows.correlation_high, color, linewidth=1)
        dots = {"color": color, "markersize": 3, "label": name_of(method)}
        axes.plot(rows.correlation, heights, marker, **dots)
    axes.axvline(0, color=style.INK, linewidth=0.6)
    style.name_rows(axes, FEATURES)
    axes.set_xlabel("rank correlation with the gap")
    drawing.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    style.letters((tasks, axes))
    seen = spoken(data, "{method}, {feature}: {correlation:.2f}")
    return drawing, data, f"Rank correlations with gaps. {seen}.", ()


def finding_of_hardness(study: Study) -> str:
    """For each feature, the method whose gap goes most with it."""
    data = hardness(study)
    most = data.sort_values("correlation").drop_duplicates("feature", keep="last").sort_index()
    seen = [
        f"{row['feature']}, {name_of(row['method'])} "
        f"{interval_in_words(row, 'correlation', digits=2)}"
        for row in most.to_dict("records")
    ]
    words = f"Over {data.tasks.max()} random tasks gaps go most with (rank correlations): "
    return f"{words}{'; '.join(seen)}." if seen else ""


HARDNESS = Section(
    "hardness",
    short="Hard tasks",
    title="What makes a task hard, and for whom?",
    caption="Rank correlation of a feature of tasks and the gap of a method",
    finding=finding_of_hardness,
    figure="hardness",
    table="hardness",
)
