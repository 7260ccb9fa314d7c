"""What scores on a sample of tasks say of other tasks: intervals, variance shares, power.

A sample is runs within instances within families. Instances are drawn anew, and so are runs: a
mean over few instances is uncertain by the instances, however many runs each has. Families are
given, not sampled, and count alike.

Intervals are of a hierarchical bootstrap (A. C. Davison & D. V. Hinkley 1997, Bootstrap Methods
and their Application, section 3.8): instances are drawn with replacement within their family,
then runs within each instance drawn. A mixed model is not used: gaps to an optimum are skewed and
end at 0, methods that draw nothing have no spread over runs, and the spread of the others differs
by a factor of ten between tasks, where a mixed model has one residual for all. Shares of variance
are of the analysis of variance (S. R. Searle, G. Casella & C. E. McCulloch 1992, Variance
Components, chapter 4: expected mean squares), which needs no distribution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from coartic.analysis.statistics import spread
from coartic.analysis.statistics.estimates import FEWEST, LEVEL, NO_SPREAD, SEED, TAILS, Inference
from coartic.analysis.statistics.power import POWER
from coartic.robot import Array

RESAMPLES = 1_999
"""Of both levels, for an interval of one number."""
Runs = tuple[Array, ...]
"""Scores of the runs (n,) on an instance; of two methods, whose difference counts: first less
second."""
Scores = Mapping[str, Sequence[Runs]]
"""By family, of each of its instances."""
_METHOD = f"mean over instances, families alike; hierarchical bootstrap, {RESAMPLES} resamples"


def value(runs: Runs) -> float:
    """Of an instance: the mean over runs, or the difference of two."""
    return float(spread.difference(*runs))


def other_tasks(scores: Scores, *, seed: int = SEED) -> Inference:
    """Mean over families of the mean over instances of the mean over runs, for other tasks.

    The percentile interval, wider by √(k / (k − 1)) for the k instances of a family: by so much
    k draws of k fall short of the spread of its mean. It is a little too wide where few runs
    vary much (their noise is in the instances' means already). No interval where a family has
    fewer than three instances. Raises ValueError without any.
    """
    values = {family: np.array([value(runs) for runs in own]) for family, own in scores.items()}
    if not values or not all(len(own) for own in values.values()):
        raise ValueError("a mean over instances needs one instance of each family")
    estimate = math.fsum(float(spread.mean(own)) for own in values.values()) / len(values)
    n = tuple(map(len, values.values()))
    if min(n) < FEWEST:
        note = f"no interval: a family has fewer than {FEWEST} instances"
        return Inference(estimate, n, _METHOD, note=note)
    drawn = np.zeros(RESAMPLES)
    for place, (family, own) in enumerate(scores.items()):
        drawn += _deviations(own, values[family], np.random.default_rng([seed, place]))
    if not np.ptp(drawn):
        return Inference(estimate, n, _METHOD, estimate, estimate, note=NO_SPREAD)
    low, high = estimate + np.quantile(drawn / len(values), TAILS)
    least, most = (
        math.fsum(f(_extreme(runs, f) for runs in own) for own in scores.values()) / len(values)
        for f in (min, max)
    )
    low, high = max(float(low), least), min(float(high), most)
    return Inference(estimate, n, _METHOD, low, high, seed=seed)


def _extreme(runs: Runs, of: Callable[..., float]) -> float:
    """Least or greatest of the values that an instance's runs can make, which no mean exceeds."""
    if len(runs) == 1:
        return float(of(runs[0]))
    other = max if of is min else min
    return float(of(runs[0])) - float(other(runs[1]))


def _deviations(own: Sequence[Runs], values: Array, rng: np.random.Generator) -> Array:
    """Of resampled means of one family from its mean, shape ``(RESAMPLES,)``."""
    count = len(own)
    which = rng.integers(count, size=(RESAMPLES, count))
    drawn = values[which]
    for number, samples in enumerate(own):
        chosen = which == number
        for sign, runs in zip((1, -1), samples, strict=False):
            if np.ptp(runs):
                places = rng.integers(len(runs), size=(int(chosen.sum()), len(runs)))
                drawn[chosen] += sign * (runs[places].mean(axis=1) - spread.mean(runs))
    return np.asarray((drawn.mean(axis=1) - spread.mean(values)) * math.sqrt(count / (count - 1)))


@dataclass(frozen=True)
class Components:
    """Where the variance of scores comes from, in their unit squared; at least 0."""

    method: float
    """Of the methods' means over all instances."""
    instance: float
    """Of the instances' means over all methods: how hard they are."""
    interaction: float
    """Of what a method does on an instance beyond both: which method suits which task."""
    seed: float
    """Of the runs of a method on an instance, mean over all of them."""

    @property
    def total(self) -> float:
        """Of a run of a random one of the methods on a random instance."""
        return self.method + self.instance + self.interaction + self.seed

    def shares(self) -> dict[str, float]:
        """Of the total, by source; NaN where nothing varies."""
        total = self.total or math.nan
        return {name: value / total for name, value in vars(self).items()}


def components(scores: Mapping[str, Sequence[Array]]) -> Components:
    """Variance components of the scores of the runs (n,) by method and instance.

    Every method has the same instances in the same order, at least two, and at least two methods
    there are; runs may differ in number. A method that draws nothing has one run without error.
    By expected mean squares, those below 0 taken for 0. Raises ValueError for fewer.
    """
    rows = list(scores.values())
    if len(rows) < 2 or len({len(row) for row in rows}) > 1 or len(rows[0]) < 2:
        raise ValueError("components need two methods on the same instances, two at least")
    means = np.array([[float(spread.mean(runs)) for runs in row] for row in rows])
    within = np.array([[_variance(runs) for runs in row] for row in rows])
    runs = np.array([[len(own) for own in row] for row in rows])
    methods, instances = means.shape
    of_method = means.mean(axis=1, keepdims=True)
    of_instance = means.mean(axis=0, keepdims=True)
    both = ((means - of_method - of_instance + means.mean()) ** 2).sum()
    both /= (methods - 1) * (instances - 1)
    by_method = instances * float(spread.variance(of_method.ravel()))
    by_instance = methods * float(spread.variance(of_instance.ravel()))
    noise = float((within / runs).mean())
    return Components(
        method=max(0.0, by_method - both) / instances,
        instance=max(0.0, by_instance - both) / methods,
        interaction=max(0.0, float(both) - noise),
        seed=float(within.mean()),
    )


def _variance(runs: Array) -> float:
    return float(spread.variance(runs)) if len(runs) > 1 else 0.0


@dataclass(frozen=True)
class Paired:
    """The difference of two methods over instances: its mean, and how it varies."""

    mean: float
    between: float
    """Variance of the true difference over instances, at least 0."""
    within: tuple[float, float]
    """Variance of a run of each of the two."""

    def variance(self, runs: int) -> float:
        """Of the difference that one instance shows with so many runs of each."""
        return self.between + sum(self.within) / runs

    def needed(self, difference: float, runs: int, level: float = LEVEL) -> int:
        """Instances, three at least, with which a true mean difference is found.

        With a power of :data:`~coartic.analysis.statistics.power.POWER` by a two-tailed t-test of
        the paired differences at ``level``. Raises ValueError for a difference of 0.
        """
        if difference == 0:
            raise ValueError("no number of instances finds a difference of 0")
        sd, count = math.sqrt(self.variance(runs)), FEWEST
        while chance(difference, sd, count, level) < POWER:
            count = max(count + 1, round(1.02 * count))
        return count


def paired(first: Sequence[Array], second: Sequence[Array]) -> Paired:
    """Of the scores of the runs (n,) of two methods on the same instances, two at least."""
    pairs = list(zip(first, second, strict=True))
    differences = np.array([float(spread.mean(a)) - float(spread.mean(b)) for a, b in pairs])
    within = np.array([[_variance(a), _variance(b)] for a, b in pairs])
    noise = np.array([[_variance(a) / len(a), _variance(b) / len(b)] for a, b in pairs])
    between = float(spread.variance(differences)) - float(noise.sum(axis=1).mean())
    of_runs = within.mean(axis=0)
    return Paired(
        float(spread.mean(differences)),
        max(0.0, between),
        (float(of_runs[0]), float(of_runs[1])),
    )


def chance(difference: float, sd: float, count: int, level: float, *, tails: int = 2) -> float:
    """P(a t-test of ``count`` instances finds a true mean difference with this SD over them)."""
    if sd == 0:
        return float(difference != 0)
    shift = abs(difference) * math.sqrt(count) / sd
    bound = stats.t.isf(level / tails, count - 1)
    found = float(stats.nct.sf(bound, count - 1, shift))
    return 1.0 if math.isnan(found) and shift > bound else found
