"""The paper's general hypotheses, judged over families of random tasks: each test is of instances.

A claim holds in general if it holds in every family that it names; development instances, on which
methods were tuned, are not judged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.evidence import all_hold, exceeds, shown
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import STATEMENTS, decides
from coartic.analysis.generality.sample import Sample
from coartic.analysis.methods import CONDITIONS, INITIAL, LEARNER, most_exploring
from coartic.analysis.signatures.subtasks import ROUNDING
from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.words import tally
from coartic.robot import Array

COMPARED = (
    "one-tailed bootstrap tests over instances of the mean difference, as a share of the best "
    "known reward, in each family"
)
"""What comparisons on instances test."""
_JERK = "trajectory-optimisation/jerk"


def _sample(data: Data) -> Sample:
    if data.study.instances is None:
        raise MissingError("this folder has no instances of families of tasks")
    return data.study.instances


def _judged(data: Data, family: str) -> tuple[str, ...]:
    """Names of the instances of a family that are there to be reported."""
    sample = _sample(data)
    names = sample.families.get(family, ())
    return tuple(name for name in names if sample.tasks[name].split != "development")


def _over(data: Data, family: str, values: Sequence[float | None]) -> Array:
    """Values of the instances that have one, shape ``(n,)``."""
    known = np.array([value for value in values if value is not None])
    if len(known) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} instances of {family} can be judged")
    return known


def _learner(data: Data, name: str) -> str:
    """Of the paper's conditions the one that explores most."""
    return most_exploring(data.task(name)).removeprefix(LEARNER)


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
        condition = _learner(data, name) if what == "EC" else what
        found = data.replays(name, condition) if replay else data.rewards(name, condition)
    except MissingError:
        return None
    return float(spread.mean(found))


def _gain(data: Data, name: str, pair: str) -> float | None:
    """Of the first of a pair over the second, in per cent of the best known reward."""
    first, second = (_reward(data, name, side) for side in pair.split(" > "))
    if first is None or second is None:
        return None
    return 100 * (first - second) / abs(_sample(data).references[name].best)


def _compared(data: Data, families: Sequence[str], compared: Sequence[str]) -> Finding:
    samples, parts = [], []
    for pair in compared:
        for family in families:
            names = _judged(data, family)
            own = _over(data, family, [_gain(data, name, pair) for name in names])
            samples.append(own)
            parts.append(f"{family} {pair}: {shown(own)} % on {len(own)} instances")
    return _held(samples, parts)


def _held(samples: Sequence[Array], parts: Sequence[str]) -> Finding:
    """Whether the mean of every sample is above 0."""
    found = all_hold([exceeds(values, 0.0, sure=True) for values in samples], parts)
    return replace(found, samples=tuple(samples))


for _name, _said in STATEMENTS.items():
    if _said.compared:
        decides(_name, families=_said.families, compared=_said.compared)(_compared)


def _mean_sign(data: Data, name: str, condition: str, sign: str) -> float | None:
    """Of the runs of a condition on an instance."""
    try:
        data.learned(name, condition)
    except MissingError:
        return None
    values = data.study.signs[name, LEARNER + condition].values.get(sign)
    return None if values is None else float(spread.mean(values))


def _learned_sign(data: Data, sign: str, name: str) -> float | None:
    """Mean of a signature over the runs of the learner on an instance."""
    return _mean_sign(data, name, _learner(data, name), sign)


Parts = tuple[list[Array], list[str]]
"""Values of instances by family, less their bound, and what was seen of each."""


def _beyond(
    data: Data, claim: str, of: Callable[[str], float | None], unit: str, bound: float = 0.0
) -> Parts:
    """By how much what is measured of an instance is beyond a bound, in every family."""
    samples, parts = [], []
    for family in STATEMENTS[claim].families:
        own = _over(data, family, [of(name) for name in _judged(data, family)])
        samples.append(own - bound)
        parts.append(f"{family} {shown(own, '.2f')} {unit} on {len(own)} instances")
    return samples, parts


@decides("first-movement-sacrificed-in-general")
def _first_movement(data: Data) -> Finding:
    claim = "first-movement-sacrificed-in-general"
    first, one = _beyond(
        data, claim, partial(_learned_sign, data, "first"), "ticks longer", ROUNDING
    )
    whole, two = _beyond(
        data, claim, partial(_learned_sign, data, "whole"), "ticks shorter in all"
    )
    return _held(first + whole, one + two)


@decides("hand-coarticulation-in-general")
def _hands(data: Data) -> Finding:
    """By learning, less what comes of taking the closest hand."""
    claim = "hand-coarticulation-in-general"
    return _held(*_beyond(data, claim, partial(_more_hands, data), "points"))


def _more_hands(data: Data, name: str) -> float | None:
    """Share of goals hit with the slower hand under condition 4 less that under 2, in points."""
    learned, closest = (_mean_sign(data, name, c, "hand") for c in ("EC4", "EC2"))
    return None if learned is None or closest is None else 100 * (learned - closest)


def _arm(data: Data, claim: str, sign: str, unit: str) -> Finding:
    return _held(*_beyond(data, claim, partial(_learned_sign, data, sign), unit))


for _name, _sign, _unit in (
    ("arm-coarticulation-in-general", "arm", "ticks"),
    ("other-arm-coarticulation-in-general", "other arm", "of the way"),
):
    decides(_name, claim=_name, sign=_sign, unit=_unit)(_arm)


@decides("corrective-ensures-in-general")
def _ensures(data: Data) -> Finding:
    failed: dict[str, int] = {}
    trials = 0
    for family in STATEMENTS["corrective-ensures-in-general"].families:
        names = _judged(data, family)
        if not names:
            raise MissingError(f"this folder has no instances of {family} that can be judged")
        for name in names:
            for label in CONDITIONS:
                if (name, label) in data.study.cells:
                    runs = data.learned(name, label.removeprefix(LEARNER))
                    trials += int(runs.trials.sum())
                    failed[family] = failed.get(family, 0) + int(runs.failed_trials.sum())
    count = sum(failed.values())
    text = f"{count} of {trials} trials do not hit every goal ({tally(failed)})"
    return Finding(not count, text)
