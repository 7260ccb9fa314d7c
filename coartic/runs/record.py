"""The record of a run: its job, outcome and scores, and the columns under which it is stored."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from types import SimpleNamespace
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, InstanceOf

from coartic.errors import SolutionError
from coartic.internal.limits import real_array
from coartic.learner.learning_run import CORRECTIONS_BY_TENTH
from coartic.method import MOST_COUNT, Meter
from coartic.model import PAPER
from coartic.motion.movement import segment_lengths
from coartic.motion.solution import Execution, Movement, execute_many
from coartic.motion.trial import compiled_task
from coartic.runs.plan import Cell, Job
from coartic.tasks.task import Task

Status = Literal["ok", "infeasible", "solver-failed", "timeout", "crashed"]
"""Status of a run."""
PREFIXES = {"solution": "", "initial": "initial_", "replay": "replay_"}
"""Prefixes of columns by the part of a run that the columns score: ``solution``, ``initial`` (the
first trial of a learner) and ``replay`` (one noiseless greedy trial after learning)."""
PARTS = tuple(PREFIXES)
UNREPEATED = "made_again"
"""Entry of the details of a run that was made again with another result: what differs."""
_MOST_MOVEMENTS = 10_000
"""Most movements of a solution."""
_MOST_NUMBERS = 400_000
"""Most numbers in the start, targets and waypoints of a solution."""
MOST_STEPS = 1_000_000
"""Most movement steps of a solution from the start straight through its targets and waypoints."""


class Score(NamedTuple):
    """Score of a part of a run (solution, initial or replay), from its execution; None where
    blank."""

    reward: int | None = None
    """Total reward, minus the ticks."""
    hands: str | None = None
    """Hand of each goal, such as ``LRLR``."""
    movements: tuple[Movement, ...] = ()
    """Movements as executed, with their ticks."""
    corrections: int | None = None
    """Corrective movements that a solution needed."""
    other_arm_travel: float | None = None
    """Joint travel of the arm that a solution does not choose, rad."""


@dataclass(frozen=True)
class Times:
    """Time and memory of a run. Runs of one job share the time of the job evenly."""

    wall_s: float | None = None
    """Wall time, s; None if unknown."""
    cpu_s: float | None = None
    """CPU time, s; None if unknown."""
    warm: bool | None = None
    """True if the process had run the method before; None if unknown."""
    together: int = 1
    """Number of runs of the job."""
    process_peak_mb: float | None = None
    """Most memory of the worker so far, MiB, with all its earlier runs; None if unknown."""


@dataclass(frozen=True)
class Outcome:
    """The result of a run, without scores."""

    status: Status
    """``ok``, ``infeasible``, ``solver-failed``, ``timeout`` or ``crashed``."""
    reason: str = ""
    """The reason why the run is not ok; empty if the run is ok."""
    parts: dict[str, list[InstanceOf[Movement]]] = field(default_factory=dict)
    """Movements by part (``solution``, ``initial``, ``replay``), not yet executed and scored."""
    details: dict[str, Any] = field(default_factory=dict)
    """Further data that the method or the process keeps, by name."""
    used: tuple[str, ...] = ()
    """Declared information that the method used."""
    meter: Meter | None = None
    """Counts of trials, of evaluations and of movements; None if the worker gave no answer."""
    rewards: list[Annotated[int, Field(gt=-(2**31), lt=2**31)] | None] = field(default_factory=list)
    """Reward of each trial; None if the trial failed or its reward is not kept."""
    times: Times = Times()
    environment: dict[str, Any] | None = None
    """Versions, platform, processor, variables, arithmetic and commit, by name, or only the entries
    that differ from the environment of the process that scores the run."""


@dataclass(frozen=True)
class Run:
    """A run: its job, its outcome and the scores of its parts."""

    job: Job
    """A job of this run alone."""
    outcome: Outcome
    """The outcome, without ``parts``: the scores have their movements."""
    scores: dict[str, Score]
    """Scores by part (``solution``, ``initial``, ``replay``); empty if the run is not ok."""
    date: str
    """Date and time at which the run was scored, UTC."""

    @property
    def cell(self) -> Cell:
        """Task, method and parameters of the run (:class:`Cell`)."""
        return self.job.cell

    @property
    def number(self) -> int:
        """Number of the run, from 0 within its cell."""
        return self.job.numbers[0]

    @cached_property
    def id(self) -> str:
        """Id of the run: 16 hex digits, a hyphen, and the version or code of the method."""
        return self.job.run_id(self.number)

    @property
    def seed(self) -> int:
        """Seed of the random numbers."""
        return self.job.run_seed(self.number)

    @property
    def solution(self) -> Score:
        """Score of the solution; a blank score if the run is not ok."""
        return self.scores.get("solution", Score())

    @property
    def initial(self) -> Score:
        """Score of a learner's first trial; blank if the trial or the run failed, or for other
        methods."""
        return self.scores.get("initial", Score())

    @property
    def replay(self) -> Score:
        """Score of a learner's greedy trial after learning; blank if the trial or the run failed,
        or for other methods."""
        return self.scores.get("replay", Score())

    @property
    def counts(self) -> Any:
        """Counts of the run, by the names of :class:`~coartic.method.Meter`, each None if the
        worker gave no answer."""
        return self.outcome.meter or SimpleNamespace(**dict.fromkeys(vars(Meter())))

    @property
    def best_trial(self) -> int | None:
        """The first trial with the reward of the solution, from 0; None if no trial has it."""
        reward, rewards = self.solution.reward, self.outcome.rewards
        return None if reward is None or reward not in rewards else rewards.index(reward)

    @property
    def early_corrections(self) -> int | None:
        """Corrective movements in the first tenth of a learner's trials after trial 0; None if they
        were not counted."""
        return self._corrections(1)

    @property
    def late_corrections(self) -> int | None:
        """Corrective movements in the last tenth of a learner's trials after trial 0; None if they
        were not counted."""
        return self._corrections(-1)

    def _corrections(self, place: int) -> int | None:
        """Return the corrective movements of a learner in tenth ``place``, from 1 (-1: the last),
        of its trials after trial 0; None unless the details have a list of 11 counts."""
        counts = self.outcome.details.get(CORRECTIONS_BY_TENTH)
        if not isinstance(counts, list) or len(counts) != 11:
            return None
        are_counts = all(type(count) is int and 0 <= count <= MOST_COUNT for count in counts)
        return counts[place] if are_counts else None

    @property
    def is_downsampled(self) -> bool:
        """True if rewards of some trials that did not fail are not kept: None in their place."""
        meter = self.outcome.meter
        return meter is not None and self.outcome.rewards.count(None) > meter.failed_trials

    def downsample(self) -> Run:
        """Return a copy of the run with the rewards of its best trial and of each trial that was
        better than all earlier trials, and None as the reward of other trials."""
        best, solved, kept = -math.inf, self.best_trial, list[int | None]()
        for trial, reward in enumerate(self.outcome.rewards):
            better = reward is not None and reward > best
            kept.append(reward if better or trial == solved else None)
            best = max(best, -math.inf if reward is None else reward)
        return replace(self, outcome=replace(self.outcome, rewards=kept))

    @cached_property
    def result(self) -> str:
        """Hash, 16 hex digits, of status, movements with their ticks and configurations, and the
        rewards that are kept; not of times and counts."""
        movements = [[part, *each] for part in PARTS for each in self.movement_data(part)]
        content = json.dumps([self.outcome.status, *movements]).encode()
        return hashlib.sha256(content + reward_bytes(self.outcome.rewards)).hexdigest()[:16]

    def movement_data(self, part: str) -> list[list[Any]]:
        """Return the movements of a part (``solution``, ``initial`` or ``replay``), each as a list
        for JSON (:func:`movement_data`); an empty list if the run lacks the part."""
        return [movement_data(each) for each in self.scores.get(part, Score()).movements]

    def to_row(self) -> dict[str, Any]:
        """Return the columns of the run in table ``results`` by name, without the ids of rows that
        the store adds: ``id``, ``cell`` and ``environment``."""
        row = {name: attrgetter(source)(self) for name, _, source, _ in COLUMNS if source}
        details = json.dumps(self.outcome.details)
        used = ", ".join(self.outcome.used)
        return row | {"suite_seed": self.job.seed, "used": used, "details": details}


COLUMNS = (
    ("run_id", "TEXT NOT NULL UNIQUE", "id",
     "hash of task, method, parameters and seed, with the version or code of the method"),
    ("suite", "TEXT", "", "name of the suite"),
    ("task", "TEXT", "", "name of the task"),
    ("method", "TEXT", "", "id of the method"),
    ("setting", "TEXT", "", "parameters that are not the defaults"),
    ("run", "INTEGER NOT NULL", "number", "number of the run, from 0"),
    ("seed", "INTEGER NOT NULL", "seed", "the same for every method on a task and `run`"),
    ("status", "TEXT NOT NULL", "outcome.status",
     "`ok`, `infeasible`, `solver-failed`, `timeout` or `crashed`"),
    ("reason", "TEXT NOT NULL", "outcome.reason", "why the run is not ok"),
    ("hands", "TEXT", "solution.hands", "hand of each goal in the solution, such as `LRLR`"),
    ("reward", "INTEGER", "solution.reward", "of the solution; of a learner its best trial"),
    ("replay_reward", "INTEGER", "replay.reward",
     "of one more trial of a learner, greedy and without noise"),
    ("replay_hands", "TEXT", "replay.hands", "hand of each goal in that trial"),
    ("initial_reward", "INTEGER", "initial.reward",
     "of a learner's first trial: the corrective process alone"),
    ("initial_hands", "TEXT", "initial.hands", "hand of each goal in that trial"),
    ("best_trial", "INTEGER", "best_trial", "first trial that got `reward`, from 0"),
    ("trials", "INTEGER", "counts.trials", "physical trials, as many as `--trials` says"),
    ("initial_trials", "INTEGER", "counts.initial_trials",
     "trials besides, of the search for the first hands, where the [task](howto/task.md) names "
     "a rule for them"),
    ("movement_ticks", "INTEGER", "counts.movement_ticks", "control ticks of all these trials"),
    ("forward_kinematics", "INTEGER", "counts.forward_kinematics",
     "evaluations of the forward kinematics"),
    ("jacobians", "INTEGER", "counts.jacobians", "evaluations of the Jacobian"),
    ("corrective_iterations", "INTEGER", "counts.corrective_iterations",
     "iterations of the corrective process"),
    ("corrections", "INTEGER", "counts.corrections",
     "corrective movements of all these trials"),
    ("failed_trials", "INTEGER", "counts.failed_trials", "trials that missed a goal"),
    ("gradients", "INTEGER", "counts.gradients", "evaluations of a solver's gradient"),
    ("hessians", "INTEGER", "counts.hessians", "evaluations of a solver's Hessian"),
    ("solver_iterations", "INTEGER", "counts.solver_iterations", "iterations of a solver"),
    ("solution_corrections", "INTEGER", "solution.corrections",
     "corrective movements of the solution"),
    ("early_corrections", "INTEGER", "early_corrections",
     "corrective movements in the first tenth of a learner's trials after its first trial"),
    ("late_corrections", "INTEGER", "late_corrections",
     "corrective movements in the last tenth"),
    ("other_arm_travel", "REAL", "solution.other_arm_travel",
     "joint travel of the arm that is not chosen, rad"),
    ("build_s", "REAL", "counts.build_s", "seconds of setting up a solver's problems"),
    ("solve_s", "REAL", "counts.solve_s", "seconds of solving, without compiling"),
    ("wall_s", "REAL", "outcome.times.wall_s", "seconds of wall time"),
    ("cpu_s", "REAL", "outcome.times.cpu_s", "seconds of CPU time"),
    ("warm", "BOOLEAN", "outcome.times.warm",
     "whether the process had run the method before"),
    ("together", "INTEGER", "outcome.times.together",
     "runs that one process made side by side; they share their time evenly"),
    ("process_peak_mb", "REAL", "outcome.times.process_peak_mb",
     "most memory of the process so far, MiB"),
    ("time_limit_s", "REAL", "job.time_limit_s", "limit of CPU time, seconds"),
    ("date", "TEXT NOT NULL", "date", "date and time at the end, UTC"),
    ("used", "TEXT NOT NULL", "outcome.used",
     "declared information that the method used"),
    ("result", "TEXT NOT NULL", "result",
     "hash of the outcome; runs with the same value are identical"),
    ("information", "TEXT", "", "information that the method declares"),
    ("parameters", "TEXT", "", "all parameters of the method, as JSON"),
    ("commit", "TEXT", "", "commit of the checkout, with + if it was changed since"),
    ("code", "TEXT", "",
     "versions of model and method, such as `1.2`; of a method file a hash of its code"),
    ("packages", "TEXT", "", "hash of the versions of Python and of libraries"),
)  # fmt: skip
"""Columns of view ``runs``, which has a row for each stored run of the plan; SQL, data frames and
documentation follow from them. Each has its name; its type in SQL, with ``NOT NULL`` if table
``results`` has a value for every run; the attribute of :class:`Run` that table ``results`` stores,
empty for a column of another table; and a phrase of the documentation."""


def movement_data(movement: Movement) -> list[Any]:
    """Return a movement as a list of goal, hand, kind, ticks and path: the form in which workers
    send, hashes count and folders store movements.

    The path is JSON: the target, or the waypoints of a movement of kind ``path``, without the sign
    of -0.0; None stands for missing ticks and a missing target. Raises an error, such as TypeError
    or ValueError, for a movement that has no such form.
    """
    m, place = movement, movement.target
    if m.waypoints is not None:
        if m.kind != "path" or not (place is None or np.array_equal(place, m.waypoints[-1])):
            raise ValueError("only a path has waypoints, and its target is the last of them")
        place = m.waypoints
    numbers = None if place is None else (real_array("a path", place) + 0.0).tolist()
    text = None if numbers is None else json.dumps(numbers, separators=(",", ":"))
    return [int(m.goal), str(m.hand), str(m.kind), m.ticks and int(m.ticks), text]


def movement_from(data: Sequence[Any]) -> Movement:
    """Return a movement from the list that :func:`movement_data` returns. Other data may raise
    TypeError, ValueError or IndexError."""
    goal, hand, kind, ticks, text = data
    place = None if text is None else np.array(json.loads(text), np.float64)
    if kind == "path" and place is not None:
        return Movement(goal, hand, kind, place[-1], ticks, place)
    return Movement(goal, hand, kind, place, ticks)


def reward_bytes(rewards: Sequence[int | None]) -> bytes:
    """Return the rewards of trials as bytes, four a number; the caller packs them.

    The first number is the best reward, signed (0 without any reward). Then each trial has the
    number of ticks by which it is worse, plus 1, or 0 if its reward is None. All lowest bytes of
    the numbers come first, then all next bytes: so they pack best.
    """
    values = np.array(rewards, np.float64)  # None becomes NaN
    best = 0.0 if np.isnan(values).all() else np.nanmax(values)
    numbers = np.append(best, np.where(np.isnan(values), 0.0, best - values + 1.0))
    return numbers.astype(np.int64).astype("<u4").view(np.uint8).reshape(-1, 4).T.tobytes()


def execute_all(task: Task, solutions: Sequence[Sequence[Movement]]) -> list[Execution | Exception]:
    """Execute solutions of a task, whose targets and waypoints are arrays of floats, under the
    paper's model. Return a list with the execution of each solution, in order; in its place the
    error, not raised, of a solution that breaks the rules of the task or is too long
    (:func:`too_long`)."""
    errors = [too_long(task, solution) for solution in solutions]
    short = [s for s, error in zip(solutions, errors, strict=True) if error is None]
    executions = iter(execute_many(compiled_task(task, PAPER), short))
    return [next(executions) if error is None else error for error in errors]


def too_long(task: Task, solution: Sequence[Movement]) -> SolutionError | None:
    """Return the error of a solution with more than 10,000 movements, with more numbers (in the
    start, waypoints and targets) than :data:`_MOST_NUMBERS`, or, if all configurations have the
    shape of the start, with more steps from the start through them than :data:`MOST_STEPS`; None
    for any other solution. Targets and waypoints are arrays."""
    if len(solution) > _MOST_MOVEMENTS:
        return SolutionError(f"{len(solution)} movements; at most {_MOST_MOVEMENTS} are allowed")
    corners = [task.q0]
    for movement in solution:
        corners += [] if movement.waypoints is None else list(movement.waypoints)
        corners += [] if movement.target is None else [movement.target]
    if (count := sum(map(np.size, corners))) > _MOST_NUMBERS:
        return SolutionError(f"its paths have {count} numbers; at most {_MOST_NUMBERS} are allowed")
    shapes = {np.shape(corner) for corner in corners}
    if len(shapes) == 1:  # otherwise the solution breaks the rules
        with np.errstate(over="ignore"):
            steps = segment_lengths(corners).sum() / PAPER.step
        if steps > MOST_STEPS:
            return SolutionError(
                f"its path has {steps:.0f} steps; at most {MOST_STEPS} are allowed"
            )
    return None
