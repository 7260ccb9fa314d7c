"""The conformance kit: what a contributor runs on a new method or task.

Each law is checked on runs with a time limit, in a process that performs them all, and in another
one. A law that cannot be checked fails; it is never skipped silently.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import dist
from pathlib import Path
from typing import Any

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
BUDGET = 7  # trials of the runs that are to keep to it


@dataclass(frozen=True)
class Law:
    """One law and what was found."""

    name: str
    passed: bool
    finding: str


class BrokenLawError(CoarticError):
    """A law does not hold; the message says what was seen."""


Check = Callable[[], str]
"""Says what was found; raises BrokenLawError where the law does not hold."""


def check_method(
    entry: Entry, *, laws: Collection[str] | None = None, tasks: Sequence[Task] | None = None
) -> list[Law]:
    """Every law of a method, in order, on the shipped tasks; or some laws, or on other tasks."""
    checks = MethodChecks(entry, tasks or [load_task(name) for name in builtin_tasks()])
    return check_laws(
        {name: check for name, check in checks.by_law().items() if laws is None or name in laws}
    )


def check_laws(checks: Mapping[str, Check]) -> list[Law]:
    """What each check finds, by the name of its law."""
    laws = []
    for name, check in checks.items():
        try:
            laws.append(Law(name, True, check()))
        except CoarticError as error:
            laws.append(Law(name, False, str(error)))
        except Exception as error:
            laws.append(Law(name, False, f"the check broke: {type(error).__name__}: {error}"))
    return laws


class MethodChecks:
    """The laws of a method, with the runs on which they are checked."""

    def __init__(self, entry: Entry, tasks: Sequence[Task]) -> None:
        self.entry = entry
        trials = {"trials": CHECK_TRIALS} if "trials" in entry.defaults else {}
        self.parameters = trials | dict(entry.method.quick)
        self.tasks = [task for task in tasks if self.applies_to(task)]

    def by_law(self) -> dict[str, Check]:
        """The checks, in order."""
        return {
            "declaration": self.declaration,
            "parameters": self.keeps_parameters,
            "solution": self.solution,
            "determinism": self.determinism,
            "no hidden state": self.no_hidden_state,
            "limits": self.limits,
            "information": self.information,
            "failure": self.failure,
        }

    def applies_to(self, task: Task) -> bool:
        """Whether the method, with the parameters of the check, applies to a task."""
        return self.entry.why_not(task, self.parameters) is None

    def job(self, task: Task, seed: int = 1, budget: int | None = None, **more: Any) -> Job:
        """A run of the method on a task."""
        return job_of(
            self.entry,
            task.model_dump(mode="json"),
            self.entry.complete(self.parameters),
            (seed,),
            trial_budget=budget,
            time_limit_s=CHECK_LIMIT_S,
            **more,
        )

    @cached_property
    def runs(self) -> dict[tuple[str, str], Run]:
        """All runs of the check in one process, in this order: by what they are for, and task."""
        if not self.tasks:
            raise BrokenLawError(
                "it applies to none of the shipped tasks, so nothing can be checked"
            )
        wanted: list[tuple[str, Task, Job]] = []
        wanted += [("first", task, self.job(task)) for task in self.tasks]
        wanted += [("again", task, self.job(task)) for task in self.tasks]
        wanted += [("other seed", task, self.job(task, seed=2)) for task in reversed(self.tasks)]
        wanted += [("after others", task, self.job(task)) for task in self.tasks]
        wanted += [("budget", task, self.job(task, budget=BUDGET)) for task in self.tasks]
        hopeless = hopeless_task(self.tasks[0])
        if self.applies_to(hopeless):
            wanted.append(("hopeless", hopeless, self.job(hopeless, within_reach=False)))
        runs = performed([job for *_, job in wanted], [task for _, task, _ in wanted])
        return {(what, task.name): run for (what, task, _), run in zip(wanted, runs, strict=True)}

    def each(self, what: str) -> Iterator[tuple[str, Run]]:
        """Runs for something, by task. Raises BrokenLawError for one that took too long."""
        for (purpose, task), run in self.runs.items():
            if purpose == what:
                if run.status == "timeout":
                    raise BrokenLawError(f"on {task}: {run.row['reason']}")
                yield task, run

    def compare(self, what: str, how: str) -> None:
        """Raises BrokenLawError where runs for something differ from the first ones."""
        for task, run in self.each(what):
            for difference in differences(self.runs["first", task], run):
                raise BrokenLawError(f"{how.format(task)}: {difference}")

    def declaration(self) -> str:
        """It says what it is."""
        method = self.entry.method
        for attribute in ("title", "citation"):
            if not getattr(method, attribute).strip():
                raise BrokenLawError(f"{attribute} is empty")
        return f"{method.title}; told: {', '.join(self.entry.told) or 'nothing'}"

    def keeps_parameters(self) -> str:
        """Its parameters survive JSON, are checked and cannot be changed."""
        parameters = self.entry.complete({})
        again = self.entry.complete(parameters)
        if again != parameters:
            raise BrokenLawError(
                f"written as JSON and read back, they change: {parameters} became {again}"
            )
        try:
            self.entry.complete({"no_such_parameter": 1})
        except CoarticError:
            pass
        else:
            raise BrokenLawError("an unknown parameter is accepted; forbid extra keys")
        if self.entry.method.Parameters.model_config.get("frozen") is not True:
            raise BrokenLawError("they can be changed after validation; freeze them")
        return ", ".join(f"{key}={value}" for key, value in parameters.items()) or "none"

    def solution(self) -> str:
        """Its solutions can be executed and hit every goal."""
        rewards = []
        for task, run in self.each("first"):
            if run.status != "ok":
                raise BrokenLawError(f"on {task}: {run.status}: {run.row['reason']}")
            rewards.append(f"{task} {run.row['reward']}")
        with_what = ", ".join(f"{key}={value}" for key, value in self.parameters.items())
        checked_with = f" (checked with {with_what})" if with_what else ""
        return f"executed and scored on {', '.join(rewards)}{checked_with}"

    def determinism(self) -> str:
        """The same seed gives the same result."""
        self.compare("again", "same seed on {}, same process")
        last = self.tasks[-1]
        other = next(performed([self.job(last)], [last]))
        for difference in differences(self.runs["first", last.name], other):
            raise BrokenLawError(f"same seed on {last.name}, another process: {difference}")
        if not self.entry.method.stochastic:
            self.compare("other seed", "declared not to be stochastic, but another seed on {}")
            return "the same result under any seed, in one process and in another"
        return "same seed, same result, in one process and in another"

    def no_hidden_state(self) -> str:
        """Runs before it change nothing."""
        self.compare("after others", "after other runs, {} with the same seed")
        return "other runs in between change nothing"

    def limits(self) -> str:
        """It keeps to its budget of trials."""
        for task, run in self.each("budget"):
            trials = run.row["trials"] or 0
            if run.status not in ("ok", "infeasible") or trials > BUDGET:
                why = run.row["reason"] or f"{trials} were made"
                raise BrokenLawError(f"a budget of {BUDGET} trials on {task}: {why}")
        return f"keeps to a budget of {BUDGET} trials"

    def information(self) -> str:
        """It uses what it declares, and nothing else."""
        declared = {item.value for item in self.entry.method.told if item in METERED}
        used: set[str] = set()
        for task, run in self.each("first"):
            reason = run.row["reason"]
            if any(words in reason for words in ("does not declare", "own compiled")):
                raise BrokenLawError(f"on {task}: {reason}")
            used |= set(filter(None, run.row["used"].split(", ")))
        if idle := sorted(declared - used):
            raise BrokenLawError(f"declared but never used: {', '.join(idle)}")
        return f"declared and used: {', '.join(sorted(used)) or 'nothing'}"

    def failure(self) -> str:
        """It says so where a task cannot be completed."""
        for _, run in self.each("hopeless"):
            if run.status not in ("infeasible", "solver-failed"):
                raise BrokenLawError(
                    f"on a task that nobody can complete it gives {run.status} "
                    f"{run.row['reason']}; it should give infeasible, with a reason"
                )
            return f"a task that nobody can complete gives {run.status}: {run.row['reason']}"
        return "says beforehand that it does not apply to a task without a solution"


def hopeless_task(like: Task) -> Task:
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


def check_task_file(path: Path, registered: Registry) -> list[Law]:
    """Every law of a task file, in order; of one that is not valid the first alone."""
    try:
        task = load_task(path)
    except TaskError as error:
        return [Law("valid", False, str(error))]
    goals = counted(len(task.goals), "goal")
    valid = Law("valid", True, f"{task.name}, {goals}, {' and '.join(task.hands)} hand")

    def serialisable() -> str:
        content = json.loads(json.dumps(task.model_dump(mode="json")))
        if parse_task(content, str(path)) != task:
            raise BrokenLawError("it changes when it is written as JSON and read back")
        return "survives being written as JSON"

    def name() -> str:
        if task.name in builtin_tasks() and load_task(task.name) != task:
            raise BrokenLawError(f"name {task.name!r} belongs to a different, shipped task")
        return f"name {task.name!r} is its own"

    def distinct_goals() -> str:
        for number, (goal, after) in enumerate(pairwise(task.goals), 1):
            if dist(goal, after) <= task.radius:
                raise BrokenLawError(
                    f"goals {number} and {number + 1} lie within one radius of each other: "
                    "hitting the first nearly hits the second"
                )
        return "successive goals lie apart"

    def solvable() -> str:
        try:
            hands = initial_hands(checked_task(task))
        except (NotApplicableError, TaskError) as error:
            raise BrokenLawError(str(error)) from None
        execution = corrective_trial(task, hands)
        if not execution.completed:
            raise BrokenLawError(f"initial hands {hands}: {execution.reason}")
        return f"initial hands {hands} complete it with {execution.reward}"

    def provenance() -> str:
        missing = [key for key in ("goals", "start") if key not in task.provenance]
        if missing:
            raise BrokenLawError(f"no source and status for {' and '.join(missing)} ([provenance])")
        return "goals and start have a source and a status"

    def methods() -> str:
        names = [name for name, entry in registered.items() if entry.why_not(task) is None]
        if not names:
            raise BrokenLawError("no method applies to it")
        return ", ".join(names)

    checks = (serialisable, name, distinct_goals, solvable, provenance, methods)
    return [valid, *check_laws({check.__name__.replace("_", " "): check for check in checks})]
