"""Signatures of learners beside random search with the same hands: what selection alone shows."""

from __future__ import annotations

import numpy as np

from coartic.analysis.random_search import (
    beside_random_search,
    most_of_random_search,
    most_trials,
    random_search_on,
    selects,
)
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.table import Rows, row_of_cell, table
from coartic.robot import Array

SHOWN = {
    "first": "first movement slower (ticks)",
    "arm": "next goal nearer (ticks)",
    "other arm": "idle hand nearer (share)",
}
"""Signatures of the table, in words. The choice of hands is not among them, as hands are equal."""
MORE = 10
"""Times as many trials in the last column."""


@table(
    "signature; task; method; hands; runs; value: mean .2; "
    "improved: random search, runs that improved .2; random_runs: number of these runs; "
    "p: p that the method has more .p; "
    "every: random search, all runs .2; "
    "more_trials: random search, ten times the trials, runs that improved .2"
)
def list_beside_random_search(study: Study) -> Rows:
    """Signatures of every method that selects from its trials, for each hand sequence with which a
    tenth of its improved runs end, beside random search with the same hands."""
    labels = [str(label) for label in study.methods.index if selects(study, label)]
    for signature in SHOWN:
        for task in one_by_one(study):
            for label in labels:
                if not (cell := study.cells.get((task, label))) or not len(cell.good):
                    continue
                if not random_search_on(study, task):
                    continue
                trials = most_trials(study, task, label)
                for hands, both in beside_random_search(study, signature, task, label).items():
                    values, improved = both
                    there = signature, task, hands
                    enough = len(improved) > 0
                    row = row_of_cell(study, cell) | {
                        "signature": SHOWN[signature],
                        "hands": hands,
                        "runs": len(values),
                        "value": values.mean(),
                        "improved": mean_of(improved),
                        "random_runs": len(improved),
                        "p": bootstrap_test(values, improved).p if enough else np.nan,
                        "every": mean_of(most_of_random_search(study, *there, trials, every=True)),
                        "more_trials": mean_of(most_of_random_search(study, *there, MORE * trials)),
                    }
                    yield f"{signature} {task} {label} {hands}", row


def mean_of(values: Array) -> float:
    """Return the mean; NaN without values."""
    return float(values.mean()) if len(values) else float("nan")
