"""What a run had spent when its best reward rose, and what it costs to reach targets.

After COCO (Hansen et al. 2021): targets are rewards evenly spaced between those of the initial
solution and of the optimum, and what counts is the share of pairs of run and target that have
been reached. Shares and the budgets that they take are exact, not read off a grid.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic.analysis.methods import in_order, is_search, is_variant
from coartic.analysis.optima import locks_base
from coartic.analysis.statistics.estimates import FEWEST, SEED, TAILS, Estimate, interval
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.topics.comparison.groups import group_of, numbers, solve_times
from coartic.analysis.topics.comparison.scores import ALL_TASKS, gaps, initial_and_optimum
from coartic.robot import Array

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""What can be spent: columns of ``runs``; ``solve_s`` is wall time in s."""


@dataclass(frozen=True)
class BestSoFar:
    """One run as a step function of what it spent.

    A planner is one step, from no solution to its solution, at all that it spent.
    """

    rewards: Array
    """Best reward after each improvement, rising, shape ``(k,)``; empty without a solution."""
    spent: dict[str, Array]
    """Spend at each improvement, by kind, shape ``(k,)`` each."""
    total: dict[str, float]
    """Spend of the whole run; NaN where it is not known, as for the time of cold runs."""
    learns: bool
    """Whether it made trials."""

    @property
    def solved(self) -> bool:
        """Whether it has a solution."""
        return len(self.rewards) > 0

    def placeable(self, spend: str) -> bool:
        """Whether its steps can be placed: a run without a solution has none to place."""
        return not self.solved or bool(np.isfinite(self.total[spend]))

    def best(self, spend: str, budgets: Array) -> Array:
        """Best reward within each budget; -inf where there is no solution yet."""
        steps = np.concatenate([[-np.inf], self.rewards])
        values: Array = steps[np.searchsorted(self.spent[spend], budgets, side="right")]
        return values


@cached
def best_so_far(study: Study) -> dict[str, BestSoFar]:
    """:class:`BestSoFar` of every run of a folder, by run id.

    Trials are counted from 1. Kinematics evaluations and time are known as totals of the run and
    spread evenly over its trials, which is not exact: over the first 10, 100 and 1000 of 10 000
    trials, evaluations were 0.6 to 1.5 times their even share, 3.4 times for the first 10 trials
    of CMA-ES on two-armed 1 (the learner, random search and CMA-ES, six cells, one seed each);
    a learner without its corrective process spends most of them on its first trial. Times
    are those of :func:`coartic.analysis.topics.comparison.groups.solve_times`: without building.
    """
    trials_of = dict(study.rewards())
    by_run = {}
    for cell in study.cells.values():
        runs = cell.runs.assign(solve_s=solve_times(cell.good).reindex(cell.runs.index))
        totals = zip(*(numbers(runs[name]).tolist() for name in SPENDS), strict=True)
        rows = zip(map(str, runs.run_id), totals, runs.status, runs.reward, strict=True)
        for run_id, spent, status, reward in rows:
            total, trials = dict(zip(SPENDS, spent, strict=True)), trials_of.get(run_id)
            if status != "ok":
                none = np.empty(0)
                steps = none, dict.fromkeys(SPENDS, none)
            elif trials is None:
                spent_at_once = {name: np.array([value]) for name, value in total.items()}
                steps = np.array([float(reward)]), spent_at_once
            else:
                steps = improvements(trials, total)
            by_run[run_id] = BestSoFar(*steps, total, learns=trials is not None)
    return by_run


def cells_by_spend(study: Study) -> Iterator[tuple[CellRuns, str, list[BestSoFar]]]:
    """Every cell and spend with the runs whose steps are known.

    Without cells whose parameters lock the base: they solve another problem than the task.
    """
    for cell in study.cells.values():
        if locks_base(cell.runs):
            continue
        runs = [best_so_far(study)[str(run_id)] for run_id in cell.runs.run_id]
        for spend in SPENDS:
            yield cell, spend, [run for run in runs if run.placeable(spend)]


def improvements(rewards: Array, total: dict[str, float]) -> tuple[Array, dict[str, Array]]:
    """Rewards and spends of a run's steps, from the reward of each of its trials, NaN if failed."""
    best = np.maximum.accumulate(np.where(np.isnan(rewards), -np.inf, rewards))
    steps = np.flatnonzero(best > np.concatenate([[-np.inf], best[:-1]]))
    number = (steps + 1).astype(np.float64)
    spent = {name: total[name] * (number / len(rewards)) for name in SPENDS}
    return best[steps], spent | {"trials": number}


WAY = np.arange(1, 21) / 20
"""Targets, as shares of the way from the initial solution to the optimum."""
RESAMPLES = 1_999
COARSE, BLOCKS = 64, 20
"""Parts of a curve, in some of which crossings are looked for; blocks of resamples in memory."""
PRICES = (
    ("trials_to_quarter", "trials", 0.25),
    ("trials_to_half", "trials", 0.5),
    ("kinematics_to_half", "forward_kinematics", 0.5),
    ("seconds_to_half", "solve_s", 0.5),
)
"""Columns of :func:`price`: what is spent to reach which share of the targets."""


class Targets:
    """One method's pairs of run and target over one or several tasks, which count alike."""

    def __init__(self, spends: Sequence[Array]) -> None:
        """``spends``: a task each, what every run had spent at every target, ``(runs, 20)``.

        Infinite where the target is not reached.
        """
        self.sizes = tuple(map(len, spends))
        values = np.concatenate([of_task.ravel() for of_task in spends])
        weights = np.concatenate(
            [np.full(of_task.size, 1 / of_task.size / len(spends)) for of_task in spends]
        )
        order = np.argsort(values, kind="stable")
        self.values, self.weights = values[order], weights[order]
        self.runs = order // len(WAY)
        """Which run each pair is of."""

    def curve(self) -> tuple[Array, Array]:
        """Budgets at which the share rises, and the share from there on."""
        last = np.append(self.values[1:] != self.values[:-1], True)
        reached = last & np.isfinite(self.values)
        return self.values[reached], np.cumsum(self.weights)[reached]

    def share(self) -> float:
        """Share that is reached in the end."""
        return float(self.weights[np.isfinite(self.values)].sum())

    def crossing(self, level: float) -> Estimate:
        """The least budget within which ``level`` of the pairs are reached; infinite without any.

        With its percentile interval: runs are drawn anew within their task, and the tasks stay.
        It is not widened as means over tasks are, as a budget can be infinite. No interval where a
        task has too few runs.
        """
        steps = np.append(self.values, math.inf)
        budget = float(steps[(np.cumsum(self.weights) < level - 1e-9).sum()])
        if min(self.sizes) < FEWEST:
            return Estimate(budget)
        # First between which of some places of the curve resamples cross, then at which pair.
        places = np.unique(np.linspace(0, len(self.values), COARSE + 1).astype(int))
        parts = [
            np.bincount(self.runs[a:b], self.weights[a:b], minlength=sum(self.sizes))
            for a, b in itertools.pairwise(places)
        ]
        reached = np.cumsum([np.zeros(sum(self.sizes)), *parts], axis=0)
        budgets = []
        for counts in np.array_split(resampled_counts(self.sizes), BLOCKS):
            shares = counts @ reached.T
            before = (shares < level - 1e-9).sum(axis=1) - 1
            first, last = before.min(), min(before.max() + 1, len(parts))
            near = slice(places[first], places[last])
            shares = shares[:, [first]] + np.cumsum(
                counts[:, self.runs[near]] * self.weights[near], axis=1
            )
            budgets.append(steps[near.start + (shares < level - 1e-9).sum(axis=1)])
        low, high = np.quantile(np.concatenate(budgets), TAILS, method="inverted_cdf")
        return Estimate(budget, float(low), float(high))


@lru_cache(maxsize=2)
def resampled_counts(sizes: tuple[int, ...]) -> NDArray[np.uint8]:
    """How often each run is in each resample, ``(RESAMPLES, runs)``, tasks by their runs."""
    rng = np.random.default_rng(SEED)
    draws = (rng.multinomial(size, np.full(size, 1 / size), size=RESAMPLES) for size in sizes)
    return np.concatenate([counts.astype(np.uint8) for counts in draws], axis=1)


@cached
def targets(study: Study) -> dict[tuple[str, str, str], Targets]:
    """Pairs of run and target by task, method and spend; over :data:`ALL_TASKS` where some method
    ran on all of several.

    Tasks are those of :func:`~.standings.initial_and_optimum`, methods all but variants and
    searches for the optimum. A run whose steps are not known, such as the time of a cold one,
    has no part.
    """
    scale = initial_and_optimum(study)
    spends: dict[tuple[str, str, str], Array] = {}
    for cell, spend, runs in cells_by_spend(study):
        if cell.task in scale and runs and not is_variant(cell.label) | is_search(cell.label):
            spends[cell.task, cell.label, spend] = spent_at(runs, spend, *scale[cell.task])
    over_all = {}
    rows = gaps(study).drop_duplicates(["method", "task"])
    for method, cells in rows.groupby("method", sort=False):
        for spend in SPENDS:
            keys = [(*cell, spend) for cell in zip(cells.task, cells.label, strict=True)]
            if 1 < len(scale) == len(keys) and spends.keys() >= set(keys):
                over_all[ALL_TASKS, str(method), spend] = Targets([spends[key] for key in keys])
    return over_all or {key: Targets([spent]) for key, spent in spends.items()}


def spent_at(runs: Sequence[BestSoFar], spend: str, start: float, best: float) -> Array:
    """What each run had spent when it reached each target, ``(runs, 20)``."""
    wanted = np.ceil(start + WAY * (best - start) - 1e-9)
    rows = [
        np.append(run.spent[spend], math.inf)[np.searchsorted(run.rewards, wanted)] for run in runs
    ]
    return np.array(rows)


def halfway(study: Study, method: str) -> dict[str, float]:
    """Trials to the target halfway from the initial solution to the optimum, by task.

    Medians over runs, infinite where most runs never reach it. ``method``: a label, or the
    learner's conditions together.
    """
    scale = initial_and_optimum(study)
    rows = gaps(study).drop_duplicates(["method", "task"])
    medians = {}
    for row in rows[rows.method == method].itertuples():
        ids = study.cells[str(row.task), str(row.label)].runs.run_id
        runs = [best_so_far(study)[str(run_id)] for run_id in ids]
        spent = spent_at(runs, "trials", *scale[str(row.task)])[:, list(WAY).index(0.5)]
        medians[str(row.task)] = float(np.quantile(spent, 0.5, method="inverted_cdf"))
    return {name: medians[name] for name in scale if name in medians}


@cached
def price(study: Study) -> pd.DataFrame:
    """What it costs each method to reach a quarter and half of the targets, over all tasks.

    The index is the label; over the first task where there is one only. ``task``; ``knows``: its
    group; ``reached``: share of targets in the end; the columns of :data:`PRICES` with their
    intervals (``_low``, ``_high``), infinite where it is not reached.
    """
    by_method = targets(study)
    over = next(iter(by_method), ("",))[0]
    labels = in_order(list(dict.fromkeys(name for task, name, _ in by_method if task == over)))
    rows = {}
    for label in labels:
        if (over, label, "trials") in by_method:
            row: dict[str, object] = {"task": over, "knows": group_of(study, label)}
            row["reached"] = by_method[over, label, "trials"].share()
            for name, spend, level in PRICES:
                if (over, label, spend) in by_method:
                    row |= interval(name, by_method[over, label, spend].crossing(level))
            rows[label] = row
    columns = [f"{name}{end}" for name, *_ in PRICES for end in ("", "_low", "_high")]
    frame = pd.DataFrame.from_dict(rows, orient="index")
    return frame.reindex(columns=["task", "knows", "reached", *columns])
