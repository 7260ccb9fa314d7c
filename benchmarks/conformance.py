"""Checks of a new method or task against the rules, for contributors.

A method is checked on runs with a limit of CPU time, in a process that performs them all, and in
another one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, pairwise
from math import dist
from pathlib import Path
from typing import Any, NamedTuple

from coartic import (
    NotApplicableError,
    Task,
    TaskError,
    builtin_tasks,
    corrective_trial,
    initial_hands,
    load_task,
)
from coartic.benchmarks.registry import Registry
from coartic.benchmarks.reproduce import compare_runs, perform_in_order
from coartic.benchmarks.worker import Job
from coartic.method import METERED
from coartic.runs.card import MethodCard
from coartic.runs.plan import RunKey, Setting
from coartic.runs.run import Run
from coartic.tasks.task import check_task
from coartic.text import counted

CHECK_TRIALS = 60  # enough to learn something, few enough to be quick
CHECK_LIMIT_S = 120.0
BUDGET = 7  # trials of the runs that are to keep to it


class Law(NamedTuple):
    """A law, whether it holds, and the finding in words."""

    name: str
    passed: bool
    finding: str


def law(name: str, problems: Iterable[str], finding: str) -> Law:
    """A law that holds where there is no problem."""
    problem = next(iter(problems), None)
    return Law(name, problem is None, problem or finding)


def check_method(card: MethodCard, tasks: Sequence[Task] | None = None) -> list[Law]:
    """Every law of a method, in order, on the shipped tasks or on others."""
    trials = {"trials": CHECK_TRIALS} if "trials" in card.defaults else {}
    parameters = trials | card.rules()["quick"]

    def applies(task: Task) -> bool:
        return card.why_not(task, parameters) is None

    def job(task: Task, seed: int = 1, trial_budget: int | None = None) -> Job:
        complete = card.complete(parameters)
        setting = Setting(task, card.name, card.code, card.told, complete, trial_budget)
        return Job(setting, card, (RunKey("check", 0, 0, seed),), CHECK_LIMIT_S)

    laws = [declaration_law(card), parameters_law(card)]
    tasks = list(filter(applies, tasks or map(load_task, builtin_tasks())))
    if not tasks:
        problem = "it applies to none of the shipped tasks, so nothing can be checked"
        return [*laws, Law("solution", False, problem)]
    hopeless = list(filter(applies, [hopeless_task(tasks[0])]))
    jobs, others = [job(task) for task in tasks], [job(task, seed=2) for task in tasks]
    bounded = [job(task, trial_budget=BUDGET) for task in tasks]
    last = [job(task) for task in hopeless]
    runs = perform_in_order([*jobs, *jobs, *others, *jobs, *bounded, *last])
    names = [task.name for task in tasks]
    first, again, other, after, budget = (dict(zip(names, runs, strict=False)) for _ in range(5))
    ends = list(runs)
    elsewhere = dict(zip(names[-1:], perform_in_order(jobs[-1:]), strict=True))
    seed_matters = card.stochastic
    return [
        *laws,
        solution_law(first, parameters),
        law(
            "determinism",
            chain(
                changes(first, again, "same seed on {}, same process"),
                changes(first, elsewhere, "same seed on {}, another process"),
                changes(
                    first,
                    {} if seed_matters else other,
                    "declared not to be stochastic, but another seed on {}",
                ),
            ),
            f"the same result under {'the same' if seed_matters else 'any'} seed, in one process "
            "and in another",
        ),
        law(
            "no hidden state",
            changes(first, after, "after other runs, {} with the same seed"),
            "other runs in between change nothing",
        ),
        budget_law(budget),
        information_law(card, first),
        failure_law(ends),
    ]


def changes(before: dict[str, Run], runs: dict[str, Run], how: str) -> Iterator[str]:
    """Differences of runs from earlier runs of the same task, in words."""
    for task, run in runs.items():
        for difference in compare_runs(before[task], run):
            yield f"{how.format(task)}: {difference}"


def declaration_law(card: MethodCard) -> Law:
    """Title and citation are there."""
    empty = [name for name in ("title", "citation") if not getattr(card, name).strip()]
    finding = f"{card.title}; told: {', '.join(card.told) or 'nothing'}"
    return law("declaration", (f"{name} is empty" for name in empty), finding)


def parameters_law(card: MethodCard) -> Law:
    """The parameters survive JSON, are checked and cannot be changed."""
    parameters = card.complete({})

    def problems() -> Iterator[str]:
        again = card.complete(parameters)
        if again != parameters:
            yield f"written as JSON and read back, they change: {parameters} became {again}"
        config = card.rules()["config"]
        if config.get("extra") != "forbid":
            yield "an unknown parameter is accepted; forbid extra keys"
        if config.get("frozen") is not True:
            yield "they can be changed after validation; freeze them"

    return law("parameters", problems(), list_values(parameters) or "none")


def list_values(parameters: dict[str, Any]) -> str:
    """Parameters with their values."""
    return ", ".join(f"{key}={value}" for key, value in parameters.items())


def solution_law(runs: dict[str, Run], parameters: dict[str, Any]) -> Law:
    """Every solution can be executed and hits all goals."""
    problems = (
        f"on {task}: {run.status}: {run.reason}" for task, run in runs.items() if run.status != "ok"
    )
    rewards = ", ".join(f"{task} {run.reward}" for task, run in runs.items())
    checked_with = f" (checked with {list_values(parameters)})" if parameters else ""
    return law("solution", problems, f"executed and scored on {rewards}{checked_with}")


def budget_law(runs: dict[str, Run]) -> Law:
    """The method keeps to its budget of trials."""
    problems = (
        f"a budget of {BUDGET} trials on {task}: {run.reason or (run.meter and run.meter.trials)}"
        for task, run in runs.items()
        if run.status not in ("ok", "infeasible") or (run.meter and run.meter.trials > BUDGET)
    )
    return law("limits", problems, f"keeps to a budget of {BUDGET} trials")


def information_law(card: MethodCard, runs: dict[str, Run]) -> Law:
    """The method uses all that it declares, and nothing else."""
    declared = {item.value for item in METERED if item.value in card.told}
    used = {name for run in runs.values() for name in run.used}
    problems = [
        f"on {task}: {run.reason}"
        for task, run in runs.items()
        if any(
            words in run.reason
            for words in ("does not declare", "own compiled", "outside its session")
        )
    ]
    if declared - used:
        problems.append(f"declared but never used: {', '.join(sorted(declared - used))}")
    return law(
        "information", problems, f"declared and used: {', '.join(sorted(used)) or 'nothing'}"
    )


def failure_law(runs: Sequence[Run]) -> Law:
    """The method gives a reason where a task cannot be completed."""
    problems = (
        f"on a task that nobody can complete it gives {run.status} {run.reason}; it should "
        "give infeasible, with a reason"
        for run in runs
        if run.status not in ("infeasible", "solver-failed")
    )
    finding = "says beforehand that it does not apply to a task without a solution"
    for run in runs:
        finding = f"a task that nobody can complete gives {run.status}: {run.reason}"
    return law("failure", problems, finding)


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
    shipped = task.name in builtin_tasks() and load_task(task.name) != task
    near = (
        f"goals {number} and {number + 1} lie within one radius of each other: hitting the first "
        "nearly hits the second"
        for number, (goal, after) in enumerate(pairwise(task.goals), 1)
        if dist(goal, after) <= task.radius
    )
    unsourced = [key for key in ("goals", "start") if key not in task.provenance]
    methods = [name for name, card in registered.items() if card.why_not(task) is None]
    return [
        Law("valid", True, f"{task.name}, {goals}, {' and '.join(task.hands)} hand"),
        law(
            "name",
            [f"name {task.name!r} belongs to a different, shipped task"] * shipped,
            f"name {task.name!r} is its own",
        ),
        law("distinct goals", near, "successive goals lie apart"),
        solvable_law(task),
        law(
            "provenance",
            [f"no source and status for {' and '.join(unsourced)} ([provenance])"]
            * bool(unsourced),
            "goals and start have a source and a status",
        ),
        Law(
            "methods",
            bool(methods),
            f"{counted(len(methods), 'method')} can solve it, such as {', '.join(methods[:2])}"
            if methods
            else "no method applies to it",
        ),
    ]


def solvable_law(task: Task) -> Law:
    """The corrective process alone completes it."""
    try:
        hands = initial_hands(check_task(task))
    except (NotApplicableError, TaskError) as error:
        return Law("solvable", False, str(error))
    execution = corrective_trial(task, hands)
    reason = [f"initial hands {hands}: {execution.reason}"] * (not execution.completed)
    return law("solvable", reason, f"initial hands {hands} complete it with {execution.reward}")
