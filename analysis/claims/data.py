"""What claims read of a results folder, with a record of the runs that each claim has read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import Execution, Task
from coartic.analysis.claims.register import Finding
from coartic.analysis.methods import LEARNER, PLACEBO, name_of
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.statistics.estimates import FEWEST, mean
from coartic.analysis.study import CellKey, Study
from coartic.analysis.topics.families.sample import signs
from coartic.analysis.topics.paper.published import (
    published_cell,
    published_exhaustive,
    published_initial,
)
from coartic.analysis.trajectories import Trajectories, best_sequences, initial_solution
from coartic.analysis.words import estimate, number, tally
from coartic.learner.kernel import TENTHS
from coartic.learner.learning import TRIALS
from coartic.robot import Array

LEAST_CHANGES = "trajectory-optimisation/squared-changes"
"""The plan of Jordan's smoothness cost."""


class MissingError(Exception):
    """The folder lacks what a claim needs."""


Judge: TypeAlias = "Callable[..., Finding]"
JUDGES: dict[str, Judge] = {}
"""By the id of a claim, the function of :class:`Data` that judges it."""
TESTS: dict[str, str] = {}
"""By the id of a claim, how it is tested, in words; margins in braces are put in."""


def judges(claim: str, test: str, **arguments: Any) -> Callable[[Judge], Judge]:
    """A decorator: the function judges a claim of ``claims.toml``, by a test in words.

    ``arguments`` are given to it; a function may judge several claims, each with its own.
    """

    def register(judge: Judge) -> Judge:
        JUDGES[claim], TESTS[claim] = partial(judge, **arguments), test
        return judge

    return register


@dataclass(frozen=True, eq=False)
class Measurement:
    """A value of each run, or one number, with the words by which evidence names them."""

    task: str
    who: str
    """Whose they are: ``EC2``, ``replay of EC1``, ``initial``, ``random guesses``."""
    numbers: Array
    """Shape ``(runs,)``; ``()`` of one number, which is exact."""
    quantity: str = ""
    """What is measured, in words; empty for rewards."""
    printed: str = ""
    """The reward that the paper prints, in words; empty where it prints none."""

    @property
    def name(self) -> str:
        """Where they are from."""
        return f"{self.task}, {self.who}"

    @property
    def in_ticks(self) -> bool:
        """Whether it is counted in ticks."""
        return not self.quantity or "ticks by which" in self.quantity

    def __str__(self) -> str:
        """One number, or the mean with its BCa interval."""
        if not self.numbers.ndim:
            return number(float(self.numbers))
        return estimate(mean(self.numbers), 1 if self.in_ticks else 3)


@dataclass(frozen=True)
class RunCount:
    """How many runs of a cell do something."""

    number: int
    total: int
    words: str
    """Beginning of the evidence."""

    @property
    def share(self) -> float:
        """Share of the runs."""
        return self.number / self.total


@dataclass(frozen=True)
class LearnedHands:
    """Hand sequence that each run of a cell learned."""

    task: str
    condition: str
    sequences: tuple[str, ...]

    @property
    def tally(self) -> Counter[str]:
        """Runs by hand sequence."""
        return Counter(self.sequences)

    @property
    def commonest(self) -> str:
        """The sequence that most runs learned."""
        return self.tally.most_common(1)[0][0]

    def count(self, what: str, does: Sequence[bool] | NDArray[np.bool_]) -> RunCount:
        """How many runs do something, which the evidence calls ``what``."""
        words = f"{self.task} {self.condition} {what}"
        count, total = int(np.sum(does)), len(does)
        return RunCount(count, total, f"{words}: {count} of {total} runs ({tally(self.tally)})")

    def are(self, *sequences: str, name: str) -> RunCount:
        """How many runs learned one of some sequences, which the evidence calls ``name``."""
        return self.count(name, [hands in sequences for hands in self.sequences])


@dataclass
class Data:
    """A results folder as one claim reads it. Methods raise MissingError for what it lacks.

    A method of the folder is named by its label.
    """

    study: Study
    run_ids: list[str] = field(default_factory=list)
    """Runs read so far, some of them more than once."""
    failed: list[CellKey] = field(default_factory=list)
    """Cells that were asked for so far and not read, as some of their runs failed."""

    def task(self, name: str) -> Task:
        """A task of the folder."""
        if name not in self.study.tasks:
            raise MissingError(f"this folder has no task {name}")
        return self.study.tasks[name]

    def runs(self, task: str, label: str) -> pd.DataFrame:
        """Solved runs of a method."""
        cell = self.study.cells.get((task, label))
        if cell is None or not len(cell.runs):
            raise MissingError(f"this folder has no runs of {label} on {task}")
        if len(cell.good) < len(cell.runs):
            self.failed.append((task, label))
            failed = len(cell.runs) - len(cell.good)
            raise MissingError(
                f"{failed} of {len(cell.runs)} runs of {label} on {task} failed, so "
                "the mean of the others would mislead"
            )
        runs = cell.good
        if label.startswith((LEARNER, PLACEBO)):
            trials = sorted(set(cell.runs.trials))
            if trials != [TRIALS]:
                raise MissingError(
                    f"the paper's runs have {TRIALS} trials; those of {label} on {task} have "
                    f"{', '.join(map(str, trials))}"
                )
            if len(runs) < FEWEST:
                raise MissingError(f"fewer than {FEWEST} runs of {label} on {task}")
        self.run_ids.extend(runs.run_id)
        return runs

    def cell(self, task: str, label: str) -> Trajectories:
        """Executed solutions of a method."""
        self.runs(task, label)
        return self.study.trajectories(task, label)

    def hands(self, task: str, label: str) -> LearnedHands:
        """Hand sequences that runs of the learner learned."""
        learned = tuple(map(str, self.runs(task, label).hands))
        return LearnedHands(task, who_is(label), learned)

    def reward(self, task: str, label: str) -> Measurement:
        """Rewards of the best trials; of a method that draws nothing its one reward."""
        rewards = self.runs(task, label).reward.to_numpy(dtype=np.float64)
        method = self.study.cells[task, label].method
        if not self.study.plan.methods[method].stochastic:
            rewards = np.array(rewards.mean())
        return self._of(task, label, rewards, "reward")

    def replay(self, task: str, label: str) -> Measurement:
        """Rewards of noiseless replays after learning.

        The learned reward is that of the best trial, which is never below trial 0's.
        """
        runs = self.runs(task, label)
        rewards = runs.replay_reward.to_numpy(dtype=np.float64, na_value=np.nan)
        return self._of(task, label, rewards, "replay")

    def initial(self, task: str) -> Measurement:
        """Reward of a task's initial solution."""
        reward = np.array(self.initial_execution(task).reward, dtype=np.float64)
        printed = published_initial(task)
        return Measurement(task, "initial", reward, printed=printed.in_words if printed else "")

    def best(self, task: str) -> Measurement:
        """Highest reward of the corrective process alone over all hand sequences."""
        printed = published_exhaustive(task)
        reward = np.array(self.best_sequences(task)[1])
        return Measurement(task, "best", reward, printed=printed.in_words if printed else "")

    def corrections(self, task: str, label: str, tenth: Literal["early", "late"]) -> Measurement:
        """Share of movements that are corrected, in the first or the last tenth of the trials.

        Trial 0 does not count: it has no other movements by construction.
        """
        runs = self.runs(task, label)
        movements = (runs.trials - 1) * len(self.task(task).goals) / TENTHS
        shares = (runs[f"{tenth}_corrections"] / movements).to_numpy(dtype=np.float64)
        when = "first" if tenth == "early" else "last"
        words = f"share of movements that are corrected, in the {when} tenth of the trials"
        return self._of(task, label, shares, tenth, words)

    def last_corrections(self, task: str, label: str) -> Measurement:
        """Share of movements that are corrected in the learned solution."""
        corrections = self.runs(task, label).solution_corrections
        shares = (corrections / len(self.task(task).goals)).to_numpy(np.float64)
        words = "share of movements that are corrected, in the learned solution"
        return self._of(task, label, shares, "last", words)

    def sign(self, name: str, task: str, label: str) -> Measurement:
        """A sign of coarticulation, of the runs that have one; of an instance, computed once."""
        self.runs(task, label)
        if self.task(task).family is not None:
            values = signs(self.study)[task, label].get(name, np.empty(0))
        else:
            values = SIGNS[name].of(self.study.trajectories(task, label))
        return self._of(task, label, values, name, SIGNS[name].words)

    def replayed_sign(self, name: str, task: str, label: str) -> Measurement:
        """A sign of coarticulation in noiseless replays after learning."""
        self.runs(task, label)
        values = SIGNS[name].of(self.study.replays(task, label))
        words = SIGNS[name].in_short or SIGNS[name].words
        return self._of(task, label, values, name, f"in noiseless replays, {words}")

    def resemblance(self, task: str, label: str) -> Measurement:
        """Share of the initial solution's distance to the plan that each run has covered."""
        self.runs(task, label)
        (plan,) = self.cell(task, LEAST_CHANGES).runs
        planned = plan.execution.configurations

        def apart(execution: Execution) -> float:
            """Mean distance of postures at the goals, length unit and rad mixed."""
            return float(np.linalg.norm(execution.configurations - planned, axis=-1).mean())

        before = apart(self.initial_execution(task))
        runs = self.cell(task, label).runs
        shares = np.array([1 - apart(run.execution) / before for run in runs])
        return self._of(
            task, label, shares, "resemblance",
            "share of the distance of the initial solution to the plan for least squared changes "
            "that learning has covered (postures at the goals)",
        )  # fmt: skip

    def _of(
        self, task: str, label: str, values: Array, name: str, quantity: str = ""
    ) -> Measurement:
        """What is measured of runs of a method."""
        if values.ndim and (not len(values) or not np.isfinite(values).all()):
            raise MissingError(f"{who_is(label)} on {task} has no {name}")
        replay = "replay of" * (name == "replay")
        who = " ".join(filter(None, (replay, who_is(label))))
        printed = "" if quantity else printed_reward(task, label)
        return Measurement(task, who, values, quantity, printed)

    def initial_execution(self, task: str) -> Execution:
        """A task's initial solution: the corrective process alone with the task's hands."""
        execution = initial_solution(self.task(task))
        if execution is None:
            raise MissingError(f"the corrective process alone does not complete {task}")
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


def who_is(label: str) -> str:
    """A method as evidence names it: the learner by its condition."""
    return label.removeprefix(LEARNER) if label.startswith(LEARNER) else name_of(label)


def printed_reward(task: str, label: str) -> str:
    """Mean reward of runs as the paper has it, in words; empty where it does not print it."""
    cell = published_cell(task, label.removeprefix(LEARNER))
    summary = cell and cell.summary
    return summary.in_words if summary else ""
