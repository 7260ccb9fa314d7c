"""Hands and signatures over instances: in how many tasks coarticulation is there."""

from __future__ import annotations

from typing import NamedTuple

from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import CONDITIONS
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import ROUNDING
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study, cached
from coartic.robot import Array

THERE = {"hand": 0.1, "arm": ROUNDING, "other arm": 0.1, "first": ROUNDING, "whole": ROUNDING}
"""From where on a sign of :data:`~coartic.analysis.signatures.signs.SIGNS` is there: a tenth of the
goals, or of the way; more than a tick, which rounding can make."""


@cached
def signs(study: Study) -> dict[tuple[str, str], dict[str, Array]]:
    """Of every instance and condition of the learner, by name and label.

    Signs by the names of :data:`THERE`, of the runs (n,) that have a value; without none of it.
    """
    by_cell = {}
    instances = sample(study)
    for name in instances.references if instances else ():
        for label in CONDITIONS:
            cell = study.cells.get((name, label))
            if cell is not None and len(cell.good):
                runs = study.trajectories(name, label)
                measured = {sign: SIGNS[sign].of(runs) for sign in THERE}
                by_cell[name, label] = {sign: each for sign, each in measured.items() if len(each)}
    return by_cell


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
    rows, by_cell = [], signs(sample.study)
    for label in CONDITIONS:
        for sign in THERE:
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
