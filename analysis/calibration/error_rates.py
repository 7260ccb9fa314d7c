"""Do the tests and intervals of this package hold their nominal rates on data like ours?

``python -m coartic.analysis.calibration.error_rates`` simulates samples of 20 runs from normal
distributions and from distributions shaped like learned rewards (skewed, with several levels, in
whole ticks), applies the functions that the tables use, and prints how often each errs: type-I
error of tests at level 0.05, intervals of 95 % that miss the truth, and how often means that
differ by just the margin are called equivalent (nominal 2.5 %). Rates come with their 95 %
interval (Wilson), and a mark where that interval excludes the nominal rate; of rates that hold,
about one in 20 gets a mark by chance. A few minutes on two cores; the same seed gives the same
rates.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
from scipy import stats

from coartic.analysis.calibration.simulation import Check, Draw, simulate
from coartic.analysis.statistics import across_tasks, estimates
from coartic.analysis.statistics.equivalence import Equivalence, bootstrap_equivalence, difference
from coartic.analysis.statistics.estimates import LEVEL, Inference
from coartic.analysis.statistics.hypotheses import (
    Alternative,
    bootstrap_test,
    permutation_test,
    sign_flip_test,
)
from coartic.robot import Array

RUNS = 20
RESAMPLES = 999
SIMULATIONS = 4_000
MARGIN = 5.0
_SIGNS: dict[Alternative, str] = {"greater": ">", "less": "<"}

Sample = Callable[[np.random.Generator], Any]
"""Draws what a test or interval is given."""


@dataclass(frozen=True)
class Population:
    """A distribution of rewards with the parameters that intervals are to cover."""

    name: str
    draw: Draw
    mean: float

    @cached_property
    def middle(self) -> float:
        """Interquartile mean, of a million values: exact to about SD/1000."""
        values = np.sort(self.draw(np.random.default_rng(0), 1_000_000))
        return float(stats.trim_mean(values, 0.25))

    def sample(self, runs: int = RUNS) -> Sample:
        """So many rewards."""
        return lambda rng: self.draw(rng, runs)

    def task(self, rng: np.random.Generator) -> dict[str, Array]:
        """Rewards of a task by itself."""
        return {self.name: self.draw(rng, RUNS)}

    def centred(self, rng: np.random.Generator) -> Array:
        """Rewards less their true mean."""
        return self.draw(rng, RUNS) - self.mean

    def near(self, shift: float) -> Sample:
        """Rewards around ``shift``, small beside the margin: else wide intervals never err."""
        return lambda rng: self.centred(rng) / 10 + shift


@cache
def populations() -> tuple[Population, ...]:
    """Normal, skewed, and mixtures like learned rewards of the two-armed tasks.

    Levels are share, mean and SD of the hand sequences that runs settle on: two-armed-2 under
    exploration condition 4, two-armed-1 under condition 2.
    """
    return (
        Population("normal", lambda rng, n: rng.normal(-303, 3, n), -303.0),
        Population("skewed", lambda rng, n: -300 - rng.gamma(1.5, 4.0, n), -306.0),
        _mixture("two levels", (0.7, -331.0, 7.0), (0.3, -355.0, 1.0)),
        _mixture("three levels", (0.73, -617.0, 8.0), (0.17, -580.0, 14.0), (0.10, -517.0, 7.0)),
    )


def _mixture(name: str, *levels: tuple[float, float, float]) -> Population:
    """Normal levels, rounded to whole ticks; rounding does not move the mean."""
    shares, means, sds = np.array(levels).T

    def draw(rng: np.random.Generator, n: int) -> Array:
        chosen = rng.choice(len(shares), size=n, p=shares)
        return np.asarray(np.rint(rng.normal(means[chosen], sds[chosen])))

    return Population(name, draw, float(shares @ means))


def checks() -> Iterator[Check]:
    """Everything that is simulated, in the order of the table."""
    every = populations()
    yield from _tests(*every)
    yield from _intervals(*every)
    yield from _equivalences(*every)


def _check(
    subject: str,
    data: str,
    errs: Callable[[Any], bool],
    infer: Callable[..., Any],
    *samples: Sample,
    nominal: float = LEVEL,
) -> Check:
    """Whether what ``infer`` says of samples is an error."""

    def seen(rng: np.random.Generator) -> bool:
        seed = int(rng.integers(2**32))
        drawn = [sample(rng) for sample in samples]
        return errs(infer(*drawn, seed=seed, resamples=RESAMPLES))

    return Check(subject, data, seen, nominal)


def _rejects(found: Inference) -> bool:
    return found.p <= LEVEL


def _misses(truth: float) -> Callable[[Inference], bool]:
    """Whether an interval leaves out the true value; one that is missing does."""
    return lambda found: not found.low <= truth <= found.high


def _tests(*every: Population) -> Iterator[Check]:
    """Of means that are equal, whatever the shapes: what a test of means is asked in earnest."""
    normal, _, two, _ = every
    pairs = [(each, each) for each in every]
    pairs += [pair for each in every[1:] for pair in ((each, normal), (normal, each))]
    of_two = {"bootstrap test": bootstrap_test, "permutation test": permutation_test}
    for a, b in pairs:
        for name, of in of_two.items():
            subject, data = f"{name}, one-tailed", f"{a.name} > {b.name}"
            yield _check(subject, data, _rejects, of, a.centred, b.centred)
    for each in every:
        for tail, sign in _SIGNS.items():
            subject, data = "bootstrap test against a known value", f"{each.name} {sign} value"
            known = partial(bootstrap_test, second=each.mean, alternative=tail)
            yield _check(subject, data, _rejects, known, each.sample())
    for each in (normal, two):
        for tail, sign in _SIGNS.items():
            subject, data = "sign-flip test, one-tailed", f"{each.name} {sign} {normal.name}"
            flips = partial(sign_flip_test, alternative=tail)
            yield _check(subject, data, _rejects, flips, each.centred, normal.centred)


def _intervals(*every: Population) -> Iterator[Check]:
    """BCa's, and those across tasks."""
    normal = every[0]

    def mean(of: Population, n: int) -> Check:
        subject = f"BCa interval of a mean, n = {n}"
        return _check(subject, of.name, _misses(of.mean), estimates.mean, of.sample(n))

    yield from (mean(normal, 5), mean(normal, 10))
    for each in every:
        yield mean(each, RUNS)
        subject, data = "BCa interval of a difference of means", f"{each.name} - {normal.name}"
        errs, samples = _misses(each.mean - normal.mean), (each.sample(), normal.sample())
        yield _check(subject, data, errs, estimates.difference_of_means, *samples)
        subject, errs = "BCa interval of an interquartile mean", _misses(each.middle)
        yield _check(subject, each.name, errs, across_tasks.interquartile_mean, each.task)
    for theta in (0.5, 0.8, 0.95, 0.99):
        shift = math.sqrt(2) * float(stats.norm.ppf(theta))
        subject = "interval of a probability of improvement"
        draws = [partial(np.random.Generator.normal, loc=mean, size=RUNS) for mean in (shift, 0)]
        infer = estimates.probability_of_improvement
        yield _check(subject, f"normal, {theta}", _misses(theta), infer, *draws)
    yield _across(every)


def _across(tasks: tuple[Population, ...]) -> Check:
    """Every task scaled to its own mean and SD, so that all of them overlap."""
    rng = np.random.default_rng(0)
    scales = [float(each.draw(rng, 1_000_000).std()) for each in tasks]

    def scores(rng: np.random.Generator, n: int = RUNS) -> dict[str, Array]:
        return {
            each.name: (each.draw(rng, n) - each.mean) / scale
            for each, scale in zip(tasks, scales, strict=True)
        }

    pool = np.concatenate(list(scores(rng, 1_000_000).values()))
    truth = float(stats.trim_mean(np.sort(pool), 0.25))
    subject = "interval of an interquartile mean across tasks"
    return _check(subject, "all four", _misses(truth), across_tasks.interquartile_mean, scores)


def _equivalences(*every: Population) -> Iterator[Check]:
    """Means a margin apart, of samples and beside a published summary; then the intervals."""
    normal = every[0]

    def beside_summary(a: Array, b: Array, **_: object) -> Equivalence:
        return difference(a, float(b.mean()), float(b.std(ddof=1)), len(b), margin=MARGIN)

    def agrees(found: Equivalence) -> bool:
        return found.verdict == "equivalent"

    def interval(a: Array, b: Array | float = 0.0, **options: Any) -> Equivalence:
        return bootstrap_equivalence(a, b, 1.0, **options)  # the margin is idle

    for each in every:
        for subject, infer in (
            ("equivalence by bootstrap", partial(bootstrap_equivalence, margin=MARGIN)),
            ("equivalence to mean ± SD (Welch)", beside_summary),
        ):
            for side, word in ((1, "above"), (-1, "below")):
                name, data = f"{subject}, at the margin", f"{each.name}, {word}"
                samples = each.near(side * MARGIN), normal.near(0.0)
                yield _check(name, data, agrees, infer, *samples, nominal=LEVEL / 2)
    for each in every:
        for kind, of in (("mean", (each,)), ("difference", (each, normal))):
            subject = f"studentised bootstrap interval of a {kind}"
            data = " - ".join(one.name for one in of)
            yield _check(subject, data, _misses(0.0), interval, *(one.centred for one in of))


if __name__ == "__main__":
    sections = {"Errs": list(checks())}
    simulate(__doc__, sections, SIMULATIONS, 0, lambda seed, number, _: seed + number, "wilson")
