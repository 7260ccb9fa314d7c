"""What it costs to reach targets on the way from the initial solution to the optimum.

After COCO (Hansen et al. 2021): targets are rewards evenly spaced between those of the initial
solution and of the optimum, and what counts is the share of pairs of run and target that have
been reached. Shares and the budgets that they take are exact, not read off a grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.progress import SPENDS, BestSoFar, cells_by_spend
from coartic.analysis.comparisons.standings import ALL_TASKS, ends, gaps
from coartic.analysis.methods import is_search, is_variant
from coartic.analysis.statistics.estimates import FEWEST, SEED, TAILS
from coartic.analysis.study import Study, cached
from coartic.robot import Array

WAY = np.arange(1, 21) / 20
"""Targets, as shares of the way from the initial solution to the optimum."""
_RESAMPLES = 1_999
_FIGURES_AT_ONCE = 1_000_000  # weights of pairs in memory


class Crossing(NamedTuple):
    """The budget within which a method reaches a share of its pairs of run and target."""

    budget: float
    """Infinite where it never does."""
    low: float
    """Of the 95 % percentile interval over runs; NaN where runs are too few."""
    high: float


class Targets:
    """One method's pairs of run and target over one or several tasks, which count alike."""

    def __init__(self, spends: Sequence[Array]) -> None:
        """``spends``: a task each, what every run had spent at every target, ``(runs, 20)``.

        Infinite where the target is not reached.
        """
        self.runs = sum(map(len, spends))
        weights = [np.full(own.shape, 1 / own.size / len(spends)) for own in spends]
        values = np.concatenate([own.ravel() for own in spends])
        self._order = np.argsort(values, kind="stable")
        self._values = values[self._order]
        self._weights = np.concatenate([own.ravel() for own in weights])
        self._sizes = tuple(map(len, spends))

    def curve(self) -> tuple[Array, Array]:
        """Budgets at which the share rises, and the share from there on."""
        last = np.append(self._values[1:] != self._values[:-1], True)
        reached = last & np.isfinite(self._values)
        return self._values[reached], np.cumsum(self._weights[self._order])[reached]

    def share(self) -> float:
        """Share that is reached in the end."""
        return float(self._weights[self._order][np.isfinite(self._values)].sum())

    def crossing(self, level: float) -> Crossing:
        """The least budget within which ``level`` of the pairs are reached."""
        budget = self._least(self._weights[None], level)[0]
        if min(self._sizes) < FEWEST:
            return Crossing(budget, math.nan, math.nan)
        budgets = np.concatenate([self._least(weights, level) for weights in self._resampled()])
        low, high = np.quantile(budgets, TAILS, method="inverted_cdf")
        return Crossing(budget, float(low), float(high))

    def _resampled(self) -> Iterator[Array]:
        """Weights of the pairs with runs drawn anew within their task, ``(resamples, pairs)``, some
        resamples at a time: of thousands of runs all would fill the memory."""
        rng = np.random.default_rng(SEED)
        drawn = [
            rng.multinomial(size, np.full(size, 1 / size), size=_RESAMPLES).astype(np.int32)
            for size in self._sizes
        ]
        at_once = max(1, _FIGURES_AT_ONCE // len(self._weights))
        for first in range(0, _RESAMPLES, at_once):
            counts = np.concatenate([own[first : first + at_once] for own in drawn], axis=1)
            yield np.repeat(counts, len(WAY), axis=1) * self._weights

    def _least(self, weights: Array, level: float) -> Array:
        """For each row of weights, the least value at which their sum reaches the level."""
        shares = np.cumsum(weights[:, self._order], axis=1)
        place = (shares < level - 1e-9).sum(axis=1)
        found: Array = np.append(self._values, math.inf)[place]
        return found


@cached
def targets(study: Study) -> dict[tuple[str, str, str], Targets]:
    """Pairs of run and target by task (or :data:`ALL_TASKS`), method and spend.

    Of the tasks of :func:`~.standings.ends`, and of all methods but variants and searches for
    the optimum. A run whose steps are not known, such as the time of a cold one, has no part.
    """
    scale = ends(study)
    spends: dict[tuple[str, str, str], Array] = {}
    for cell, spend, runs in cells_by_spend(study):
        if cell.task in scale and runs and not is_variant(cell.label) | is_search(cell.label):
            spends[cell.task, cell.label, spend] = _spends(runs, spend, *scale[cell.task])
    found = {}
    for (method, labels), spend in ((m, s) for m in _everywhere(study).items() for s in SPENDS):
        keys = [(task, label, spend) for task, label in labels.items()]
        if len(scale) > 1 and all(key in spends for key in keys):
            found[ALL_TASKS, method, spend] = Targets([spends[key] for key in keys])
    return found | {key: Targets([own]) for key, own in spends.items()}


def _spends(runs: Sequence[BestSoFar], spend: str, start: float, best: float) -> Array:
    """What each run had spent when it reached each target, ``(runs, 20)``."""
    wanted = np.ceil(start + WAY * (best - start) - 1e-9)
    rows = [
        np.append(run.spent[spend], math.inf)[np.searchsorted(run.rewards, wanted)] for run in runs
    ]
    return np.array(rows)


def _everywhere(study: Study) -> Mapping[str, dict[str, str]]:
    """Methods that ran on all tasks: their labels by task."""
    found: dict[str, dict[str, str]] = {}
    rows: pd.DataFrame = gaps(study).drop_duplicates(["method", "task"])
    for method, own in rows.groupby("method", sort=False):
        if len(own) == len(ends(study)) and not is_variant(str(method)):
            found[str(method)] = dict(zip(map(str, own.task), map(str, own.label), strict=True))
    return found
