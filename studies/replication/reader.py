"""Read from a results folder what a claim needs."""

import math
import tomllib
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from comparisons import Higher, Measurement
from published import TRIALS, published_alone, published_cell

from coartic import NotApplicableError, corrective_trial, initial_hands
from coartic.analysis import SIGNATURES, Study, mean_excess, with_control
from coartic.estimates import MIN_VALUES

LEARNER = "dual-process/"
EC1, EC2, EC3, EC4 = CONDITIONS = tuple(f"{LEARNER}EC{n}" for n in (1, 2, 3, 4))
EC1_BY_SUBTASK, EC4_BY_SUBTASK = f"{EC1}-subtask", f"{EC4}-subtask"
"""Ids of the learner that learns from the reward of each subtask."""
RANDOM_SEARCH = "random-search"
MIN_VALUES_ON_INSTANCE = 3
"""Smallest number of runs whose mean is the value of a random task."""
ONE_ARMED = "ascending", "descending"
TWO_ARMED = TASK_1, TASK_2 = "two-armed-1", "two-armed-2"
CELLS_OF_ONE_ARM = [(task, EC1) for task in ONE_ARMED]
CELLS_OF_TWO_ARMS = [*((TASK_1, label) for label in (EC2, EC3, EC4)),
                     *((TASK_2, label) for label in (EC3, EC4))]  # fmt: skip
MARGINS = SimpleNamespace(**{
    name: entry["value"]
    for name, entry in tomllib.loads(
        Path(__file__).with_name("margins.toml").read_text("utf-8")
    ).items()
})  # fmt: skip
"""Margins of the claims, as ``margins.toml`` explains."""


class MissingError(Exception):
    """Error that a folder lacks runs, tasks or values that a claim needs."""


@dataclass
class Reader:
    """A results folder, and the runs that a claim has read from it.

    Argument ``label`` is a method with its setting. All methods raise MissingError for missing
    tasks, runs and values.
    """

    study: Study
    run_ids: list[str] = field(default_factory=list)
    """Ids of the runs that were read so far. An id can occur more than once."""

    def task(self, name):
        """Return a task of the folder."""
        if name not in self.study.tasks:
            raise MissingError(f"this folder has no task {name}")
        return self.study.tasks[name]

    def title(self, name):
        """Return the title of a task, or its name if the folder has no such task."""
        return self.study.tasks[name].label if name in self.study.tasks else name

    def who(self, label):
        """Return the name of a method in the evidence. For the learner, this is its condition."""
        if label.startswith(LEARNER):
            return label.removeprefix(LEARNER)
        return self.study.methods.title.get(label, label.replace("-", " "))

    def least_runs(self, name):
        """Return the smallest number of runs of a method that a claim needs on a task.

        It is lower on an instance of a family, where the mean over runs is one value of a test over
        instances.
        """
        return MIN_VALUES_ON_INSTANCE if self.task(name).family else MIN_VALUES

    def runs(self, task, label):
        """Return the runs of a method on a task, and note their ids (:func:`usable_runs`)."""
        runs = usable_runs(self.study, task, label)
        self.run_ids.extend(runs.run_id)
        return runs

    def cell(self, task, label, *, replay=False):
        """Return the executed solutions of a method, or its noiseless replays after learning."""
        self.runs(task, label)
        return self.study.executed(task, label, replay=replay)

    def hands(self, task, label):
        """Return the hand sequence of each run of the learner."""
        return list(map(str, self.runs(task, label).hands))

    def reward(self, task, label):
        """Return the rewards of the best trials, or one reward for a deterministic method."""
        rewards = self.runs(task, label).reward.to_numpy(dtype=np.float64)
        if not self.study.methods.stochastic[label]:
            rewards = np.array(rewards.mean())
        return self._reward(task, label, rewards)

    def replay(self, task, label):
        """Return the rewards of noiseless replays after learning.

        A replay makes the learned movements. In contrast, the reward of the best trial is a
        maximum, and never below the reward of trial 0.
        """
        rewards = self.runs(task, label).replay_reward.to_numpy(dtype=np.float64, na_value=np.nan)
        if np.isnan(rewards).any():
            raise MissingError(f"{self.who(label)} on {self.title(task)} has no replay")
        return self._reward(task, label, rewards, "replay of ")

    def _reward(self, task, label, rewards, which=""):
        published = (published_cell(task, self.who(label)) or {}).get("")
        return Measurement(self.title(task), which + self.who(label), rewards, published=published)

    def initial(self, task):
        """Return the reward of a task's initial solution."""
        reward = np.array(self.initial_execution(task).reward, dtype=np.float64)
        published = published_alone(task, "initial hands")
        return Measurement(self.title(task), "initial", reward, published=published)

    def best(self, task):
        """Return the highest reward of the corrective process alone over all hand sequences."""
        rewards = self.alone(task)
        if np.isnan(rewards).all():
            title = self.title(task)
            raise MissingError(
                f"the corrective process alone completes {title} with no hand sequence"
            )
        published, best = published_alone(task, "best of all sequences"), np.nanmax(rewards)
        return Measurement(self.title(task), "best", np.array(best), published=published)

    def signature(self, name, task, label, *, replay=False):
        """Return a signature of coarticulation for the runs that have this signature."""
        self.runs(task, label)
        values = self.study.signature(name, task, label, replay=replay).to_numpy(np.float64)
        values = values[np.isfinite(values)]
        return self.shown(name, task, label, values, ("in noiseless replays, " if replay else ""))

    def beyond_random_search(self, name, task, label):
        """Return comparisons of a method's signature with random search, by hand sequence.

        Runs are selected as in :func:`coartic.analysis.with_control`.
        """
        self.runs(task, label)
        pairs = []
        one_handed = len(self.task(task).hands) == 1
        for hands, (values, control) in with_control(self.study, name, task, label).items():
            if len(control) < (least := self.least_runs(task)):
                raise MissingError(
                    f"fewer than {least} runs of {RANDOM_SEARCH} on {task} with hands {hands} and "
                    f"{TRIALS} trials"
                )
            words = "" if one_handed else f"with hands {hands}, "
            first = self.shown(name, task, label, values, words)
            pairs.append(Higher(first, self.shown(name, task, RANDOM_SEARCH, control, words)))
        return pairs

    def excess_over_random_search(self, name, task, label):
        """Return by how much a method's signature exceeds random search on an instance of a family.

        This is a single number. Runs are selected as in :func:`coartic.analysis.with_control`.
        """
        self.runs(task, label)
        excess = mean_excess(self.study, name, task, label)
        if math.isnan(excess):
            raise MissingError(f"no random search on {task} has the hands of {self.who(label)}")
        return self.shown(name, task, label, np.array([excess]))

    def shown(self, name, task, label, values, words=""):
        """Return a signature with its words. Raises MissingError if no run has this signature."""
        if not len(values):
            raise MissingError(f"{self.who(label)} on {self.title(task)} has no {name}")
        quantity = words + SIGNATURES[name].words
        return Measurement(self.title(task), self.who(label), values, quantity)

    def initial_execution(self, task):
        """Return the initial solution of a task: the corrective process with its initial hands."""
        with suppress(NotApplicableError):
            execution = corrective_trial(self.task(task), initial_hands(self.task(task)))
            if execution.completed:
                return execution
        raise MissingError(f"the corrective process alone does not complete {self.title(task)}")

    def alone(self, task):
        """Return the rewards of the corrective process alone by hand sequence, NaN for failures."""
        rewards = self.study.sequences(self.task(task).name).reward
        if not len(rewards):
            raise MissingError(
                f"this folder has no rewards of the corrective process alone on {self.title(task)}"
            )
        return rewards.to_numpy(dtype=np.float64, na_value=np.nan)


def there(reads):
    """Yield the results of functions, and leave out functions that raise MissingError."""
    for read in reads:
        with suppress(MissingError):
            yield read()


@lru_cache(maxsize=8_192)
def usable_runs(study, task, label):
    """Return the runs of a method on a task.

    Raises MissingError if a run has no solution. For the learner and random search, it is also
    raised for too few runs, and for another number of trials than that of the paper. The
    result is cached: claims ask for the same runs.
    """
    read = Reader(study)
    runs, title = study.cells.get((task, label)), read.title(task)
    if runs is None:
        raise MissingError(f"this folder has no runs of {label} on {title}")
    if failed := (runs.status != "ok").sum():
        raise MissingError(
            f"{failed} of {len(runs)} runs of {label} on {title} failed, so "
            "the mean of the others would mislead"
        )
    if study.methods.algorithm[label] in ("learner", "random search"):
        trials = sorted(runs.trials.unique())
        if trials != [TRIALS]:
            raise MissingError(
                f"the paper's runs have {TRIALS} trials; those of {label} on {title} have "
                f"{', '.join(map(str, trials))}"
            )
        if len(runs) < (least := read.least_runs(task)):
            raise MissingError(f"fewer than {least} runs of {label} on {title}")
    return runs
