"""Cells and jobs: the runs that a suite asks for, with their ids and seeds.

A cell is a method with its parameters on a task. A plan is a list of jobs, one for each cell.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from coartic.errors import CoarticError
from coartic.internal.text import describe_parameters
from coartic.model import PAPER, MotionModel, check_model, differences
from coartic.runs.contrasts import Contrast
from coartic.runs.method_info import MethodInfo, same_value
from coartic.tasks.task import Task, in_world


@dataclass(frozen=True)
class Cell:
    """A method with its parameters on a task, with a motion model and a trial budget."""

    task: Task
    method: MethodInfo
    parameters: dict[str, Any]
    """Dict that maps parameters of the method to values (:meth:`.MethodInfo.complete`)."""
    trial_budget: int | None = None
    """Largest number of trials of a run; None for no limit. Trials of the search for initial hands
    are not counted."""
    model: MotionModel = PAPER
    """Motion model of the trials and of the scoring, with the tolerances for the task."""
    named: dict[str, str] = field(default_factory=dict)
    """Dict that maps the ids of methods whose runs the method makes first to their codes
    (:mod:`coartic.method.as_method`)."""

    def __post_init__(self) -> None:
        model = check_model(self.model)
        if model.radius == self.task.radius:  # this is no other world
            model = model._replace(radius=None)
        model = model.for_radius(self.task.radius)
        object.__setattr__(self, "model", model)

    @cached_property
    def arena(self) -> Task:
        """The task with the radius of the goals in the world of the cell (:func:`.in_world`)."""
        return in_world(self.task, self.model)

    @cached_property
    def world(self) -> str:
        """Constants in :data:`.WORLD` that differ from the paper's; empty for the paper's world.

        An example is ``motor_noise=0.01``. Other constants, such as tolerances, are not named.
        """
        return describe_parameters(differences(self.model))

    @property
    def setting(self) -> str:
        """Parameters that differ from ``method.defaults``, such as ``noise_sd=0.1``, or ``""``."""
        defaults = self.method.defaults
        return describe_parameters(
            {
                name: value
                for name, value in self.parameters.items()
                if name not in defaults or not same_value(value, defaults[name])
            }
        )

    @property
    def trials(self) -> int | None:
        """Requested number of trials: parameter ``trials``, but at most :attr:`trial_budget`.

        None if the method does not have this parameter.
        """
        trials = trials_in(self.parameters)
        return min(trials, self.trial_budget or trials) or None

    @property
    def label(self) -> str:
        """Id of the method and its setting, such as ``cma-es/bandit sigma=0.1``."""
        return label_of(self.method.name, self.setting)

    @cached_property
    def id(self) -> str:
        """Id of the cell: the first 16 digits of :attr:`digest`, ``-`` and ``MethodInfo.code``."""
        return f"{self.digest[:16]}-{self.method.code}"

    @cached_property
    def definition(self) -> dict[str, Any]:
        """The task as plain data: a dict that maps its fields to values."""
        return self.task.model_dump(mode="json")

    @cached_property
    def digest(self) -> str:
        """Hash of task, id of the method, parameters, model and trial budget: 64 hex digits.

        The codes of methods that the parameters name are hashed as well. The code of the method
        itself and the time limit are not.
        """
        return hash_of(self.content | {"method": self.method.name})

    @property
    def content(self) -> dict[str, Any]:
        """The cell as it is stored: a dict of plain data."""
        return {
            "task": self.definition,
            "method": self.method.content,
            "parameters": self.parameters,
            "model": self.model.stored(self.task.radius),
            "trial_budget": self.trial_budget,
            **({"named": self.named} if self.named else {}),
        }


@dataclass(frozen=True)
class Job:
    """Runs of one cell, with their seed and limits.

    A plan has one job for each cell. To perform a plan, its jobs are divided into smaller jobs; a
    worker process performs the runs of such a job together.
    """

    cell: Cell
    seed: int
    """Seed of the suite."""
    numbers: Sequence[int]
    """Numbers of the runs of the job; the runs of a cell are numbered from 0. In a plan the numbers
    are a range. A results folder stores only the largest number of the range, so that a job with
    the runs 50 to 99 is read back as a job with the runs 0 to 99."""
    time_limit_s: float | None = None
    """Limit of the total CPU time of all runs of the job (in s). None stands for a day
    (:class:`.Local`)."""
    suite: str = ""
    """Name of the suite that asks for the runs."""
    trials: int | None = None
    """Number of trials of a run that the command sets or, by default, that the suite sets. It is at
    most the trial budget. If neither sets a number, it is the trial budget, or None without a
    budget."""
    called: str = ""
    """Name of the runs in rankings, figures and contrasts that the block of the suite gives (key
    ``as``); empty for none."""
    question: tuple[str, str] | None = None
    """Title and description of the suite, if the suite is the user's own and the command adds no
    tasks to it; otherwise None."""
    of_suite: bool = True
    """False for a cell that the command, and not a block of the suite, asks for."""
    contrasts: tuple[tuple[Contrast, int], ...] = ()
    """Contrasts of the suite, each with its number of cells (:attr:`.Registered.cells`)."""

    def run_id(self, number: int) -> str:
        """Return the id of a run.

        The id has the form ``HASH-CODE``. HASH is 16 hex digits of a hash of the cell, the suite's
        seed and the run's number. CODE is ``MethodInfo.code``: the versions of model and method, or
        the hash of a method file.
        """
        text = f"{self.cell.digest} {self.seed} {number}"
        digits = hashlib.sha256(text.encode()).hexdigest()[:16]
        return f"{digits}-{self.cell.method.code}"

    def run_seed(self, number: int) -> int:
        """Return the seed of the random numbers of run ``number`` (:func:`run_seed`)."""
        return run_seed(self.seed, self.cell.task.name, number)

    def judge_seed(self, number: int) -> int:
        """Return the seed of the noise with which run ``number`` is scored (:func:`judge_seed`)."""
        return judge_seed(self.seed, self.cell.task.name, number)


def cell_of(
    task: Task,
    method: MethodInfo,
    parameters: Mapping[str, Any],
    trials: int | None = None,
    trial_budget: int | None = None,
    model: MotionModel = PAPER,
) -> Cell:
    """Return the cell of a method on a task.

    Parameters
    ----------
    task : Task
    method : MethodInfo
    parameters : mapping of str to object
        Dict that maps parameters of the method to values. For a parameter that is not passed, the
        default is used.
    trials : int, optional
        Default of parameter ``trials``, if the method has this parameter. By default it is the
        default of the method.
    trial_budget : int, optional
        Largest number of trials of a run; by default there is no limit.
    model : MotionModel
        Motion model of the runs.

    Returns
    -------
    Cell

    Raises
    ------
    CoarticError
        The method does not accept the parameters.
    """
    if trials is not None and "trials" in method.defaults:
        method = replace(method, defaults=method.defaults | {"trials": trials})
        parameters = {"trials": trials, **parameters}
    complete = method.complete(parameters)
    return Cell(task, method, complete, trial_budget, model, method.codes_named_in(complete))


def tasks_by_name(tasks: Iterable[Task]) -> dict[str, Task]:
    """Return a dict that maps the names of tasks to the tasks.

    Raises CoarticError if two different tasks have the same name.
    """
    named = dict[str, Task]()
    for task in tasks:
        if named.setdefault(task.name, task) != task:
            raise CoarticError(
                f"two tasks have the name {task.name!r}: give one of them another name"
            )
    return named


def run_seed(suite_seed: int, task: str, number: int) -> int:
    """Return the seed of a run.

    The seed depends only on the suite's seed, the task's name and the run's number. It does not
    depend on the method, so that the runs of two methods are paired.
    """
    return _seed_of(suite_seed, task, number)


def judge_seed(suite_seed: int, task: str, number: int) -> int:
    """Return the seed of the noise with which run ``number`` of a task is scored.

    The seed is computed from the suite's seed, the task's name and the run's number. It is the same
    for all methods, and no method sees noise with this seed in its own trials.
    """
    return _seed_of(suite_seed, f"{task} judge", number)


def reference_seed(suite_seed: int, task: str) -> int:
    """Return the seed of the noise for scoring the best known solutions of a task.

    No run uses this seed, neither for its trials nor for its score.
    """
    return _seed_of(suite_seed, f"{task} reference", 0)


def _seed_of(suite_seed: int, text: str, number: int) -> int:
    """Derive a 63-bit seed from another seed, a text and a number."""
    words = np.frombuffer(hashlib.sha256(text.encode()).digest()[:16], dtype="<u4")
    sequence = np.random.SeedSequence(suite_seed, spawn_key=(*map(int, words), number))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))


def hash_of(content: Any) -> str:
    """Return the SHA-256 of plain data as 64 hex digits.

    The hash is computed from the JSON of the data with sorted keys.
    """
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def world_title(world: str) -> str:
    """Return the name of a world for a sentence, such as ``the world motor_noise=0.01``.

    ``world`` is the text of :attr:`Cell.world`; the empty string gives ``the paper's world``.
    """
    return f"the world {world}" if world else "the paper's world"


def trials_in(parameters: Mapping[str, Any]) -> int:
    """Return the value of parameter ``trials``, or 0 if there is no such parameter.

    The result is also 0 if the value is not an ``int`` above 0.
    """
    trials = parameters.get("trials")
    return trials if type(trials) is int and trials > 0 else 0


def size_of(plan: Sequence[Job]) -> int:
    """Return the number of runs of a plan, over all its jobs."""
    return sum(len(job.numbers) for job in plan)


def label_of(method: str, setting: str) -> str:
    """Return a method's id followed by its setting, such as ``cma-es/bandit sigma=0.1``."""
    return f"{method} {setting}".strip()
