"""Hands and signatures over instances: in how many tasks coarticulation is there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coartic import Trajectory
from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import CONDITIONS
from coartic.analysis.signatures.other_arm import preshaping
from coartic.analysis.signatures.subtasks import isolated_agreement, served
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study, cached
from coartic.analysis.trajectories import Trajectories
from coartic.robot import Array

SIGNS = {
    "hand": "share of the goals that others follow which are hit with a hand that is not the "
    "quicker one for them alone",
    "arm": "ticks by which learned postures leave the next goal nearer, mean over goals",
    "other arm": "share of its way to its next goal that the waiting arm's hand makes while it "
    "waits, mean over goals",
    "first": "ticks by which the first movement is longer than the corrective process's with the "
    "same hands",
    "whole": "ticks by which the whole is shorter than it",
}
"""What is measured of every run, by name."""


@cached
def signs(study: Study) -> dict[tuple[str, str], dict[str, Array]]:
    """Of every instance and condition of the learner, by name and label.

    Signs by the names of :data:`SIGNS`, of the runs (n,) that have a value; without none of it.
    """
    by_cell = {}
    instances = sample(study)
    for name in instances.references if instances else ():
        for label in CONDITIONS:
            cell = study.cells.get((name, label))
            if cell is not None and len(cell.good):
                by_cell[name, label] = _values(study.trajectories(name, label))
    return by_cell


def _values(cell: Trajectories) -> dict[str, Array]:
    # Runs often end in the same solution, but not to the last bit: each is measured.
    of_runs = np.array([_of_run(cell, run) for run in cell.runs])
    change = cell.against_same_hands.astype(np.float64)
    values = dict(zip(("hand", "arm", "other arm"), of_runs.T, strict=True))
    values |= {"first": change[:, 0], "whole": -change.sum(axis=1)}
    present = {name: column[~np.isnan(column)] for name, column in values.items()}
    return {name: column for name, column in present.items() if len(column)}


def _of_run(cell: Trajectories, run: Trajectory) -> tuple[float, float, float]:
    """Hand, arm and other arm of :data:`SIGNS`; NaN for what the run does not have."""
    two = len(cell.task.hands) > 1
    quicker = isolated_agreement(run)[:-1]
    hand = 1.0 - sum(quicker) / len(quicker) if two and quicker else math.nan
    gains = served(run)[:, 1]
    arm = float(gains.mean()) if np.isfinite(gains).all() else math.nan
    waiting = math.nan
    if two and cell.initial is not None:
        nearer = preshaping(run, cell.initial)
        of_goals = nearer[~np.isnan(nearer)]
        waiting = float(of_goals.mean()) if len(of_goals) else math.nan
    return hand, arm, waiting


class Presence(NamedTuple):
    """One signature of one condition in one family, or over all of them."""

    family: str
    label: str
    sign: str
    instances: int
    value: Inference
    there: int
    """Instances whose mean is beyond :data:`THERE`."""


THERE = {"hand": 0.1, "arm": 1.0, "other arm": 0.1, "first": 1.0, "whole": 1.0}
"""From where on a signature is there: a tenth of the goals, or of the way; more than a tick, which
rounding can make."""


def presence(sample: Sample) -> list[Presence]:
    """Every signature by condition and family, and over all families."""
    rows, by_cell = [], signs(sample.study)
    for label in CONDITIONS:
        for sign in SIGNS:
            scores = {}
            for family, names in sample.families.items():
                values = [by_cell.get((name, label), {}).get(sign) for name in names]
                instances = [(of_runs,) for of_runs in values if of_runs is not None]
                if instances:
                    scores[family] = instances
            parts = [{family: instances} for family, instances in scores.items()]
            for part in [*parts, scores] if len(parts) > 1 else parts:
                means = [float(runs[0].mean()) for instances in part.values() for runs in instances]
                family = next(iter(part)) if len(part) == 1 else ""
                there = sum(value > THERE[sign] for value in means)
                mean = other_tasks(part)
                rows.append(Presence(family, label, sign, len(means), mean, there))
    return rows
