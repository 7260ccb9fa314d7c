"""What a run had spent when its best reward rose: the steps of its anytime curve."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from coartic.analysis.cells import CellRuns
from coartic.analysis.comparisons.methods import numbers, solve_times
from coartic.analysis.optima import locks_base
from coartic.analysis.study import Study, cached
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
    are those of :func:`coartic.analysis.comparisons.methods.solve_times`: without building.
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
