"""Which properties of a task make coarticulation pay: known before anything is run on it."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from coartic import Task
from coartic.analysis.generality.sample import Sample
from coartic.analysis.methods import most_exploring
from coartic.analysis.signatures.trajectories import best_sequences
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import regression

PROPERTIES = {
    "distance": "mean distance from goal to goal, as a share of the reach",
    "spread": "SD of these distances, likewise",
    "goals": "number of goals",
    "redundancy": "joints of an arm beyond two",
    "base": "directions in which the base moves (free 2, on a rail 1, locked 0)",
}
"""Of a task, by name."""
OUTCOMES = {
    "worth": "best known reward above the best of the corrective process alone with any hands",
    "learned": "mean reward of the learner (EC1, EC4) above the same",
}
"""What is explained, as a share of the best known reward."""


class Property(NamedTuple):
    """What one more of a property goes with, all others alike, in shares of the best known."""

    outcome: str
    name: str
    effect: Inference
    least: float
    most: float
    """Least and most that there is of it in the sample."""
    instances: int
    explained: float
    """R² of the whole regression, within families."""


def properties(task: Task) -> dict[str, float]:
    """Of a task alone, by the names of :data:`PROPERTIES`."""
    links = len(task.robot.right_links)
    steps = [
        float(np.hypot(*np.subtract(b, a))) for a, b in itertools.pairwise(np.array(task.goals))
    ]
    reach = float(sum(task.robot.right_links))
    return {
        "distance": float(np.mean(steps)) / reach if steps else 0.0,
        "spread": float(np.std(steps)) / reach if steps else 0.0,
        "goals": float(len(task.goals)),
        "redundancy": float(links - 2),
        "base": float(2 - len(task.locked_base)),
    }


def outcomes(sample: Sample, name: str) -> dict[str, float]:
    """Of an instance by the names of :data:`OUTCOMES`, as far as the folder knows them."""
    sequences = sample.study.results.sequences
    best = best_sequences(sequences, name)
    if not best:
        return {}
    own = sequences[(sequences.task == name) & (sequences.hands == best[0])]
    alone, reference = float(own.reward.iloc[0]), sample.references[name].best
    found = {"worth": (reference - alone) / abs(reference)}
    gap = sample.gap(name, most_exploring(sample.tasks[name]))
    if gap is not None:
        found["learned"] = found["worth"] - float(np.mean(gap))
    return found


def what_pays(sample: Sample) -> list[Property]:
    """A regression over all instances for each outcome; none for too few instances."""
    known = {name: outcomes(sample, name) for name in sample.references}
    found = []
    for outcome in OUTCOMES:
        names = [name for name, values in known.items() if outcome in values]
        if not names:
            continue
        values = np.array([known[name][outcome] for name in names])
        table = np.array([list(properties(sample.tasks[name]).values()) for name in names])
        groups = [str(sample.tasks[name].family) for name in names]
        try:
            effects, explained = regression(values, table, groups)
        except ValueError:  # too few
            continue
        for place, (name, effect) in enumerate(zip(PROPERTIES, effects, strict=True)):
            least, most = float(table[:, place].min()), float(table[:, place].max())
            if not math.isnan(effect.estimate):
                row = Property(outcome, name, effect, least, most, len(names), explained)
                found.append(row)
    return found
