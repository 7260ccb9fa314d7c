"""Access of claims to a results folder, with a record of the runs that each claim reads."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd

from coartic import Execution, Task
from coartic.analysis.methods import CONDITION_OF, RANDOM_SEARCH, title_of
from coartic.analysis.published import Summary, published_alone, published_cell
from coartic.analysis.random_search import (
    beside_random_search,
    excess_on_instance,
    random_search_on,
)
from coartic.analysis.signatures.measures import SIGNATURES
from coartic.analysis.solutions import Solutions, initial_solution
from coartic.analysis.study import CellKey, Study
from coartic.analysis.words import estimate, number
from coartic.estimates import FEWEST, mean
from coartic.learner.learning import TRIALS
from coartic.robot import Array


class MissingError(Exception):
    """Error that a folder lacks runs, tasks or values that a claim needs."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """Values of runs, or a single number, with the words by which evidence names them."""

    task: str
    """Title of the task."""
    who: str
    """Method, as in ``EC2``, ``replay of EC1``, ``initial``, ``random-search``."""
    numbers: Array
    """Values, shape ``(runs,)``; shape ``()`` of a single number, which is exact."""
    quantity: str = ""
    """Measured quantity in words; empty for rewards."""
    published: Summary | None = None
    """Reward that the paper publishes; None if the paper publishes no such reward."""

    @property
    def name(self) -> str:
        """Title of the task, and method."""
        return f"{self.task}, {self.who}"

    @property
    def in_ticks(self) -> bool:
        """True for rewards and numbers of ticks."""
        return not self.quantity or "ticks by which" in self.quantity

    def __str__(self) -> str:
        """Write the number, or the mean with its BCa interval."""
        if not self.numbers.ndim:
            return number(float(self.numbers))
        return estimate(mean(self.numbers), 1 if self.in_ticks else 3)


class Higher(NamedTuple):
    """A claimed order of means: the first mean exceeds the second mean, or 0, by a margin."""

    first: Measurement
    second: Measurement | None = None
    by: float = 0.0
    """Margin, in the unit of the measurements."""


@dataclass
class Reader:
    """A results folder as one claim reads it.

    A ``label`` is a method with its setting. Methods raise MissingError for missing tasks, runs and
    values.
    """

    study: Study
    run_ids: list[str] = field(default_factory=list)
    """Ids of the runs read so far, some of them more than once."""
    failed: list[CellKey] = field(default_factory=list)
    """Cells that the claim asked for and could not use because some of their runs failed."""

    def task(self, name: str) -> Task:
        """Return a task of the folder."""
        if name not in self.study.tasks:
            raise MissingError(f"this folder has no task {name}")
        return self.study.tasks[name]

    def title(self, name: str) -> str:
        """Return the title of a task, or its name if the folder has no such task."""
        return self.study.tasks[name].label if name in self.study.tasks else name

    def runs(self, task: str, label: str) -> pd.DataFrame:
        """Return the runs of a method on a task, if all of them have a solution."""
        cell, title = self.study.cells.get((task, label)), self.title(task)
        if cell is None or not len(cell.runs):
            raise MissingError(f"this folder has no runs of {label} on {title}")
        if len(cell.good) < len(cell.runs):
            self.failed.append((task, label))
            failed = len(cell.runs) - len(cell.good)
            raise MissingError(
                f"{failed} of {len(cell.runs)} runs of {label} on {title} failed, so "
                "the mean of the others would mislead"
            )
        runs = cell.good
        if self.study.methods.algorithm[label] in ("learner", "random search"):
            trials = sorted(cell.runs.trials.unique())
            if trials != [TRIALS]:
                raise MissingError(
                    f"the paper's runs have {TRIALS} trials; those of {label} on {title} have "
                    f"{', '.join(map(str, trials))}"
                )
            if len(runs) < FEWEST:
                raise MissingError(f"fewer than {FEWEST} runs of {label} on {title}")
        self.run_ids.extend(runs.run_id)
        return runs

    def cell(self, task: str, label: str, *, replay: bool = False) -> Solutions:
        """Return the executed solutions of a method, or its noiseless replays after learning."""
        self.runs(task, label)
        return self.study.executed(task, label, replay=replay)

    def hands(self, task: str, label: str) -> list[str]:
        """Return the hand sequence of each run of the learner."""
        return list(map(str, self.runs(task, label).hands))

    def reward(self, task: str, label: str) -> Measurement:
        """Return the rewards of the best trials; a single reward for a deterministic method."""
        rewards = self.runs(task, label).reward.to_numpy(dtype=np.float64)
        if not self.study.methods.stochastic[label]:
            rewards = np.array(rewards.mean())
        published = published_reward(task, label)
        return Measurement(self.title(task), who_is(label), rewards, published=published)

    def replay(self, task: str, label: str) -> Measurement:
        """Return the rewards of noiseless replays after learning.

        A replay makes the movements that were learned. The reward of the best trial is a maximum,
        never below the reward of trial 0.
        """
        runs = self.runs(task, label)
        rewards = runs.replay_reward.to_numpy(dtype=np.float64, na_value=np.nan)
        if np.isnan(rewards).any():
            raise MissingError(f"{who_is(label)} on {self.title(task)} has no replay")
        published = published_reward(task, label)
        who = f"replay of {who_is(label)}"
        return Measurement(self.title(task), who, rewards, published=published)

    def initial(self, task: str) -> Measurement:
        """Return the reward of a task's initial solution."""
        reward = np.array(self.initial_execution(task).reward, dtype=np.float64)
        published = published_alone(task, "initial hands")
        return Measurement(self.title(task), "initial", reward, published=published)

    def best(self, task: str) -> Measurement:
        """Return the highest reward of the corrective process alone over all hand sequences."""
        rewards = self.alone(task)
        if np.isnan(rewards).all():
            title = self.title(task)
            raise MissingError(
                f"the corrective process alone completes {title} with no hand sequence"
            )
        published, best = published_alone(task, "best of all sequences"), np.nanmax(rewards)
        return Measurement(self.title(task), "best", np.array(best), published=published)

    def signature(self, name: str, task: str, label: str, *, replay: bool = False) -> Measurement:
        """Return a signature of coarticulation of the runs that have this signature."""
        self.runs(task, label)
        values = self.study.signature_of(name, task, label, replay=replay)
        return self.shown(name, task, label, values, "in noiseless replays, " * replay)

    def beside_random_search(self, name: str, task: str, label: str) -> list[Higher]:
        """Return the order of a signature of a method and of random search, for each hand sequence.

        The rule is that of :mod:`coartic.analysis.random_search`: equal hands, runs that improved,
        as many trials, and the width of the box that shows most.
        """
        for each in (label, *self.random_search(task)):
            self.runs(task, each)
        pairs = []
        one_handed = len(self.task(task).hands) == 1
        for hands, both in beside_random_search(self.study, name, task, label).items():
            words = "" if one_handed else f"with hands {hands}, "
            if not len(both[1]):
                raise MissingError(
                    f"fewer than {FEWEST} runs of {RANDOM_SEARCH} on {task} with hands {hands} "
                    "improved on the corrective process alone"
                )
            pairs.append(
                Higher(
                    self.shown(name, task, label, both[0], words),
                    self.shown(name, task, RANDOM_SEARCH, both[1], words),
                )
            )
        if not pairs:
            raise MissingError(
                f"no run of {who_is(label)} on {task} improved on the corrective process alone"
            )
        return pairs

    def excess_over_random_search(self, name: str, task: str, label: str) -> Measurement:
        """Return the excess of a method's signature over random search on an instance of a family,
        a single number, by the same rule."""
        self.runs(task, label)
        excess = excess_on_instance(self.study, name, task, label)
        if math.isnan(excess):
            raise MissingError(f"no random search on {task} has the hands of {who_is(label)}")
        return self.shown(name, task, label, np.array([excess]))

    def shown(
        self, name: str, task: str, label: str, values: Array, words: str = ""
    ) -> Measurement:
        """Return a signature with its words. Raises MissingError if no run has this signature."""
        if not len(values):
            raise MissingError(f"{who_is(label)} on {self.title(task)} has no {name}")
        return Measurement(self.title(task), who_is(label), values, words + SIGNATURES[name].words)

    def random_search(self, task: str) -> list[str]:
        """Return the labels of the settings of random search that solved a task in 10,000
        trials."""
        return random_search_on(self.study, task, TRIALS) or [RANDOM_SEARCH]

    def initial_execution(self, task: str) -> Execution:
        """Return the initial solution of a task."""
        execution = initial_solution(self.task(task))
        if execution is None:
            raise MissingError(f"the corrective process alone does not complete {self.title(task)}")
        return execution

    def alone(self, task: str) -> Array:
        """Return the rewards of the corrective process alone by hand sequence, NaN for failures."""
        rewards = self.study.sequences(self.task(task).name).reward
        if not len(rewards):
            title = self.title(task)
            raise MissingError(
                f"this folder has no rewards of the corrective process alone on {title}"
            )
        return rewards.to_numpy(dtype=np.float64, na_value=np.nan)


def who_is(label: str) -> str:
    """Return the name of a method in evidence, for the learner its condition."""
    return CONDITION_OF.get(label) or title_of(label)


def published_reward(task: str, label: str) -> Summary | None:
    """Return the mean reward of runs in the paper; None if the paper does not publish it."""
    return (published_cell(task, CONDITION_OF.get(label, "")) or {}).get("")


def there(reads: Iterable[Callable[[], Measurement]]) -> Iterator[Measurement]:
    """Yield the measurements for which the folder has runs."""
    for read in reads:
        with suppress(MissingError):
            yield read()
