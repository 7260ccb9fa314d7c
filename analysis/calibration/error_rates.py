"""Do the tests and intervals of this package hold their nominal rates on data like ours?

``python -m analysis.calibration.error_rates`` simulates samples of 20 runs from normal
distributions
and from distributions shaped like learned rewards (skewed, with several levels, in whole
ticks), applies the functions that the tables use, and prints how often each errs: type-I
error of tests at level 0.05, coverage of 95 % intervals, and how often means that differ by
just the margin are called equivalent (nominal 2.5 %). Rates come with their 95 % interval
(Wilson), and a mark where that interval excludes the nominal rate: ``+`` errs too often,
``-`` errs too seldom; of rates that hold, about one in 20 gets a mark by chance. A few
minutes on two cores; the same seed gives the same table.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from scipy import stats

from analysis.published import Summary
from analysis.statistics import estimates as statistics
from analysis.statistics import hypotheses
from analysis.statistics.across_tasks import interquartile_mean
from analysis.statistics.equivalence import bootstrap_equivalence, difference
from analysis.statistics.estimates import LEVEL
from analysis.table import Table
from coartic.robot import Array

Draw = Callable[[np.random.Generator, int], Array]

RUNS = 20
RESAMPLES = 999
SIMULATIONS = 4_000


@dataclass(frozen=True)
class Population:
    """A distribution of rewards with the parameters that intervals are to cover."""

    name: str
    draw: Draw
    mean: float
    middle: float
    """Interquartile mean."""


@dataclass(frozen=True)
class Check:
    """A claim to be counted: whether one simulated data set leads to an error."""

    subject: str
    data: str
    nominal: float
    errs: Callable[[np.random.Generator, int], bool]


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
    normal, skewed, two, three = populations()
    found: list[Check] = []
    for each in (normal, skewed, two, three):
        found += [_null_test(name, each, each) for name in _TESTS]
    # Equal means, different shapes: what a test of means is asked in earnest.
    for each in (skewed, two, three):
        found += [_null_test(name, each, normal) for name in _TESTS]
        found += [_null_test(name, normal, each) for name in _TESTS]
    for each in (normal, skewed, two, three):
        found += [_known_test(each, tail) for tail in ("greater", "less")]
    found += [_flip_test(each, normal, tail) for each in (normal, two) for tail in _ONE_TAILED]
    found += [_covers_mean(normal, runs) for runs in (5, 10)]
    for each in (normal, skewed, two, three):
        found += [_covers_mean(each, RUNS), _covers_difference(each, normal), _covers_middle(each)]
    found += [_covers_improvement(theta) for theta in (0.5, 0.8, 0.95, 0.99)]
    found.append(_covers_across((normal, skewed, two, three)))
    for each in (normal, skewed, two, three):
        found += [_equivalent(each, normal, side) for side in (1, -1)]
        found += [_equivalent_to_summary(each, normal, side) for side in (1, -1)]
    for each in (normal, skewed, two, three):
        found += [_covers_studentised(each, None), _covers_studentised(each, normal)]
    return found


_ONE_TAILED: tuple[hypotheses.Alternative, ...] = ("greater", "less")
_TESTS = {
    "bootstrap test": hypotheses.bootstrap_test,
    "permutation test": hypotheses.permutation_test,
}


def _centred(population: Population, rng: np.random.Generator, n: int = RUNS) -> Array:
    return population.draw(rng, n) - population.mean


def _null_test(name: str, first: Population, second: Population) -> Check:
    test = _TESTS[name]

    def errs(rng: np.random.Generator, seed: int) -> bool:
        a, b = _centred(first, rng), _centred(second, rng)
        return test(a, b, seed=seed, resamples=RESAMPLES).p <= LEVEL

    return Check(f"{name}, one-tailed", f"{first.name} > {second.name}", LEVEL, errs)


def _known_test(population: Population, tail: hypotheses.Alternative) -> Check:
    def errs(rng: np.random.Generator, seed: int) -> bool:
        values = population.draw(rng, RUNS)
        found = hypotheses.bootstrap_test(
            values, population.mean, tail, seed=seed, resamples=RESAMPLES
        )
        return found.p <= LEVEL

    sign = ">" if tail == "greater" else "<"
    name = "bootstrap test against a known value"
    return Check(name, f"{population.name} {sign} value", LEVEL, errs)


def _flip_test(first: Population, second: Population, tail: hypotheses.Alternative) -> Check:
    def errs(rng: np.random.Generator, seed: int) -> bool:
        a, b = _centred(first, rng), _centred(second, rng)
        return hypotheses.sign_flip_test(a, b, tail, seed=seed, resamples=RESAMPLES).p <= LEVEL

    sign = ">" if tail == "greater" else "<"
    return Check("sign-flip test, one-tailed", f"{first.name} {sign} {second.name}", LEVEL, errs)


def _misses(found: statistics.Inference, truth: float) -> bool:
    """Whether an interval leaves out the true value; one that is missing does."""
    return not found.low <= truth <= found.high


def _covers_mean(population: Population, runs: int) -> Check:
    def errs(rng: np.random.Generator, seed: int) -> bool:
        found = statistics.mean(population.draw(rng, runs), seed=seed, resamples=RESAMPLES)
        return _misses(found, population.mean)

    return Check(f"BCa interval of a mean, n = {runs}", population.name, LEVEL, errs)


def _covers_difference(first: Population, second: Population) -> Check:
    def errs(rng: np.random.Generator, seed: int) -> bool:
        found = statistics.difference_of_means(
            first.draw(rng, RUNS), second.draw(rng, RUNS), seed=seed, resamples=RESAMPLES
        )
        return _misses(found, first.mean - second.mean)

    data = f"{first.name} - {second.name}"
    return Check("BCa interval of a difference of means", data, LEVEL, errs)


def _covers_studentised(first: Population, second: Population | None) -> Check:
    """The interval of the equivalence test, of a mean or a difference; its margin is idle."""

    def errs(rng: np.random.Generator, seed: int) -> bool:
        a = _centred(first, rng)
        b = 0.0 if second is None else _centred(second, rng)
        found = bootstrap_equivalence(a, b, 1.0, seed=seed, resamples=RESAMPLES)
        return _misses(found, 0.0)

    if second is None:
        return Check("studentised bootstrap interval of a mean", first.name, LEVEL, errs)
    data = f"{first.name} - {second.name}"
    return Check("studentised bootstrap interval of a difference", data, LEVEL, errs)


def _covers_middle(population: Population) -> Check:
    def errs(rng: np.random.Generator, seed: int) -> bool:
        values = population.draw(rng, RUNS)
        found = statistics.interquartile_mean(values, seed=seed, resamples=RESAMPLES)
        return _misses(found, population.middle)

    return Check("BCa interval of an interquartile mean", population.name, LEVEL, errs)


def _covers_improvement(theta: float) -> Check:
    shift = math.sqrt(2) * float(stats.norm.ppf(theta))

    def errs(rng: np.random.Generator, seed: int) -> bool:
        a, b = rng.normal(shift, 1, RUNS), rng.normal(0, 1, RUNS)
        found = statistics.probability_of_improvement(a, b, seed=seed, resamples=RESAMPLES)
        return _misses(found, theta)

    return Check("interval of a probability of improvement", f"normal, {theta}", LEVEL, errs)


def _covers_across(tasks: tuple[Population, ...]) -> Check:
    """Every task scaled to its own mean and SD, so that all of them overlap."""
    rng = np.random.default_rng(0)
    scales = [float(each.draw(rng, 1_000_000).std()) for each in tasks]

    def scores(rng: np.random.Generator, n: int) -> dict[str, Array]:
        return {
            each.name: _centred(each, rng, n) / scale
            for each, scale in zip(tasks, scales, strict=True)
        }

    pool = np.concatenate(list(scores(rng, 1_000_000).values()))
    truth = float(stats.trim_mean(np.sort(pool), 0.25))

    def errs(rng: np.random.Generator, seed: int) -> bool:
        found = interquartile_mean(scores(rng, RUNS), seed=seed, resamples=RESAMPLES)
        return _misses(found, truth)

    return Check("interval of an interquartile mean across tasks", "all four", LEVEL, errs)


def _equivalent(first: Population, second: Population, side: int) -> Check:
    margin = 5.0

    def errs(rng: np.random.Generator, seed: int) -> bool:
        a, b = _shrunk(first, rng) + side * margin, _shrunk(second, rng)
        found = bootstrap_equivalence(a, b, margin, seed=seed, resamples=RESAMPLES)
        return found.verdict == "equivalent"

    data = f"{first.name}, {'above' if side > 0 else 'below'}"
    return Check("equivalence by bootstrap, at the margin", data, LEVEL / 2, errs)


def _equivalent_to_summary(first: Population, second: Population, side: int) -> Check:
    margin = 5.0

    def errs(rng: np.random.Generator, seed: int) -> bool:
        a, b = _shrunk(first, rng) + side * margin, _shrunk(second, rng)
        published = Summary(float(b.mean()), float(b.std(ddof=1)), len(b))
        return difference(a, published, margin=margin).verdict == "equivalent"

    data = f"{first.name}, {'above' if side > 0 else 'below'}"
    return Check("equivalence to mean ± SD (Welch), at the margin", data, LEVEL / 2, errs)


def _shrunk(population: Population, rng: np.random.Generator) -> Array:
    """Around 0, and small beside the margin: else wide intervals would never err."""
    return _centred(population, rng) / 10


def simulate(check: Check, simulations: int, seed: int) -> int:
    """How often a check errs in so many simulated data sets."""
    rng = np.random.default_rng(seed)
    return sum(check.errs(rng, int(rng.integers(2**32))) for _ in range(simulations))


def error_rates(simulations: int, seed: int, jobs: int) -> Table:
    """The table: what errs, on which data, how often, with a mark."""
    plan = checks()
    counts = Parallel(n_jobs=jobs)(
        delayed(simulate)(check, simulations, seed + number) for number, check in enumerate(plan)
    )
    rows = []
    for check, errors in zip(plan, counts, strict=True):
        interval = stats.binomtest(errors, simulations).proportion_ci(method="wilson")
        mark = (
            "+" if interval.low > check.nominal else "-" if interval.high < check.nominal else ""
        )
        rows.append(
            (
                check.subject,
                check.data,
                f"{check.nominal:.1%}",
                f"{errors / simulations:.1%} [{interval.low:.1%}, {interval.high:.1%}]",
                mark,
            )
        )
    title = f"Error rates, n = {RUNS}, {simulations} simulations, seed {seed}"
    return Table(title, ("what", "data", "nominal", "errs [95 % interval]", ""), tuple(rows))


def main() -> None:
    """``python -m analysis.calibration.error_rates``: print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--simulations", type=int, default=SIMULATIONS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    if given.simulations < 1:
        sys.exit("at least one simulation")
    table = error_rates(given.simulations, given.seed, given.jobs)
    print(f"# {table.title}\n\n{table.to_markdown()}")


if __name__ == "__main__":
    main()
