"""Do the tests and intervals of this package hold their nominal rates on data like ours?

``python -m analysis.calibration.error_rates`` simulates samples of 20 runs from normal
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
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy import stats

from analysis.calibration.simulation import Check, Draw, arguments, lines
from analysis.published import Summary
from analysis.statistics import estimates as statistics
from analysis.statistics import hypotheses
from analysis.statistics.across_tasks import interquartile_mean
from analysis.statistics.equivalence import Equivalence, bootstrap_equivalence, difference
from analysis.statistics.estimates import LEVEL
from coartic.robot import Array

RUNS = 20
RESAMPLES = 999
SIMULATIONS = 4_000
MARGIN = 5.0

Sample = Callable[[np.random.Generator], Any]
"""Draws what a test or interval is given."""


@dataclass(frozen=True)
class Population:
    """A distribution of rewards with the parameters that intervals are to cover."""

    name: str
    draw: Draw
    mean: float
    middle: float
    """Interquartile mean."""

    def sample(self, runs: int = RUNS) -> Sample:
        """So many rewards."""
        return lambda rng: self.draw(rng, runs)

    def centred(self, rng: np.random.Generator) -> Array:
        """Rewards less their true mean."""
        return self.draw(rng, RUNS) - self.mean

    def near(self, shift: float) -> Sample:
        """Rewards around ``shift``, small beside the margin: else wide intervals never err."""
        return lambda rng: self.centred(rng) / 10 + shift


# Share, mean and SD of the hand sequences that runs settle on: two-armed-2 under
# exploration condition 4, two-armed-1 under condition 2.
_TWO = ((0.7, -331.0, 7.0), (0.3, -355.0, 1.0))
_THREE = ((0.73, -617.0, 8.0), (0.17, -580.0, 14.0), (0.10, -517.0, 7.0))


def populations() -> tuple[Population, ...]:
    """Normal, skewed, and mixtures like learned rewards of the two-armed tasks."""
    return (
        _population("normal", lambda rng, n: rng.normal(-303, 3, n), -303.0),
        _population("skewed", lambda rng, n: -300 - rng.gamma(1.5, 4.0, n), -306.0),
        _mixture("two levels", _TWO),
        _mixture("three levels", _THREE),
    )


def _mixture(name: str, levels: tuple[tuple[float, float, float], ...]) -> Population:
    """Normal levels, rounded to whole ticks; rounding does not move the mean."""
    shares, means, sds = np.array(levels).T

    def draw(rng: np.random.Generator, n: int) -> Array:
        chosen = rng.choice(len(shares), size=n, p=shares)
        return np.asarray(np.rint(rng.normal(means[chosen], sds[chosen])))

    return _population(name, draw, float(shares @ means))


def _population(name: str, draw: Draw, mean: float) -> Population:
    """The interquartile mean from a million values: exact to about SD/1000."""
    values = np.sort(draw(np.random.default_rng(0), 1_000_000))
    return Population(name, draw, mean, float(stats.trim_mean(values, 0.25)))


def checks() -> list[Check]:
    """Everything that is simulated, in the order of the table."""
    every = populations()
    normal, _, two, _ = every
    pairs = [(each, each) for each in every]
    # Equal means, different shapes: what a test of means is asked in earnest.
    pairs += [pair for each in every[1:] for pair in ((each, normal), (normal, each))]
    found = [
        _check(f"{name}, one-tailed", f"{a.name} > {b.name}", _rejects, test, a.centred, b.centred)
        for a, b in pairs
        for name, test in _TESTS.items()
    ]
    found += [_known_test(each, tail) for each in every for tail in _ONE_TAILED]
    found += [_flip_test(each, normal, tail) for each in (normal, two) for tail in _ONE_TAILED]
    found += [_covers(normal, runs) for runs in (5, 10)]
    for each in every:
        found += [_covers(each), _covers_difference(each, normal), _covers(each, middle=True)]
    found += [_covers_improvement(theta) for theta in (0.5, 0.8, 0.95, 0.99)]
    found.append(_covers_across(every))
    for each in every:
        above, below = (_equivalent(each, normal, side) for side in (1, -1))
        found += [check for pair in zip(above, below, strict=True) for check in pair]
    for each in every:
        found += [_covers_studentised(each, None), _covers_studentised(each, normal)]
    return found


_ONE_TAILED: tuple[hypotheses.Alternative, ...] = ("greater", "less")
_TESTS = {
    "bootstrap test": hypotheses.bootstrap_test,
    "permutation test": hypotheses.permutation_test,
}


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


def _rejects(found: statistics.Inference) -> bool:
    return found.p <= LEVEL


def _misses(truth: float) -> Callable[[statistics.Inference], bool]:
    """Whether an interval leaves out the true value; one that is missing does."""
    return lambda found: not found.low <= truth <= found.high


def _agrees(found: Equivalence) -> bool:
    return found.verdict == "equivalent"


def _known_test(population: Population, tail: hypotheses.Alternative) -> Check:
    def test(values: Array, **options: Any) -> statistics.Inference:
        return hypotheses.bootstrap_test(values, population.mean, tail, **options)

    data = f"{population.name} {_sign(tail)} value"
    subject = "bootstrap test against a known value"
    return _check(subject, data, _rejects, test, population.sample())


def _flip_test(first: Population, second: Population, tail: hypotheses.Alternative) -> Check:
    test = partial(hypotheses.sign_flip_test, alternative=tail)
    data = f"{first.name} {_sign(tail)} {second.name}"
    subject = "sign-flip test, one-tailed"
    return _check(subject, data, _rejects, test, first.centred, second.centred)


def _sign(tail: hypotheses.Alternative) -> str:
    return ">" if tail == "greater" else "<"


def _covers(population: Population, runs: int = RUNS, *, middle: bool = False) -> Check:
    """The interval of a mean, or of an interquartile mean."""
    subject = f"BCa interval of a{'n interquartile mean' if middle else f' mean, n = {runs}'}"
    errs = _misses(population.middle if middle else population.mean)
    infer = statistics.interquartile_mean if middle else statistics.mean
    return _check(subject, population.name, errs, infer, population.sample(runs))


def _covers_difference(first: Population, second: Population) -> Check:
    return _check(
        "BCa interval of a difference of means",
        f"{first.name} - {second.name}",
        _misses(first.mean - second.mean),
        statistics.difference_of_means,
        first.sample(),
        second.sample(),
    )


def _covers_studentised(first: Population, second: Population | None) -> Check:
    """The interval of the equivalence test, of a mean or a difference; its margin is idle."""

    def infer(a: Array, b: Array | float = 0.0, **options: Any) -> Equivalence:
        return bootstrap_equivalence(a, b, 1.0, **options)

    subject = f"studentised bootstrap interval of a {'difference' if second else 'mean'}"
    data = f"{first.name} - {second.name}" if second else first.name
    samples = [each.centred for each in (first, second) if each is not None]
    return _check(subject, data, _misses(0.0), infer, *samples)


def _covers_improvement(theta: float) -> Check:
    shift = math.sqrt(2) * float(stats.norm.ppf(theta))
    return _check(
        "interval of a probability of improvement",
        f"normal, {theta}",
        _misses(theta),
        statistics.probability_of_improvement,
        lambda rng: rng.normal(shift, 1, RUNS),
        lambda rng: rng.normal(0, 1, RUNS),
    )


def _covers_across(tasks: tuple[Population, ...]) -> Check:
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
    return _check(subject, "all four", _misses(truth), interquartile_mean, scores)


def _equivalent(first: Population, second: Population, side: int) -> list[Check]:
    """At the margin, between samples, and between a sample and a published summary."""

    def beside_summary(a: Array, b: Array, **_: object) -> Equivalence:
        published = Summary(float(b.mean()), float(b.std(ddof=1)), len(b))
        return difference(a, published, margin=MARGIN)

    data = f"{first.name}, {'above' if side > 0 else 'below'}"
    samples = first.near(side * MARGIN), second.near(0.0)
    return [
        _check(f"{subject}, at the margin", data, _agrees, infer, *samples, nominal=LEVEL / 2)
        for subject, infer in (
            ("equivalence by bootstrap", partial(bootstrap_equivalence, margin=MARGIN)),
            ("equivalence to mean ± SD (Welch)", beside_summary),
        )
    ]


def main() -> None:
    """``python -m analysis.calibration.error_rates``: print a line for each check."""
    given = arguments(__doc__, SIMULATIONS, 0)
    seed: int = given.seed
    sections, rule = {"Errs": checks()}, lambda number, check: seed + number
    for line in lines(sections, given.simulations, rule, "wilson", given.jobs):
        print(line, flush=True)


if __name__ == "__main__":
    main()
