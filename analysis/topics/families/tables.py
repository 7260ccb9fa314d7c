"""Tables of families of random tasks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import TypeVar

import numpy as np
import pandas as pd

from coartic.analysis.methods import (
    EC1,
    EC2,
    EC3,
    EC4,
    INITIAL,
    LEARNERS,
    PLACEBO,
    is_variant,
    name_of,
)
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.statistics.estimates import LEVEL, interval
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.instances import Scores, other_tasks, value
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.families.instances import THERE, Sample, sample, scores_of
from coartic.robot import Array

OfFamily = TypeVar("OfFamily")
CONTRASTS = (
    (EC2, INITIAL),
    (EC1, INITIAL),
    (EC3, EC2),
    (EC4, EC3),
    (EC4, EC2),
)
"""More exploration against less: learning at all; random hands in place of the closest, the other
arm still; the other arm's joints as well; the same, against the closest hands: conditions 2 and 4
differ in nothing but the hands that they try."""
INITIAL_SOLUTION = "the initial solution"
"""How the column of contrasts names it."""
ALL = "all"
"""What stands in the column of families for the mean over all of them, each counting alike."""


@table("method, instances, gap[], to_bound[], in *")
def family_gaps(study: Study) -> Rows:
    """Gap to the best known reward over families with two arms, and in each family."""
    instances = sample(study)
    two_armed = [
        name
        for name, tasks in instances.families.items()
        if len(instances.tasks[tasks[0]].hands) > 1
    ]
    rows: list[tuple[str, Row]] = []
    for label in ("learner", *(name for name in instances.labels if not is_variant(name))):
        scores, bounded = (instances.gaps(label, to_bound=to) for to in (False, True))
        if not scores:
            continue
        row: Row = {"method": label, "instances": sum(map(len, scores.values())), "gap": math.nan}
        for name, gaps in (("gap", scores), ("to_bound", bounded)):
            if two_armed and set(two_armed) <= gaps.keys():
                row |= interval(name, other_tasks({family: gaps[family] for family in two_armed}))
        for family in instances.families:
            row[f"in {family}"] = (
                other_tasks({family: scores[family]}).value if family in scores else math.nan
            )
        cells = [
            cell
            for (task, name), cell in study.cells.items()
            if task in instances.tasks and name == instances.label_on(task, label)
        ]
        rows.append((label, row | runs_of(*cells)))
    yield from sorted(rows, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


def gains(instances: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]) -> Scores:
    """Rewards of both as shares of the best known, by family: what the first gains."""

    def share(name: str, label: str) -> Array:
        gap = instances.gap(name, label)
        assert gap is not None  # of shared instances
        return -gap

    return {
        family: [(share(name, first), share(name, second)) for name in of_family]
        for family, of_family in names.items()
    }


def gains_by_hands(
    instances: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]
) -> Scores:
    """The part of it that the hand sequences make: as if each run got the best that is known with
    its hands. The rest is what joints make of them."""

    def share(name: str, label: str) -> Array:
        best_by_hands, best = instances.by_hands[name], instances.references[name].reward
        hands = instances.study.cells[name, label].good.hands
        return np.array([best_by_hands[str(sequence)] for sequence in hands]) / abs(best)

    return {
        family: [(share(name, first), share(name, second)) for name in of_family]
        for family, of_family in names.items()
    }


def told_apart(first: Array, second: Array) -> bool:
    """Whether runs on one instance tell two methods apart, at 5 % and by itself."""
    if not np.ptp(first) and not np.ptp(second):
        return bool(first[0] != second[0])
    other = second if len(second) > 1 else float(second[0])
    return bool(bootstrap_test(first, other, "two-sided", resamples=999).p < LEVEL)


def each_and_all(by_family: dict[str, OfFamily]) -> Iterator[tuple[str, dict[str, OfFamily]]]:
    """Every family by itself, and ``all`` of them where there are several."""
    for family, part in by_family.items():
        yield family, {family: part}
    if len(by_family) > 1:
        yield ALL, by_family


def family_runs(study: Study, family: str, labels: Iterable[str]) -> Row:
    """Ids of the runs of methods on the instances of a family, or of all."""
    return runs_of(
        *(
            cell
            for (task, label), cell in study.cells.items()
            if label in labels and (family == ALL or study.tasks[task].family == family)
        )
    )


@table("contrast, family, instances, gain[], median, by_hands[], better, worse, told_apart")
def exploration(study: Study) -> Rows:
    """More exploration against less, by family and over all of them."""
    instances = sample(study)
    for first, second in CONTRASTS:
        less = INITIAL_SOLUTION if second == INITIAL else name_of(second)
        contrast = f"{name_of(first)} over {less}"
        for family, names in each_and_all(instances.shared(first, second)):
            scores = gains(instances, first, second, names)
            of_instances = [runs for of_family in scores.values() for runs in of_family]
            # Equal means of different runs may differ in the last bit.
            values = np.array(list(map(value, of_instances))).round(12)
            row: Row = {
                "contrast": contrast,
                "family": family,
                "instances": len(values),
                **interval("gain", other_tasks(scores)),
                "median": float(np.median(values)),
                **interval(
                    "by_hands", other_tasks(gains_by_hands(instances, first, second, names))
                ),
                "better": int((values > 0).sum()),
                "worse": int((values < 0).sum()),
                "told_apart": sum(told_apart(*runs) for runs in of_instances),
                **family_runs(study, family, (first, second)),
            }
            yield f"{contrast}, {family}", row


@table("sign, method, family, instances, there, mean[]")
def family_signs(study: Study) -> Rows:
    """Signs of coarticulation over instances, of the learner by condition and of the placebo."""
    instances = sample(study)
    for label, sign in itertools.product((*LEARNERS, PLACEBO), THERE):
        for family, scores in each_and_all(scores_of(instances, label, sign)):
            means = [float(runs[0].mean()) for of_family in scores.values() for runs in of_family]
            row: Row = {
                "sign": SIGNS[sign].in_short,
                "method": label,
                "family": family,
                "instances": len(means),
                "there": sum(mean > THERE[sign] for mean in means),
                **interval("mean", other_tasks(scores)),
                **family_runs(study, family, (label,)),
            }
            yield f"{sign}, {label}, {family}", row


@cached
def instance_gaps(study: Study) -> pd.DataFrame:
    """Gap of every method without variants on every instance, beside the mean of its family.

    Columns ``method``, ``family``, ``task``, ``gap`` (mean over runs), ``mean[]`` about other
    tasks of the family, ``instances``.
    """
    instances = sample(study)
    rows: list[Row] = []
    for label in instances.labels:
        for family, scores in instances.gaps(label).items() if " " not in label else ():
            mean = interval("mean", other_tasks({family: scores}))
            names = instances.shared(label)[family]
            rows += [
                {"method": label, "family": family, "task": name, "gap": float(np.mean(runs)),
                 **mean, "instances": len(scores)}
                for name, (runs,) in zip(names, scores, strict=True)
            ]  # fmt: skip
    columns = ["method", "family", "task", "gap", "mean", "mean_low", "mean_high", "instances"]
    return pd.DataFrame(rows, columns=columns)
