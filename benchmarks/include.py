"""Include the runs of other folders: shipped results, or results of another machine or person.

Results folders can be joined if all of them agree in

- the suite, its seed and the trial budget;
- the task that each task name stands for;
- the version or code of each method (with an exception: if the code of a method from a file has
  changed since its runs were made, these runs are left out, and a warning names the method);
- the parameters of each method and setting on each task.

The folders may come from different machines, and from different versions of coartic and of
libraries. A folder may lack runs of its own plan.
"""

from __future__ import annotations

import itertools
import os
import warnings
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from coartic.benchmarks.provenance import made_with
from coartic.benchmarks.reproduce import compare_runs
from coartic.errors import CoarticError
from coartic.internal.text import pluralize
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, hash_of
from coartic.runs.shipped import SHIPPED, SHIPPED_SUITES, open_shipped, results_folder
from coartic.runs.store import Store, open_store, open_store_for_writing


def include_folders(
    plan: Sequence[Job],
    folders: Sequence[str | Path],
    out: Path,
    tasks: Collection[str] | None = None,
    methods: Mapping[str, MethodInfo] | None = None,
) -> list[Job]:
    """Copy the runs of other folders into a results folder, and join their plans.

    A cell is a method with its parameters on a task. The joined plan consists of the cells of
    ``plan``, and of those cells in the plans of the other folders of which run 0 is stored in one
    of these folders. The joined plan replaces the plan of ``out``. This function does not perform
    missing runs; :func:`.perform` does.

    Parameters
    ----------
    plan : sequence of Job
        Jobs of this command, at least one. The numbers of the runs of each job begin at 0.
    folders : sequence of str or Path
        Results folders to include. ``"shipped"`` stands for the shipped results.
    out : Path
        Results folder into which the runs are copied. A missing folder is made.
    tasks : collection of str, optional
        Names of tasks. Cells of the other folders on tasks that are not named here are left out. By
        default, cells on all tasks are joined.
    methods : mapping of str to MethodInfo, optional
        Dict that maps ids to the methods that the command knows; by default the methods of
        ``plan``. If a method in this dict is from a file, its runs in other folders are used only
        if the same code made them.

    Returns
    -------
    list of Job
        The joined plan.

    Raises
    ------
    CoarticError
        One of these is the case:

        - a folder does not exist or cannot be read, or is ``out`` itself;
        - ``out`` cannot be written, or has results of another suite;
        - the numbers of the runs of a job of ``plan`` do not begin at 0;
        - the folders do not agree (:mod:`.include` lists what must be equal);
        - two folders have different results of the same run. One of them may be ``out``.

    Warns
    -----
    UserWarning
        One of these is the case:

        - the joined plan lacks runs of the plan of a folder, because these runs, or earlier runs of
          the same cell, are stored in none of the folders;
        - the plan of a folder contains a cell of a stochastic method that ``plan`` lacks, and the
          joined plan has fewer runs of this cell than the largest number of runs that ``plan`` asks
          for;
        - a folder contains runs of a method from a file that were made by other code than the code
          in ``methods``.
    """
    if any(job.numbers[0] for job in plan):
        raise CoarticError(
            "runs do not begin at 0: they are a part of an array. Include the folders of all parts "
            "later, with the number of all runs"
        )
    with ExitStack() as stack:
        sources: dict[str, Store] = {}
        for folder in map(results_folder, folders):
            name = str(folder)
            if name in SHIPPED_SUITES:
                suite = plan[0].suite if name == SHIPPED else SHIPPED_SUITES[name]
                sources[name] = stack.enter_context(open_shipped(suite))
                continue
            if folder.resolve() == out.resolve():
                raise CoarticError(f"{name} cannot include itself: choose another --out")
            if not os.path.lexists(folder):
                raise CoarticError(
                    f"folder {name!r} does not exist; {SHIPPED!r} stands for the shipped results"
                )
            sources[name] = stack.enter_context(open_store(folder))
        for source in sources.values():
            source.check_file()  # all sources are checked before the first row is copied
        known = methods or {job.cell.method.name: job.cell.method for job in plan}
        joined = _join(plan, sources, tasks, known)
        target = stack.enter_context(open_store_for_writing(out))
        _check_same_results({str(out): target, **sources})
        target.replace_plan(joined, made_with())
        for source in sources.values():
            target.include(source)
    return joined


def _join(
    plan: Sequence[Job],
    sources: Mapping[str, Store],
    tasks: Collection[str] | None,
    known: Mapping[str, MethodInfo],
) -> list[Job]:
    """Join the plan of a command with the plans of other results folders.

    All cells of ``plan`` are in the joined plan. A cell of another folder is left out if

    - its task is not in ``tasks`` (None stands for all tasks);
    - its method is from a file, and the code of the method differs from the code in ``known`` (a
      warning says so);
    - it is not in ``plan``, and no folder contains run 0 of the cell.

    The runs of a cell of the joined plan are numbered from 0 without gaps: first all runs that
    ``plan`` asks for, then the runs with the next numbers, up to the first one that is stored in
    none of the folders.

    Parameters
    ----------
    plan : sequence of Job
        Jobs of the command.
    sources : mapping of str to Store
        Dict that maps the name of each other folder to its opened store.
    tasks : collection of str or None
        Names of the tasks whose cells are joined; None for all tasks.
    known : mapping of str to MethodInfo
        Dict that maps ids to the methods of the command.

    Returns
    -------
    list of Job
        The jobs of the joined plan: the cells of ``plan``, then the other cells.

    Raises
    ------
    CoarticError
        The folders do not agree (:mod:`.include`).
    """

    def is_current(job: Job) -> bool:
        here = known.get(job.cell.method.name, job.cell.method)
        return here.is_ours or here.code == job.cell.method.code

    plans, stored = dict[str, list[Job]](), set[tuple[str, int]]()
    for name, source in sources.items():
        on_tasks = {
            position: job
            for position, job in enumerate(source.plan())
            if tasks is None or job.cell.task.name in tasks
        }
        plans[name], unused = [*filter(is_current, on_tasks.values())], Counter[str]()
        for position, number, *_ in source.present():
            if (job := on_tasks.get(position)) and is_current(job):
                stored.add((job.cell.digest, number))
            elif job:
                unused[job.cell.method.name] += 1
        for method, count in unused.items():
            warnings.warn(
                f"{name}: {pluralize(count, 'run')} of {method} not used, made before its file, or "
                "a file that it imports or reads, changed",
                stacklevel=3,
            )
    asked = {job.cell.digest: len(job.numbers) for job in plan}
    # Cells of ``plan`` with all runs in the sources will not be performed here. So built-in methods
    # may have another version here.
    missing = [
        job for job in plan if not stored.issuperset((job.cell.digest, n) for n in job.numbers)
    ]
    parts = {**plans, "this command": missing}
    _check_joinable(plan[0], parts)
    methods = {job.cell.method.name: job.cell.method for part in parts.values() for job in part}
    for job in plan:  # failed runs are performed again if the code is available here
        if methods[job.cell.method.name].code == job.cell.method.code:
            methods[job.cell.method.name] = job.cell.method
    jobs: dict[str, Job] = {}
    for job in itertools.chain(plan, *plans.values()):
        digest = job.cell.digest
        runs = asked.get(digest, 0)
        while (digest, runs) in stored:
            runs += 1
        if runs:
            cell = replace(job.cell, method=methods[job.cell.method.name])
            of_suite = job.of_suite and digest in asked
            own = replace(plan[0], called=job.called, of_suite=of_suite)
            jobs.setdefault(digest, replace(own, cell=cell, numbers=range(runs)))
    _warn_of_gaps(asked, plans, jobs)
    return list(jobs.values())


def _warn_of_gaps(
    asked: Mapping[str, int], plans: Mapping[str, Sequence[Job]], jobs: Mapping[str, Job]
) -> None:
    """Warn of each folder whose plan has cells with missing or too few runs.

    A cell has missing runs if the joined plan has fewer runs of the cell than the plan of the
    folder. A cell has too few runs if its method is stochastic, the command does not ask for the
    cell, and the joined plan has fewer runs of the cell than the largest number in ``asked``.

    Parameters
    ----------
    asked : mapping of str to int
        Dict that maps the digest of each cell of the command to its number of runs.
    plans : mapping of str to sequence of Job
        Dict that maps the name of each other folder to its plan.
    jobs : mapping of str to Job
        Dict that maps the digest of each cell to its job in the joined plan.
    """
    most_runs = max(asked.values())
    for name, part in plans.items():
        lacking, few = list[Job](), list[Job]()
        for job in part:
            digest, method = job.cell.digest, job.cell.method
            runs = len(jobs[digest].numbers) if digest in jobs else 0
            if runs < len(job.numbers):
                lacking.append(job)
            elif digest not in asked and method.stochastic and runs < most_runs:
                few.append(job)
        if lacking:
            warnings.warn(
                f"{name} is not finished: it lacks runs of {_named(lacking)}. Runs after the first "
                "missing one are not included",
                stacklevel=4,
            )
        if few:
            warnings.warn(
                f"{name} has fewer than {pluralize(most_runs, 'run')}, which this command asks "
                f"for, of {_named(few)}",
                stacklevel=4,
            )


def _named(jobs: Sequence[Job]) -> str:
    """Describe the first three jobs, and say how many others there are."""
    names = [f"{job.cell.label} on {job.cell.task.name}" for job in jobs[:3]]
    more = f" and {len(jobs) - 3} more" if len(jobs) > 3 else ""
    return f"{', '.join(names)}{more}"


def _check_joinable(default: Job, parts: Mapping[str, Sequence[Job]]) -> None:
    """Raise CoarticError if two parts of the joined plan do not agree.

    ``parts`` is a dict that maps the name of each part, such as a folder, to its jobs. The suite,
    the seed and the trial budget of a part are those of its first job, or of ``default`` if the
    part has no jobs. The docstring of this module lists what must be equal.
    """
    first_values: dict[str, tuple[str, object]] = {}

    def agree(part_name: str, what: str, value: object, hint: str = "") -> None:
        origin, first_value = first_values.setdefault(what, (part_name, value))
        if first_value != value:
            raise CoarticError(
                f"{what} is {first_value} in {origin} and {value} in {part_name}{hint}"
            )

    for part_name, part in parts.items():
        job = part[0] if part else default
        agree(part_name, "the suite", repr(job.suite))
        agree(part_name, "the seed", job.seed)
        agree(part_name, "the trial budget", job.cell.trial_budget or "unlimited")
    for part_name, cell in (
        (part_name, job.cell) for part_name, part in parts.items() for job in part
    ):
        name, method = cell.task.name, cell.method
        agree(part_name, f"task {name!r}", f"definition {hash_of(cell.definition)[:8]}")
        kind = "version" if method.is_ours else "code"
        hint = ": leave it out of one of them" + (
            ", or give it another name" if not method.is_ours else ""
        )
        agree(part_name, f"method {method.name!r}", f"{kind} {method.code}", hint)
        cell_named = f"{cell.label} on {name}"
        older = ": repeat the `coartic run` command of the older folder"
        agree(part_name, f"the list of parameters of {cell_named}", sorted(cell.parameters), older)
        for key, value in cell.parameters.items():
            agree(part_name, f"{key} of {cell_named}", value)


def _check_same_results(stores: Mapping[str, Store]) -> None:
    """Raise CoarticError if two results folders have different results of the same run.

    ``stores`` is a dict that maps the name of each folder to its store. If only some of the rewards
    of a run are stored in one of the folders, only these rewards are compared.
    """
    first_results = dict[str, tuple[str, str]]()
    for name, store in stores.items():
        for run_id, result in store.results().items():
            first_name, first_result = first_results.setdefault(run_id, (name, result))
            if first_result == result:
                continue
            run = store.run(run_id)
            if changes := compare_runs(stores[first_name].run(run_id), run):
                raise CoarticError(
                    f"run {run['run']} of {run.cell.method.name} on {run.cell.task.name} differs "
                    f"between {first_name} and {name} ({run_id}): {changes[0]}"
                )
