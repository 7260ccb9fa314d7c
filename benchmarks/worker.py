"""The process that methods run in: it describes them, asks them, lets them solve.

Its guard starts it (:mod:`coartic.benchmarks.guard`). It reads questions and writes answers, one
JSON line each. It may run code that nobody has read, so nothing that it says is more than a
statement: what it hands over as a solution is executed and scored elsewhere.
"""

from __future__ import annotations

import gc
import json
import os
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any

from pydantic_core import PydanticSerializationError, to_json

from coartic import CoarticError, MotionModel, NotApplicableError, Task, parse_task
from coartic.benchmarks.code_identity import built_in_code, built_in_sources, foreign_code
from coartic.benchmarks.declaration import (
    Foreign,
    MethodFileError,
    brief,
    built_in_methods,
    completed,
    declared,
    methods_of,
    reason_against,
)
from coartic.benchmarks.guard import THREADS
from coartic.benchmarks.provenance import environment, process_peak_mb
from coartic.errors import SolutionError
from coartic.learner.learning import warm_up
from coartic.method import (
    BudgetError,
    Information,
    Method,
    MethodError,
    Result,
    Session,
    UndeclaredError,
)
from coartic.runs.record import SOLUTIONS
from coartic.runs.scores import PlainMovement

_solved_before: set[str] = set()


class ForeignCodeError(CoarticError):
    """This worker would perform the run with other code than was asked for."""


def answer(question: dict[str, Any]) -> Any:
    """What is asked for, as plain data. Raises CoarticError where that cannot be had."""
    what = question["question"]
    if what == "prepare":
        warm_up(parse_task(question["task"], "a job", reach=False), learns=question["learns"])
        return "ready"
    if what == "solve":
        return perform(question)
    foreign = Foreign(**question["foreign"])
    if what == "describe":
        return [declared(method).model_dump(mode="json") for method in _foreign_methods(foreign)]
    method = _method(question["method"], foreign)
    if what == "complete":
        return completed(method, question["parameters"])
    if what == "applies":
        task = parse_task(question["task"], "task", reach=False)
        return reason_against(method, task, question["parameters"])
    raise CoarticError(f"nobody knows what {what!r} asks for")


def perform(job: dict[str, Any]) -> dict[str, Any]:
    """What a method states of each run of a job, and in what time they were made, with what.

    Whatever a method does is an outcome, not an error.

    Runs that are performed side by side have equal shares of the time. Raises
    ForeignCodeError where this process runs other code than the job's.
    """
    specification, foreign = job["specification"], job["foreign"]
    name = specification["method"]
    method_class = _method_as_asked(name, None if foreign is None else Foreign(**foreign), job)
    task = parse_task(specification["task"], "specification", reach=job["reach"])
    sessions = [
        Session(
            task,
            seed,
            map(Information, job["told"]),  # as declared, whatever became of the class since
            model=MotionModel(**specification["model"]),
            trial_budget=specification["trial_budget"],
            trusted=foreign is None,
        )
        for seed in job["seeds"]
    ]
    method = method_class(method_class.Parameters(**specification["parameters"]))
    warm = name in _solved_before
    _solved_before.add(name)
    wall, cpu = time.perf_counter(), time.process_time()
    outcomes = _outcomes(method, specification["parameters"], task, sessions)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    runs, limit_s = len(sessions), job["time_limit_s"]
    timing = {
        "wall_s": wall / runs,
        "cpu_s": cpu / runs,
        "warm": warm,
        "together": runs,
        "process_peak_mb": process_peak_mb(),
        "time_limit_s": None if limit_s is None else limit_s / runs,
    }
    surroundings = {
        **_environment(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": job["command"],
    }
    stated = [
        {
            **outcome,
            "used": sorted(session.used),
            "meter": session.meter.as_dict(),
            "rewards": session.rewards,
        }
        for session, outcome in zip(sessions, outcomes, strict=True)
    ]
    return {"timing": timing, "environment": surroundings, "runs": stated}


def _method_as_asked(name: str, foreign: Foreign | None, job: dict[str, Any]) -> type[Method]:
    """The method of a job, with the job's code. Raises ForeignCodeError otherwise."""
    try:
        method = _method(name, foreign, job.get("module"))
        if foreign is None and job["sources"] == built_in_sources(job["code"]):
            return method  # to the letter what the job's code was made of
        code = built_in_code(method.__module__) if foreign is None else _foreign_code(foreign)
    except CoarticError as error:
        raise ForeignCodeError(f"method {name!r}: {error}") from None
    if code != job["code"]:
        raise ForeignCodeError(
            f"method {name!r} has code {code} here and {job['code']} where the suite was "
            "started; install the same version everywhere"
        )
    return method


def _outcomes(
    method: Method, parameters: dict[str, Any], task: Task, sessions: Sequence[Session]
) -> list[dict[str, Any]]:
    """Status, reason, and the result as plain data where there is one, of each session."""

    def results() -> Sequence[Result | MethodError]:
        reason_not = reason_against(type(method), task, parameters)
        if reason_not is not None:
            raise MethodError("infeasible", reason_not)
        if len(sessions) == 1:
            return [method.solve(sessions[0])]
        return method.solve_together(sessions)

    try:
        found = results()
    except BaseException as error:
        return [_outcome(error, session) for session in sessions]
    return [_outcome(result, session) for result, session in zip(found, sessions, strict=True)]


def _outcome(result: Any, session: Session) -> dict[str, Any]:
    status, reason = "ok", ""
    stated: dict[str, Any] = {}
    try:
        if isinstance(result, BaseException):
            raise result
        stated = _stated(result, session)
    except MethodError as error:
        status, reason, stated = error.outcome, str(error), {"details": error.details}
    except UndeclaredError as error:
        status, reason = "crashed", str(error)
    except BudgetError as error:
        status, reason = "crashed", f"the method did not keep to its budget: {error}"
    except (_ResultError, SolutionError) as error:
        status, reason = "solver-failed", str(error)
    except NotApplicableError as error:
        status, reason = "infeasible", str(error)
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        status, reason = "crashed", brief(error)
    return {"status": status, "reason": reason, **stated}


class _ResultError(ValueError):
    """What a method returned is no result."""


def _stated(result: Any, session: Session) -> dict[str, Any]:
    """A result as plain data, if it is one."""
    if not isinstance(result, Result):
        raise _ResultError(f"the method returned {type(result).__name__}, not a Result")
    session.check_solution(tuple(result.solution))
    try:
        stated = {
            name: [dict(vars(PlainMovement.of(movement))) for movement in getattr(result, name)]
            for name in SOLUTIONS
        }
        others = {"details": result.details, "bound": result.bound}
        json.dumps(others, allow_nan=False)
    except (TypeError, ValueError, AttributeError, RecursionError) as error:
        raise _ResultError(f"the method's result cannot be kept: {brief(error)}") from None
    return {**stated, **others}


@cache
def _environment() -> dict[str, Any]:
    return {**environment(), "threads": {name: os.environ.get(name) for name in THREADS}}


@cache
def _foreign_methods(foreign: Foreign) -> list[type[Method]]:
    return methods_of(foreign)


@cache
def _foreign_code(foreign: Foreign) -> str:
    return foreign_code(foreign)


def _method(name: str, foreign: Foreign | None, module: str | None = None) -> type[Method]:
    """Of this project's methods those of one module alone are imported."""
    if foreign is not None:
        methods, missing = _foreign_methods(foreign), f"{foreign.where} defines no method {name!r}"
    elif module is not None:
        methods, missing = [*built_in_methods(module)], "it is not installed on this worker"
    else:
        methods, missing = [], "another version asks for it; install the same everywhere"
    for method in methods:
        if method.name == name:
            return method
    raise MethodFileError(missing)


def main() -> None:
    """Answer questions until the input ends."""
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a method prints is not an answer
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # and what it reads is not a question
    answers.write(f"{os.getpid()}\n".encode())
    answers.flush()
    for line in questions:
        said: dict[str, Any] = {"error": None, "answer": None}
        question = json.loads(line)
        token = question.pop("token")
        if question["question"] != "prepare" and not gc.isenabled():
            gc.freeze()  # what was imported and compiled until now
            gc.enable()
        try:
            said["answer"] = answer(question)
            text = _json(said)
        except CoarticError as error:
            other = isinstance(error, ForeignCodeError)
            text = _json({"error": str(error), "answer": None, "foreign_code": other})
        except (Exception, SystemExit, KeyboardInterrupt) as error:
            text = _json({"error": brief(error), "answer": None})
        answers.write(token.encode() + b" " + text + b"\n")
        answers.flush()


def _json(said: dict[str, Any]) -> bytes:
    try:
        return to_json(said)  # a tenth of the time of what comes next
    except PydanticSerializationError:  # half a character, say
        return json.dumps(said, allow_nan=False).encode()
