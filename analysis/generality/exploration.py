"""More exploration, instance by instance: whether it is better, and where not, why not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import EC1, EC2, EC3, EC4, INITIAL
from coartic.analysis.statistics.estimates import LEVEL, Inference
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.instances import Scores, other_tasks, value
from coartic.analysis.study import Study, cached
from coartic.robot import Array

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


class Contrast(NamedTuple):
    """One condition less another, as a share of the best known reward; positive: better."""

    first: str
    second: str
    family: str
    """Empty over all of them, each counting alike."""
    instances: int
    difference: Inference
    median: float
    """Over instances of the difference on each."""
    hands: Inference
    """Part of it that the hand sequences make: as if each run got the best that is known with
    its hands. The rest is what joints make of them."""
    better: int
    """Instances on which the first has the higher mean reward."""
    worse: int
    told: int
    """Instances on which the runs tell the two apart, in either direction."""


@cached
def contrasts(study: Study) -> list[Contrast]:
    """Every contrast of :data:`CONTRASTS` in every family, then over all; none without any."""
    instances = sample(study)
    rows: list[Contrast] = []
    if instances is None:
        return rows
    for first, second in CONTRASTS:
        names = instances.shared(first, second)
        groups = [{family: of_family} for family, of_family in names.items()]
        groups += [names] if len(names) > 1 else []
        rows += [_contrast(instances, first, second, group) for group in groups]
    return rows


def gains(sample: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]) -> Scores:
    """Rewards of both as shares of the best known, by family: what the first gains."""

    def share(name: str, label: str) -> Array:
        gap = sample.gap(name, label)
        assert gap is not None  # of shared instances
        return -gap

    return {
        family: [(share(name, first), share(name, second)) for name in of_family]
        for family, of_family in names.items()
    }


def _contrast(
    sample: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]
) -> Contrast:
    scores = gains(sample, first, second, names)
    # Equal means of different runs may differ in the last bit.
    of_instances = [runs for of_family in scores.values() for runs in of_family]
    values = np.array(list(map(value, of_instances))).round(12)
    hands = {
        family: [(_by_hands(sample, n, first), _by_hands(sample, n, second)) for n in of_family]
        for family, of_family in names.items()
    }
    return Contrast(
        *(first, second, next(iter(names)) if len(names) == 1 else "", len(values)),
        difference=other_tasks(scores),
        median=float(np.median(values)),
        hands=other_tasks(hands),
        better=int((values > 0).sum()),
        worse=int((values < 0).sum()),
        told=sum(told_apart(*runs) for runs in of_instances),
    )


def _by_hands(sample: Sample, name: str, label: str) -> Array:
    """Best known reward with the hands of each run (n,), as a share of the best known."""
    best_by_hands, best = sample.by_hands[name], sample.references[name].reward
    hands = sample.study.cells[name, label].good.hands
    return np.array([best_by_hands[str(sequence)] for sequence in hands]) / abs(best)


def told_apart(first: Array, second: Array) -> bool:
    """Whether runs on one instance tell two methods apart, at 5 % and by itself."""
    if not np.ptp(first) and not np.ptp(second):
        return bool(first[0] != second[0])
    other = second if len(second) > 1 else float(second[0])
    return bool(bootstrap_test(first, other, "two-sided", resamples=999).p < LEVEL)
