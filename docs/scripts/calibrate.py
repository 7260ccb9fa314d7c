"""How intervals and tests do where the truth is known: ``python docs/scripts/calibrate.py``.

With a folder of many runs of random search on ascending and descending, how often it passes as a
signature of coarticulation: ``coartic run comparison --tasks ascending,descending --methods
random-search --runs 400 --out results/random-search``, then ``python docs/scripts/calibrate.py
results/random-search``.

Samples like rewards are drawn, 500 times for each number of runs. Intervals at 95 % should
hold the truth in 95 % of them; tests at 5 % should reject a true hypothesis in 5 % at most. The
table is in docs/statistics.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from coartic import estimates
from coartic.analysis.methods import RANDOM_SEARCH
from coartic.analysis.signatures.context_tests import (
    beyond_p,
    permutation_p,
    standardised_posture_difference,
)
from coartic.analysis.statistics.hypotheses import (
    bootstrap_test,
    share_test,
    sign_flip_test,
)
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study, load
from coartic.estimates import LEVEL
from coartic.robot import Array

SIMULATIONS, RESAMPLES = 500, 999
"""Samples of each kind, and resamples of each; a rate of 5 % is known to ± 2 %."""
RUNS = (5, 20, 100)
Draw = Callable[[np.random.Generator, int], Array]
POPULATIONS: dict[str, Draw] = {
    "ticks": lambda rng, n: -300 + rng.normal(0, 3, n).round(),
    "skewed": lambda rng, n: -300 - rng.exponential(8, n).round(),
    "two levels": lambda rng, n: np.where(
        rng.random(n) < 0.7, -331 + rng.normal(0, 5, n), -355 + rng.normal(0, 1, n)
    ).round(),
}
"""Rewards as they occur: with ties, skewed, and on two levels, by the hands that are learned."""
SHARE = 0.75


def holds(interval: estimates.Estimate, truth: float) -> bool:
    """Whether an interval holds a value, to rounding; no interval does not."""
    return interval.low - 1e-9 <= truth <= interval.high + 1e-9


def of_rewards(rng: np.random.Generator, draw: Draw, n: int, mean: float) -> dict[str, bool]:
    """What the procedures for rewards make of two samples from one population."""
    a, b = draw(rng, n), draw(rng, n)
    return {
        "interval of a mean (BCa)": holds(estimates.mean(a, resamples=RESAMPLES), mean),
        "interval of a difference (BCa)": holds(
            estimates.difference_of_means(a, b, resamples=RESAMPLES), 0
        ),
        "interval of paired differences (BCa)": holds(
            estimates.mean(a - b, resamples=RESAMPLES), 0
        ),
        "test of a mean (bootstrap)": bootstrap_test(a, mean, resamples=RESAMPLES).p <= LEVEL,
        "test of two means (bootstrap)": bootstrap_test(a, b, resamples=RESAMPLES).p <= LEVEL,
        "test of pairs (sign flips)": sign_flip_test(a - b).p <= LEVEL,
    }


def of_counts(rng: np.random.Generator, n: int) -> dict[str, bool]:
    """Whether the test of a share rejects, at a share of three quarters."""
    counts = rng.multinomial(n, [SHARE, 0.15, 0.10], size=2).tolist()
    p = share_test(counts[0][0], n, SHARE, "greater").p
    return {"test of a share (exact binomial)": p <= LEVEL}


def of_postures(rng: np.random.Generator, n: int) -> dict[str, bool]:
    """Whether the permutation test of postures rejects, of two joints that vary together."""
    first, second = rng.exponential(0.1, (2, n, 2)) @ np.array([[1.0, 0.5], [0.0, 1.0]])
    p = permutation_p(first, second, rng, resamples=RESAMPLES)
    return {"test of postures (permutation)": bool(p <= LEVEL)}


def of_instances(rng: np.random.Generator, n: int) -> dict[str, bool]:
    """Whether the interval over n random tasks, five runs each, holds the mean of skewed gaps."""
    centres = rng.exponential(0.1, n)
    mean = other_tasks({"a": [centre + rng.exponential(0.02, 5) for centre in centres]})
    return {"interval over random tasks": holds(mean, 0.12)}


def rates() -> Iterator[tuple[str, str, int, float]]:
    """Procedure, population, number of runs, and in what share of samples it holds or rejects."""
    rng = np.random.default_rng(0)
    kinds: dict[str, Callable[[int], dict[str, bool]]] = {
        "counts": lambda n: of_counts(rng, n),
        "skewed": lambda n: of_postures(rng, n) | of_instances(rng, n),
    }
    for n in RUNS:
        for name, draw in POPULATIONS.items():
            mean = float(draw(rng, 4_000_000).mean())
            seen = pd.DataFrame([of_rewards(rng, draw, n, mean) for _ in range(SIMULATIONS)])
            yield from ((str(what), name, n, rate) for what, rate in seen.mean().items())
        for name, kind in kinds.items():
            seen = pd.DataFrame([kind(n) for _ in range(SIMULATIONS)])
            yield from ((str(what), name, n, rate) for what, rate in seen.mean().items())


STUDIES, RANDOM_SEARCH_RUNS = 200, 20
"""Simulated studies, and runs of the method and of random search in each."""


def rates_of_random_search(study: Study) -> Iterator[tuple[str, float]]:
    """In what share of simulated studies random search passes as a signature, by rule.

    A study takes runs of random search without replacement, half of them as a method's. By the
    rules of the claims *context* and *first-movement-sacrificed*, each with and without random
    search.
    """
    tasks = ("ascending", "descending")
    cells = [study.executed(task, RANDOM_SEARCH) for task in tasks]
    shown = [cell.configurations[:, 0] for cell in cells]
    slower = [cell.against_same_hands[:, 0].astype(np.float64) for cell in cells]
    rng, passed = np.random.default_rng(0), []
    for _ in range(STUDIES):
        picks = [rng.permutation(len(runs))[: 2 * RANDOM_SEARCH_RUNS] for runs in shown]
        pairs = list(zip(shown, picks, strict=True))
        method = (
            pairs[0][0][pairs[0][1][:RANDOM_SEARCH_RUNS]],
            pairs[1][0][pairs[1][1][:RANDOM_SEARCH_RUNS]],
        )
        rest = (
            pairs[0][0][pairs[0][1][RANDOM_SEARCH_RUNS:]],
            pairs[1][0][pairs[1][1][RANDOM_SEARCH_RUNS:]],
        )
        differ = standardised_posture_difference(*method) > 1.0
        differ &= bool(permutation_p(*method, rng, resamples=RESAMPLES) < LEVEL)
        beyond = beyond_p(method, rest, rng, resamples=RESAMPLES) < LEVEL
        ticks = [
            (t[p[:RANDOM_SEARCH_RUNS]], t[p[RANDOM_SEARCH_RUNS:]])
            for t, p in zip(slower, picks, strict=True)
        ]
        first = [bootstrap_test(a, 1.0, resamples=RESAMPLES).p < LEVEL for a, _ in ticks]
        more = [bootstrap_test(a, b, resamples=RESAMPLES).p < LEVEL for a, b in ticks]
        passed.append({
            "context, without random search": differ,
            "context": differ and beyond,
            "first movement, without random search": all(first),
            "first movement": all(first) and all(more),
        })  # fmt: skip
    for rule, share in pd.DataFrame(passed).mean().items():
        yield str(rule), float(share)


def main() -> None:
    """Print the rates in per cent, a row for each procedure and population."""
    if len(sys.argv) > 1:
        rates_by_rule = pd.DataFrame(
            rates_of_random_search(load(sys.argv[1])), columns=["rule", "passes"]
        )
        print(rates_by_rule.to_csv(index=False, float_format="%.3f"))
        return
    frame = pd.DataFrame(rates(), columns=["procedure", "rewards", "n", "rate"])
    frame["rate"] = (100 * frame.rate).map("{:.1f}".format)
    table = frame.set_index(["procedure", "rewards", "n"]).rate.unstack()  # noqa: PD010
    print(table.to_csv(sep="|"))


if __name__ == "__main__":
    main()
