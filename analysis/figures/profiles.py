"""Methods over all tasks: score profiles and performance profiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from coartic.analysis.comparisons.overall import REACHED, by_task, normalised_scores
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot, worded
from coartic.analysis.figures.selection import (
    HEADLINES,
    chosen,
    known_methods,
    missing,
)
from coartic.analysis.methods import EC4, most_exploring, short_name
from coartic.analysis.statistics.across_tasks import profile
from coartic.analysis.study import Study

LEARNER = "learner"
"""The paper's learner on all tasks: EC1 where there is one hand, EC4 where there are two."""
POINTS = 81
_SHOWN = {
    "corrective-alone/every",
    "random-search/climbing",
    "cma-es/bandit",
    "nullspace-qp/next-goal",
    "posture-based/two-goals",
    "trajectory-optimisation/path-length",
    "trajectory-optimisation/jerk",
}
_FARTHEST = {"score": 1.0, "gap": 0.16}
"""Right end of the score profile, and of the performance profile (gap to the optimum)."""


@style.styled
def profiles(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Share of runs, each task counting the same, by normalised score and by gap.

    Methods with runs on every task of the folder whose optimum is known; :data:`LEARNER`
    joins the paper's conditions. The caption names methods that were asked for and have no
    such runs. Raises CoarticError where there is none.
    """
    scores = normalised_scores(study)
    tasks = list(scores.task.unique())
    known = study.tasks
    learners = {name: most_exploring(known[name]) for name in tasks}
    joined = scores[scores.method == scores.task.map(learners)].assign(method=LEARNER)
    scores = pd.concat([joined, scores], ignore_index=True)
    known_methods(study, [label for label in methods or () if label != LEARNER])
    if not tasks:
        raise missing(study, "no task with a known optimum and an initial solution below it")
    labels = list(methods or [LEARNER])
    if methods is None:
        hidden = set(HEADLINES) - _SHOWN
        labels += [label for label in chosen(study, tasks, None) if label not in hidden]
    everywhere = [label for label in labels if set(by_task(scores, label)) == set(tasks)]
    names = ", ".join(tasks)
    if not everywhere:
        raise missing(study, f"no runs on every one of {names}: {', '.join(labels)}")
    data = pd.concat([_profiles(scores, label) for label in everywhere], ignore_index=True)
    absent = [short_name(label) for label in methods or () if label not in everywhere]
    ends = data[(data.kind == "gap") & (data.threshold.round(6) == 0.05)]
    words = "; ".join(
        f"{_name(row['method'])}: {row['share']:.0%}" for row in ends.to_dict("records")
    )
    elsewhere = f" Not run on every task: {', '.join(absent)}." if absent else ""
    figure = _draw(data, everywhere)
    return worded("profiles", figure, data, tasks=names, absent=elsewhere, shares=words)


def _profiles(scores: pd.DataFrame, label: str) -> pd.DataFrame:
    """Both curves of a method: shares of runs at thresholds, with their intervals."""
    parts = []
    for kind, farthest in _FARTHEST.items():
        levels = np.linspace(0.0, farthest, POINTS)
        found = profile(by_task(scores, label, kind), levels, REACHED[kind])
        curve = {"share": found.share, "low": found.low, "high": found.high}
        named = {"method": label, "kind": kind, "threshold": levels}
        parts.append(pd.DataFrame({**named, **curve, "runs": sum(found.n)}))
    return pd.concat(parts)


def _name(label: str) -> str:
    return "learner (EC1, EC4)" if label == LEARNER else short_name(label)


def _draw(data: pd.DataFrame, labels: Sequence[str]) -> Figure:
    # The learner looks as its fourth condition does.
    alike = {label: EC4 if label == LEARNER else label for label in labels}
    looks = style.looks(alike.values())
    lines: dict[str, Any] = {
        label: {**looks[like].line, "linewidth": 1.6 if label == LEARNER else 0.9}
        for label, like in alike.items()
    }
    rows = -(-len(labels) // 3)
    shape = style.grid(2, 2)
    size = style.widest(), 2.35 * shape[0] + 0.15 * rows * shape[0]
    figure, panels = style.figure_of(shape, size, sharey=True)
    for axes, (kind, curves) in zip(panels, data.groupby("kind", sort=False), strict=True):
        for label, own in curves.groupby("method", sort=False):
            line = lines[str(label)]
            axes.plot(own.threshold, own.share, **line)
            if (own.low < own.high).any():
                band: Any = {"color": line["color"], "alpha": 0.15, "linewidth": 0}
                axes.fill_between(own.threshold, own.low, own.high, **band)
        axes.set_xlim(0, _FARTHEST[str(kind)])
        axes.set_title(str(kind).capitalize())
    panels[0].set_ylim(-0.02, 1.02)  # shared
    panels[0].set_ylabel("share of runs")
    panels[0].set_xlabel("normalised score above")
    panels[1].set_xlabel("gap to the optimum at most")
    panels[1].set_xticks([0, 0.05, 0.1, 0.15], ["0", "5 %", "10 %", "15 %"])
    style.letters(panels)
    style.legend(figure, [style.entry(_name(label), **lines[label]) for label in labels], 3)
    return figure
