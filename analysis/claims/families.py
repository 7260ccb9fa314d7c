"""Judges of the paper's general hypotheses, over families of random tasks.

Tests are of instances: the value of an instance is a mean over its runs. A claim holds in general
if it holds in every family that it names; development instances, on which methods were tuned, are
not judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.claims.rules import all_hold, shown
from coartic.analysis.generality.presence import signs
from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import CONDITIONS, INITIAL, LEARNER, most_exploring
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.words import number, tally
from coartic.robot import Array

_JERK = "trajectory-optimisation/jerk"
_RESAMPLES = 99_999
"""More than elsewhere: some verdicts on families are close, and samples are small."""


def compared(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over instances of the mean difference, as a share of the best \
known reward, in each family"""
    samples, parts = [], []
    for pair in claim.compared:
        for family in claim.families:
            values = _values(data, family, partial(_gain, data, pair=pair))
            samples.append(values)
            parts.append(f"{family} {pair}: {shown(values)} % on {len(values)} instances")
    return _all_above_0(samples, parts)


def first_movement(data: Data, claim: Claim) -> Finding:
    """Whether the first movement gets slower and the whole task faster."""
    longer = _by_family(data, claim, "first", "ticks longer", MARGINS["ticks"])
    shorter = _by_family(data, claim, "whole", "ticks shorter in all")
    samples, parts = zip(*longer, *shorter, strict=True)
    return _all_above_0(samples, parts)


def chosen_arm(data: Data, claim: Claim) -> Finding:
    """Whether learned postures leave the next goal nearer."""
    return _all_above_0(*zip(*_by_family(data, claim, "arm", claim.unit), strict=True))


def waiting_arm(data: Data, claim: Claim) -> Finding:
    """Whether the waiting arm brings its hand nearer to its next goal."""
    return _all_above_0(*zip(*_by_family(data, claim, "other arm", claim.unit), strict=True))


def choice_of_hand(data: Data, claim: Claim) -> Finding:
    """Whether learning hits goals with the slower hand more often than the closest hand does."""

    def more(name: str) -> float | None:
        learned, closest = (_mean_sign(data, name, c, "hand") for c in ("EC4", "EC2"))
        return None if learned is None or closest is None else 100 * (learned - closest)

    samples = [_values(data, family, more) for family in claim.families]
    parts = [
        f"{family} {shown(values)} {claim.unit} on {len(values)} instances"
        for family, values in zip(claim.families, samples, strict=True)
    ]
    return _all_above_0(samples, parts)


def corrective_ensures(data: Data, claim: Claim) -> Finding:
    """Whether no trial of the learner fails."""
    failed: dict[str, int] = {}
    trials = 0
    for family in claim.families:
        names = _reported(data, family)
        if not names:
            raise MissingError(f"this folder has no instances of {family} that can be judged")
        for name in names:
            for label in CONDITIONS:
                if (name, label) in data.study.cells:
                    runs = data.learned(name, label.removeprefix(LEARNER))
                    trials += int(runs.trials.sum())
                    failed[family] = failed.get(family, 0) + int(runs.failed_trials.sum())
    count = sum(failed.values())
    text = f"{count} of {number(trials)} trials fail to hit every goal ({tally(failed)})."
    return Finding(not count, text)


def _sample(data: Data) -> Sample:
    found = sample(data.study)
    if found is None:
        raise MissingError("this folder has no instances of families of tasks")
    return found


def _reported(data: Data, family: str) -> tuple[str, ...]:
    """Names of the instances of a family that are there to be reported."""
    found = _sample(data)
    names = found.families.get(family, ())
    return tuple(name for name in names if found.tasks[name].split != "development")


def _values(data: Data, family: str, of: Callable[[str], float | None]) -> Array:
    """Values of the instances of a family that have one, shape ``(n,)``."""
    known = [value for name in _reported(data, family) if (value := of(name)) is not None]
    if len(known) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} instances of {family} can be judged")
    return np.array(known)


def _by_family(
    data: Data, claim: Claim, sign: str, unit: str, bound: float = 0.0
) -> list[tuple[Array, str]]:
    """By how much a sign of the learner's runs exceeds a bound, and the mean in words."""
    rows = []
    for family in claim.families:
        values = _values(data, family, lambda name: _learned_sign(data, sign, name))
        text = f"{family} {shown(values, 2)} {unit} on {len(values)} instances"
        rows.append((values - bound, text))
    return rows


def _all_above_0(samples: Iterable[Array], parts: Iterable[str]) -> Finding:
    """Whether the mean of every sample is above 0."""
    kept = tuple(samples)
    tests = [bootstrap_test(values, 0.0, resamples=_RESAMPLES) for values in kept]
    return replace(all_hold(tests, list(parts)), samples=kept)


def _gain(data: Data, name: str, pair: str) -> float | None:
    """Of the first of a pair over the second, in per cent of the best known reward."""
    first, second = (_reward(data, name, side) for side in pair.split(" > "))
    if first is None or second is None:
        return None
    return 100 * (first - second) / abs(_sample(data).references[name].best)


def _reward(data: Data, name: str, side: str) -> float | None:
    """Mean reward of one side on an instance; None where it cannot be judged."""
    *replay, what = side.split()
    try:
        if what == "initial":
            return float(data.runs(name, INITIAL).reward.iloc[0])
        if what == "best":
            return data.best_sequences(name)[1]
        if what == "jerk":
            return float(data.runs(name, _JERK).reward.mean())
        condition = _condition(data, name) if what == "EC" else what
        values = (data.replays if replay else data.rewards)(name, condition)
    except MissingError:
        return None
    return float(np.mean(values))


def _condition(data: Data, name: str) -> str:
    """Of the paper's conditions the one that explores most."""
    return most_exploring(data.task(name)).removeprefix(LEARNER)


def _learned_sign(data: Data, sign: str, name: str) -> float | None:
    """Mean of a sign over the runs of the learner on an instance."""
    return _mean_sign(data, name, _condition(data, name), sign)


def _mean_sign(data: Data, name: str, condition: str, sign: str) -> float | None:
    """Mean of a sign over the runs of a condition on an instance."""
    try:
        data.learned(name, condition)
    except MissingError:
        return None
    values = signs(data.study)[name, LEARNER + condition].get(sign)
    return None if values is None else float(values.mean())
