"""Plan a suite: from a suite and a request to jobs, with the parameters of every run."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PlainValidator, ValidationError

from coartic import CoarticError, Task, builtin_tasks, load_task
from coartic.benchmarks.registry import Registry, methods_named, registry
from coartic.benchmarks.suites import (
    WILDCARD,
    Seconds,
    Suite,
    TaskNamed,
    TrialCount,
    check_kind,
    load_suite,
    suites,
    tasks_of,
)
from coartic.internal.limits import (
    MOST_RUNS,
    MOST_SEED,
    check_limits,
    plain_values,
)
from coartic.internal.text import counted, unknown
from coartic.internal.validation import FileData, explain, sentence_error
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, cell_of, tasks_by_name
from coartic.tasks.families import (
    instance_of,
    is_file,
    load_family,
    named_by,
    own_families,
    read_family,
    shipped_families,
)
from coartic.tasks.task import address_of, check_task


def _task_or_name(value: Any) -> Task | str:
    """Return a task, or its name or path as a text. Raises an error for any other value."""
    if isinstance(value, str | Path | Task):
        return value if isinstance(value, Task) else str(value)
    raise sentence_error(f"{value!r} is no task; it should be a name, a path or a task")


def _runs_asked(value: Any) -> int | range | None:
    """Return an allowed number of runs, an allowed range of runs (step 1) or None. Raises an error
    for any other value."""
    is_range = isinstance(value, range) and len(value) > 0 and value.step == 1
    first, last = (value.start, value.stop) if is_range else (0, value)
    try:
        if value is not None:
            check_limits("runs", last, 1, MOST_RUNS)
            check_limits("its first run", first, 0, MOST_RUNS)
    except ValueError as error:
        example = "range(50, 100), or 50..99 in a command"
        raise sentence_error(f"{error}, or a range, such as {example}") from None
    return value if is_range or value is None else int(value)


class Request(FileData):
    """The part of a suite to run, with its numbers of runs and trials, its seed and its limits."""

    tasks: tuple[Annotated[Any, PlainValidator(_task_or_name)], ...] = ()
    """Names of tasks, ranges of instances such as ``"long/v1/i000..i009"``, task files, and tasks
    (Task); by default all tasks of the suite. An instance or a task of your own that the suite does
    not have is run with every method of ``methods``, or of the suite, that applies to it."""
    methods: tuple[str, ...] = ()
    """Ids of methods, with wildcards such as ``"optimum/*"``; by default all methods of the suite.
    A method that the suite does not have is run on every task of the suite that it applies to."""
    method_files: tuple[Path, ...] = ()
    """Files with your own methods. If neither ``methods`` nor the suite names a method of a file,
    also by a wildcard, all methods of the file run, together with the other methods."""
    family_files: tuple[Path, ...] = ()
    """Files with your own families."""
    runs: Annotated[Any, PlainValidator(_runs_asked)] = None
    """Number of runs of each cell; by default the number of the suite. A range such as
    ``range(50, 100)`` is a part of the runs, for a job of an array."""
    trials: TrialCount | None = None
    """Trials of each run, for methods that have this parameter; by default the number of the
    suite, or else of the method."""
    seed: Annotated[int, Field(ge=0, le=MOST_SEED, strict=True)] = 0
    """Seed of the suite."""
    time_limit_s: Seconds | None = None
    """Most CPU time of a job, s; by default the limit of the suite."""
    trial_budget: TrialCount | None = None
    """Most physical trials of a run, whatever its method."""


def request_for(**options: Any) -> Request:
    """Return a checked request; ``options`` are fields of :class:`Request`, by name, all optional.
    Raises CoarticError for unknown options and wrong values."""
    try:
        return Request.model_validate(plain_values(options))
    except ValidationError as error:
        raise CoarticError(explain(error, Request.model_fields)) from None


def plan_suite(suite: str | Path | Suite, **options: Any) -> list[Job]:
    """Plan the runs of a suite, or of a part of it.

    Parameters
    ----------
    suite : str, Path or Suite
        A suite, a shipped suite by name, or a suite file (``.toml``).
    options
        The fields of :class:`Request`, such as ``tasks``, ``methods``, ``runs`` and ``trials``.

    Returns
    -------
    list of Job
        A job for each cell (a method with parameters on a task) that has runs, with their numbers.

    Raises
    ------
    CoarticError
        A name is unknown or taken, a number or a parameter is refused, ``trials``, ``runs``
        (except 1) or a family file has no effect, a task or method that is named has no runs of any
        number, a cell has two numbers of runs, or a method does not apply to a task of its block
        (without a wildcard; otherwise, and for added tasks and methods, it is left out).
    """
    request = request_for(**options)
    if not isinstance(suite, Suite):
        suite = load_suite(str(suite))
    return plan(suite, request, registry(request.method_files))


def plan(suite: Suite, request: Request, registered: Registry) -> list[Job]:
    """Return the jobs that a request asks for, one for each cell that has runs; ``registered`` has
    all known methods. Raises CoarticError as :func:`plan_suite` does."""
    asked = {name: methods_named(name, registered) for name in request.methods}
    asked |= {name: [name] for name in _unnamed_methods(suite, request, registered)}
    names, own, task_named = _asked_tasks(suite, request)
    job = partial(_job_of, suite, request)
    jobs = [*_suite_jobs(suite, registered, own, task_named, job)]
    ids = dict.fromkeys(itertools.chain(*asked.values()))
    if not request.methods:
        ids = dict.fromkeys(each.cell.method.name for each in jobs) | ids
    methods = [registered[name] for name in ids]
    there = tasks_by_name([*(each.cell.task for each in jobs), *own.values()])
    of_suite = {each.cell.method.name for each in jobs}
    planned = {(each.cell.task.name, each.cell.label) for each in jobs}
    jobs += [
        job(task, method)
        for task, method in itertools.product(there.values(), methods)
        if (task.name in own or method.name not in of_suite)
        and (task.name, method.name) not in planned
        and method.why_not(task) is None
    ]
    if wrong := [name for name in names if name not in there]:
        hint = " Instances are a range, such as long/v1/i000..i009."
        words = (f"{unknown('task', name, there)}{hint * ('/' in name)}" for name in wrong)
        raise CoarticError("\n".join(words))
    jobs = [each for each in jobs if not names or each.cell.task.name in names]
    chosen = [each for each in jobs if each.cell.method.name in ids]
    busy = {each.cell.task.name for each in chosen}
    if idle := [there[name] for name in names if name not in busy]:
        raise CoarticError(_why_nothing_runs(suite, idle, methods, jobs))
    running = {each.cell.method.name for each in chosen}
    for wanted in asked.values() or [[*ids]]:
        if running.isdisjoint(wanted):
            idle_methods = [registered[name] for name in wanted]
            raise CoarticError(_why_nothing_runs(suite, [], idle_methods, jobs))
    _check_effects(request, chosen)
    jobs = _distinct_jobs([each for each in chosen if each.numbers])
    if own or suite in suites().values():
        return jobs
    return [replace(each, question=(suite.title, suite.description)) for each in jobs]


def _unnamed_methods(suite: Suite, request: Request, registered: Registry) -> list[str]:
    """Return the ids of all methods in the user's files, without files with a method that the suite
    or the request names."""
    files = {
        registered[method].where
        for names in (request.methods, *(block.methods for block in suite.blocks))
        for name in names
        for method in methods_named(name, registered)
    }
    return [
        name
        for name, info in registered.items()
        if info.where.endswith(".py") and info.where not in files
    ]


def _check_effects(request: Request, jobs: Sequence[Job]) -> None:
    """Raise CoarticError if ``trials``, ``runs`` (except 1) or a family file of a request has no
    effect on its jobs."""
    methods = {job.cell.method.name: job.cell.method for job in jobs}
    if request.trials and not any("trials" in each.defaults for each in methods.values()):
        raise CoarticError(f"trials has no effect: no parameter of {', '.join(methods)} is trials")
    if request.runs not in (None, 1, range(1)) and not any(
        each.stochastic for each in methods.values()
    ):
        raise CoarticError(
            f"runs has no effect: no run of {', '.join(methods)} depends on a seed, so one is made"
        )
    for path in request.family_files:
        family = read_family(path).name
        if not any(job.cell.task.name.startswith(f"{family}/") for job in jobs):
            raise CoarticError(
                f"{path} has no effect: no instance of {family} is among the tasks. Name some, "
                f"such as {family}/i000..i009"
            )


def _asked_tasks(
    suite: Suite, request: Request
) -> tuple[dict[str, None], dict[str, Task], TaskNamed]:
    """Return the names of the tasks that a request asks for, as keys; by name, the user's tasks and
    the instances among them that the suite lacks; and a function that returns a task by its name.
    Raises CoarticError for a task whose name belongs to another task."""
    for path in request.family_files:
        check_kind(str(path), "family")
    of_tasks = [each.rpartition("/")[0] for each in request.tasks if isinstance(each, str)]
    paths = (*request.family_files, *(Path(each) for each in of_tasks if is_file(each)))
    families = own_families([*dict.fromkeys(paths)])
    names, own = dict[str, None](), dict[str, Task]()

    def task_named(name: str) -> Task:
        address = address_of(name)
        if name in own:
            return own[name]
        if address is not None and address.family in families:
            return instance_of(families[address.family], address)
        return load_task(name)

    for each in request.tasks:
        if isinstance(each, str) and not each.endswith(".toml"):
            place, _, numbers = each.rpartition("/")
            named = f"{load_family(place).name}/{numbers}" if is_file(place) else each
            names |= dict.fromkeys(named_by(named))
            continue
        task = load_task(each) if isinstance(each, str) else check_task(each)
        is_known = task.name in builtin_tasks() or task.family in (*families, *shipped_families())
        if (task_named(task.name) if is_known else own.setdefault(task.name, task)) != task:
            whose = "a shipped task" if is_known else "another task"
            raise CoarticError(
                f"{each}: name {task.name!r} is already taken by {whose}: give it another name"
            )
        names[task.name] = None
    of_suite = {name for block in suite.blocks for each in block.tasks for name in named_by(each)}
    if own:
        there = [t for block in suite.blocks for t in tasks_of(suite, block, (), task_named)]
        own = {name: task for name, task in own.items() if task not in there}
    brought = (name for name in names if name not in of_suite and address_of(name))
    own |= {name: task_named(name) for name in brought}
    return names, own, task_named


def _suite_jobs(
    suite: Suite,
    registered: Registry,
    own: Collection[str],
    task_named: TaskNamed,
    job: Callable[..., Job],
) -> Iterator[Job]:
    """Yield the jobs of a suite, made by ``job`` (:func:`_job_of`). Raises CoarticError for an
    unknown method, for a method that does not apply to a task of a block without wildcards, and for
    parameters that a method does not take."""
    for block in suite.blocks:
        ids = dict.fromkeys(m for name in block.methods for m in methods_named(name, registered))
        is_open = WILDCARD in "".join((*block.methods, *block.tasks))  # skip what does not apply
        for task in tasks_of(suite, block, own, task_named):
            for method in map(registered.__getitem__, ids):
                for values in itertools.product(*block.grid.values()):
                    parameters = block.parameters | dict(zip(block.grid, values, strict=True))
                    reason = method.why_not(task, parameters)
                    if reason is None:
                        yield job(task, method, parameters, block.runs)
                    elif not is_open:
                        raise CoarticError(
                            f"suite {suite.name!r}: {reason}; put tasks and methods that fit "
                            "together into a block of their own"
                        )


def _job_of(
    suite: Suite,
    request: Request,
    task: Task,
    method: MethodInfo,
    parameters: Mapping[str, Any] | None = None,
    runs: int | None = None,
) -> Job:
    """Return the job of a method with parameters on a task. Runs and trials come from the request,
    or else from the block (``runs``, ``parameters``), the suite or, trials, the method. A method
    that is not stochastic has run 0 alone, and no run if ``request.runs`` does not begin at 0."""
    trials, parameters = request.trials or suite.trials, {**(parameters or {})}
    if request.trials:
        parameters.pop("trials", None)
    cell = cell_of(task, method, parameters, trials, request.trial_budget)
    asked = request.runs or runs or suite.runs
    numbers = asked if isinstance(asked, range) else range(asked)
    numbers = numbers if method.stochastic else range(numbers.start, 1)
    limit_s = request.time_limit_s or suite.time_limit_s
    by_suite = suite.trials if request.trials else None
    return Job(cell, request.seed, numbers, limit_s, suite.name, by_suite)


def _why_nothing_runs(
    suite: Suite, idle: Sequence[Task], methods: Iterable[MethodInfo], jobs: Sequence[Job]
) -> str:
    """Return a sentence that says why methods have nothing to run: on the first task of ``idle``,
    tasks that a request names and for which these methods have no job, or else on the tasks of
    ``jobs``."""
    tasks = idle[:1] or tasks_by_name(job.cell.task for job in jobs).values()
    reasons = dict.fromkeys(method.why_not(task) for task in tasks for method in methods)
    there_is = ", ".join(dict.fromkeys(job.cell.label for job in jobs)) or "nothing there"
    why = "; ".join(filter(None, reasons)) or f"suite {suite.name!r} has {there_is}"
    what = f"task {idle[0].name!r}" if idle else "what was asked for"
    return f"no method to run on {what}: {why}."


def _distinct_jobs(jobs: Iterable[Job]) -> list[Job]:
    """Return the first job of each cell. Raises CoarticError for two numbers of runs of a cell."""
    distinct = dict[str, Job]()
    for job in jobs:
        if (first := distinct.setdefault(job.cell.digest, job)).numbers != job.numbers:
            raise CoarticError(
                f"{job.cell.task.name} x {job.cell.label}: the suite asks for "
                f"{counted(len(first.numbers), 'run')} of it, and then for {len(job.numbers)}; "
                "give one number"
            )
    return list(distinct.values())
