"""What a worker process does: it lets a method solve a task, and states what came of it.

It may run code that nobody here has read, so its word is no more than that: what it hands over as
a solution is executed and scored in the parent process, where the method has never been.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from coartic.benchmarks.provenance import process_peak_mb
from coartic.benchmarks.registry import Entry, error_line, method_at
from coartic.errors import NotApplicableError, SolutionError
from coartic.learner.conditions import METHOD_PREFIX
from coartic.learner.learning import warm_up
from coartic.method import (
    BudgetError,
    Information,
    MethodError,
    Result,
    Session,
    UndeclaredError,
)
from coartic.model import PAPER, MotionModel
from coartic.motion.solution import Movement
from coartic.runs.plan import SEARCH
from coartic.runs.store import PARTS
from coartic.tasks.task import Task, parse_task


@dataclass(frozen=True)
class Job:
    """Runs of one cell that are performed side by side: they differ in their seeds alone."""

    task: dict[str, Any]
    method: str
    where: str
    """What is imported: the name of a module, or the path of a method file."""
    is_ours: bool
    """Whether the method is one of this project's."""
    code: str
    told: tuple[str, ...]
    parameters: dict[str, Any]
    seeds: tuple[int, ...]
    model: MotionModel = PAPER
    trial_budget: int | None = None
    time_limit_s: float | None = None
    """CPU time of all its runs together."""
    within_reach: bool = True
    """Whether goals out of reach are refused; how methods cope is checked with such."""


def job_of(
    entry: Entry,
    task: dict[str, Any],
    parameters: dict[str, Any],
    seeds: tuple[int, ...],
    **how: Any,
) -> Job:
    """Runs of a method with all its parameters on a task; ``how`` are further fields of a job."""
    method = (entry.name, entry.where, entry.is_ours, entry.code, entry.told)
    return Job(task, *method, parameters, seeds, **how)


@dataclass
class Outcome:
    """What a method states of one run."""

    status: str
    reason: str = ""
    parts: dict[str, list[Movement]] = field(default_factory=dict)
    """Its solution, and of a learner first trial and replay."""
    bound: int | None = None
    details: dict[str, Any] = field(default_factory=dict)
    used: tuple[str, ...] = ()
    meter: dict[str, Any] = field(default_factory=dict)
    rewards: list[int | None] = field(default_factory=list)


@dataclass
class Answer:
    """What a worker states of a job."""

    outcomes: list[Outcome]
    wall_s: float | None
    """Of all runs together; None where the worker died and nobody knows when it began."""
    cpu_s: float | None = None
    warm: bool | None = None
    """Whether the process had run the method before."""
    process_peak_mb: float | None = None
    environment: dict[str, Any] | None = None
    """Where this is not that of the parent process."""


def failed(
    job: Job,
    status: str,
    reason: str,
    wall_s: float | None = None,
    cpu_s: float | None = None,
) -> Answer:
    """The answer of a job whose worker gave none: ``timeout`` or ``crashed``."""
    return Answer([Outcome(status, reason)] * len(job.seeds), wall_s, cpu_s)


def perform(job: Job) -> Answer:
    """Perform a job. Whatever the method does is an outcome, not an error."""
    task = parse_task(job.task, "a job", reach=job.within_reach)
    sessions = [
        Session(
            task,
            seed,
            map(Information, job.told),  # as declared, whatever became of the class since
            model=job.model,
            trial_budget=job.trial_budget,
            trusted=job.is_ours,
        )
        for seed in job.seeds
    ]
    warm = job.method in _performed
    _performed.add(job.method)
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        results = results_of(job, task, sessions)
    except BaseException as error:
        results = [error] * len(sessions)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    outcomes = [outcome_of(job, *pair) for pair in zip(results, sessions, strict=True)]
    return Answer(outcomes, wall, cpu, warm, process_peak_mb())


def prepare(tasks: Iterable[tuple[dict[str, Any], bool]]) -> None:
    """Compile the kernels for these tasks, or load them, on no run's clock; of each, whether the
    learner is run on it."""
    done = set()
    for definition, learns in tasks:
        task = parse_task(definition, "a job", reach=False)
        if (kernels := (task.robot.most_links, learns)) not in done:
            done.add(kernels)
            warm_up(task, learns=learns)


def learns(method: str) -> bool:
    """Whether a method is the learner, which has a kernel of its own."""
    return method.startswith(METHOD_PREFIX)


_performed: set[str] = set()
_method = cache(method_at)


def results_of(
    job: Job, task: Task, sessions: Sequence[Session]
) -> Sequence[Result | BaseException]:
    """What the method returns in each session."""
    method_class = _method(job.where, job.method)
    method = method_class(method_class.Parameters(**job.parameters))
    reason_not = method.why_not(task)
    if reason_not is not None:
        raise MethodError("infeasible", str(reason_not))
    if len(sessions) == 1:
        return [method.solve(sessions[0])]
    return method.solve_together(sessions)


def outcome_of(job: Job, result: Any, session: Session) -> Outcome:
    """A result as plain data, or how the run failed."""
    spent: dict[str, Any] = {
        "used": tuple(sorted(item.value for item in session.used)),
        "meter": vars(session.meter),
        "rewards": session.rewards,
    }
    try:
        if isinstance(result, MethodError):
            if result.outcome not in ("infeasible", "solver-failed"):
                why = f"it ended with an unknown outcome, {result.outcome!r}: {result}"
                return Outcome("crashed", why, **spent)
            details = plain_details(result.details)
            return Outcome(result.outcome, str(result), details=details, **spent)
        if isinstance(result, BaseException):
            raise result
        return Outcome("ok", **spent, **stated(job.method, result, session))
    except UndeclaredError as error:
        return Outcome("crashed", str(error), **spent)
    except BudgetError as error:
        reason = f"the method did not keep to its budget: {error}"
        return Outcome("crashed", reason, **spent)
    except SolutionError as error:
        return Outcome("solver-failed", str(error), **spent)
    except NotApplicableError as error:
        return Outcome("infeasible", str(error), **spent)
    except BaseException as error:
        return Outcome("crashed", error_line(error), **spent)


def stated(method: str, result: Any, session: Session) -> dict[str, Any]:
    """What a method's result says, as plain data. Raises SolutionError for what cannot be kept."""
    if not isinstance(result, Result):
        raise SolutionError(f"the method returned {type(result).__name__}, not a Result")
    if result.bound is not None and not method.startswith(SEARCH):
        raise SolutionError(f"it states a bound, which is for this project's methods {SEARCH}*")
    try:
        session.check_solution(tuple(result.solution))
        parts = {
            part: [plain_movement(movement) for movement in getattr(result, part)]
            for part in PARTS
            if part == "solution" or getattr(result, part)
        }
        details = plain_details(result.details)
        bound = None if result.bound is None else int(result.bound)
    except (TypeError, ValueError, AttributeError, RecursionError) as error:
        raise SolutionError(f"the method's result cannot be kept: {error_line(error)}") from None
    for part in ("initial", "replay"):
        if any(movement.kind == "path" for movement in parts.get(part, ())):
            raise SolutionError(
                f"movements in {part!r} follow a path; only those of a solution may"
            )
    return {"parts": parts, "details": details, "bound": bound}


def plain_details(details: Any) -> dict[str, Any]:
    """As plain data."""
    return dict(json.loads(json.dumps(details, allow_nan=False)))


def plain_movement(movement: Movement) -> Movement:
    """A movement of plain numbers, texts and arrays."""
    target, waypoints = movement.target, movement.waypoints
    return Movement(
        int(movement.goal),
        str(movement.hand),  # type: ignore[arg-type]
        str(movement.kind),  # type: ignore[arg-type]
        None if target is None else np.array(target, dtype=np.float64),
        waypoints=None if waypoints is None else np.array(waypoints, dtype=np.float64),
    )
