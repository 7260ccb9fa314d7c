"""Plan a suite: make a job for each method with parameters on each task."""

from __future__ import annotations

import itertools
import warnings
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, PlainValidator, ValidationError

from coartic import CoarticError, Task, builtin_tasks, load_task
from coartic.benchmarks.registry import Registry, methods_named, registry
from coartic.benchmarks.suites import (
    WILDCARD,
    Seconds,
    Suite,
    TaskNamed,
    TrialCount,
    Worlds,
    check_kind,
    errors_of_block,
    load_suite,
    suites,
    tasks_of,
)
from coartic.internal.limits import (
    MAX_RUNS,
    MAX_SEED,
    check_limits,
    plain_values,
)
from coartic.internal.text import describe_parameters, pluralize, unknown
from coartic.internal.validation import FileData, described_error, explain
from coartic.method import outline_of
from coartic.method.as_method import reason_against_named
from coartic.model import PAPER, MotionModel, differences
from coartic.runs.contrasts import Contrast
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, cell_of, tasks_by_name
from coartic.runs.rows import LEARNER_ROWS, places_of
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
    """Validate a task: return a Task unchanged, a name or path as a string."""
    if isinstance(value, str | Path | Task):
        return value if isinstance(value, Task) else str(value)
    raise described_error(f"task {value!r} must be a name, a path or a Task")


def _runs_asked(value: Any) -> int | range | None:
    """Validate a number of runs, a range with step 1, or None."""
    is_range = isinstance(value, range) and len(value) > 0 and value.step == 1
    first, last = (value.start, value.stop) if is_range else (0, value)
    try:
        if value is not None:
            check_limits("runs", last, 1, MAX_RUNS)
            check_limits("its first run", first, 0, MAX_RUNS)
    except ValueError as error:
        example = "range(50, 100), or 50..99 in a command"
        raise described_error(f"{error}, or a range, such as {example}") from None
    return value if is_range or value is None else int(value)


def _one_world(worlds: Worlds) -> Worlds:
    """Return the worlds unchanged; raise a validation error if there is more than one."""
    if len(worlds) > 1:
        raise described_error(
            "model has a list of values; here each constant has one value. Lists belong into table "
            "'model' of a suite or of its blocks"
        )
    return worlds


class Request(FileData):
    """What a command asks for: tasks, methods and runs of a suite, and limits."""

    tasks: tuple[Annotated[Any, PlainValidator(_task_or_name)], ...] = ()
    """Tasks to run: names of tasks, ranges of instances such as ``"long/v1/i000..i009"``, paths of
    task files, or objects (Task). By default all tasks of the suite are run. Instances of families
    and tasks of your own can be named here even if the suite does not have them: on such a task,
    all ``methods`` that apply to it are run (by default all methods of the suite)."""
    methods: tuple[str, ...] = ()
    """Methods to run: ids, exploration conditions such as ``"EC1"``, or wildcards such as
    ``"optimum/*"``. By default all methods of the suite are run; ``"*"`` stands for them, too. A
    method that the suite does not have is run on all planned tasks to which it applies, in each
    world in which the suite has the task."""
    method_files: tuple[Path, ...] = ()
    """Python files that define your own methods. If ``methods`` or the suite names a method of a
    file, by its id or by a wildcard (in ``methods`` a wildcard other than ``"*"``), only the named
    methods of this file are run. Otherwise all methods of the file are run, in addition to the
    other methods."""
    family_files: tuple[Path, ...] = ()
    """TOML files with your own families. ``tasks`` names their instances."""
    runs: Annotated[Any, PlainValidator(_runs_asked)] = None
    """Number of runs of each cell (a method with its parameters on a task); by default the number
    that the suite sets. A range such as ``range(50, 100)`` asks only for the runs with these
    numbers, so that several jobs of a cluster can each perform a part of the runs of a suite."""
    trials: TrialCount | None = None
    """Number of trials of each run, for methods that have this parameter. By default it is the
    number that the suite or its block sets, or else the default of the method."""
    seed: Annotated[int, Field(ge=0, le=MAX_SEED, strict=True)] = 0
    """Seed of the suite, from which the seeds of all runs are computed."""
    time_limit_s: Seconds | None = None
    """Limit of the CPU time of a job (in s); by default the limit that the suite sets."""
    trial_budget: TrialCount | None = None
    """Largest number of physical trials of a run, for all methods; by default there is no limit."""
    model: Annotated[Worlds, AfterValidator(_one_world)] | None = None
    """World in which methods practise and are scored: a dict that maps each constant that differs
    from the paper's to one value, such as ``{"motor_noise": 0.01}``. Blocks of the suite with a
    world of their own (table ``model`` of the block or of the suite) are left out, with a
    warning."""


def request_for(**options: Any) -> Request:
    """Make a request from options, which are the fields of :class:`Request`.

    Options that are not passed have the defaults of the fields. Raises CoarticError for an unknown
    option or a wrong value.
    """
    try:
        return Request.model_validate(plain_values(options))
    except ValidationError as error:
        raise CoarticError(explain(error, Request.model_fields)) from None


def plan_suite(suite: str | Path | Suite, **options: Any) -> list[Job]:
    """Plan the runs of a suite, or those that the options select.

    Parameters
    ----------
    suite : str, Path or Suite
        A suite, the name of a shipped suite, or a suite file (``.toml``).
    **options
        Fields of :class:`Request`, such as ``tasks``, ``methods``, ``runs`` and ``trials``.

    Returns
    -------
    list of Job
        A job for each cell (a method with its parameters on a task) that has runs. A method that
        does not depend on a seed has only run 0. Its cells are left out, without an error, if
        ``runs`` is a range that does not begin at 0, and another planned method depends on a seed.

    Raises
    ------
    CoarticError
        One of these is the case:

        - the suite, a task, a method or a family is unknown, its file cannot be used, or two tasks,
          methods or families have the same name;
        - an option or a parameter of a method has a wrong value;
        - ``trials`` or a family file has no effect;
        - ``runs`` asks for runs other than run 0, although no planned method depends on a seed;
        - two cells of the suite differ only in their numbers of trials, so that ``trials`` would
          make them equal;
        - a task or method that the options name belongs to no cell of the plan;
        - two blocks of the suite ask for different numbers of runs of the same cell;
        - a block without wildcards names a method that does not apply to all tasks of the block.

    Examples
    --------
    >>> jobs = plan_suite("paper", tasks=["ascending"], methods=["EC1"], runs=3)
    >>> [(job.cell.label, job.cell.task.name, [*job.numbers]) for job in jobs]
    [('dual-process/EC1', 'ascending', [0, 1, 2])]
    """
    request = request_for(**options)
    if not isinstance(suite, Suite):
        suite = load_suite(str(suite))
    with ExitStack() as ends:
        return plan(suite, request, registry(request.method_files, ends))


def plan(suite: Suite, request: Request, registered: Registry) -> list[Job]:
    """Plan the runs of a suite for a checked request, as :func:`plan_suite` does.

    ``registered`` is a dict that maps ids to all known methods. Raises the errors of
    :func:`plan_suite`.
    """
    names, own, task_named = _asked_tasks(suite, request)
    job = partial(_job_of, suite, request)
    named = {name: methods_named(name, registered) for name in request.methods if name != WILDCARD}
    left_out = set(registered) - {*itertools.chain(*named.values())}
    if not request.methods or WILDCARD in request.methods:
        left_out = set()
    jobs = [*_suite_jobs(suite, request, registered, own, task_named, job, left_out)]
    jobs = [replace(made, of_suite=made.cell.task.name not in own) for made in jobs]
    _check_names(jobs)
    contrasts = _checked_contrasts(suite, request, registered, task_named)
    of_suite = dict.fromkeys(planned.cell.method.name for planned in jobs)
    asked = {name: named.get(name, [*of_suite]) for name in request.methods}
    asked |= {name: [name] for name in _unnamed_methods(suite, request, registered)}
    ids = dict.fromkeys(itertools.chain(*asked.values()))
    if not request.methods:
        ids = of_suite | ids
    methods = [registered[name] for name in ids]
    tasks = tasks_by_name([*(planned.cell.task for planned in jobs), *own.values()])
    cells = {(planned.cell.task.name, planned.cell.label) for planned in jobs}
    worlds = _worlds_beside(jobs, request)
    usual = [world for world in worlds if world == PAPER] or worlds
    jobs += [
        replace(job(task, method, world=world), of_suite=False)
        for task, method in itertools.product(tasks.values(), methods)
        if (task.name in own or method.name not in of_suite)
        and (task.name, method.name) not in cells
        for world in (usual if method.name in of_suite else worlds)
        if (task.name in own or task.name in worlds[world])
        and method.refuses(world) is None
        and method.inapplicable_reason(task) is None
    ]
    if wrong := [name for name in names if name not in tasks]:
        hint = " Instances are a range, such as long/v1/i000..i009."
        words = (
            f"task {name!r} is not in suite {suite.name!r}: choose a suite that has it"
            if name in builtin_tasks()
            else f"{unknown('task', name, tasks)}{hint if '/' in name else ''}"
            for name in wrong
        )
        raise CoarticError("\n".join(words))
    jobs = [planned for planned in jobs if not names or planned.cell.task.name in names]
    chosen = [planned for planned in jobs if planned.cell.method.name in ids]
    busy = {planned.cell.task.name for planned in chosen}
    if idle := [tasks[name] for name in names if name not in busy]:
        raise CoarticError(_why_nothing_runs(suite, request, idle, methods, jobs))
    running = {planned.cell.method.name for planned in chosen}
    for wanted in asked.values() or [[*ids]]:
        if running.isdisjoint(wanted):
            idle_methods = [registered[name] for name in wanted]
            raise CoarticError(_why_nothing_runs(suite, request, [], idle_methods, jobs))
    _check_effects(request, chosen)
    if request.trials:
        _check_trials(
            request.trials, plan(suite, request.model_copy(update={"trials": None}), registered)
        )
    jobs = _distinct_jobs([planned for planned in chosen if planned.numbers])
    is_asked = not own and suite not in suites().values()
    question = (suite.title, suite.description) if is_asked else None
    return [replace(planned, question=question, contrasts=contrasts) for planned in jobs]


def _checked_contrasts(
    suite: Suite, request: Request, registered: Registry, task_named: TaskNamed
) -> tuple[tuple[Contrast, int], ...]:
    """Return the contrasts of a suite, checked against all its blocks, with their cells."""
    if not suite.contrasts:
        return ()
    from coartic.analysis.contrasts import check_contrasts  # SciPy, for suites that ask

    whole = request.model_copy(update={"model": None})
    job = partial(_job_of, suite, whole)
    places = places_of(_suite_jobs(suite, whole, registered, (), task_named, job, ()))
    try:
        return check_contrasts(suite.contrasts, places)
    except CoarticError as error:
        raise CoarticError(f"suite {suite.name!r}, {error}") from None


def _check_names(jobs: Iterable[Job]) -> None:
    """Raise CoarticError if a block's name (``as``) is that of another row, or of two settings."""
    jobs = [*jobs]
    labels, others = dict[tuple[str, str, str], str](), {job.cell.label for job in jobs}
    others |= {*LEARNER_ROWS, *(job.cell.method.name for job in jobs)}
    for job in jobs:
        cell = job.cell
        if job.called in others:
            raise CoarticError(
                f"as = {job.called!r} is the name of another row: choose another name"
            )
        if job.called:
            first = labels.setdefault((job.called, cell.task.name, cell.world), cell.label)
            if first != cell.label:
                raise CoarticError(
                    f"as = {job.called!r} names two settings on {cell.task.name}: {first} and "
                    f"{cell.label}; it must name one"
                )


def _unnamed_methods(suite: Suite, request: Request, registered: Registry) -> list[str]:
    """Return the ids of the methods in the user's files that nothing names.

    If neither the request (``methods``) nor a block of the suite names a method of a file, all
    methods of this file are returned. The wildcard ``"*"`` in the request does not count as a name.
    """
    files = {
        registered[method].where
        for names in (
            [name for name in request.methods if name != WILDCARD],
            *(block.methods for block in suite.blocks),
        )
        for name in names
        for method in methods_named(name, registered)
    }
    return [
        name
        for name, info in registered.items()
        if info.where.endswith(".py") and info.where not in files
    ]


def _check_effects(request: Request, jobs: Sequence[Job]) -> None:
    """Raise CoarticError if ``trials``, ``runs`` or a family file has no effect.

    A request for one run (``runs`` = 1) is always allowed.
    """
    methods = {job.cell.method.name: job.cell.method for job in jobs}
    if request.trials and not any("trials" in method.defaults for method in methods.values()):
        raise CoarticError(
            f"trials has no effect: no method has this parameter ({', '.join(methods)})"
        )
    if request.runs not in (None, 1, range(1)) and not any(
        method.stochastic for method in methods.values()
    ):
        raise CoarticError(
            f"runs has no effect: no method depends on a seed ({', '.join(methods)}), so each has "
            "one run"
        )
    for path in request.family_files:
        family = read_family(path).name
        if not any(job.cell.task.name.startswith(f"{family}/") for job in jobs):
            raise CoarticError(
                f"{path} has no effect: the tasks contain no instance of {family}. Name some, such "
                f"as {family}/i000..i009"
            )


def _check_trials(trials: int, jobs: Iterable[Job]) -> None:
    """Raise CoarticError if two cells differ only in their numbers of trials.

    With ``trials`` trials, such cells would be equal. ``jobs`` are the planned jobs, with the
    numbers of trials that the suite and the methods set.
    """
    first_jobs = dict[str, Job]()
    for job in jobs:
        cell, others = job.cell, {**job.cell.parameters, "trials": trials}
        first_job = first_jobs.setdefault(replace(cell, parameters=others).digest, job)
        if first_job is not job:
            first, other = (each.cell.parameters["trials"] for each in (first_job, job))
            raise CoarticError(
                f"trials is {trials}, but suite {job.suite!r} compares {first} with {other} trials "
                f"of {cell.method.name} on {cell.task.name}: leave trials out, or change the suite"
            )


def _asked_tasks(
    suite: Suite, request: Request
) -> tuple[dict[str, None], dict[str, Task], TaskNamed]:
    """Look up the tasks that a request names.

    Returns
    -------
    names : dict
        Names of the tasks as keys, in the order of the request; the values are None.
    own : dict
        Dict that maps names to the named tasks that the suite does not have: tasks of the user, and
        instances of families.
    task_named : callable
        Function that returns the task with a given name or file.

    Raises
    ------
    CoarticError
        A file cannot be used, a family is unknown, or a task has the name of another task. Whether
        other names are tasks of the suite is not checked.
    """
    for path in request.family_files:
        check_kind(str(path), "family")
    parents = [task.rpartition("/")[0] for task in request.tasks if isinstance(task, str)]
    paths = (*request.family_files, *(Path(parent) for parent in parents if is_file(parent)))
    families = own_families([*dict.fromkeys(paths)])
    names, own = dict[str, None](), dict[str, Task]()

    def task_named(name: str) -> Task:
        address = address_of(name)
        if name in own:
            return own[name]
        if address is not None and address.family in families:
            return instance_of(families[address.family], address)
        return load_task(name)

    for asked in request.tasks:
        if isinstance(asked, str) and not asked.endswith(".toml"):
            parent, _, numbers = asked.rpartition("/")
            name = f"{load_family(parent).name}/{numbers}" if is_file(parent) else asked
            names |= dict.fromkeys(named_by(name))
            continue
        task = load_task(asked) if isinstance(asked, str) else check_task(asked)
        is_known = task.name in builtin_tasks() or task.family in (*families, *shipped_families())
        if (task_named(task.name) if is_known else own.setdefault(task.name, task)) != task:
            owner = "a shipped task" if is_known else "another task"
            raise CoarticError(
                f"{asked}: the name {task.name!r} belongs to {owner}: give this task another name"
            )
        names[task.name] = None
    of_suite, suite_tasks = set[str](), list[Task]()
    for number, block in enumerate(suite.blocks, 1):
        with errors_of_block(suite, number):
            of_suite |= {name for entry in block.tasks for name in named_by(entry)}
            suite_tasks += tasks_of(block, (), task_named) if own else ()
    own = {name: task for name, task in own.items() if task not in suite_tasks}
    instances = (name for name in names if name not in of_suite and address_of(name))
    own |= {name: task_named(name) for name in instances}
    return names, own, task_named


def _world_of(request: Request) -> MotionModel:
    """Return the world of a request, by default the paper's."""
    return request.model[0] if request.model else PAPER


def _worlds_beside(jobs: Sequence[Job], request: Request) -> dict[MotionModel, set[str]]:
    """Return the worlds of the jobs of a suite, with the names of the tasks of their jobs.

    Methods that the request adds to the suite run in all of them; methods of the suite run on added
    tasks in the paper's world, if the suite has it. Without jobs there is only the world of the
    request.
    """
    worlds = defaultdict[MotionModel, set[str]](set) if jobs else {_world_of(request): set[str]()}
    for made in jobs:
        worlds[PAPER._replace(**differences(made.cell.model))].add(made.cell.task.name)
    return worlds


def _suite_jobs(
    suite: Suite,
    request: Request,
    registered: Registry,
    own: Collection[str],
    task_named: TaskNamed,
    job: Callable[..., Job],
    left_out: Collection[str],
) -> Iterator[Job]:
    """Yield the jobs of all blocks of a suite.

    Parameters
    ----------
    suite : Suite
    request : Request
    registered : mapping of str to MethodInfo
        Dict that maps ids to all known methods.
    own : collection of str
        Names of tasks that are added to each block whose ``tasks`` contain ``*``.
    task_named : callable
        Function that returns the task with a given name.
    job : callable
        Function that makes a job: :func:`_job_of` without its first two arguments.
    left_out : collection of str
        Ids of methods that will not run. It is no error if they do not apply.

    Yields
    ------
    Job

    Raises
    ------
    CoarticError
        A method or a parameter is unknown, the ``goals`` of a block leave no task, or a method does
        not apply to a task of a block without wildcards.
    """
    for number, block in enumerate(suite.blocks, 1):
        with errors_of_block(suite, number):
            named = itertools.chain(*(methods_named(name, registered) for name in block.methods))
            methods = [registered[name] for name in dict.fromkeys(named)]
            # In a block with a wildcard, methods are skipped on tasks to which they do not apply.
            is_open = WILDCARD in "".join((*block.methods, *block.tasks))
            tasks = [*tasks_of(block, own, task_named)]
            if block.goals is not None and not tasks and not own:
                raise CoarticError(f"goals = {[*block.goals]} leaves no task")
            worlds = block.model or suite.model
            if request.model and worlds:
                warnings.warn(
                    f"suite {suite.name!r}, block {number}, is left out: it has a world of its own "
                    f"({', '.join(describe_parameters(differences(world)) for world in worlds)})",
                    stacklevel=2,
                )
                continue
            for task, method, world in itertools.product(tasks, methods, worlds or (None,)):
                for values in itertools.product(*block.grid.values()):
                    parameters = block.parameters | dict(zip(block.grid, values, strict=True))
                    chosen = world or _world_of(request)
                    reason = method.refuses(chosen) or method.inapplicable_reason(task, parameters)
                    if reason is None and method.is_ours:
                        reason = reason_against_named(parameters, outline_of(task), chosen)
                    if reason is None:
                        yield job(task, method, parameters, block.runs, chosen, block.called)
                    elif not is_open and method.name not in left_out:
                        raise CoarticError(
                            f"{reason}; name in a block only methods that apply to all of its tasks"
                        )


def _job_of(
    suite: Suite,
    request: Request,
    task: Task,
    method: MethodInfo,
    parameters: Mapping[str, Any] | None = None,
    runs: int | None = None,
    world: MotionModel | None = None,
    called: str | None = None,
) -> Job:
    """Return the job of a method with parameters on a task.

    Each of the following values is taken from the first source that sets it:

    - the numbers of the runs: the request, the block (``runs``), the suite;
    - the number of trials: the request, the block (``parameters``), the suite, the default of the
      method;
    - the world: the block or the suite (``world``), the request, the paper's world;
    - the limit of CPU time: the request, the suite.

    A method that is not stochastic has only run 0. Its job has no runs if the runs of the request
    do not begin at 0.
    """
    trials, parameters = request.trials or suite.trials, {**(parameters or {})}
    if request.trials:
        parameters.pop("trials", None)
    world = _world_of(request) if world is None else world
    cell = cell_of(task, method, parameters, trials, request.trial_budget, world)
    asked = request.runs or runs or suite.runs
    numbers = asked if isinstance(asked, range) else range(asked)
    numbers = numbers if method.stochastic else range(numbers.start, 1)
    limit_s = request.time_limit_s or suite.time_limit_s
    due = min(filter(None, (trials, request.trial_budget)), default=None)
    return Job(cell, request.seed, numbers, limit_s, suite.name, due, called or "")


def _why_nothing_runs(
    suite: Suite,
    request: Request,
    idle: Sequence[Task],
    methods: Iterable[MethodInfo],
    jobs: Sequence[Job],
) -> str:
    """Return a sentence that explains why methods have no runs.

    Parameters
    ----------
    suite : Suite
    request : Request
    idle : sequence of Task
        Tasks that the request names and on which none of the methods runs. The sentence explains
        only the first of them. If ``idle`` is empty, the sentence explains the tasks of ``jobs``.
    methods : iterable of MethodInfo
        The methods that the request asks for.
    jobs : sequence of Job
        All jobs of the plan before methods were selected.
    """
    tasks = idle[:1] or tasks_by_name(job.cell.task for job in jobs).values()
    reasons = dict.fromkeys(
        method.refuses(_world_of(request)) or method.inapplicable_reason(task)
        for task in tasks
        for method in methods
    )
    labels = ", ".join(dict.fromkeys(job.cell.label for job in jobs)) or "no methods for it"
    reason = "; ".join(filter(None, reasons)) or f"suite {suite.name!r} has {labels}"
    where = f"task {idle[0].name!r}" if idle else "any of the tasks"
    return f"no method runs on {where}: {reason}."


def _distinct_jobs(jobs: Iterable[Job]) -> list[Job]:
    """Return the first job of each cell.

    Raises CoarticError if two jobs of the same cell have different numbers of runs, or if two cells
    have the same name, because tables would take them for one.
    """
    distinct, named = dict[str, Job](), dict[tuple[str, str, str], str]()
    for job in jobs:
        cell = job.cell
        if cell.digest != named.setdefault((cell.task.name, cell.world, cell.label), cell.digest):
            raise CoarticError(
                f"two settings have the name {cell.label} on {cell.task.name}: leave out one of "
                "the values, such as 1 and '1'"
            )
        first_job = distinct.setdefault(cell.digest, job)
        if first_job.numbers != job.numbers:
            raise CoarticError(
                f"{job.cell.label} on {job.cell.task.name}: the suite asks for "
                f"{pluralize(len(first_job.numbers), 'run')}, and in a later block for "
                f"{len(job.numbers)}; ask for one number of runs"
            )
    return list(distinct.values())
