"""Simulated data sets, each asked yes or no: how often yes, beside how often it should be."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from joblib import Parallel, delayed
from scipy import stats

from coartic.analysis.statistics.estimates import CONFIDENCE
from coartic.analysis.statistics.intervals import Interval
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


Seed = int | Sequence[int]
Method = Literal["wilson", "exact"]


def rate(check: Check, simulations: int, seed: Seed, method: Method = "exact") -> Interval:
    """How often a check sees something in so many data sets; the same seed, the same rate."""
    rng = np.random.default_rng(seed)
    seen = sum(bool(check.seen(rng)) for _ in range(simulations))
    low, high = stats.binomtest(seen, simulations).proportion_ci(CONFIDENCE, method=method)
    return Interval(seen / simulations, float(low), float(high))


def lines(
    sections: Mapping[str, Sequence[Check]],
    simulations: int,
    seed_of: Callable[[int, Check], Seed],
    method: Method = "exact",
    jobs: int = 1,
) -> Iterator[str]:
    """One a check, under titles, with a mark where it departs from its nominal rate.

    ``seed_of`` takes the number of the check among all, and the check.
    """
    plan = [check for checks in sections.values() for check in checks]
    found = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(rate)(check, simulations, seed_of(number, check), method)
        for number, check in enumerate(plan)
    )
    for title, checks in sections.items():
        yield f"\n{title}"
        for check in checks:
            own: Interval = next(found)
            line = f"{check.name:70} {own.value:6.2%}  [{own.low:.2%}, {own.high:.2%}]"
            due = own.value if check.nominal is None else check.nominal
            mark = "ABOVE" if own.low > due else "BELOW" if own.high < due else ""
            yield f"{line}  {mark}".rstrip()


def simulate(
    words: str | None,
    sections: Mapping[str, Sequence[Check]],
    simulations: int,
    seed: int,
    seed_of: Callable[[int, int, Check], Seed],
    method: Method = "exact",
) -> argparse.Namespace:
    """A command that prints :func:`lines`; ``seed_of`` takes the seed asked for before the rest.

    ``words``, of which the first line is shown, say what it does; ``simulations`` and ``seed``
    are what it does unless asked otherwise. Exits with a sentence where that is of no use.
    """
    parser = argparse.ArgumentParser(description=(words or "").split("\n")[0])
    parser.add_argument("--simulations", type=int, default=simulations)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    if given.simulations < 1:
        parser.error("at least one simulation")
    print(f"{given.simulations} simulated data sets each, seed {given.seed}; intervals at 95 %")
    rule = partial(seed_of, given.seed)
    for line in lines(sections, given.simulations, rule, method, given.jobs):
        print(line, flush=True)
    return given
