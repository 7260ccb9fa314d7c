"""Whether two means agree within a margin: by inclusion of their interval.

A 95 % interval within ±margin is two one-sided tests at level 2.5 % (TOST; D. J.
Schuirmann 1987, Journal of Pharmacokinetics and Biopharmaceutics 15). Against the paper,
of which only mean, SD and number of runs are printed, the interval is Welch's; where the
runs of both sides are at hand, it is the studentised bootstrap's. Of shares of runs it is
that of R. G. Newcombe (1998), Statistics in Medicine 17, 873.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from coartic.analysis.statistics.estimates import (
    CONFIDENCE,
    FEWEST,
    NO_SPREAD,
    RESAMPLES,
    SEED,
    Inference,
    sample,
    samples_of,
)
from coartic.analysis.statistics.hypotheses import standard_error, studentised_null
from coartic.analysis.statistics.intervals import student, wilson
from coartic.analysis.statistics.spread import mean, variance

MARGIN = 0.01
"""Differences up to this share of the published reward count as equivalent."""


@dataclass(frozen=True, kw_only=True)
class Equivalence(Inference):
    """A difference of means with its interval, beside a margin.

    ``p`` is of the hypothesis that the means differ by the margin or more: the larger p of
    the two one-sided tests.
    """

    margin: float

    @property
    def verdict(self) -> Literal["equivalent", "different", "undecided"]:
        """Equivalent where the interval lies within the margin, different where it
        lies outside, undecided where it does neither."""
        if -self.margin <= self.low and self.high <= self.margin:
            return "equivalent"
        if self.low > self.margin or self.high < -self.margin:
            return "different"
        return "undecided"


def difference(
    ours: ArrayLike, published: float, sd: float | None, runs: int, *, margin: float | None = None
) -> Equivalence:
    """Our mean less the published one, with Welch's interval from its SD and number of runs.

    Where no SD is printed (None) the published mean is taken as exact, and the interval is
    Student's. The margin is :data:`MARGIN` of the published mean unless given. With fewer
    than two runs of our own there is no interval; without spread on either side it is a
    point.
    """
    values = sample(ours)
    value = float(mean(values)) - published
    margin = MARGIN * abs(published) if margin is None else _positive(margin)
    theirs = [(sd**2, runs)] if sd is not None and runs > 1 else []
    found = Equivalence(
        estimate=value,
        n=(len(values), *(runs for _, runs in theirs)),
        method="difference to the published mean, "
        + ("Welch's interval" if theirs else "Student's interval, published mean as exact"),
        margin=margin,
    )
    if len(values) < 2:
        return replace(found, note="no interval: fewer than 2 values")
    parts = [(v / n, n - 1) for v, n in [(float(variance(values)), len(values)), *theirs]]
    total = sum(part for part, _ in parts)
    if total == 0.0:
        return replace(found, low=value, high=value, note=NO_SPREAD)
    freedom = total**2 / sum(part**2 / free for part, free in parts)
    error = math.sqrt(total)
    _, low, high, _ = student(value, error, freedom)
    p = float(special.stdtr(freedom, (abs(value) - margin) / error))
    return replace(found, low=low, high=high, p=p)


def bootstrap_equivalence(
    first: ArrayLike,
    second: ArrayLike | float,
    margin: float,
    *,
    seed: int = SEED,
    resamples: int = RESAMPLES,
) -> Equivalence:
    """Mean of ``first`` less mean of ``second`` with its studentised bootstrap interval.

    Independent samples, or one against a number taken as known. The bootstrap-t interval of
    Efron & Tibshirani (1993, section 12.5), whose ends are order statistics, so that it lies
    within the margin just where ``p`` is below 2.5 %. Fewer than three values in a sample: no
    interval. No spread in any: a point.
    """
    samples, margin = samples_of(first, second), _positive(margin)
    means = [float(mean(values)) for values in samples]
    value = means[0] - sum(means[1:])
    found = Equivalence(
        estimate=value,
        n=tuple(map(len, samples)),
        method=f"difference of means, studentised bootstrap, {resamples} resamples",
        margin=margin,
    )
    if min(found.n) < FEWEST:
        return replace(found, note=f"no interval: a sample has fewer than {FEWEST} values")
    error = standard_error(samples)
    if error == 0.0:
        return replace(found, low=value, high=value, note=NO_SPREAD)
    null = np.sort(studentised_null(samples, resamples, np.random.default_rng(seed)))
    outside = int((resamples + 1) * (1 - CONFIDENCE) / 2 + 1e-9)
    if outside < 1:
        raise ValueError(f"{resamples} resamples are too few for an interval of {CONFIDENCE}")
    above = 1 + int((null >= (value + margin) / error).sum())
    below = 1 + int((null <= (value - margin) / error).sum())
    return replace(
        found,
        low=value - float(null[-outside]) * error,
        high=value - float(null[outside - 1]) * error,
        p=max(above, below) / (resamples + 1),
        seed=seed,
    )


def shares(first: tuple[int, int], second: tuple[int, int], margin: float) -> Equivalence:
    """Share of ``first`` less that of ``second``, each a count and the runs it is out of.

    Newcombe's interval (:func:`difference_of_shares`). ``p`` is half the error rate at which
    the interval just touches the margin, 1 where the shares themselves differ by the margin or
    more.
    """
    margin, found = _positive(margin), difference_of_shares(first, second)

    def room(z: float) -> float:
        """What the interval of ± z standard errors leaves of the margin."""
        at = difference_of_shares(first, second, confidence=2 * float(special.ndtr(z)) - 1)
        return margin - max(-at.low, at.high)

    touching, widest = -math.inf, 8.0
    if room(0.0) > 0:
        touching = widest if room(widest) >= 0 else float(optimize.brentq(room, 0.0, widest))
    given = {**vars(found), "p": float(special.ndtr(-touching))}
    return Equivalence(**given, margin=margin)


def difference_of_shares(
    first: tuple[int, int], second: tuple[int, int], *, confidence: float = CONFIDENCE
) -> Inference:
    """Share of ``first`` less that of ``second``, each a count and the runs it is out of.

    Newcombe's hybrid of two Wilson intervals (1998, method 10), from −1 to 1. Raises ValueError
    for a count that is not from 0 to a positive number of runs.
    """
    for count, total in (first, second):
        if not 0 <= count <= total or not total:
            raise ValueError(f"{count} of {total} runs is no share")
    a, b = (wilson(*of, confidence) for of in (first, second))
    apart = a.value - b.value
    return Inference(
        apart,
        (first[1], second[1]),
        "difference of shares, score interval (Newcombe 1998, method 10)",
        apart - math.hypot(a.value - a.low, b.high - b.value),
        apart + math.hypot(a.high - a.value, b.value - b.low),
    )


def _positive(margin: float) -> float:
    if not margin > 0:
        raise ValueError(f"margin {margin}: it must be positive")
    return margin
