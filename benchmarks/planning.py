"""From a suite and a request to a plan: every run with all its parameters."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PlainValidator, ValidationError

from coartic import CoarticError, Task, builtin_tasks, load_task
from coartic.benchmarks.registry import Registry, methods_named, registry
from coartic.benchmarks.suites import WILDCARD, Suite, changed_tasks, load_suite
from coartic.internal.limits import MOST_CELLS, MOST_RUNS, MOST_SECONDS, MOST_SEED, MOST_TRIALS
from coartic.internal.text import unknown
from coartic.internal.validation import FileData, error_saying, explain_inline
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Cell, Job, cell_of, trials_in
from coartic.tasks.families import instance_of, named_by, own_families
from coartic.tasks.task import address_of, check_task


def task_or_name(value: Any) -> Task | str:
    """Return a task or its name; a path as a text."""
    if isinstance(value, str | Path | Task):
        return value if isinstance(value, Task) else str(value)
    raise error_saying(f"{value!r} is no task; it should be a name, a path or a task")


def number_of_python(value: Any) -> Any:
    """Return a number of NumPy as a number of Python, and any other value as it is."""
    return value.item() if isinstance(value, np.number) else value


_Tasks = tuple[Annotated[Any, PlainValidator(task_or_name)], ...]
_Files = tuple[Path, ...]
_plain = BeforeValidator(number_of_python)


class Request(FileData):
    """The part of a suite that is run, and how."""

    tasks: _Tasks = ()
    """Names of tasks, ranges of instances such as ``"long/v1/i000..i009"``, task files, and tasks
    (Task); without any, all of the suite's. A task that the suite does not have runs under every
    method of ``methods``, or of the suite, that applies to it."""
    methods: tuple[str, ...] = ()
    """Ids of methods; ``"optimum/*"`` stands for all that begin so. Without any, all of the
    suite's. A method that the suite does not have runs on all tasks of the suite that it applies
    to."""
    method_files: _Files = ()
    """Files with methods of your own."""
    family_files: _Files = ()
    """Files with families of your own."""
    runs: Annotated[int, Field(ge=1, le=MOST_RUNS, strict=True), _plain] | None = None
    """Runs of each cell; by default the suite's number."""
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS, strict=True), _plain] | None = None
    """Trials of each run, for methods that have this parameter; by default the suite's number."""
    seed: Annotated[int, Field(ge=0, le=MOST_SEED, strict=True), _plain] = 0
    """Seed of the suite."""
    time_limit_s: Annotated[float, Field(ge=1e-3, le=MOST_SECONDS, strict=True), _plain] | None = (
        None
    )
    """CPU time of a run, s; by default the suite's."""
    trial_budget: Annotated[int, Field(ge=1, le=MOST_TRIALS, strict=True), _plain] | None = None
    """Most physical trials of a run, of any method."""


def request_for(**options: Any) -> Request:
    """Return a checked request. Raises CoarticError for unknown options and wrong values."""
    try:
        return Request.model_validate(options)
    except ValidationError as error:
        raise CoarticError(explain_inline(error, [*Request.model_fields])) from None


def plan_suite(suite: str | Path | Suite, **options: Any) -> list[Job]:
    """Plan every run of a suite.

    Parameters
    ----------
    suite : str, Path or Suite
        A shipped suite by name, or a suite file (``.toml``).
    options
        The fields of :class:`Request`, such as ``tasks``, ``methods``, ``runs`` and ``trials``.

    Returns
    -------
    list of Job
        A job for each cell, with all parameters of the method and the numbers of the runs.

    Raises
    ------
    CoarticError
        For anything unknown, out of bounds, or that does not go together.
    """
    request = request_for(**options)
    if not isinstance(suite, Suite):
        suite = load_suite(str(suite))
    return plan(suite, request, registry(request.method_files))


def plan(suite: Suite, request: Request, registered: Registry) -> list[Job]:
    """Return the jobs that a request asks for.

    Raises CoarticError for unknown names, for a task whose name is taken, for parameters that a
    method does not take, for more than :data:`MOST_CELLS` cells, and if nothing is left to run.
    """
    families = own_families(request.family_files)

    def task_named(name: str) -> Task:
        address = address_of(name)
        if address is not None and address.family in families:
            return instance_of(families[address.family], address)
        return load_task(name)

    methods = [registered[m] for name in request.methods for m in methods_named(name, registered)]
    names, own = asked_tasks(request.tasks, task_named)
    in_suite = {name for block in suite.blocks for name in block.task_names(own)}
    others = (name for name in names if name not in in_suite and address_of(name))
    own |= {name: task_named(name) for name in others if name not in own}
    suite = with_numbers(suite, request)
    cells = list(itertools.islice(suite_cells(suite, registered, own, task_named), MOST_CELLS + 1))
    if len(cells) > MOST_CELLS:
        raise CoarticError(
            f"suite {suite.name!r} asks for more than {MOST_CELLS:_} combinations "
            "(tasks x moves x methods x grid)"
        )
    cells += extra_cells(suite, own, methods, [cell for cell, _ in cells])
    there = dict.fromkeys([*(cell.task.name for cell, _ in cells), *own])
    if wrong := [name for name in names if name not in there]:
        hint = " Instances are a range, such as long/v1/i000..i009."
        words = (f"{unknown('task', name, there)}{hint * ('/' in name)}" for name in wrong)
        raise CoarticError("\n".join(words))
    methods = methods or [*{cell.method.name: cell.method for cell, _ in cells}.values()]
    ids = {method.name for method in methods}
    cells = [(cell, runs) for cell, runs in cells if not names or cell.task.name in names]
    chosen = [(cell, runs) for cell, runs in cells if cell.method.name in ids]
    busy = {cell.task.name for cell, _ in chosen}
    if not busy.issuperset(own) or not chosen:
        idle = [task for task in own.values() if task.name not in busy]
        raise CoarticError(why_nothing_runs(suite, idle, methods, [cell for cell, _ in cells]))
    return jobs_of(suite, request, chosen)


def asked_tasks(
    asked: Iterable[Task | str], task_named: Callable[[str], Task]
) -> tuple[dict[str, None], dict[str, Task]]:
    """Return the names of the tasks that a request names, and its own tasks by name: files, and
    tasks that are neither shipped nor an instance of a family.

    Raises CoarticError for a task whose name belongs to another task.
    """
    names, own = dict[str, None](), dict[str, Task]()
    for each in asked:
        if isinstance(each, str) and not each.endswith(".toml"):
            names |= dict.fromkeys(named_by(each))
            continue
        task = load_task(each) if isinstance(each, str) else check_task(each)
        is_known = task.name in builtin_tasks() or address_of(task.name)
        there = task_named(task.name) if is_known else own.setdefault(task.name, task)
        if there != task:
            whose = "a shipped task" if is_known else "another task"
            raise CoarticError(
                f"{each}: name {task.name!r} is already taken by {whose}: give it another name"
            )
        names[task.name] = None
    return names, own


def with_numbers(suite: Suite, request: Request) -> Suite:
    """Return the suite with the numbers of runs and trials and the time limit of a request."""
    asked = request.model_dump(include={"runs", "trials", "time_limit_s"}, exclude_none=True)
    blocks = [
        block.model_copy(update={"runs": request.runs or block.runs}) for block in suite.blocks
    ]
    return suite.model_copy(update=asked | {"blocks": tuple(blocks)})


def suite_cells(
    suite: Suite, registered: Registry, own: Mapping[str, Task], task_named: Callable[[str], Task]
) -> Iterator[tuple[Cell, int]]:
    """Yield the cells of a suite, each with its number of runs. A block for all tasks is for one's
    own as well, but moves no goal of them.

    Raises CoarticError for a method that is unknown or does not apply to a task, and for parameters
    that it does not take.
    """
    for block in suite.blocks:
        ids = dict.fromkeys(m for name in block.methods for m in methods_named(name, registered))
        is_open = WILDCARD in "".join((*block.methods, *block.tasks))  # it is for all that applies
        for name in block.task_names(own):
            if name in own and block.move is not None and WILDCARD in block.tasks:
                continue
            task = own.get(name) or task_named(name)
            if block.goals is not None and len(task.goals) not in block.goals:
                continue
            for changed, id_ in itertools.product(changed_tasks(task, suite, block), ids):
                reason = registered[id_].why_not(changed, block.parameters)
                if reason is not None and not is_open:
                    raise CoarticError(f"suite {suite.name!r}: {reason}")
                for values in itertools.product(*block.grid.values()) if reason is None else ():
                    parameters = block.parameters | dict(zip(block.grid, values, strict=True))
                    cell = cell_of(changed, registered[id_], parameters, suite.trials)
                    yield cell, block.runs or suite.runs


def extra_cells(
    suite: Suite, own: Mapping[str, Task], methods: Iterable[MethodInfo], cells: Sequence[Cell]
) -> Iterator[tuple[Cell, int]]:
    """Yield the cells that a request adds to the cells of a suite: its methods that the suite does
    not have on the suite's tasks, and its own tasks under its methods, or all of the suite."""
    of_suite = {cell.method.name: cell.method for cell in cells}
    tasks = {cell.task.name: cell.task for cell in cells if cell.task.name not in own}
    there = {(cell.task.name, cell.label) for cell in cells}
    new = [method for method in methods if method.name not in of_suite]
    for task, method in (
        *itertools.product(tasks.values(), new),
        *itertools.product(own.values(), methods or of_suite.values()),
    ):
        if (task.name, method.name) not in there and method.why_not(task) is None:
            yield cell_of(task, method, {}, suite.trials), suite.runs


def why_nothing_runs(
    suite: Suite, idle: Sequence[Task], methods: Iterable[MethodInfo], cells: Sequence[Cell]
) -> str:
    """Return a sentence on why methods have nothing to run: on the first of one's own tasks that
    are ``idle``, or, if there is none, on the tasks of these cells."""
    tasks = idle[:1] or list({cell.task.name: cell.task for cell in cells}.values())
    reasons = dict.fromkeys(method.why_not(task) for task in tasks for method in methods)
    there_is = ", ".join(dict.fromkeys(cell.label for cell in cells)) or "nothing there"
    why = "; ".join(filter(None, reasons)) or f"suite {suite.name!r} has {there_is}"
    what = f"task {idle[0].name!r}" if idle else "what was asked for"
    return f"no method to run on {what}: {why}."


def jobs_of(suite: Suite, request: Request, cells: Iterable[tuple[Cell, int]]) -> list[Job]:
    """Return a job for each cell with its number of runs; a cell that is there twice has one.

    Raises CoarticError for two tasks of one name, two numbers of runs, and too many trials.
    """
    tasks, jobs = dict[str, Task](), dict[str, Job]()
    for each, runs in cells:
        cell = replace(each, trial_budget=request.trial_budget)
        where = f"{cell.task.name} x {cell.label}"
        if tasks.setdefault(cell.task.name, cell.task) != cell.task:  # names distinguish results
            raise CoarticError(
                f"two different tasks are called {cell.task.name!r}: give one another name"
            )
        if trials_in(cell.parameters) > MOST_TRIALS:
            raise CoarticError(
                f"{where}: {trials_in(cell.parameters):_} trials a run; at most {MOST_TRIALS:_} "
                "are kept"
            )
        numbers = range(runs if cell.method.stochastic else 1)
        job = Job(cell, request.seed, numbers, suite.time_limit_s, suite.name)
        if jobs.setdefault(cell.digest, job).numbers != numbers:
            raise CoarticError(
                f"{where}: the suite asks for {len(jobs[cell.digest].numbers)} runs of it, and "
                f"then for {len(numbers)}; give one number"
            )
    return list(jobs.values())
