"""More exploration, instance by instance: whether it is better, and where not, why not."""

from __future__ import annotations

import numpy as np

from coartic.analysis.generality.sample import Sample
from coartic.analysis.methods import EC1, EC2, EC3, EC4, INITIAL
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.instances import Scores
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


def gains_by_hands(
    sample: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]
) -> Scores:
    """The part of it that the hand sequences make: as if each run got the best that is known with
    its hands. The rest is what joints make of them."""

    def share(name: str, label: str) -> Array:
        best_by_hands, best = sample.by_hands(name), sample.references[name].reward
        hands = sample.study.cells[name, label].good.hands
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
