"""Hands and signatures over instances: in how many tasks coarticulation is there."""

from __future__ import annotations

from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import CONDITIONS
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import ROUNDING
from coartic.analysis.statistics.instances import Runs
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


def scores_of(sample: Sample, label: str, sign: str) -> dict[str, list[Runs]]:
    """A sign of a condition by family, of the instances that have a value."""
    by_cell, scores = signs(sample.study), {}
    for family, names in sample.families.items():
        values = [by_cell.get((name, label), {}).get(sign) for name in names]
        instances: list[Runs] = [(of_runs,) for of_runs in values if of_runs is not None]
        if instances:
            scores[family] = instances
    return scores
