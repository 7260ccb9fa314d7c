"""Simulated data sets, each asked yes or no: how often yes, beside how often it should be."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from scipy import stats

from coartic.robot import Array

Draw = Callable[[np.random.Generator, int], Array]
"""Draws so many values, or rows of them."""


@dataclass(frozen=True)
class Check:
    """One kind of data set and what is asked of it."""

    subject: str
    data: str
    seen: Callable[[np.random.Generator], bool]
    """Simulate once: whether the test rejects, or the interval holds or misses the truth."""
    nominal: float | None = None
    """Share of data sets in which it should be seen, where something is promised."""

    @property
    def name(self) -> str:
        """Subject and data."""
        return f"{self.subject}, {self.data}"


class Rate(NamedTuple):
    """Share of data sets in which something is seen, with its 95 % interval."""

    share: float
    low: float
    high: float

    def mark(self, nominal: float | None) -> str:
        """Says so where the interval excludes the nominal rate."""
        if nominal is None or self.low <= nominal <= self.high:
            return ""
        return "ABOVE" if self.low > nominal else "BELOW"


Seed = int | Sequence[int]
Interval = Literal["wilson", "exact"]


def rate(check: Check, simulations: int, seed: Seed, interval: Interval = "exact") -> Rate:
    """How often a check sees something in so many data sets; the same seed, the same rate."""
    rng = np.random.default_rng(seed)
    seen = sum(bool(check.seen(rng)) for _ in range(simulations))
    low, high = stats.binomtest(seen, simulations).proportion_ci(0.95, method=interval)
    return Rate(seen / simulations, float(low), float(high))


def lines(
    sections: Mapping[str, Sequence[Check]],
    simulations: int,
    seed_of: Callable[[int, Check], Seed],
    interval: Interval = "exact",
    jobs: int = 1,
) -> Iterator[str]:
    """One a check, under titles, with a mark where it departs from its nominal rate.

    ``seed_of`` takes the number of the check among all, and the check.
    """
    plan = [check for checks in sections.values() for check in checks]
    found = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(rate)(check, simulations, seed_of(number, check), interval)
        for number, check in enumerate(plan)
    )
    for title, checks in sections.items():
        yield f"\n{title}"
        for check in checks:
            own: Rate = next(found)
            line = f"{check.name:70} {own.share:6.2%}  [{own.low:.2%}, {own.high:.2%}]"
            yield f"{line}  {own.mark(check.nominal)}".rstrip()


def arguments(words: str | None, simulations: int, seed: int) -> argparse.Namespace:
    """Those of a command that simulates; exits with a sentence where they are of no use."""
    parser = argparse.ArgumentParser(description=(words or "").split("\n")[0])
    parser.add_argument("--simulations", type=int, default=simulations)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    if given.simulations < 1:
        parser.error("at least one simulation")
    print(f"{given.simulations} simulated data sets each, seed {given.seed}; intervals at 95 %")
    return given
