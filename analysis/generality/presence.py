"""Hands and signatures over instances: in how many tasks coarticulation is there."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import CONDITIONS, TWO_ARMED
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import ROUNDING
from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study, cached
from coartic.analysis.trajectories import best_sequences
from coartic.robot import Array

THERE = {"hand": 0.1, "arm": ROUNDING, "other arm": 0.1, "first": ROUNDING, "whole": ROUNDING}
"""From where on a sign of :data:`~coartic.analysis.signatures.signs.SIGNS` is there: a tenth of the
goals, or of the way; more than a tick, which rounding can make."""


@dataclass(frozen=True)
class Signs:
    """Of the runs of a learner on an instance."""

    values: dict[str, Array]
    """By the names of :data:`THERE`, of the runs (n,) that have a value; without none of it."""
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
                best = best_sequences(study.sequences, name)
                initial = str(cell.good.initial_hands.iloc[0])
                measured = {sign: SIGNS[sign].of(runs) for sign in THERE}
                values = {sign: each for sign, each in measured.items() if len(each)}
                found[name, label] = Signs(values, tuple(runs.sequences), initial, tuple(best))
    return found


class Presence(NamedTuple):
    """One signature of one condition in one family, or over all of them."""

    family: str
    label: str
    sign: str
    instances: int
    value: Inference
    there: int
    """Instances whose mean is beyond :data:`THERE`."""


def presence(sample: Sample) -> list[Presence]:
    """Every signature by condition and family, and over all families."""
    rows, found = [], signs(sample.study)
    for label in CONDITIONS:
        for sign in THERE:
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
                        sample.by_hands[name][hands] == best[name]
                        for name, (hands, _) in most.items()
                    ),
                    consistent=sum(most[name][1] > 0.75 * len(s.hands) for name, s in own),
                    both_hands=float(np.mean(both)),
                )
                rows.append(row)
    return rows
