"""Let methods solve tasks in worker processes, and return the outcomes as JSON.

A method can run any code. Therefore the parent process does not import method files. It checks the
form of the outcome that the worker sends, and executes and scores the solution itself.
"""

from __future__ import annotations

import json
import logging
import resource
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter

from coartic.errors import NotApplicableError, SolutionError
from coartic.internal.text import error_line, pluralize
from coartic.method import (
    Information,
    MethodError,
    Result,
    Session,
    UndeclaredError,
    outline_of,
    reason_against,
)
from coartic.method.as_method import reason_against_named, solve_in
from coartic.motion.trials import trials_outside
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job
from coartic.runs.record import PARTS, Outcome, Times, movement_data, movement_from

_log = logging.getLogger(__name__)  # shown by ``coartic check --verbose``


_OUTCOMES = TypeAdapter(list[Outcome])
_MAX_DETAILS_LENGTH = 10_000_000
_MALFORMED = ValueError, TypeError, ArithmeticError, AttributeError, LookupError, RecursionError
"""Errors that malformed data raises."""


def peak_rss_mib() -> float:
    """Return the peak resident set size of this process so far (in MiB).

    On Linux, the value of a process that was started by exec includes the peak of its parent.
    """
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def fail(
    job: Job,
    status: Literal["timeout", "crashed"],
    reason: str,
    wall_s: float | None = None,
    cpu_s: float | None = None,
) -> list[Outcome]:
    """Return an outcome for each run of a job that has no usable answer.

    Parameters
    ----------
    job : Job
    status : {"timeout", "crashed"}
        Status of all runs of the job.
    reason : str
        Why the job has no usable answer.
    wall_s, cpu_s : float, optional
        Wall time and CPU time of the job (in s), which are divided equally among its runs. By
        default they are unknown.

    Returns
    -------
    list of Outcome
        An outcome for each run of the job.
    """
    runs = len(job.numbers)
    times = Times(wall_s and wall_s / runs, cpu_s and cpu_s / runs, together=runs)
    return [Outcome(status, reason, times=times) for _ in job.numbers]


def answer_of(outcomes: Sequence[Outcome]) -> bytes:
    """Encode outcomes as JSON: a list of objects with the fields of :class:`Outcome`.

    In movements, a NaN of a target is written as ``null`` (:func:`.movement_data`). Elsewhere NaN
    and infinity are written as ``NaN`` and ``Infinity``, which Python's module ``json`` reads.
    Raises TypeError, ValueError or RecursionError for data that JSON cannot represent.
    """

    def plain(outcome: Outcome) -> dict[str, Any]:
        parts = {
            part: [*map(movement_data, movements)] for part, movements in outcome.parts.items()
        }
        meter, times = outcome.meter and vars(outcome.meter), vars(outcome.times)
        return vars(outcome) | {"meter": meter, "times": times, "parts": parts}

    return json.dumps(list(map(plain, outcomes))).encode()


def outcomes_from(job: Job, answer: bytes) -> list[Outcome]:
    """Decode the outcomes of a job from its answer (:func:`answer_of`).

    If the answer is malformed, or does not have an outcome for each run of the job, all outcomes
    have status ``crashed``.
    """
    try:
        content = json.loads(answer)
        for outcome in content:
            parts = outcome["parts"].items()
            outcome["parts"] = {part: [*map(movement_from, movements)] for part, movements in parts}
        outcomes = _OUTCOMES.validate_python(content)
        if len(outcomes) == len(job.numbers):
            return outcomes
        reason = f"{len(outcomes)} for {pluralize(len(job.numbers), 'run')}"
    except _MALFORMED as error:
        reason = error_line(error)
    return fail(job, "crashed", f"its outcomes cannot be read: {reason}")


def perform_job(job: Job) -> list[Outcome]:
    """Perform the runs of a job in this process, and return their outcomes.

    An error that the method raises is not raised here: it determines the status and the reason of
    the outcomes. If the job has several runs, the method makes all of them in one call
    (:meth:`.Method.solve_together`).

    Parameters
    ----------
    job : Job

    Returns
    -------
    list of Outcome
        Outcome of each run, in the order of ``job.numbers``.
    """
    cell, name = job.cell, job.cell.method.name
    sessions = [
        Session(
            cell.arena,
            job.run_seed(number),
            # the declared information, because a method could change its class
            map(Information, cell.method.information),
            model=cell.model,
            trial_budget=cell.trial_budget,
            trusted=cell.method.is_ours,
            of_run=True,
        )
        for number in job.numbers
    ]
    budget = cell.trial_budget or "any number of"
    _log.debug("%s on %s: seed %s, %s trials", name, cell.task.name, job.seed, budget)
    warm = name in _seen
    _seen.add(name)
    wall, cpu, outside_trials = time.perf_counter(), time.process_time(), trials_outside()
    try:
        method = cell.method.configure(cell.parameters)
        results: Sequence[Any]
        outline = outline_of(cell.arena)
        reason_not = method.refuses(cell.model) or reason_against(method, outline)
        if cell.method.is_ours:
            reason_not = reason_not or reason_against_named(cell.parameters, outline, cell.model)
        if reason_not is not None:
            raise MethodError("infeasible", str(reason_not))
        if cell.method.is_ours:
            results = solve_in(method, sessions)
        else:
            results = [method.solve(session) for session in sessions]
        outside_trials = trials_outside() - outside_trials
        if outside_trials and not cell.method.is_ours:
            raise UndeclaredError(
                f"the method made {pluralize(outside_trials, 'trial')} outside its session, which "
                "are not counted: by coartic.objective, learn, execute or an environment"
            )
    except BaseException as error:
        results = [error] * len(sessions)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    runs = len(sessions)
    times = Times(wall / runs, cpu / runs, warm, runs, peak_rss_mib())
    pairs = zip(results, sessions, strict=True)
    return [_outcome_of(cell.method, result, session, times) for result, session in pairs]


_seen: set[str] = set()
"""Ids of the methods that this process has run."""


def _outcome_of(method: MethodInfo, result: Any, session: Session, times: Times) -> Outcome:
    """Return the outcome of a run.

    Parameters
    ----------
    method : MethodInfo
        Method of the run.
    result : object
        What the method returned, or the error that it raised.
    session : Session
        Session of the run, with its counts and the rewards of its trials.
    times : Times
        Times and memory of the run.
    """
    try:
        if isinstance(result, MethodError):
            details = _plain_details(result.details)
            outcome = Outcome(result.outcome, str(result), details=details)
        elif isinstance(result, BaseException):
            raise result
        else:
            outcome = Outcome("ok", **statement(result, session))
    except SolutionError as error:
        outcome = Outcome("solver-failed", str(error))
    except NotApplicableError as error:
        outcome = Outcome("infeasible", str(error))
    except BaseException as error:
        _log.debug("Traceback of the run:", exc_info=error)
        reason = _place_of(error, method) + error_line(error) + _limit_met(error)
        outcome = Outcome("crashed", reason)
    return replace(
        outcome,  # a solution can use the corrective process
        used=tuple(sorted(item.value for item in session.used)),
        meter=session.meter,
        rewards=session.rewards,
        times=times,
    )


def _limit_met(error: BaseException) -> str:
    """Return words on the limit of the memory of this process, for an error that it may cause.

    NumPy and Python raise MemoryError; other libraries and the system say that they cannot
    *allocate* memory.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_DATA)
    if limit == resource.RLIM_INFINITY:
        return ""
    if not (isinstance(error, MemoryError) or "allocate" in str(error)):
        return ""
    return (
        f". The limit of a process is {limit / 2**30:.1f} GiB: 80 % of the machine's memory, "
        "divided by the number of processes; give a smaller --jobs"
    )


def _place_of(error: BaseException, method: MethodInfo) -> str:
    """Return where a method file caused an error, such as ``mine.py, line 12: ``.

    The line is the last line of the file in the traceback of the error. The result is an empty
    string if the traceback has no line of the file, and for built-in methods.
    """
    if method.is_ours:
        return ""
    module = sys.modules.get(method.where)
    file = str(getattr(module, "__file__", method.where))
    frames = traceback.walk_tb(error.__traceback__)
    lines = [line for frame, line in frames if frame.f_code.co_filename == file]
    return f"{Path(file).name}, line {lines[-1]}: " if lines else ""


def statement(result: Any, session: Session) -> dict[str, Any]:
    """Return the fields ``parts`` and ``details`` of an outcome from the result of a method.

    Parameters
    ----------
    result : object
        What the method returned.
    session : Session
        Session of the run, which checks that the solution uses only declared information.

    Returns
    -------
    dict
        ``parts`` is a dict that maps ``solution``, and ``initial`` and ``replay`` if they are not
        empty, to lists of movements. ``details`` is a copy of the details as plain data.

    Raises
    ------
    SolutionError
        The result is not a Result, or cannot be stored.
    UndeclaredError
        The solution has a corrective movement without a target, and the method does not declare the
        corrective process.
    """
    if not isinstance(result, Result):
        raise SolutionError(f"the method returned {type(result).__name__}; it must return a Result")
    try:
        parts = {
            part: [movement_from(movement_data(movement)) for movement in getattr(result, part)]
            for part in PARTS
            if part == "solution" or getattr(result, part)
        }
        session.check_solution(parts["solution"])
        details = _plain_details(result.details)
    except _MALFORMED as error:
        raise SolutionError(f"the method's result cannot be stored: {error_line(error)}") from None
    return {"parts": parts, "details": details}


def _plain_details(details: Any) -> dict[str, Any]:
    """Return a copy of the details of a result as plain data.

    Raises TypeError, ValueError or RecursionError for details that JSON cannot represent, or whose
    JSON has more than 10,000,000 characters.
    """
    text = json.dumps(details, allow_nan=False, ensure_ascii=False)
    if len(text) > _MAX_DETAILS_LENGTH:
        raise ValueError(
            f"details have {len(text):,} characters; at most {_MAX_DETAILS_LENGTH:,} are allowed"
        )
    return dict(json.loads(text.encode()))
