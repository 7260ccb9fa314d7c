"""The conformance kit: what a contributor runs on a new method or task.

Each law is checked by performing runs in processes of their own, with a time limit: one
that lives through the whole check, and another one. A law that cannot be checked fails;
it is never skipped silently.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from coartic import (
    CoarticError,
    NotApplicableError,
    Task,
    TaskError,
    builtin_tasks,
    corrective_trial,
    initial_hands,
    load_task,
    parse_task,
)
from coartic.benchmarks.harness import record_of
from coartic.benchmarks.registry import Entry, Registry
from coartic.benchmarks.reproduce import differences, perform_once
from coartic.benchmarks.sandbox import Keeper, keeper
from coartic.benchmarks.specification import Limits, RunSpec, Setting
from coartic.method import METERED
from coartic.runs.record import Record
from coartic.tasks.task import checked_task
from coartic.text import counted, plain

CHECK_TRIALS = 60  # enough to learn something, few enough to be quick
CHECK_LIMIT_S = 120.0
_BUDGET = 7


@dataclass(frozen=True)
class Law:
    """One law and what was found."""

    name: str
    passed: bool
    finding: str


class _BrokenError(Exception):
    """A law does not hold; the message says what was seen."""


def check_method(
    entry: Entry, *, laws: Collection[str] | None = None, tasks: Sequence[Task] | None = None
) -> list[Law]:
    """Every law of a method, in order, on the shipped tasks; or some laws, or on other tasks."""
    with keeper() as own:
        checks = _MethodChecks(entry, own, tasks or [load_task(name) for name in builtin_tasks()])
        return list(_run(c for c in checks.laws() if laws is None or c[0] in laws))


def check_task_file(path: Path, known: Registry) -> list[Law]:
    """Every law of a task file, in order."""
    return list(_run(_TaskChecks(path, known).laws()))


Check = tuple[str, Callable[[], str]]


def _run(checks: Iterable[Check]) -> Iterator[Law]:
    for name, check in checks:
        try:
            yield Law(name, True, check())
        except _BrokenError as broken:
            yield Law(name, False, str(broken))
        except CoarticError as error:
            yield Law(name, False, str(error))
        except Exception as error:
            yield Law(name, False, f"the check broke: {type(error).__name__}: {error}")


class _MethodChecks:
    def __init__(self, entry: Entry, own: Keeper, tasks: Sequence[Task]) -> None:
        self.entry = entry
        self._keeper = own
        self._tasks = tasks

    def laws(self) -> Iterator[Check]:
        yield "declaration", self.declaration
        yield "parameters", self.parameters
        yield "solution", self.solution
        yield "determinism", self.determinism
        yield "no hidden state", self.no_hidden_state
        yield "limits", self.limits
        yield "information", self.information
        yield "failure", self.failure

    @cached_property
    def defaults(self) -> dict[str, Any]:
        """Parameters of the check: few trials where the method has trials."""
        trials = {"trials": CHECK_TRIALS} if "trials" in self.fields else {}
        return trials | self.entry.declared.quick

    @cached_property
    def fields(self) -> dict[str, Any]:
        return dict(self.entry.declared.defaults)

    @cached_property
    def tasks(self) -> list[Task]:
        found = [task for task in self._tasks if self.entry.why_not(task, self.defaults) is None]
        if not found:
            raise _BrokenError("it applies to none of the shipped tasks, so nothing can be checked")
        return found

    def spec(self, task: Task, seed: int = 1, budget: int | None = None) -> RunSpec:
        limits = Limits(CHECK_LIMIT_S, budget)
        return Setting(task, self.entry, tuple(self.defaults.items()), limits).spec(0, seed)

    def record(self, task: Task, seed: int = 1, budget: int | None = None) -> Record:
        """A run in the process that lives through the whole check."""
        spec = self.spec(task, seed, budget)
        return self.perform(spec, spec.job())

    def perform(self, spec: RunSpec, job: dict[str, Any]) -> Record:
        answer = self._keeper.perform(job)
        if "failure" in answer:
            raise _BrokenError(f"{answer['failure']}: {plain(answer['reason'])}")
        return record_of(answer, spec)

    @cached_property
    def first_records(self) -> list[tuple[Task, Record]]:
        return [(task, self.record(task)) for task in self.tasks]

    def declaration(self) -> str:
        method = self.entry.declared
        for attribute in ("title", "citation"):
            if not getattr(method, attribute).strip():
                raise _BrokenError(f"{attribute} is empty")
        told = ", ".join(sorted(method.told)) or "nothing"
        return f"{method.title}; told: {told}"

    def parameters(self) -> str:
        parameters = self.entry.complete({})
        again = self.entry.complete(parameters)
        if again != parameters:
            raise _BrokenError(
                f"written as JSON and read back, they change: {parameters} became {again}"
            )
        try:
            self.entry.complete({"no_such_parameter": 1})
        except CoarticError:
            pass
        else:
            raise _BrokenError("an unknown parameter is accepted; forbid extra keys")
        if not self.entry.declared.frozen:
            raise _BrokenError("they can be changed after validation; freeze them")
        return ", ".join(f"{key}={value}" for key, value in parameters.items()) or "none"

    def solution(self) -> str:
        rewards = []
        for task, record in self.first_records:
            if record.solution is None:
                raise _BrokenError(f"on {task.name}: {record.status}: {record.reason}")
            rewards.append(f"{task.name} {record.solution.reward}")
        with_what = ", ".join(f"{key}={value}" for key, value in self.defaults.items())
        return (
            "executed and scored on "
            + ", ".join(rewards)
            + (f" (checked with {with_what})" if with_what else "")
        )

    def determinism(self) -> str:
        for task, record in self.first_records:
            found = differences(record, self.record(task))
            if found:
                raise _BrokenError(f"same seed on {task.name}, same process: {found[0]}")
        task, record = self.first_records[-1]
        found = differences(record, perform_once(self.spec(task)))
        if found:
            raise _BrokenError(f"same seed on {task.name}, another process: {found[0]}")
        if not self.entry.declared.stochastic:
            found = differences(record, self.record(task, seed=2))
            if found:
                raise _BrokenError(
                    f"declared not to be stochastic, but another seed on {task.name}: {found[0]}"
                )
            return "the same result under any seed, in one process and in another"
        return "same seed, same result, in one process and in another"

    def no_hidden_state(self) -> str:
        for task in reversed(self.tasks):
            self.record(task, seed=2)
        for task, record in self.first_records:
            found = differences(record, self.record(task))
            if found:
                raise _BrokenError(f"after other runs, {task.name} with the same seed: {found[0]}")
        return "other runs in between change nothing"

    def limits(self) -> str:
        for task in self.tasks:
            record = self.record(task, budget=_BUDGET)
            trials = 0 if record.meter is None else record.meter.trials
            if record.status not in ("ok", "infeasible") or trials > _BUDGET:
                raise _BrokenError(
                    f"a budget of {_BUDGET} trials on {task.name}: "
                    + (record.reason or f"{trials} were made")
                )
        return f"keeps to a budget of {_BUDGET} trials"

    def information(self) -> str:
        declared = {item.value for item in self.entry.declared.told if item in METERED}
        used: set[str] = set()
        for task, record in self.first_records:
            if any(words in record.reason for words in ("does not declare", "own compiled")):
                raise _BrokenError(f"on {task.name}: {record.reason}")
            used |= set(record.used)
        idle = sorted(declared - used)
        if idle:
            raise _BrokenError(f"declared but never used: {', '.join(idle)}")
        return f"declared and used: {', '.join(sorted(used)) or 'nothing'}"

    def failure(self) -> str:
        task = _hopeless(self.tasks[0])
        if self.entry.why_not(task, self.defaults) is not None:
            return "says beforehand that it does not apply to a task without a solution"
        spec = self.spec(task)
        record = self.perform(spec, {**spec.job(), "reach": False})
        if record.status not in ("infeasible", "solver-failed"):
            raise _BrokenError(
                f"on a task that nobody can complete it gives {record.status} {record.reason}; "
                "it should give infeasible, with a reason"
            )
        return f"a task that nobody can complete gives {record.status}: {record.reason}"


def _hopeless(like: Task) -> Task:
    """A task beyond reach, which validation would refuse, with the hands of another."""
    return like.model_copy(
        update={
            "name": "hopeless",
            "goals": ((9e3, 9e3),),
            "locked_base": ("x", "y"),
            "initial_hands": "R" if "right" in like.hands else "L",
            "provenance": {},
        }
    )


class _TaskChecks:
    def __init__(self, path: Path, known: Registry) -> None:
        self.path = path
        self.known = known

    def laws(self) -> Iterator[Check]:
        yield "valid", self.valid
        yield "serialisable", self.serialisable
        yield "name", self.own_name
        yield "distinct goals", self.distinct_goals
        yield "solvable", self.solvable
        yield "provenance", self.provenance
        yield "methods", self.methods

    @cached_property
    def loaded(self) -> Task | TaskError:
        try:
            return load_task(self.path)
        except TaskError as error:
            return error

    @property
    def task(self) -> Task:
        if isinstance(self.loaded, TaskError):
            raise _BrokenError("not checked, as the file is not valid")
        return self.loaded

    def valid(self) -> str:
        if isinstance(self.loaded, TaskError):
            raise _BrokenError(str(self.loaded))
        goals = counted(len(self.task.goals), "goal")
        return f"{self.task.name}, {goals}, {' and '.join(self.task.hands)} hand"

    def serialisable(self) -> str:
        content = json.loads(json.dumps(self.task.model_dump(mode="json")))
        if parse_task(content, str(self.path)) != self.task:
            raise _BrokenError("it changes when it is written as JSON and read back")
        return "survives being written as JSON"

    def own_name(self) -> str:
        name = self.task.name
        if name in builtin_tasks() and load_task(name) != self.task:
            raise _BrokenError(f"name {name!r} belongs to a different, shipped task")
        return f"name {name!r} is its own"

    def distinct_goals(self) -> str:
        goals = self.task.goal_array
        for index in range(1, len(goals)):
            gap = float(np.hypot(*(goals[index] - goals[index - 1])))
            if gap <= self.task.radius:
                raise _BrokenError(
                    f"goals {index} and {index + 1} lie within one radius of each other: "
                    "hitting the first nearly hits the second"
                )
        return "successive goals lie apart"

    def solvable(self) -> str:
        try:
            hands = initial_hands(checked_task(self.task))
        except (NotApplicableError, TaskError) as error:
            raise _BrokenError(str(error)) from None
        execution = corrective_trial(self.task, hands)
        if not execution.completed:
            raise _BrokenError(f"initial hands {hands}: {execution.reason}")
        return f"initial hands {hands} complete it with {execution.reward}"

    def provenance(self) -> str:
        missing = [key for key in ("goals", "start") if key not in self.task.provenance]
        if missing:
            raise _BrokenError(f"no source and status for {' and '.join(missing)} ([provenance])")
        return "goals and start have a source and a status"

    def methods(self) -> str:
        names = [name for name, entry in self.known.items() if entry.why_not(self.task) is None]
        if not names:
            raise _BrokenError("no method applies to it")
        return ", ".join(names)
