"""Where the variance of gaps comes from, and how many instances and runs show a difference."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from coartic.analysis.generality.sample import Sample
from coartic.analysis.methods import INITIAL, TWO_ARMED
from coartic.analysis.statistics.instances import Components, Paired, components, paired

DIFFERENCE = 0.01
"""Of the best known reward, between two methods."""
RUNS = (1, 3, 10, 30)
"""Of each method on each instance."""


class Shares(NamedTuple):
    """Variance components of the gaps of a family's methods."""

    family: str
    of: str
    """Which methods."""
    methods: int
    instances: int
    components: Components


def variance_shares(sample: Sample) -> list[Shares]:
    """In each family with two methods, of those without variants that solved all they share.

    But for the initial solution, which is far behind all; then of the paper's conditions alone.
    """
    learned = [label for label in sample.labels if " " not in label and label != INITIAL]
    parts = {"all methods": learned, "EC2 to EC4": [n for n in learned if n in TWO_ARMED]}
    found = []
    for family, (of, labels) in itertools.product(sample.families, parts.items()):
        # Methods that failed an instance would leave it out for all others.
        sizes = {
            label: len(sample.gaps(label, families=[family]).get(family, ())) for label in labels
        }
        kept = [
            label for label, size in sizes.items() if size == max(sizes.values(), default=0) > 1
        ]
        own = sample.gaps(*kept, families=[family]).get(family, []) if kept else []
        if len(kept) > 1 and len(own) > 1:
            scores = {label: [runs[k] for runs in own] for k, label in enumerate(kept)}
            found.append(Shares(family, of, len(kept), len(own), components(scores)))
    return found


class Needed(NamedTuple):
    """Instances that show :data:`DIFFERENCE` between two methods, over all families together."""

    first: str
    second: str
    instances: int
    """That they share here."""
    difference: float
    """Mean gap of the first less that of the second."""
    between: float
    """SD of their true difference over instances of a family."""
    within: float
    """SD of a run's difference on one instance."""
    needed: tuple[int, ...]
    """By the numbers of :data:`RUNS`."""


def needed(sample: Sample) -> list[Needed]:
    """Every pair of methods without variants on two instances of a family or more.

    But for the initial solution, which none is near.
    """
    labels = [label for label in sample.labels if " " not in label and label != INITIAL]
    found = []
    for first, second in itertools.combinations(labels, 2):
        scores = sample.gaps(first, second)
        own = [
            paired([runs[0] for runs in pairs], [runs[1] for runs in pairs])
            for pairs in scores.values()
            if len(pairs) > 1
        ]
        if not own:
            continue
        between = float(np.mean([pair.between for pair in own]))
        within = tuple(float(np.mean([pair.within[k] for pair in own])) for k in (0, 1))
        mean = float(np.mean([pair.mean for pair in own]))
        pooled = Paired(mean, between, (within[0], within[1]))
        instances = sum(map(len, scores.values()))
        counts = tuple(pooled.needed(DIFFERENCE, runs) for runs in RUNS)
        sds = between**0.5, sum(within) ** 0.5
        found.append(Needed(first, second, instances, mean, *sds, counts))
    return found
