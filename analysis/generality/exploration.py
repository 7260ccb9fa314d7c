"""More exploration, instance by instance: whether it is better, and where not, why not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coartic.analysis.comparisons.progress import best_so_far
from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import EC1, EC2, EC3, EC4, INITIAL
from coartic.analysis.statistics.estimates import LEVEL, Inference
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.instances import Scores, other_tasks, value
from coartic.analysis.study import Study, cached
from coartic.robot import Array

BUDGETS = (1_000, 10_000, 100_000)
"""Trials at which learning curves are read, as far as the runs went."""
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
    found: list[Contrast] = []
    if instances is None:
        return found
    for first, second in CONTRASTS:
        names = instances.shared(first, second)
        own = [_contrast(instances, first, second, {family: names[family]}) for family in names]
        found += own
        if len(own) > 1:
            found.append(_contrast(instances, first, second, names))
    return found


def gains(sample: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]) -> Scores:
    """Rewards of both as shares of the best known, by family: what the first gains."""

    def share(name: str, label: str) -> Array:
        gap = sample.gap(name, label)
        assert gap is not None  # of shared instances
        return -gap

    return {
        family: [(share(name, first), share(name, second)) for name in own]
        for family, own in names.items()
    }


def _contrast(
    sample: Sample, first: str, second: str, names: dict[str, tuple[str, ...]]
) -> Contrast:
    scores = gains(sample, first, second, names)
    # Equal means of different runs may differ in the last bit.
    values = np.array([value(runs) for own in scores.values() for runs in own]).round(12)
    hands = {
        family: [(_by_hands(sample, n, first), _by_hands(sample, n, second)) for n in own]
        for family, own in names.items()
    }
    return Contrast(
        *(first, second, next(iter(names)) if len(names) == 1 else "", len(values)),
        difference=other_tasks(scores),
        median=float(np.median(values)),
        hands=other_tasks(hands),
        better=int((values > 0).sum()),
        worse=int((values < 0).sum()),
        told=sum(_apart(*runs) for own in scores.values() for runs in own),
    )


def _by_hands(sample: Sample, name: str, label: str) -> Array:
    """Best known reward with the hands of each run (n,), as a share of the best known."""
    known, best = sample.by_hands(name), sample.references[name].best
    hands = sample.study.cells[name, label].good.hands
    return np.array([known[str(own)] for own in hands]) / abs(best)


def _apart(first: Array, second: Array) -> bool:
    """Whether runs on one instance tell two methods apart, at 5 % and by itself."""
    if not np.ptp(first) and not np.ptp(second):
        return bool(first[0] != second[0])
    other = second if len(second) > 1 else float(second[0])
    return bool(bootstrap_test(first, other, "two-sided", resamples=999).p < LEVEL)


class Budget(NamedTuple):
    """What is left to the best known after so many trials; or the difference of two conditions."""

    family: str
    label: str
    second: str
    """Empty for one method's gap; else what the first, ``label``, gains over this."""
    trials: int
    instances: int
    value: Inference


def budgets(sample: Sample) -> list[Budget]:
    """Mean gap of methods that learn after each of :data:`BUDGETS`, and contrasts, by family.

    Noise included: the best trial so far. A method has a value where all of its runs on all of
    its instances made so many trials.
    """
    found = []
    curves = {label: _curves(sample, label) for label in sample.labels}
    pairs = [(label, "") for label in sample.labels]
    pairs += [pair for pair in CONTRASTS if pair[1] != INITIAL]
    variants = [label for label in sample.labels if " " in label]
    pairs += [(label, label.partition(" ")[0]) for label in variants]
    for trials in BUDGETS:
        for first, second in pairs:
            sides = [curves.get(label, {}).get(trials, {}) for label in (first, second) if label]
            shared = [name for name in sides[0] if all(name in side for side in sides)]
            for family, names in sample.families.items():
                own = [
                    tuple(-side[name] if second else side[name] for side in sides)
                    for name in names
                    if name in shared
                ]
                if own:
                    mean = other_tasks({family: own})
                    found.append(Budget(family, first, second, trials, len(own), mean))
    return found


def _curves(sample: Sample, label: str) -> dict[int, dict[str, Array]]:
    """Gap of every run (n,) by trials and instance, for runs that made so many."""
    found: dict[int, dict[str, Array]] = {}
    for name, reference in sample.references.items():
        cell = sample.study.cells.get((name, label))
        if cell is None or not len(cell.runs):
            continue
        runs = [best_so_far(sample.study)[str(run)] for run in cell.runs.run_id]
        if not all(run.learns and run.solved for run in runs):
            continue
        made = min(int(run.total["trials"]) for run in runs)
        within = np.array([budget for budget in BUDGETS if budget <= made], dtype=np.float64)
        best = np.array([run.best("trials", within) for run in runs])
        for place, budget in enumerate(within.astype(int).tolist()):
            if np.isfinite(best[:, place]).all():
                gaps = (reference.best - best[:, place]) / abs(reference.best)
                found.setdefault(budget, {})[name] = gaps
    return found
