"""Performs runs: builds the method, lets it solve, executes and scores what it returns.

``python -m benchmarks.worker`` is the child process of a sandbox.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from functools import cache
from typing import Any

from benchmarks import store
from benchmarks.methods import Entry, Plugin, build, code_hash, plugin_methods, registry
from benchmarks.provenance import environment
from benchmarks.sandbox import THREADS, die_with_parent
from coartic import CoarticError, MotionModel, Task, execute, parse_task
from coartic.frames import movement_rows
from coartic.learner import warm_up
from coartic.method import BudgetError, MethodError, Session, UndeclaredError

_solved_before: set[str] = set()


class ForeignCodeError(CoarticError):
    """This worker would perform the run with other code than was asked for."""


def perform(job: dict[str, Any]) -> dict[str, Any]:
    """The record of one run. Whatever the method does is an outcome, not an error.

    Raises ForeignCodeError where this process runs other code than the job's.
    """
    specification = job["specification"]
    entry = _entry(specification["method"], job["plugin"])
    if entry.code != job["code"]:
        raise ForeignCodeError(
            f"method {specification['method']!r} has code {entry.code} here and {job['code']} "
            "where the suite was started; install the same version everywhere"
        )
    return perform_on(parse_task(specification["task"], "specification"), entry, job)


def perform_on(task: Task, entry: Entry, job: dict[str, Any]) -> dict[str, Any]:
    """:func:`perform` on a task that is already at hand, valid or not."""
    specification = job["specification"]
    method = build(entry, specification["parameters"])
    session = Session(
        task,
        specification["seed"],
        method.told,
        model=MotionModel(**specification["model"]),
        trial_budget=specification["trial_budget"],
    )
    warm = method.name in _solved_before
    _solved_before.add(method.name)

    status, reason, details = "ok", "", {}
    solution: Any = ()
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        why_not = method.why_not(task)
        if why_not is not None:
            raise MethodError("infeasible", why_not)
        result = method.solve(session)
        solution, details = result.solution, result.details
    except MethodError as error:
        status, reason, details = error.outcome, str(error), error.details
    except UndeclaredError as error:
        status, reason = "crashed", str(error)
    except BudgetError as error:
        status, reason = "crashed", f"the method did not keep to its budget: {error}"
    except CoarticError as error:
        status, reason = "infeasible", str(error)
    except Exception as error:
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
        "environment": _environment(),
    }


def _score(
    task: Task, solution: Any, model: MotionModel
) -> tuple[str, str, dict[str, Any] | None, list[dict[str, Any]]]:
    """Execute a solution apart from its method: the only score that counts."""
    try:
        execution = execute(task, solution, model=model)
    except (CoarticError, TypeError, ValueError, AttributeError, IndexError) as error:
        return "solver-failed", f"the solution cannot be executed: {error}", None, []
    if not execution.completed:
        return "infeasible", execution.reason, None, []
    score = {
        "reward": execution.reward,
        "hands": execution.hands,
        "ticks_by_goal": list(execution.ticks_by_goal()),
        "corrections": execution.corrections,
    }
    return "ok", "", score, movement_rows(task, execution.movements)


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
            return Entry(method, read.filename, code_hash(read.source), read)
    raise ForeignCodeError(f"{read.filename} defines no method {name!r}")


def main() -> None:
    """Answer jobs, one JSON line each, until the input ends."""
    die_with_parent()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a method prints is not an answer
    warm_up()
    answers.write(b"ready\n")
    answers.flush()
    for line in sys.stdin.buffer:
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
