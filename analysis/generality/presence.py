"""Hands and signatures over instances: in how many tasks coarticulation is there."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from coartic import Trajectory
from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import CONDITIONS, TWO_ARMED
from coartic.analysis.signatures.other_arm import preshaping
from coartic.analysis.signatures.subtasks import isolated_agreement, served
from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study, cached
from coartic.analysis.trajectories import Trajectories, best_sequences
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


@dataclass(frozen=True)
class Signs:
    """Of the runs of a learner on an instance."""

    values: dict[str, Array]
    """By the names of :data:`SIGNS`, of the runs (n,) that have a value; without none of it."""
    hands: tuple[str, ...]
    """Sequence of each run."""
    initial: str
    best: tuple[str, ...]
    """Sequences that are best by the corrective process alone."""


@cached
def signs(study: Study) -> dict[tuple[str, str], Signs]:
    """Of every instance and condition of the learner, by name and label."""
    found: dict[tuple[str, str], Signs] = {}
    instances = sample(study)
    for name in instances.references if instances else ():
        for label in CONDITIONS:
            cell = study.cells.get((name, label))
            if cell is not None and len(cell.good):
                runs = study.trajectories(name, label)
                best = best_sequences(study.sequences(name))
                initial = str(cell.good.initial_hands.iloc[0])
                found[name, label] = Signs(
                    _values(runs), tuple(runs.sequences), initial, tuple(best)
                )
    return found


def _values(cell: Trajectories) -> dict[str, Array]:
    # Runs often end in the same solution, but not to the last bit: each is measured.
    own = [_of_run(cell, run) for run in cell.runs]
    change = cell.against_same_hands
    values = {name: np.array([v for v in column if not math.isnan(v)]) for name, column in zip(
        ("hand", "arm", "other arm"), zip(*own, strict=True), strict=True)}  # fmt: skip
    values |= {"first": change[:, 0].astype(float), "whole": -change.sum(axis=1).astype(float)}
    return {name: column for name, column in values.items() if len(column)}


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
        known = nearer[~np.isnan(nearer)]
        waiting = float(known.mean()) if len(known) else math.nan
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
    rows, found = [], signs(sample.study)
    for label in CONDITIONS:
        for sign in SIGNS:
            scores = {}
            for family, names in sample.families.items():
                own = [
                    (found[name, label].values[sign],)
                    for name in names
                    if (name, label) in found and sign in found[name, label].values
                ]
                if own:
                    scores[family] = own
            parts = [{family: own} for family, own in scores.items()]
            for part in [*parts, scores] if len(parts) > 1 else parts:
                means = [float(spread.mean(runs[0])) for own in part.values() for runs in own]
                family = next(iter(part)) if len(part) == 1 else ""
                there = sum(value > THERE[sign] for value in means)
                found_in = other_tasks(part)
                rows.append(Presence(family, label, sign, len(means), found_in, there))
    return rows


class Recruitment(NamedTuple):
    """Which hands a condition learns in one family."""

    family: str
    label: str
    instances: int
    leaves_initial: int
    """Instances on which the commonest sequence is not the initial one."""
    as_corrective: int
    """On which it is the best by the corrective process alone."""
    as_best_known: int
    """On which it is that of the best known solution."""
    consistent: int
    """On which more than three quarters of the runs have one sequence."""
    both_hands: float
    """Share of runs that use both."""


def recruitment(sample: Sample) -> list[Recruitment]:
    """Of each condition with two arms in each family."""
    rows, found = [], signs(sample.study)
    for label in TWO_ARMED:
        for family, names in sample.families.items():
            own = [(name, found[name, label]) for name in names if (name, label) in found]
            if own:
                most = {name: Counter(signs.hands).most_common(1)[0] for name, signs in own}
                best = {name: sample.references[name].best for name in most}
                both = [np.mean([len(set(h)) > 1 for h in signs.hands]) for _, signs in own]
                row = Recruitment(
                    *(family, label, len(own)),
                    leaves_initial=sum(most[name][0] != signs.initial for name, signs in own),
                    as_corrective=sum(most[name][0] in signs.best for name, signs in own),
                    as_best_known=sum(
                        sample.by_hands(name)[hands] == best[name]
                        for name, (hands, _) in most.items()
                    ),
                    consistent=sum(most[name][1] > 0.75 * len(s.hands) for name, s in own),
                    both_hands=float(np.mean(both)),
                )
                rows.append(row)
    return rows
