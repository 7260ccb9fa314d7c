"""Means over tasks: over those that there are, and for others like them.

Over given tasks, every task counts alike, however many runs it has, and runs are resampled within
their task; the interval is about other runs on the same tasks.

A sample of tasks is runs within instances within families. Instances are drawn anew, and so are
runs: a mean over few instances is uncertain by the instances, however many runs each has. Families
are given and count alike. Intervals are of a hierarchical bootstrap (A. C. Davison & D. V. Hinkley
1997, Bootstrap Methods and their Application, section 3.8): instances are drawn with replacement
within their family, then runs within each instance drawn. A mixed model is not used: gaps to an
optimum are skewed and end at 0, methods that draw nothing have no spread over runs, and the spread
of the others differs by a factor of ten between tasks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from coartic import estimates
from coartic.estimates import FEWER_RESAMPLES, Estimate
from coartic.robot import Array

Runs = tuple[Array, ...]
"""Scores of the runs (n,) on an instance; of two methods, whose difference counts: first less
second."""
Scores = Mapping[str, Sequence[Runs]]
"""Scores of the runs on each instance, by family."""


def task_mean(values: Iterable[ArrayLike]) -> Estimate:
    """Mean over given tasks of the mean over runs, with stratified BCa interval."""

    def statistic(*strata: Array, axis: int = -1) -> Array:
        return np.asarray(sum(runs.mean(axis) for runs in strata) / len(strata))

    return estimates.bootstrap_estimate(tuple(map(estimates.vector, values)), statistic)


def value(runs: Runs) -> float:
    """Score of an instance: the mean over its runs, or the difference of two means."""
    return float(runs[0].mean()) - math.fsum(float(other.mean()) for other in runs[1:])


def other_tasks(scores: Scores) -> Estimate:
    """Mean over families of the mean over instances of the mean over runs, for other tasks.

    Parameters
    ----------
    scores : mapping of str to sequence of tuples of arrays
        By family, for each instance the scores of its runs in a tuple of one array ``(runs,)``; of
        two arrays where the difference of two methods counts, first less second.

    Returns
    -------
    Estimate
        ``value``, ``low`` and ``high`` in the unit of the scores; ``n`` instances of each family.

    Raises
    ------
    ValueError
        A family has no instance, or there is no family.

    Examples
    --------
    >>> gaps = [(np.array([0.1, 0.2]),), (np.array([0.3]),), (np.array([0.2, 0.4]),)]
    >>> gap = other_tasks({"field": gaps})
    >>> round(gap.value, 3), gap.n
    (0.25, (3,))

    Notes
    -----
    The percentile interval, wider by √(k / (k − 1)) for the k instances of a family: by so much
    k draws of k fall short of the spread of its mean. It is a little too wide where few runs
    vary much (their noise is in the instances' means already), and ends at what the runs can
    make at all. No interval where a family has fewer than three instances.
    """
    if not scores or not all(scores.values()):
        raise ValueError("a mean over instances needs one instance of each family")
    values = {family: np.array(list(map(value, instances))) for family, instances in scores.items()}
    mean = float(np.mean([instances.mean() for instances in values.values()]))
    n = tuple(map(len, values.values()))
    if min(n) < estimates.FEWEST:
        return Estimate(mean, n=n)
    deviations = np.zeros(FEWER_RESAMPLES)
    for place, (family, instances) in enumerate(scores.items()):
        rng = np.random.default_rng([estimates.SEED, place])
        count = len(instances)
        which = rng.integers(count, size=(FEWER_RESAMPLES, count))
        drawn = values[family][which]
        for number, samples in enumerate(instances):
            chosen = which == number
            for sign, runs in zip((1, -1), samples, strict=False):
                if np.ptp(runs):
                    places = rng.integers(len(runs), size=(int(chosen.sum()), len(runs)))
                    drawn[chosen] += sign * (runs[places].mean(axis=1) - runs.mean())
        wider = math.sqrt(count / (count - 1))
        deviations += (drawn.mean(axis=1) - values[family].mean()) * wider
    if np.abs(deviations).max() <= estimates.NEGLIGIBLE * abs(mean):
        return Estimate(mean, mean, mean, n=n)
    low, high = mean + np.quantile(deviations / len(values), estimates.TAILS)
    families = scores.values()
    least = np.mean([min(-greatest_value(runs, -1) for runs in family) for family in families])
    most = np.mean([max(greatest_value(runs, 1) for runs in family) for family in families])
    return Estimate(mean, max(float(low), float(least)), min(float(high), float(most)), n=n)


def greatest_value(runs: Runs, sign: int) -> float:
    """Greatest value that an instance's runs can make, or (``sign`` -1) that less it can."""
    signs = (sign, -sign)
    return math.fsum(float((s * of_runs).max()) for s, of_runs in zip(signs, runs, strict=False))
