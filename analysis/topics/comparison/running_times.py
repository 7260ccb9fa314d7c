"""Running times: what runs have spent when they reach reward targets.

After COCO (Hansen et al. 2021): targets are rewards evenly spaced between those of the initial
solution and of the optimum. The ECDF of running times is the share of pairs of run and target that
are reached within a budget. It is exact, not read off a grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.analysis.optima import locks_base
from coartic.analysis.statistics.estimates import FEWEST, SEED, TAILS, Estimate
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.topics.comparison import scores
from coartic.robot import Array

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""What can be spent: columns of ``runs``; ``solve_s`` is wall time in s."""
TARGETS = np.arange(1, 21) / 20
"""Targets, as shares of the way from the initial solution to the optimum."""
BUDGET_RESAMPLES = 1_999
_MOST_DRAWN = 20_000_000  # runs in all resamples of a budget: of very many runs there are fewer
_FEWEST_RESAMPLES = 200
RunningTimes = Sequence[Array]
"""Running times of one method: for each task, which count alike, what every run had spent at every
target, shape ``(runs, 20)``; infinite where the target is not reached."""


@dataclass(frozen=True, slots=True)
class BestSoFar:
    """One run as a step function of what it spent.

    A planner is one step, from no solution to its solution, at all that it spent.
    """

    rewards: Array
    """Best reward after each improvement, rising, shape ``(k,)``; empty without a solution."""
    trials: Array
    """Number of the trial of each improvement, from 1, shape ``(k,)``."""
    made: int
    """Trials made; a planner's step counts as one."""
    total: dict[str, float]
    """Spend of the whole run; NaN where it is not known, as for the time of cold runs."""
    learns: bool
    """Whether it made trials."""

    def spent(self, spend: str) -> Array:
        """Spend at each improvement, shape ``(k,)``."""
        if self.learns and spend == "trials":
            return self.trials
        return self.total[spend] * (self.trials / self.made)

    @property
    def solved(self) -> bool:
        """Whether it has a solution."""
        return len(self.rewards) > 0

    def best(self, spend: str, budgets: Array) -> Array:
        """Best reward within each budget; -inf where there is no solution yet."""
        steps = np.concatenate([[-np.inf], self.rewards])
        values: Array = steps[np.searchsorted(self.spent(spend), budgets, side="right")]
        return values

    def times(self, spend: str, targets: Array) -> Array:
        """Spend at which each target is reached; infinite where it never is."""
        values: Array = np.append(self.spent(spend), math.inf)
        return values[np.searchsorted(self.rewards, targets)]


@cached
def best_so_far(study: Study) -> dict[str, BestSoFar]:
    """:class:`BestSoFar` of every run of a folder, by run id.

    Trials are counted from 1. Kinematics evaluations and time are known as totals of the run and
    spread evenly over its trials, which is not exact: over the first 10, 100 and 1000 of 10 000
    trials, evaluations were 0.6 to 1.5 times their even share, 3.4 times for the first 10 trials
    of CMA-ES on two-armed 1 (the learner, hill climbing and CMA-ES, six cells, one seed each);
    a learner without its corrective process spends most of them on its first trial. Times
    are those of :func:`.scores.solve_times`: without building.
    """
    learned = {run_id: improvements(rewards) for run_id, rewards in study.rewards()}
    by_run = {}
    for cell in study.cells.values():
        times = scores.solve_times(cell.good).reindex(cell.runs.index)
        runs = cell.runs.assign(solve_s=times)
        totals = zip(*(scores.floats(runs[name]).tolist() for name in SPENDS), strict=True)
        rows = zip(map(str, runs.run_id), totals, runs.status, runs.reward, strict=True)
        for run_id, spent, status, reward in rows:
            total = dict(zip(SPENDS, spent, strict=True))
            if status != "ok":
                steps = np.empty(0), np.empty(0), 1
            else:
                steps = learned.get(run_id, (np.array([float(reward)]), np.ones(1), 1))
            by_run[run_id] = BestSoFar(*steps, total, learns=run_id in learned)
    return by_run


def improvements(rewards: Array) -> tuple[Array, Array, int]:
    """Rewards and trials of a run's steps and the number of trials, from the reward of each of
    them, NaN if failed."""
    best = np.maximum.accumulate(np.where(np.isnan(rewards), -np.inf, rewards))
    steps = np.flatnonzero(best > np.concatenate([[-np.inf], best[:-1]]))
    return best[steps], (steps + 1).astype(np.float64), len(rewards)


def steps_of(study: Study, cell: CellRuns) -> list[BestSoFar]:
    """:class:`BestSoFar` of every run of a cell."""
    return [best_so_far(study)[str(run_id)] for run_id in cell.runs.run_id]


@cached
def cells_compared(study: Study) -> dict[str, list[CellRuns]]:
    """Cells of each method whose running times are compared, on tasks with a known optimum.

    Over all of these tasks; where no method ran on all of several, on the first. Without variants,
    searches for the optimum, and cells that lock the base, which solve another problem.
    """
    tasks = scores.initial_and_optimum(study)
    eligible = {
        key: cell
        for key, cell in study.cells.items()
        if key[0] in tasks and scores.is_compared(study, cell.label) and not locks_base(cell.runs)
    }
    over_all = {
        method: [eligible[key] for key in labels.items()]
        for method, labels in scores.labels_by_task(study).items()
        if 1 < len(tasks) == len(labels) and eligible.keys() >= labels.items()
    }
    first = next(iter(eligible), ("",))[0]
    return over_all or {key[1]: [cell] for key, cell in eligible.items() if key[0] == first}


@cached
def running_times(study: Study) -> dict[tuple[str, str], RunningTimes]:
    """Running times by method and spend, of :func:`cells_compared`.

    A run whose spend is not known, such as the time of a cold one, has no part.
    """
    by_method: dict[tuple[str, str], RunningTimes] = {}
    for method, cells in cells_compared(study).items():
        for spend in SPENDS:
            times = [times_of(study, cell, spend) for cell in cells]
            if all(map(len, times)):
                by_method[method, spend] = times
    return by_method


def times_of(study: Study, cell: CellRuns, spend: str, shares: Array = TARGETS) -> Array:
    """What each run of a cell had spent when it reached each target, shape ``(runs, targets)``."""
    initial, optimum = scores.initial_and_optimum(study)[cell.task]
    targets = np.ceil(initial + shares * (optimum - initial) - 1e-9)
    runs = steps_of(study, cell)
    known = [run for run in runs if not run.solved or np.isfinite(run.total[spend])]
    times = np.empty((len(known), len(targets)))
    for row, run in zip(times, known, strict=True):
        row[:] = run.times(spend, targets)
    return times


def pairs(times: RunningTimes) -> tuple[Array, Array, NDArray[np.int32]]:
    """Running times of all pairs of run and target in ascending order, their weights, which sum to
    1, and the number of the run of each."""
    values = np.concatenate([of_task.ravel() for of_task in times])
    order = np.argsort(values, kind="stable")
    values = values[order]
    weights = [np.full(of_task.size, 1 / of_task.size / len(times)) for of_task in times]
    runs = (order // times[0].shape[1]).astype(np.int32)  # of very many runs
    return values, np.concatenate(weights)[order], runs


def ecdf(times: RunningTimes) -> tuple[Array, Array]:
    """Budgets at which the share of targets reached rises, and the share from there on."""
    values, weights, _ = pairs(times)
    last = np.append(values[1:] != values[:-1], True)
    reached = last & np.isfinite(values)
    return values[reached], np.cumsum(weights)[reached]


def share_reached(times: RunningTimes) -> float:
    """Share of targets that are reached in the end."""
    values, weights, _ = pairs(times)
    return float(weights[np.isfinite(values)].sum())


def budget_for(times: RunningTimes, share: float) -> Estimate:
    """The least budget within which a share of the targets is reached; infinite without any.

    With its percentile interval: runs are drawn anew within their task, and the tasks stay. It is
    not widened as means over tasks are, as a budget can be infinite. No interval where a task has
    too few runs.
    """
    values, weights, runs = pairs(times)
    reached = np.isfinite(values)
    values, weights, runs = values[reached], weights[reached], runs[reached]

    def budget(weights: Array) -> float:
        place = np.searchsorted(np.cumsum(weights), share - 1e-9)
        return float(values[place]) if place < len(values) else math.inf

    sizes = list(map(len, times))
    if min(sizes) < FEWEST:
        return Estimate(budget(weights))
    rng = np.random.default_rng(SEED)
    resamples = min(BUDGET_RESAMPLES, max(_MOST_DRAWN // sum(sizes), _FEWEST_RESAMPLES))
    drawn = np.concatenate([times_drawn(size, resamples, rng) for size in sizes], axis=1)
    budgets = [budget(weights * counts[runs]) for counts in drawn]
    low, high = np.quantile(budgets, TAILS, method="inverted_cdf")
    return Estimate(budget(weights), float(low), float(high))


def times_drawn(size: int, resamples: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """How often each of so many runs is drawn in each resample, shape ``(resamples, size)``.

    A byte each, as there may be many runs: none is drawn 256 times.
    """
    shares, drawn = np.full(size, 1 / size), np.empty((resamples, size), dtype=np.uint8)
    for row in drawn:
        row[:] = rng.multinomial(size, shares)
    return drawn


def trials_to_half(study: Study, method: str) -> dict[str, float]:
    """Trials to the target halfway from the initial solution to the optimum, by task.

    Medians over runs, infinite where most runs never reach it. ``method``: a label, or the
    learner's conditions together.
    """
    labels: dict[str, str] = scores.labels_by_task(study).get(method, {})
    half: Any = TARGETS == 0.5
    return {
        task: float(np.quantile(times, 0.5, method="inverted_cdf"))
        for task in scores.initial_and_optimum(study)
        if task in labels
        for times in [times_of(study, study.cells[task, labels[task]], "trials")[:, half]]
    }
