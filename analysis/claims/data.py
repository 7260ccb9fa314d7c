"""What rules read of a results folder, with a record of the runs that each claim has read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import pandas as pd

from coartic import Execution, Task
from coartic.analysis.claims.register import Finding, Side, is_method
from coartic.analysis.methods import LEARNER, PLACEBO, most_exploring
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.study import CellKey, Study
from coartic.analysis.topics.families.sample import signs
from coartic.analysis.topics.paper.published import TRIALS
from coartic.analysis.trajectories import Trajectories, best_sequences, initial_solution
from coartic.learner.kernel import TENTHS
from coartic.robot import Array

PLAN = "trajectory-optimisation/squared-changes"
"""Jordan's smoothness cost."""


class MissingError(Exception):
    """The folder lacks what a claim needs."""


Judge: TypeAlias = "Callable[[Data], Finding]"
JUDGES: dict[str, Judge] = {}
"""By the id of a claim, the function that judges it."""
TESTS: dict[str, str] = {}
"""By the id of a claim, how it is tested, in words; margins in braces are put in."""


def judges(
    claim: str, test: str
) -> Callable[[Callable[[Data], Finding]], Callable[[Data], Finding]]:
    """A decorator: the function judges a claim of ``claims.toml``, by a test in words."""

    def register(judge: Judge) -> Judge:
        JUDGES[claim], TESTS[claim] = judge, test
        return judge

    return register


@dataclass
class Data:
    """A results folder as one claim reads it."""

    study: Study
    run_ids: list[str] = field(default_factory=list)
    """Runs read so far, some of them more than once."""
    failed: list[CellKey] = field(default_factory=list)
    """Cells that were asked for so far and not read, as some of their runs failed."""

    def label(self, task: str, who: str) -> str:
        """Label of a method: ``EC4`` is the learner's, ``EC`` its that explores most on a task."""
        if who == "EC":
            return most_exploring(self.task(task))
        return who if is_method(who) else LEARNER + who

    def runs(self, task: str, who: str, hands: str = "") -> pd.DataFrame:
        """Solved runs of a method, of ``hands`` only those that learned that sequence.

        Raises MissingError where they cannot be judged.
        """
        method = self.label(task, who)
        cell = self.study.cells.get((task, method))
        if cell is None or not len(cell.runs):
            raise MissingError(f"this folder has no runs of {method} on {task}")
        if len(cell.good) < len(cell.runs):
            self.failed.append((task, method))
            failed = len(cell.runs) - len(cell.good)
            raise MissingError(
                f"{failed} of {len(cell.runs)} runs of {method} on {task} failed, so "
                "the mean of the others would mislead"
            )
        runs = cell.good[cell.good.hands == hands] if hands else cell.good
        if method.startswith((LEARNER, PLACEBO)):
            trials = sorted(set(cell.runs.trials))
            if trials != [TRIALS]:
                raise MissingError(
                    f"the paper's runs have {TRIALS} trials; those of {method} on {task} have "
                    f"{', '.join(map(str, trials))}"
                )
            if len(runs) < FEWEST:
                learned = f" learned {hands}" if hands else ""
                raise MissingError(f"fewer than {FEWEST} runs of {method} on {task}{learned}")
        self.run_ids.extend(runs.run_id)
        return runs

    def values(self, task: str, side: Side) -> Array:
        """One side of a comparison: a value of each run, or one number, shape ``()``.

        Raises MissingError where it cannot be judged.
        """
        what, who, hands = side
        if what == "number":
            return np.array(float(side.who))
        if who == "best":
            return np.array(self.best_sequences(task)[1])
        if who == "initial":
            return np.array(self.initial(task).reward, dtype=np.float64)
        runs = self.runs(task, who, hands)
        if what == "reward":
            rewards = runs.reward.to_numpy(dtype=np.float64)
            # A method that draws nothing has one reward, which is exact.
            method = self.study.cells[task, self.label(task, who)].method
            stochastic = self.study.plan.methods[method].stochastic
            return rewards if stochastic else np.array(rewards.mean())
        if what == "replay":
            # Not the learned reward, which as the best of all trials is never below trial 0's.
            values = runs.replay_reward.to_numpy(dtype=np.float64, na_value=np.nan)
        elif what in ("early", "late"):
            # Trial 0 has no other movements by construction.
            movements = (runs.trials - 1) * len(self.task(task).goals) / TENTHS
            values = (runs[f"{what}_corrections"] / movements).to_numpy(dtype=np.float64)
        elif what == "last":
            values = (runs.solution_corrections / len(self.task(task).goals)).to_numpy(np.float64)
        elif what == "resemblance":
            values = self.resemblance(task, who)
        else:
            values = self.sign(task, self.label(task, who), what.replace("-", " "))
        if not len(values) or not np.isfinite(values).all():
            raise MissingError(f"{who} on {task} has no {what}")
        return values

    def sign(self, task: str, label: str, name: str) -> Array:
        """A sign of coarticulation, of the runs that have one; of an instance, computed once."""
        if name.startswith("replayed "):
            replays = self.study.replays(task, label)
            return SIGNS[name.removeprefix("replayed ")].of(replays)
        if self.task(task).family is not None:
            return signs(self.study)[task, label].get(name, np.empty(0))
        return SIGNS[name].of(self.study.trajectories(task, label))

    def resemblance(self, task: str, who: str) -> Array:
        """Share of the initial solution's distance to the plan that each run has covered."""
        (plan,) = self.cell(task, PLAN).runs
        planned = plan.execution.configurations

        def apart(execution: Execution) -> float:
            """Mean distance of postures at the goals, length unit and rad mixed."""
            return float(np.linalg.norm(execution.configurations - planned, axis=-1).mean())

        before = apart(self.initial(task))
        return np.array([1 - apart(run.execution) / before for run in self.cell(task, who).runs])

    def hands(self, task: str, condition: str) -> Counter[str]:
        """Runs of the paper's learner by learned hand sequence."""
        return Counter(map(str, self.runs(task, condition).hands))

    def cell(self, task: str, who: str) -> Trajectories:
        """Executed solutions; raises MissingError where there are none."""
        self.runs(task, who)
        return self.study.trajectories(task, self.label(task, who))

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
        of_task = self.study.sequences(self.task(task).name)
        if not len(of_task):
            raise MissingError(
                f"this folder has no rewards of the corrective process alone on {task}"
            )
        rewards = of_task.reward.to_numpy(dtype=np.float64, na_value=np.nan)
        return dict(zip(map(str, of_task.hands), rewards.tolist(), strict=True))

    def best_sequences(self, task: str) -> tuple[list[str], float]:
        """Hand sequences that are best by the corrective process alone, and their reward."""
        rewards = self.sequences(task)
        best = best_sequences(self.study.sequences(task))
        if not best:
            raise MissingError(
                f"the corrective process alone completes {task} with no hand sequence"
            )
        return best, rewards[best[0]]
