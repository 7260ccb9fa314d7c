"""The conformance kit: what a contributor runs on a new method or task.

Each law is checked on runs with a time limit, in a process that performs them all, and in another
one. A law that cannot be checked fails;
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
from coartic.benchmarks.registry import Entry, Registry
from coartic.benchmarks.reproduce import differences, performed
from coartic.benchmarks.worker import Job, job_of
from coartic.method import METERED
from coartic.runs.store import Run
from coartic.tasks.task import checked_task
from coartic.text import counted

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
    checks = _MethodChecks(entry, tasks or [load_task(name) for name in builtin_tasks()])
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
    def __init__(self, entry: Entry, tasks: Sequence[Task]) -> None:
        self.entry = entry
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
        trials = {"trials": CHECK_TRIALS} if "trials" in self.entry.defaults else {}
        return trials | dict(self.entry.method.quick)

    @cached_property
    def tasks(self) -> list[Task]:
        found = [task for task in self._tasks if self.entry.why_not(task, self.defaults) is None]
        if not found:
            raise _BrokenError("it applies to none of the shipped tasks, so nothing can be checked")
        return found

    def job(self, task: Task, seed: int = 1, budget: int | None = None, **more: Any) -> Job:
        return job_of(
            self.entry,
            task.model_dump(mode="json"),
            self.entry.complete(self.defaults),
            (seed,),
            trial_budget=budget,
            time_limit_s=CHECK_LIMIT_S,
            **more,
        )

    @cached_property
    def runs(self) -> dict[tuple[str, str], Run]:
        """All runs of the check in one process, in this order: by what they are for, and task."""
        asked: list[tuple[str, Task, Job]] = []
        asked += [("first", task, self.job(task)) for task in self.tasks]
        asked += [("again", task, self.job(task)) for task in self.tasks]
        asked += [("other seed", task, self.job(task, seed=2)) for task in reversed(self.tasks)]
        asked += [("after others", task, self.job(task)) for task in self.tasks]
        asked += [("budget", task, self.job(task, budget=_BUDGET)) for task in self.tasks]
        hopeless = _hopeless(self.tasks[0])
        if self.entry.why_not(hopeless, self.defaults) is None:
            asked.append(("hopeless", hopeless, self.job(hopeless, within_reach=False)))
        made = performed(self.entry, [job for *_, job in asked], [task for _, task, _ in asked])
        return {(what, task.name): run for (what, task, _), run in zip(asked, made, strict=True)}

    def each(self, what: str) -> Iterator[tuple[str, Run]]:
        """Runs for something, by task. Raises _BrokenError for one that took too long."""
        for (own, task), run in self.runs.items():
            if own == what:
                if run.status == "timeout":
                    raise _BrokenError(f"on {task}: {run.row['reason']}")
                yield task, run

    def compare(self, what: str, how: str) -> None:
        """Raises _BrokenError where runs for something differ from the first ones."""
        for task, run in self.each(what):
            found = differences(self.runs["first", task], run)
            if found:
                raise _BrokenError(f"{how.format(task)}: {found[0]}")

    def declaration(self) -> str:
        method = self.entry.method
        for attribute in ("title", "citation"):
            if not getattr(method, attribute).strip():
                raise _BrokenError(f"{attribute} is empty")
        return f"{method.title}; told: {', '.join(self.entry.told) or 'nothing'}"

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
        if self.entry.method.Parameters.model_config.get("frozen") is not True:
            raise _BrokenError("they can be changed after validation; freeze them")
        return ", ".join(f"{key}={value}" for key, value in parameters.items()) or "none"

    def solution(self) -> str:
        rewards = []
        for task, run in self.each("first"):
            if run.status != "ok":
                raise _BrokenError(f"on {task}: {run.status}: {run.row['reason']}")
            rewards.append(f"{task} {run.row['reward']}")
        with_what = ", ".join(f"{key}={value}" for key, value in self.defaults.items())
        return (
            "executed and scored on "
            + ", ".join(rewards)
            + (f" (checked with {with_what})" if with_what else "")
        )

    def determinism(self) -> str:
        self.compare("again", "same seed on {}, same process")
        last = self.tasks[-1]
        other = next(performed(self.entry, [self.job(last)], [last]))
        found = differences(self.runs["first", last.name], other)
        if found:
            raise _BrokenError(f"same seed on {last.name}, another process: {found[0]}")
        if not self.entry.method.stochastic:
            self.compare("other seed", "declared not to be stochastic, but another seed on {}")
            return "the same result under any seed, in one process and in another"
        return "same seed, same result, in one process and in another"

    def no_hidden_state(self) -> str:
        self.compare("after others", "after other runs, {} with the same seed")
        return "other runs in between change nothing"

    def limits(self) -> str:
        for task, run in self.each("budget"):
            trials = run.row["trials"] or 0
            if run.status not in ("ok", "infeasible") or trials > _BUDGET:
                raise _BrokenError(
                    f"a budget of {_BUDGET} trials on {task}: "
                    + (run.row["reason"] or f"{trials} were made")
                )
        return f"keeps to a budget of {_BUDGET} trials"

    def information(self) -> str:
        declared = {item.value for item in self.entry.method.told if item in METERED}
        used: set[str] = set()
        for task, run in self.each("first"):
            reason = run.row["reason"]
            if any(words in reason for words in ("does not declare", "own compiled")):
                raise _BrokenError(f"on {task}: {reason}")
            used |= set(filter(None, run.row["used"].split(", ")))
        idle = sorted(declared - used)
        if idle:
            raise _BrokenError(f"declared but never used: {', '.join(idle)}")
        return f"declared and used: {', '.join(sorted(used)) or 'nothing'}"

    def failure(self) -> str:
        for _, run in self.each("hopeless"):
            if run.status not in ("infeasible", "solver-failed"):
                raise _BrokenError(
                    f"on a task that nobody can complete it gives {run.status} "
                    f"{run.row['reason']}; it should give infeasible, with a reason"
                )
            return f"a task that nobody can complete gives {run.status}: {run.row['reason']}"
        return "says beforehand that it does not apply to a task without a solution"


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
