"""Include the runs of other folders: shipped results, or results of another machine or person.

Folders go together if they have the same suite, seed and trial budget, the same task for each name,
the same version or code of each method and the same parameters of each of its settings. Versions of
coartic and of libraries, and machines, may differ. A folder may lack runs.
"""

from __future__ import annotations

import itertools
import os
import warnings
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from coartic.benchmarks.provenance import made_with
from coartic.benchmarks.reproduce import compare_runs
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import counted
from coartic.runs.plan import Job, hash_of
from coartic.runs.shipped import SHIPPED, open_shipped
from coartic.runs.store import Store, open_store, writing


def include_folders(
    plan: Sequence[Job],
    folders: Sequence[str | Path],
    out: Path,
    tasks: Collection[str] | None = None,
) -> list[Job]:
    """Copy the runs of other folders' plans into ``out``; store there, and return, the joined plan.

    ``plan`` has one job at least; folder ``shipped`` stands for the shipped results. The joined
    plan has the cells of ``plan`` and, on ``tasks`` (None: on all), cells with a run 0 of the
    folders. Missing runs are left to :func:`.perform`. A warning names a folder whose plan has, on
    ``tasks``, runs that the joined plan lacks, or another stochastic cell with fewer runs in the
    joined plan than ``plan`` asks for of its own.

    Raises CoarticError if a folder cannot be read or is ``out``, if runs of ``plan`` do not begin
    at 0, if the folders do not go together, and if two folders, or a folder and ``out``, have
    different results of a run. Then nothing is copied.
    """
    if any(job.numbers[0] for job in plan):
        raise CoarticError(
            "a range of runs is a part of an array: include the folders of all parts afterwards, "
            "with the number of all runs"
        )
    with ExitStack() as stack:
        sources: dict[str, Store] = {}
        for name in map(str, folders):
            if name == SHIPPED:
                sources[name] = stack.enter_context(open_shipped(plan[0].suite))
                continue
            folder = folder_named(name)
            if folder.resolve() == out.resolve():
                raise CoarticError(f"{name} cannot include itself: choose another --out")
            if not os.path.lexists(folder):
                raise CoarticError(
                    f"no folder {name!r}; {SHIPPED!r} stands for the shipped results"
                )
            sources[name] = stack.enter_context(open_store(folder))
        for source in sources.values():
            source.check_file()  # before the first row is copied
        joined = _join(plan, sources, tasks)
        target = stack.enter_context(writing(out))
        _check_same_results({str(out): target, **sources})
        target.replace_plan(joined, made_with())
        for source in sources.values():
            target.include(source)
    return joined


def _join(
    plan: Sequence[Job], sources: Mapping[str, Store], tasks: Collection[str] | None
) -> list[Job]:
    """Return the plan with the cells of the sources (stores by name), with ``tasks`` only their
    cells on these tasks. A cell has the runs that the plan asks for, and the runs that follow in
    the sources without a gap; without any it is left out. Raises CoarticError for a contradiction
    (:func:`_check_together`)."""
    whole = {name: source.plan() for name, source in sources.items()}
    plans = {
        name: [job for job in jobs if tasks is None or job.cell.task.name in tasks]
        for name, jobs in whole.items()
    }
    held = {
        (whole[name][position].cell.digest, number)
        for name, source in sources.items()
        for position, number, *_ in source.present()
    }
    asked = {job.cell.digest: len(job.numbers) for job in plan}
    # Runs of a source are not performed here: their method may have other code here.
    missing = [
        job for job in plan if not held.issuperset((job.cell.digest, n) for n in job.numbers)
    ]
    parts = {**plans, "this command": missing}
    _check_together(plan[0], parts)
    methods = {job.cell.method.name: job.cell.method for part in parts.values() for job in part}
    for job in plan:  # failures are performed again where the code is here
        if methods[job.cell.method.name].code == job.cell.method.code:
            methods[job.cell.method.name] = job.cell.method
    jobs: dict[str, Job] = {}
    for job in itertools.chain(plan, *plans.values()):
        digest = job.cell.digest
        runs = asked.get(digest, 0)
        while (digest, runs) in held:
            runs += 1
        if runs:
            cell = replace(job.cell, method=methods[job.cell.method.name])
            jobs.setdefault(digest, replace(plan[0], cell=cell, numbers=range(runs)))
    _warn_of_gaps(asked, plans, jobs)
    return list(jobs.values())


def _warn_of_gaps(
    asked: Mapping[str, int], plans: Mapping[str, Sequence[Job]], jobs: Mapping[str, Job]
) -> None:
    """Warn of a source whose plan has runs that the joined plan lacks. Warn, too, of a source with
    a cell (method and task) of a stochastic method that ``asked`` lacks, with all its runs joined,
    if it has fewer runs than the largest number in ``asked``. ``asked``: numbers
    of runs asked for, by digest of the cell; ``plans``: plans by name of the source; ``jobs``:
    joined plan, by digest."""
    most = max(asked.values())
    for name, part in plans.items():
        lacking, few = list[Job](), list[Job]()
        for job in part:
            digest, method = job.cell.digest, job.cell.method
            there = len(jobs[digest].numbers) if digest in jobs else 0
            if there < len(job.numbers):
                lacking.append(job)
            elif digest not in asked and method.stochastic and there < most:
                few.append(job)
        if lacking:
            words = f"{name} is not finished: it lacks runs of {_named(lacking)}"
            warnings.warn(
                f"{words}, and gives those before the first that is missing", stacklevel=4
            )
        if few:
            runs = counted(len(jobs[few[0].cell.digest].numbers), "run")
            words = f"{name} has {runs} of {_named(few)}; {most} are asked for here"
            warnings.warn(words, stacklevel=4)


def _named(jobs: Sequence[Job]) -> str:
    """Return words that name the cell of the first job, and count the other jobs, such as
    ``cma-es/bandit on ascending and of 2 others``."""
    others = f" and of {counted(len(jobs) - 1, 'other')}" if len(jobs) > 1 else ""
    return f"{jobs[0].cell.label} on {jobs[0].cell.task.name}{others}"


def _check_together(first: Job, parts: Mapping[str, Sequence[Job]]) -> None:
    """Raise CoarticError if the first jobs of two parts differ in suite, seed or trial budget, or
    two jobs in the definition of a task of one name, in the version or code of a method, or in a
    parameter of one label on one task. ``parts`` holds jobs by their origin, such as a folder;
    ``first`` stands for a part without jobs."""
    first_said: dict[str, tuple[str, object]] = {}

    def agree(where: str, what: str, value: object, hint: str = "") -> None:
        origin, there = first_said.setdefault(what, (where, value))
        if there != value:
            raise CoarticError(f"{what} is {there} in {origin} and {value} in {where}{hint}")

    for where, part in parts.items():
        job = part[0] if part else first
        agree(where, "the suite", repr(job.suite))
        agree(where, "the seed", job.seed)
        agree(where, "the trial budget", job.cell.trial_budget or "unlimited")
    for where, cell in ((where, job.cell) for where, part in parts.items() for job in part):
        name, method = cell.task.name, cell.method
        agree(where, f"task {name!r}", f"definition {hash_of(cell.definition)[:8]}")
        kind = "version" if method.is_ours else "code"
        hint = ": leave it out of one of them" + ", or give it another name" * (not method.is_ours)
        agree(where, f"method {method.name!r}", f"{kind} {method.code}", hint)
        cell_named = f"{cell.label} on {name}"
        agree(where, f"the list of parameters of {cell_named}", sorted(cell.parameters))
        for key, value in cell.parameters.items():
            agree(where, f"{key} of {cell_named}", value)


def _check_same_results(stores: Mapping[str, Store]) -> None:
    """Raise CoarticError if two stores, by the names of their folders, have different results of a
    run. Rewards that one of them does not keep do not count."""
    first_said = dict[str, tuple[str, str]]()
    for name, store in stores.items():
        for run_id, result in store.results().items():
            first, there = first_said.setdefault(run_id, (name, result))
            if there == result:
                continue
            run = store.run(run_id)
            if changes := compare_runs(stores[first].run(run_id), run):
                raise CoarticError(
                    f"run {run.number} of {run.cell.method.name} on {run.cell.task.name} differs "
                    f"in {first} and {name} ({run_id}): {changes[0]}"
                )
