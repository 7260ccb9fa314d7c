"""Running times: the costs at which runs reach targets, after COCO (Hansen et al. 2021).

The ECDF of running times is the share of pairs of run and target reached within a budget.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from coartic.estimates import FEWER_RESAMPLES, FEWEST, IN_CACHE, SEED, TAILS, Estimate, slices
from coartic.robot import Array

_MOST_RUNS_DRAWN = 20_000_000  # in all resamples of a budget: of very many runs there are fewer
RunningTimes = Sequence[Array]
"""Running times of a method: for each task the cost at which each run reaches each target, shape
``(runs, targets)``; infinite for a target that the run does not reach."""


def _pairs(times: RunningTimes) -> tuple[Array, Array, NDArray[np.int32]]:
    """Return the finite running times in ascending order, their weights, and the numbers of their
    runs, counted from 0 through all tasks; shape ``(k,)`` each.

    The weights of all pairs of run and target, also of pairs that are not reached, sum to 1; each
    task has the same weight and needs a run.
    """
    values = np.concatenate([of_task.ravel() for of_task in times])
    order = np.argsort(values, kind="stable")
    order = order[np.isfinite(values[order])]
    weights = [np.full(of_task.size, 1 / of_task.size / len(times)) for of_task in times]
    runs = (order // times[0].shape[1]).astype(np.int32)  # of very many runs
    return values[order], np.concatenate(weights)[order], runs


def share_by_budget(times: RunningTimes) -> tuple[Array, Array]:
    """Return the budgets at which the share of reached targets rises, ``(k,)``, and the share that
    is reached within each of these budgets, ``(k,)``.

    If no target is reached, one infinite budget with a share of 0.
    """
    values, weights, _ = _pairs(times)
    if not len(values):
        return np.array([math.inf]), np.zeros(1)
    last = np.append(values[1:] != values[:-1], True)
    return values[last], np.minimum(np.cumsum(weights)[last], 1.0)  # 1 except for rounding


def share_reached(times: RunningTimes) -> float:
    """Return the share, 0 to 1, of all pairs of run and target that are reached at any cost; each
    task has the same weight."""
    return float(_pairs(times)[1].sum())


def budget_for(times: RunningTimes, share: float) -> Estimate:
    """Return the least budget within which a share (above 0, up to 1) of all pairs of run and
    target is reached, infinite if no budget is enough; each task has the same weight.

    The percentile interval is of the bootstrap over runs within tasks, not widened: budgets can be
    infinite. No interval if a task has fewer than three runs.
    """
    values, weights, runs = _pairs(times)

    def budgets(counts: NDArray[np.uint8]) -> Array:
        reached = np.cumsum(weights * counts[:, runs], axis=1)
        return np.asarray(np.append(values, math.inf)[(reached < share - 1e-9).sum(axis=1)])

    sizes = tuple(map(len, times))
    value = float(budgets(np.ones((1, sum(sizes)), dtype=np.uint8))[0])
    if min(sizes) < FEWEST:
        return Estimate(value)
    drawn, at_once = _draws(sizes), 1 + IN_CACHE // (1 + len(values))
    resampled = [budgets(drawn[part]) for part in slices(len(drawn), at_once)]
    low, high = np.quantile(np.concatenate(resampled), TAILS, method="inverted_cdf")
    return Estimate(value, float(low), float(high))


def interval_by_budget(times: RunningTimes, budgets: Array) -> tuple[Array, Array]:
    """Return low and high ends, ``(budgets,)`` each, of the 95 % interval of the share of reward
    targets reached within each budget, a finite number in the unit of ``times``.

    The percentile interval is of the bootstrap over runs within tasks; NaN if a task has fewer than
    three runs.
    """
    sizes = tuple(map(len, times))
    if min(sizes) < FEWEST:
        return np.full(len(budgets), math.nan), np.full(len(budgets), math.nan)
    weights = np.repeat([1 / size / len(times) for size in sizes], sizes)
    reached = [np.searchsorted(np.sort(run), budgets, "right") / len(run)
               for of_task in times for run in of_task]  # fmt: skip
    drawn, at_once, within = _draws(sizes), 1 + IN_CACHE // len(weights), np.array(reached)
    shares = [(drawn[part] * weights) @ within for part in slices(len(drawn), at_once)]
    low, high = np.quantile(np.concatenate(shares), TAILS, axis=0)
    return low, high


@lru_cache(maxsize=4)  # methods mostly have as many runs as another
def _draws(sizes: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the number of times that each resample draws each run, shape ``(resamples, runs)``,
    for tasks with ``sizes`` runs, in their order: 1,999 resamples, fewer for very many runs, at
    least 200. The array is cached: do not change it."""
    rng = np.random.default_rng(SEED)
    resamples = min(FEWER_RESAMPLES, max(_MOST_RUNS_DRAWN // sum(sizes), 200))
    drawn = np.empty((resamples, sum(sizes)), dtype=np.uint8)
    for size, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True):
        for part in slices(resamples, 100):
            rows = rng.multinomial(size, np.full(size, 1 / size), part.stop - part.start)
            drawn[part, end - size : end] = rows
    return drawn
