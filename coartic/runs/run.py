"""A run: its key, its specification, its results and its cost."""

from __future__ import annotations

import hashlib
import json
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from coartic.errors import SolutionError
from coartic.learner.run import CORRECTIONS
from coartic.method import Meter
from coartic.model import PAPER
from coartic.motion.reach import compiled_task
from coartic.motion.solution import Execution, Movement, execute_many
from coartic.runs.plan import Specification, run_seed
from coartic.tasks.task import Task

RESULTS = {
    "run_id": "TEXT NOT NULL UNIQUE",
    "setting": "INTEGER NOT NULL REFERENCES settings",
    "suite_seed": "INTEGER NOT NULL",
    "run": "INTEGER NOT NULL",  # number of the run, from 0
    "seed": "INTEGER NOT NULL",
    "status": "TEXT NOT NULL",  # one of STATUSES
    "reason": "TEXT NOT NULL",  # empty where status is ok
    "hands": "TEXT",  # of the solution, such as LRLR
    "reward": "INTEGER",  # of the solution, executed and scored by the harness
    "replay_reward": "INTEGER",  # one noiseless greedy trial with what was learned
    "replay_hands": "TEXT",
    "initial_reward": "INTEGER",  # trial 0 of a learner
    "initial_hands": "TEXT",
    "best_trial": "INTEGER",  # first trial with the solution's reward, if any
    **dict.fromkeys(Meter.COUNTS, "INTEGER"),
    "solution_corrections": "INTEGER",  # corrective movements the solution needed
    "early_corrections": "INTEGER",  # in a learner's first tenth of trials after trial 0
    "late_corrections": "INTEGER",  # in the last tenth
    "other_arm_travel": "REAL",  # of the arm that is not chosen, rad
    "proven_bound": "INTEGER",  # reward that no solution exceeds, where proven
    "build_s": "REAL",
    "solve_s": "REAL",
    "wall_s": "REAL",
    "cpu_s": "REAL",
    "warm": "INTEGER",  # the process had run this method before
    "together": "INTEGER",  # runs of its batch; times are equal shares
    "process_peak_mb": "REAL",  # of the worker so far, all its runs included
    "time_limit_s": "REAL",
    "date": "TEXT NOT NULL",
    "environment": "INTEGER NOT NULL REFERENCES environments",
    "used": "TEXT NOT NULL",  # declared information that the method used, comma-separated
    "details": "TEXT NOT NULL",  # whatever the method keeps beside its solution, JSON
    "result": "TEXT NOT NULL",  # hash of status, solutions, rewards of all trials, bound
}
"""Columns of table ``results`` beside its ``id``."""
STATUSES = ("ok", "infeasible", "solver-failed", "timeout", "crashed")
"""Statuses of a run."""
MOST_MOVEMENTS = 10_000
"""Movements of one solution."""
MOST_STEPS = 1_000_000
"""Movement steps along one solution, its targets visited in order: thousands do."""
PREFIXES = {"solution": "", "initial": "initial_", "replay": "replay_"}
"""How columns of each part begin."""
PARTS = tuple(PREFIXES)
"""Parts of a run that are scored: its solution, the first trial of a learner, and one noiseless
greedy trial with what it has learned."""


_AS_THEY_ARE = (
    *("suite_seed", "status", "reason", "date", "time_limit_s"),
    *("solution_corrections", "other_arm_travel"),
)
"""Columns that are attributes of a run."""


class Score(NamedTuple):
    """One part of a run as the harness executed it."""

    reward: int
    hands: str
    movements: tuple[Movement, ...]


@dataclass(frozen=True)
class Times:
    """Time and memory that a run took: an equal share of its batch's time."""

    wall_s: float | None = None
    """None where the worker died and nobody knows when it began."""
    cpu_s: float | None = None
    warm: bool | None = None
    """Whether the process had run the method before."""
    together: int = 1
    """Runs of the batch."""
    process_peak_mb: float | None = None
    """Of the worker so far, all its runs included."""


@dataclass(frozen=True)
class Run:
    """One run."""

    specification: Specification
    suite_seed: int
    number: int
    """From 0, within its cell."""
    status: str
    """One of :data:`STATUSES`."""
    reason: str
    """Why it is not ok; empty where it is."""
    environment: dict[str, Any]
    """Versions, platform, processor, threads and commit that it was made with."""
    date: str
    time_limit_s: float | None = None
    scores: dict[str, Score] = field(default_factory=dict)
    """By part (:data:`PARTS`), of those that there are."""
    rewards: list[int | None] = field(default_factory=list)
    """Reward of each trial; None where it failed, or is not kept."""
    meter: Meter | None = None
    """None where the worker died."""
    times: Times = Times()
    solution_corrections: int | None = None
    """Corrective movements that the solution needed."""
    other_arm_travel: float | None = None
    """Travel of the arm that is not chosen, rad."""
    bound: int | None = None
    """Reward that no solution exceeds, where proven."""
    used: tuple[str, ...] = ()
    """Declared information that the method used."""
    details: dict[str, Any] = field(default_factory=dict)
    """Whatever the method keeps beside its solution."""

    @cached_property
    def id(self) -> str:
        """A hash of specification, seed of the suite and number, then that of the code."""
        return self.specification.run_id(self.suite_seed, self.number)

    @property
    def seed(self) -> int:
        """The seed of its random numbers."""
        return run_seed(self.suite_seed, self.specification.task.name, self.number)

    @property
    def reward(self) -> int | None:
        """Reward of the solution, if there is one."""
        return self.scores["solution"].reward if "solution" in self.scores else None

    @property
    def hands(self) -> str | None:
        """Hands of the solution, such as ``LRLR``, if there is one."""
        return self.scores["solution"].hands if "solution" in self.scores else None

    @property
    def best_trial(self) -> int | None:
        """The first trial with the solution's reward, if any."""
        if self.reward is None or self.reward not in self.rewards:
            return None
        return self.rewards.index(self.reward)

    @property
    def is_downsampled(self) -> bool:
        """Whether rewards of some trials are not kept (:meth:`downsample`)."""
        return self.meter is not None and self.rewards.count(None) > self.meter.failed_trials

    def downsample(self) -> Run:
        """The run with the rewards of its best trial and of trials that were better than all before
        alone; the others are None. It takes a tenth of the room."""
        best, solved, kept = -math.inf, self.best_trial, list[int | None]()
        for trial, reward in enumerate(self.rewards):
            better = reward is not None and reward > best
            kept.append(reward if better or trial == solved else None)
            best = max(best, -math.inf if reward is None else reward)
        return replace(self, rewards=kept)

    @cached_property
    def result(self) -> str:
        """Hash of status, solutions to the last joint, rewards of all trials, bound.

        Equal for runs that came out the same, whatever was spent on the way.
        """
        parts: list[Any] = [self.status, self.bound, self.rewards]
        for part in PARTS:
            parts += [[part, *movement] for movement in self.movement_data(part)]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]

    def movement_data(self, part: str) -> list[list[Any]]:
        """The movements of a part as plain data; none where there is no such part.

        SQLite keeps no sign of zero; adding 0.0 loses it here as well.
        """
        data = []
        for m in self.scores[part].movements if part in self.scores else ():
            arrays = (m.target, m.waypoints)
            places = [None if array is None else (array + 0.0).tolist() for array in arrays]
            data.append([m.goal, m.hand, m.kind, m.ticks, *places])
        return data

    def to_row(self) -> dict[str, Any]:
        """Its columns of table ``results``, apart from the numbers of other tables' rows."""
        row: dict[str, Any] = dict.fromkeys(RESULTS)
        del row["setting"], row["environment"]
        corrections = self.details.get(CORRECTIONS)
        if isinstance(corrections, list) and len(corrections) == 11:  # trial 0 and ten tenths
            row |= {"early_corrections": corrections[1], "late_corrections": corrections[-1]}
        for part, score in self.scores.items():
            prefix = PREFIXES[part]
            row |= {f"{prefix}reward": score.reward, f"{prefix}hands": score.hands}
        return row | {
            "run_id": self.id,
            "run": self.number,
            "seed": self.seed,
            "best_trial": self.best_trial,
            **{name: getattr(self, name) for name in _AS_THEY_ARE},
            **(vars(self.meter) if self.meter else {}),
            "proven_bound": self.bound,
            **asdict(self.times),
            "used": ", ".join(self.used),
            "details": json.dumps(self.details),
            "result": self.result,
        }

    @classmethod
    def from_row(
        cls,
        row: Mapping[str, Any],
        specification: Specification,
        environment: dict[str, Any],
        movements: Mapping[str, tuple[Movement, ...]],
        rewards: list[int | None],
    ) -> Run:
        """A run from its columns, its movements by part, and the rewards of its trials.

        Raises ValueError where it is not the run of its id.
        """
        made_trials = row["trials"] is not None
        run = cls(
            **{name: row[name] for name in _AS_THEY_ARE},
            specification=specification,
            number=row["run"],
            environment=environment,
            scores={
                part: Score(row[f"{PREFIXES[part]}reward"], row[f"{PREFIXES[part]}hands"], solution)
                for part, solution in movements.items()
                if solution
            },
            rewards=rewards,
            meter=Meter(**{name: row[name] for name in vars(Meter())}) if made_trials else None,
            times=Times(**{each.name: row[each.name] for each in fields(Times)}),
            bound=row["proven_bound"],
            used=tuple(filter(None, row["used"].split(", "))),
            details=json.loads(row["details"]),
        )
        if (run.id, run.seed) != (row["run_id"], row["seed"]):
            raise ValueError(f"run {row['run_id']} is not the run that its id says")
        return run


def movements_from(
    task: Task, rows: Iterable[Mapping[str, Any]], waypoints: Iterable[Mapping[str, Any]] = ()
) -> tuple[Movement, ...]:
    """The movements of one solution from its rows of ``solutions``, and from those of ``paths`` for
    movements of kind ``path``. Raises ValueError where a joint is not a finite number."""

    def joints(row: Mapping[str, Any]) -> list[float]:
        return [row[name] for name in task.robot.joint_names]

    points: dict[int, list[list[float]]] = defaultdict(list)
    for row in sorted(waypoints, key=itemgetter("waypoint")):
        points[row["order"]].append(joints(row))
    movements = []
    for row in sorted(rows, key=itemgetter("order")):
        target, path = np.array(joints(row), dtype=np.float64), None
        if row["kind"] == "path":
            path = np.array(points[row["order"]], dtype=np.float64).reshape(-1, len(target))
        if not all(np.isfinite(each).all() for each in (target, path) if each is not None):
            raise ValueError("a joint is not a finite number")
        movements.append(
            Movement(int(row["goal"]), row["hand"], row["kind"], target, int(row["ticks"]), path)
        )
    return tuple(movements)


def execute_all(task: Task, solutions: Sequence[Sequence[Movement]]) -> list[Execution | Exception]:
    """Execute solutions side by side: the only scores that count.

    In place of an execution, the error of a solution that breaks the task's rules.
    """
    errors = [too_long(task, solution) for solution in solutions]
    short = [s for s, error in zip(solutions, errors, strict=True) if error is None]
    executions = iter(execute_many(compiled_task(task, PAPER), short))
    return [next(executions) if error is None else error for error in errors]


def too_long(task: Task, solution: Sequence[Movement]) -> SolutionError | None:
    """The error of a solution that would take very long to execute."""
    if len(solution) > MOST_MOVEMENTS:
        return SolutionError(f"{len(solution)} movements; at most {MOST_MOVEMENTS} are allowed")
    corners = [task.q0]
    for movement in solution:
        corners += [] if movement.waypoints is None else list(movement.waypoints)
        corners += [] if movement.target is None else [movement.target]
    if len({np.shape(corner) for corner in corners}) == 1:  # or it breaks the rules
        steps = np.sqrt((np.diff(corners, axis=0) ** 2).sum(axis=1)).sum() / PAPER.step
        if steps > MOST_STEPS:
            return SolutionError(
                f"its path has {steps:.0f} steps; at most {MOST_STEPS} are allowed"
            )
    return None
