"""Check a new method or task against the rules, for contributors.

The runs of a method, each with a limit of CPU time, are made in a worker process, and one run again
in another process.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, pairwise
from math import dist
from pathlib import Path
from typing import NamedTuple

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
from coartic.internal.text import counted
from coartic.method import METERED
from coartic.motion.solution import goals_without_target
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, cell_of, in_words
from coartic.runs.record import Outcome, Run
from coartic.tasks.task import check_task

CHECK_TRIALS = 60  # enough to learn something, few enough to be quick
_LIMIT_S = 120.0
_BUDGET = 7  # trial budget of the runs that check law ``limits``
_NO_SEED = (
    "\nanother seed gives the same result as well: random numbers come from session.rng or "
    "session.seed; without any, stochastic = False saves runs"
)
_UNDECLARED = ("does not declare", "own compiled", "outside its session")  # words of reasons


class Law(NamedTuple):
    """A law of methods or tasks, and whether it holds."""

    name: str
    """Name of the law, such as ``determinism``."""
    passed: bool
    """True if the law holds."""
    finding: str
    """Words on what was checked; for a broken law its first problem."""


def _law(name: str, problems: Iterable[str], finding: str) -> Law:
    """Return law ``name``: broken if there are ``problems``, and its finding is then the first of
    them, else ``finding``."""
    problem = next(iter(problems), None)
    return Law(name, problem is None, problem or finding)


def check_method(
    info: MethodInfo, tasks: Sequence[Task] | None = None, *, verbose: bool = False
) -> list[Law]:
    """Check every law of a method, and return the laws in order, kept and broken. The method runs
    on ``tasks``, by default the shipped tasks; tasks to which it does not apply are left out, and
    without any task left ``solution`` is the last law, and broken. ``verbose`` shows prints, logs
    and crashes of the method, not of its run in another process."""
    trials = {"trials": CHECK_TRIALS} if "trials" in info.defaults else {}
    parameters = trials | info.rules()["quick"]

    def applies(task: Task) -> bool:
        return info.why_not(task, parameters) is None

    laws = _laws_of_declaration(info)
    given = [*map(load_task, builtin_tasks())] if tasks is None else tasks
    tasks = list(filter(applies, given))
    if not tasks:
        problem = "it applies to none of the tasks, so nothing can be checked"
        return [*laws, Law("solution", False, problem)]
    jobs = {}
    for kind, seed, budget, chosen in (
        ("first", 1, None, tasks),
        ("again", 1, None, tasks),
        ("other seed", 2, None, tasks),
        ("after others", 1, None, tasks),
        ("budget", 1, _BUDGET, tasks),
        ("hopeless", 1, None, filter(applies, [_hopeless_task(tasks[0])])),
    ):
        for task in chosen:
            cell = cell_of(task, info, parameters, trial_budget=budget)
            jobs[kind, task.name] = Job(cell, seed, (0,), _LIMIT_S)
    runs = dict(zip(jobs, perform_in_order([*jobs.values()], verbose=verbose), strict=True))
    last = tasks[-1].name
    runs["elsewhere", last] = next(perform_in_order([jobs["first", last]]))
    values = in_words(parameters)
    return [*laws, *_laws_of_runs(info, runs, f" (checked with {values})" if values else "")]


def _laws_of_runs(
    info: MethodInfo, runs: Mapping[tuple[str, str], Run], checked_with: str
) -> Iterator[Law]:
    """Yield the laws on the runs of a method: ``solution``, ``determinism``, ``no hidden state``,
    ``limits``, ``information`` and ``failure``. ``runs`` holds the runs by kind, such as ``first``,
    and name of the task; ``checked_with`` has words on the parameters, or is empty."""

    def of_kind(kind: str) -> dict[str, Outcome]:
        return {task: run.outcome for (each, task), run in runs.items() if each == kind}

    def changes(kind: str, how: str) -> Iterator[str]:
        for task in of_kind(kind):
            for change in compare_runs(runs["first", task], runs[kind, task]):
                yield f"{how.format(task)}: {change}"

    first = of_kind("first")
    solutions = {task: runs["first", task].solution for task in first}
    rewards = ", ".join(f"{task} {solution.reward}" for task, solution in solutions.items())
    by_goals = defaultdict[str, list[str]](list)
    for task, solution in solutions.items():
        if goals := goals_without_target(solution.movements):
            by_goals[", ".join(map(str, goals))].append(task)
    few = f", or are {CHECK_TRIALS} trials too few" if "trials" in info.defaults else ""
    asked = "".join(
        f"\nonly the corrective process moves to goals {goals} on {', '.join(names)}"
        for goals, names in by_goals.items()
    )
    asked += f", which have no target: is this meant{few}?" if asked else ""
    yield _law(
        "solution",
        [f"on {task}: {each.status}: {each.reason}" for task, each in first.items() if each.reason],
        f"executed and scored on {rewards}{checked_with}{asked}",
    )  # fmt: skip
    by_seed = [*changes("other seed", "declared not to be stochastic, but another seed on {}")]
    yield _law(
        "determinism",
        chain(
            changes("again", "same seed on {}, same process"),
            changes("elsewhere", "same seed on {}, another process"),
            () if info.stochastic else by_seed,
        ),
        f"the same result under {'the same' if info.stochastic else 'any'} seed, in one process "
        "and in another" + ("" if by_seed or not info.stochastic else _NO_SEED),
    )
    yield _law(
        "no hidden state",
        changes("after others", "after other runs, {} with the same seed"),
        "other runs in between change nothing",
    )
    yield _law(
        "limits",
        (
            f"a budget of {_BUDGET} trials on {task}: {each.reason or each.meter}"
            for task, each in of_kind("budget").items()
            if each.status not in ("ok", "infeasible")
            or (each.meter and each.meter.trials > _BUDGET)
        ),
        f"keeps to a budget of {_BUDGET} trials",
    )
    used = {name for each in first.values() for name in each.used}
    unused = {item.value for item in METERED if item.value in info.information} - used
    undeclared = (
        f"on {task}: {each.reason}"
        for task, each in first.items()
        if any(words in each.reason for words in _UNDECLARED)
    )
    never = [f"declared but never used: {', '.join(sorted(unused))}"] if unused else []
    declared = f"declared and used: {', '.join(sorted(used)) or 'nothing'}"
    yield _law("information", [*undeclared, *never], declared)
    hopeless = [*of_kind("hopeless").values()]
    yield _law(
        "failure",
        (
            f"on a task out of reach it gives {each.status} {each.reason}; it should "
            "give infeasible, with a reason"
            for each in hopeless
            if each.status not in ("infeasible", "solver-failed")
        ),
        f"a task out of reach gives {hopeless[0].status}: {hopeless[0].reason}"
        if hopeless
        else "says beforehand that it does not apply to a task without a solution",
    )


def _laws_of_declaration(info: MethodInfo) -> list[Law]:
    """Return laws ``declaration`` (title and citation are there) and ``parameters`` (defaults
    survive JSON, unknown names are refused, and values cannot be changed) of a method."""
    parameters, config = info.complete({}), info.rules()["config"]
    again, problems = info.complete(parameters), []
    if again != parameters:
        problems.append(f"written as JSON and read back, {parameters} became {again}")
    if config["extra"] != "forbid":
        problems.append("an unknown parameter is accepted; forbid extra keys")
    if config["frozen"] is not True:
        problems.append("they can be changed after validation; freeze them")
    return [
        _law(
            "declaration",
            (f"{n} is empty" for n in ("title", "citation") if not getattr(info, n).strip()),
            f"{info.title}; information: {', '.join(info.information) or 'none'}",
        ),
        _law("parameters", problems, in_words(parameters) or "none"),
    ]


def _hopeless_task(like: Task) -> Task:
    """Return a copy of a task with a locked base and one goal at (9000, 9000), length units: out of
    reach of usual arms near the origin."""
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
    """Check every law of a task file, and return the laws in order: ``valid``, ``name``, ``distinct
    goals``, ``solvable``, ``methods``; for an invalid file ``valid`` alone. ``registered``: known
    methods, of which one at least has to apply to the task."""
    try:
        task = load_task(path)
    except TaskError as error:
        return [Law("valid", False, str(error))]
    shipped = task.name in builtin_tasks() and load_task(task.name) != task
    near = (
        f"goals {number} and {number + 1} lie within one radius of each other: hitting the first "
        "nearly hits the second"
        for number, (goal, after) in enumerate(pairwise(task.goals), 1)
        if dist(goal, after) <= task.radius
    )
    solved, unsolved = "", []
    try:
        hands = initial_hands(check_task(task))
        execution = corrective_trial(task, hands)
        solved = f"initial hands {hands} complete it with {execution.reward}"
        if not execution.completed:
            unsolved = [f"initial hands {hands}: {execution.reason}"]
    except (NotApplicableError, TaskError) as error:
        unsolved = [str(error)]
    methods = [name for name, info in registered.items() if info.why_not(task) is None]
    return [
        Law("valid", True, f"{task.name}, {counted(len(task.goals), 'goal')}"),
        _law(
            "name",
            [f"name {task.name!r} belongs to a different, shipped task"] * shipped,
            f"name {task.name!r} is its own",
        ),
        _law("distinct goals", near, "successive goals lie apart"),
        _law("solvable", unsolved, solved),
        _law(
            "methods",
            ["no method applies to it"] * (not methods),
            f"{counted(len(methods), 'method')} can run on it, such as {', '.join(methods[:2])}",
        ),
    ]
