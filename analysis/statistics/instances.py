"""Means over tasks, with intervals for other runs on the same tasks or for other tasks.

For other runs on the same tasks, all tasks have the same weight, whatever their number of runs, and
the bootstrap resamples runs within tasks.

For other tasks, the sample has runs within instances within families. The bootstrap is hierarchical
(A. C. Davison & D. V. Hinkley 1997, Bootstrap Methods and their Application, section 3.8): it
resamples instances within families, then runs within instances. Families are fixed and have the
same weight. A mixed model does not fit: gaps to an optimum are skewed and bounded by 0, and their
spread over runs differs between methods and tasks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from coartic import estimates
from coartic.estimates import FEWER_RESAMPLES, Estimate
from coartic.internal.arguments import Numbers, checked_arguments

Scores = Mapping[str, Sequence[Numbers]]
"""Scores of the runs on each instance, shape ``(n,)``, by family."""


def task_mean(values: Iterable[ArrayLike]) -> Estimate:
    """Return the mean over tasks of the mean over runs, with the interval of
    :func:`.mean_of_means`, for ``values`` of shape ``(runs,)`` on each task. Raises ValueError
    without tasks, and for a task without runs."""
    strata = [*map(estimates.vector, values)]
    return estimates.mean_of_means(strata, [1 / len(strata) for _ in strata])


@checked_arguments
def other_tasks(scores: Scores) -> Estimate:
    """Return the mean over families, instances and runs, with its interval for other tasks.

    Parameters
    ----------
    scores : mapping of str to sequence of arrays, shape (runs,)
        For each family, the scores of the runs on each instance.

    Returns
    -------
    Estimate
        ``value``, ``low`` and ``high`` in the unit of the scores; ``n`` instances of each family.

    Raises
    ------
    ValueError
        There is no family, a family has no instance, or an instance no run.

    Examples
    --------
    >>> gaps = [np.array([0.1, 0.2]), np.array([0.3]), np.array([0.2, 0.4])]
    >>> gap = other_tasks({"field": gaps})
    >>> round(gap.value, 3), gap.n
    (0.25, (3,))

    Notes
    -----
    A percentile interval, widened by √(k / (k − 1)) for the k instances of a family, because the
    bootstrap underestimates the spread of a mean by this factor. The interval is a little too wide
    for few runs with much noise, which the means of instances contain already, and does not exceed
    the means over families of the least and of the greatest score of a run. No interval (NaN) if a
    family has fewer than three instances.
    """
    if not scores or not all(scores.values()):
        raise ValueError("a mean over instances needs one instance of each family")
    samples = {family: [*map(estimates.vector, instances)] for family, instances in scores.items()}
    values = {
        family: np.array([runs.mean() for runs in instances])
        for family, instances in samples.items()
    }
    mean = float(np.mean([instances.mean() for instances in values.values()]))
    n = tuple(map(len, values.values()))
    if min(n) < estimates.FEWEST:
        return Estimate(mean, n=n)
    deviations = np.zeros(FEWER_RESAMPLES)
    for place, (family, instances) in enumerate(samples.items()):
        rng = np.random.default_rng([estimates.SEED, place])
        count = len(instances)
        which = rng.integers(count, size=(FEWER_RESAMPLES, count))
        drawn = values[family][which]
        for number, runs in enumerate(instances):
            chosen = which == number
            if np.ptp(runs):
                places = rng.integers(len(runs), size=(int(chosen.sum()), len(runs)))
                drawn[chosen] += runs[places].mean(axis=1) - runs.mean()
        wider = math.sqrt(count / (count - 1))
        deviations += (drawn.mean(axis=1) - values[family].mean()) * wider
    if np.abs(deviations).max() <= estimates.NEGLIGIBLE * abs(mean):
        return Estimate(mean, mean, mean, n=n)
    low, high = mean + np.quantile(deviations / len(values), estimates.TAILS)
    families = samples.values()
    least = np.mean([min(runs.min() for runs in family) for family in families])
    most = np.mean([max(runs.max() for runs in family) for family in families])
    return Estimate(mean, max(float(low), float(least)), min(float(high), float(most)), n=n)
