"""What judges read of a results folder, with a record of what each has read."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from coartic import Execution, Task
from coartic.analysis.comparisons.methods import MethodRow, method_rows
from coartic.analysis.methods import LEARNER
from coartic.analysis.published import TRIALS
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.study import Study
from coartic.analysis.trajectories import Trajectories, best_sequences, initial_solution
from coartic.robot import Array

ASCENDING, DESCENDING = "ascending", "descending"
ONE, TWO = "two-armed-1", "two-armed-2"
FREE = f"{ONE}.free-base"
"""Two-armed task 1 with a base that moves in both directions (suite ``ablations``)."""

SMOOTH = ("squared-changes", "acceleration", "jerk")
"""Smoothness costs of trajectory optimisation; the first is Jordan's, the last Flash & Hogan's."""


class MissingError(Exception):
    """The folder lacks what a claim needs."""


@dataclass
class Data:
    """A results folder as one claim reads it."""

    study: Study
    run_ids: list[str] = field(default_factory=list)
    """Runs read so far, some of them more than once."""

    def runs(self, task: str, method: str, hands: str | None = None) -> pd.DataFrame:
        """Solved runs of a method, of ``hands`` only those that learned that sequence.

        Raises MissingError where they cannot be judged.
        """
        cell = self.study.cells.get((task, method))
        if cell is None or not len(cell.runs):
            raise MissingError(f"this folder has no runs of {method} on {task}")
        if len(cell.good) < len(cell.runs):
            failed = len(cell.runs) - len(cell.good)
            raise MissingError(
                f"{failed} of {len(cell.runs)} runs of {method} on {task} failed, so "
                "the mean of the others would mislead"
            )
        if method.startswith(LEARNER):
            trials = sorted(set(cell.runs.trials))
            if trials != [TRIALS]:
                raise MissingError(
                    f"the paper's runs have {TRIALS} trials; those of {method} on {task} have "
                    f"{', '.join(map(str, trials))}"
                )
            if len(cell.runs) < FEWEST:
                raise MissingError(f"fewer than {FEWEST} runs of {method} on {task}")
        found = cell.good if hands is None else cell.good[cell.good.hands == hands]
        self.run_ids.extend(found.run_id)
        return found

    def row(self, task: str, method: str) -> MethodRow:
        """The row of :meth:`runs` in the table of methods."""
        self.runs(task, method)
        return method_rows(self.study)[task, method]

    def learned(self, task: str, condition: str, hands: str | None = None) -> pd.DataFrame:
        """:meth:`runs` of the paper's learner."""
        return self.runs(task, LEARNER + condition, hands)

    def rewards(self, task: str, condition: str, hands: str | None = None) -> Array:
        """Learned rewards of runs (that learned ``hands``), shape ``(runs,)``."""
        found = self.learned(task, condition, hands).reward.to_numpy(dtype=np.float64)
        return self._enough(found, task, condition, hands)

    @staticmethod
    def _enough(found: Array, task: str, condition: str, hands: str | None) -> Array:
        if len(found) < FEWEST:
            raise MissingError(
                f"{len(found)} runs of {condition} on {task} learned {hands}, fewer than {FEWEST}"
            )
        return found

    def replays(self, task: str, condition: str, hands: str | None = None) -> Array:
        """Rewards of noiseless replays of runs (that learned ``hands``), shape ``(runs,)``.

        Not the learned reward, which as the best of all trials is never below trial 0's.
        """
        runs = self.learned(task, condition, hands)
        replays = runs.replay_reward.to_numpy(dtype=np.float64, na_value=np.nan)
        if not np.isfinite(replays).all():
            raise MissingError(f"a run of {condition} on {task} has no replay")
        return self._enough(replays, task, condition, hands)

    def hands(self, task: str, condition: str) -> Counter[str]:
        """Runs of the paper's learner by learned hand sequence."""
        return Counter(map(str, self.learned(task, condition).hands))

    def initial_reward(self, task: str, condition: str, hands: str | None = None) -> float:
        """Of trial 0: the corrective process alone."""
        return float(self.learned(task, condition, hands).initial_reward.iloc[0])

    def cell(self, task: str, method: str) -> Trajectories:
        """Executed solutions; raises MissingError where there are none."""
        self.runs(task, method)
        return self.study.trajectories(task, method)

    def task(self, name: str) -> Task:
        """A task of the folder."""
        if name not in self.study.tasks:
            raise MissingError(f"this folder has no task {name}")
        return self.study.tasks[name]

    def initial(self, name: str) -> Execution:
        """A task's initial solution: the corrective process alone with the task's hands."""
        execution = initial_solution(self.task(name), self.study.model)
        if execution is None:
            raise MissingError(f"the corrective process alone does not complete {name}")
        return execution

    def sequences(self, task: str) -> dict[str, float]:
        """Reward of the corrective process alone by hand sequence; NaN where it fails."""
        own = self.study.sequences(self.task(task).name)
        if not len(own):
            raise MissingError(
                f"this folder has no rewards of the corrective process alone on {task}"
            )
        rewards = own.reward.to_numpy(dtype=np.float64, na_value=np.nan)
        return dict(zip(map(str, own.hands), rewards.tolist(), strict=True))

    def best_sequences(self, task: str) -> tuple[list[str], float]:
        """Hand sequences that are best by the corrective process alone, and their reward."""
        known = self.sequences(task)
        best = best_sequences(self.study.sequences(task))
        if not best:
            raise MissingError(
                f"the corrective process alone completes {task} with no hand sequence"
            )
        return best, known[best[0]]
