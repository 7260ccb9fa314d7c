"""All signatures of a study, a value a row, and the contexts that they compare."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.methods import LEARNERS, main_methods
from coartic.analysis.signatures.between import (
    NOWHERE,
    Place,
    TwoContexts,
    Value,
)
from coartic.analysis.signatures.context import context_pairs
from coartic.analysis.signatures.register import Signature, of_kind
from coartic.analysis.statistics.estimates import Estimate, student_mean, wilson
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.trajectories import Trajectories
from coartic.robot import HANDS, Array

SignatureValues = Iterator[tuple[Signature, Value]]


@cached
def signature_values(study: Study) -> pd.DataFrame:
    """Every signature of every method and task of a study, a value a row.

    Columns ``task``, ``method``, ``variant``; ``signature``, ``where`` (the place in words);
    ``value`` with ``low`` and ``high`` of its interval at 95 %, ``p`` without correction, ``n``
    runs behind it, ``unit``; those of :class:`~coartic.analysis.signatures.between.Place`;
    ``label``. Signatures of runs are means with Student's interval, shares of runs have Wilson's.
    Differences between contexts stand with the first task of the pair and name the other.
    """
    identity = ["task", "method", "variant"]
    columns = ["signature", "where", "value", "low", "high", "p", "n", "unit"]
    frame = pd.DataFrame(rows(study), columns=[*identity, *columns, *Place._fields, "label"])
    return frame.astype({"goal": "Int64"})


def rows(study: Study) -> Iterator[dict[str, Any]]:
    """Rows of :func:`signature_values`, cell by cell."""
    alone = one_by_one(study)
    trajectories = {key: study.trajectories(*key) for key in study.cells if key[0] in alone}
    pairs = context_pairs(study.tasks)
    for (task, label), cell in trajectories.items():
        of_method = {name: its for (name, whose), its in trajectories.items() if whose == label}
        partners = [p for p in pairs if task in p[:2] and {*p[:2]} <= of_method.keys()]
        values = [of_runs(cell)]
        values += [
            of_contexts(cell, of_method[second], shared)
            for first, second, shared in partners
            if first == task
        ]
        for signature, value in chain(*values):
            estimate = value.estimate
            if math.isnan(estimate.value):
                continue
            yield {
                **{"task": task, "method": cell.method, "variant": cell.variant, "label": label},
                **{"signature": signature.name, "where": str(value.place), "n": value.n},
                **{"value": estimate.value, "low": estimate.low, "high": estimate.high},
                "p": estimate.p,
                "unit": signature.unit if value.unit is None else value.unit,
                **value.place._asdict(),
            }


def of_runs(cell: Trajectories) -> SignatureValues:
    """Means and shares over the runs of a cell."""
    for signature in of_kind("runs"):
        if not cell.runs or (signature.two_hands and len(cell.task.hands) < 2):
            continue
        values = np.asarray(signature.measure(cell))
        if values.ndim == 1:
            yield signature, over_runs(values, NOWHERE)
        else:
            for goal, of_goal in enumerate(values.T, 1):
                yield signature, over_runs(of_goal, Place(goal))


def over_runs(values: Array, place: Place) -> Value:
    """The mean over the runs that have a value (n,), or the share of runs, with its interval."""
    values = values[np.isfinite(values)]
    n = len(values)
    if not n:
        return Value(place)
    if values.dtype == bool:
        count = int(values.sum())
        estimate = wilson(count, n) if n > 1 else Estimate(count / n)
    else:
        estimate = student_mean(values.astype(np.float64))
    return Value(place, estimate, n)


def of_contexts(first: Trajectories, second: Trajectories, shared: int) -> SignatureValues:
    """Values at every shared goal for every hand that hit it in both contexts."""
    for goal in range(1, shared + 1):
        for contexts in contexts_at(first, second, goal):
            for signature in of_kind("contexts"):
                yield signature, signature.measure(contexts)


def contexts_at(first: Trajectories, second: Trajectories, goal: int) -> list[TwoContexts]:
    """A goal in two contexts, for every hand that hit it in both."""
    by_hand = [TwoContexts(first, second, goal, hand) for hand in HANDS]
    return [contexts for contexts in by_hand if all(contexts.runs)]


@cached
def shared_goal(study: Study) -> TwoContexts | None:
    """The first goal that two tasks share before they differ, by the paper's learner if it ran.

    None where no method has solved runs on two such tasks.
    """
    labels = [label for _, label in study.cells]
    for label in dict.fromkeys([*LEARNERS, *main_methods(labels), *labels]):
        for *names, _ in context_pairs(study.tasks):
            keys = [(name, label) for name in names]
            if all(key in study.cells and len(study.cells[key].good) for key in keys):
                first, second = (study.trajectories(*key) for key in keys)
                for contexts in contexts_at(first, second, 1):
                    return contexts
    return None
