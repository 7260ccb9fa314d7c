"""Performs runs: builds the method, lets it solve, executes and scores what it returns.

``python -m benchmarks.worker`` is the child process of a sandbox.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from datetime import UTC, datetime
from functools import cache
from typing import Any

from benchmarks import store
from benchmarks.methods import (
    BUILT_IN_ORIGIN,
    Entry,
    Plugin,
    build,
    code_hash,
    file_source,
    plugin_methods,
    registry,
    why_not,
)
from benchmarks.provenance import environment
from benchmarks.sandbox import THREADS, die_with_parent
from coartic import (
    CoarticError,
    MotionModel,
    Movement,
    NotApplicableError,
    Task,
    execute,
    parse_task,
)
from coartic.errors import SolutionError
from coartic.frames import movement_rows
from coartic.learner import warm_up
from coartic.method import BudgetError, MethodError, Result, Session, UndeclaredError
from coartic.solution import other_arm_travel

_solved_before: set[str] = set()


class ForeignCodeError(CoarticError):
    """This worker would perform the run with other code than was asked for."""


def perform(job: dict[str, Any]) -> dict[str, Any]:
    """The record of one run. Whatever the method does is an outcome, not an error.

    Raises ForeignCodeError where this process runs other code than the job's.
    """
    specification = job["specification"]
    try:
        entry = _entry(specification["method"], job["plugin"])
    except CoarticError as error:
        raise ForeignCodeError(f"method {specification['method']!r}: {error}") from None
    if entry.code != job["code"]:
        raise ForeignCodeError(
            f"method {specification['method']!r} has code {entry.code} here and {job['code']} "
            "where the suite was started; install the same version everywhere"
        )
    task = parse_task(specification["task"], "specification", reach=job["reach"])
    method = build(entry, specification["parameters"])
    session = Session(
        task,
        specification["seed"],
        method.told,
        model=MotionModel(**specification["model"]),
        trial_budget=specification["trial_budget"],
        trusted=entry.origin == BUILT_IN_ORIGIN,
    )
    warm = method.name in _solved_before
    _solved_before.add(method.name)

    status, reason = "ok", ""
    details: dict[str, Any] = {}
    solution: Any = ()
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        reason_against = why_not(entry, task, specification["parameters"])
        if reason_against is not None:
            raise MethodError("infeasible", reason_against)
        solution, details = _checked(method.solve(session))
        session.check_solution(solution)
    except MethodError as error:
        status, reason, details = error.outcome, str(error), error.details
    except UndeclaredError as error:
        status, reason = "crashed", str(error)
    except BudgetError as error:
        status, reason = "crashed", f"the method did not keep to its budget: {error}"
    except (_ResultError, SolutionError) as error:
        status, reason = "solver-failed", str(error)
    except NotApplicableError as error:
        status, reason = "infeasible", str(error)
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        status, reason = "crashed", f"{type(error).__name__}: {error}"
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu

    score: dict[str, Any] | None = None
    movements: list[dict[str, Any]] = []
    if status == "ok":
        status, reason, score, movements = _score(task, solution, session.model)
    return {
        "run_id": job["run_id"],
        "run": job["run"],
        "specification": specification,
        "code": entry.code,
        "status": status,
        "reason": reason,
        "score": score,
        "solution": movements,
        "told": sorted(method.told),
        "secondary": list(method.secondary),
        "used": sorted(session.used),
        "meter": session.meter.as_dict(),
        "details": details,
        "rewards": session.rewards,
        "timing": {
            "wall_s": wall,
            "cpu_s": cpu,
            "warm": warm,
            "process_peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "time_limit_s": job["time_limit_s"],
        },
        "origin": job["origin"],
        "environment": {
            **_environment(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": job["command"],
        },
    }


def _score(
    task: Task, solution: Any, model: MotionModel
) -> tuple[str, str, dict[str, Any] | None, list[dict[str, Any]]]:
    """Execute a solution apart from its method: the only score that counts."""
    try:
        execution = execute(task, solution, model=model)
        movements = movement_rows(task, execution.movements)
    except (CoarticError, TypeError, ValueError, AttributeError, IndexError) as error:
        return "solver-failed", f"the solution cannot be executed: {error}", None, []
    if not execution.completed:
        return "infeasible", execution.reason, None, []
    # What is stored must give the score by itself, without the corrective process.
    again = execute(task, execution.movements, model=model)
    if again.ticks_by_goal() != execution.ticks_by_goal() or again.hands != execution.hands:
        raise AssertionError(f"{execution.reward} re-executes to {again.reward}")
    score = {
        "reward": execution.reward,
        "hands": execution.hands,
        "ticks_by_goal": list(execution.ticks_by_goal()),
        "corrections": execution.corrections,
        "other_arm_travel": other_arm_travel(task, execution),
    }
    return "ok", "", score, movements


class _ResultError(ValueError):
    """What a method returned is no result."""


def _checked(result: Any) -> tuple[tuple[Movement, ...], dict[str, Any]]:
    """Solution and details of a result, if it is one and can be kept."""
    if not isinstance(result, Result):
        raise _ResultError(f"the method returned {type(result).__name__}, not a Result")
    try:
        movements = tuple(result.solution)
        details = json.loads(json.dumps(result.details, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise _ResultError(f"the method's result cannot be kept: {error}") from None
    if not isinstance(details, dict):
        raise _ResultError(f"the method's details are {type(details).__name__}, not a dict")
    return movements, details


@cache
def _environment() -> dict[str, Any]:
    return {**environment(), "threads": {name: os.environ.get(name) for name in THREADS}}


@cache
def _built_in() -> dict[str, Entry]:
    return registry()


def _entry(name: str, plugin: list[str] | None) -> Entry:
    if plugin is None:
        known = _built_in()
        if name not in known:
            raise ForeignCodeError(f"method {name!r} is not installed on this worker")
        return known[name]
    read = Plugin(*plugin)
    for method in plugin_methods(read):
        if method.name == name:
            return Entry(method, read.filename, code_hash(file_source(read.source)), read)
    raise ForeignCodeError(f"{read.filename} defines no method {name!r}")


def main() -> None:
    """Answer jobs, one JSON line each, until the input ends."""
    die_with_parent(int(sys.argv[1]))
    jobs, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a method prints is not an answer
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # and what it reads is not a job
    warm_up()
    answers.write(b"ready\n")
    answers.flush()
    for line in jobs:
        record = "{}"
        try:
            performed = perform(json.loads(line))
            answer = {"status": performed["status"]}
            record = store.encode(performed)
        except ForeignCodeError as error:
            answer = {"failure": "foreign", "reason": str(error)}
        # The record goes as text: nobody on its way to the disk has to read it.
        answers.write(f"{json.dumps(answer)}\n{record}\n".encode())
        answers.flush()


if __name__ == "__main__":
    main()
