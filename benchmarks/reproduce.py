"""Perform stored runs again, and compare the new results with the stored ones."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from shlex import quote

from coartic.benchmarks.pool import Local
from coartic.benchmarks.registry import Registry
from coartic.benchmarks.scoring import score
from coartic.errors import CoarticError, SolutionError
from coartic.internal.limits import brief_value
from coartic.internal.text import plain
from coartic.method import Meter
from coartic.pictures.trajectories import Trajectory, trajectory
from coartic.runs.plan import Cell, Job
from coartic.runs.record import OF_NOISE, PREFIXES, UNREPEATED, Row, judged, too_long
from coartic.runs.shipped import open_results


def find_run(prefix: str, folder: Path) -> Row:
    """Return the one run of a results folder whose id begins with ``prefix``.

    Raises CoarticError if the prefix is empty or contains characters that never occur in an id, if
    no id or more than one id begins with the prefix, or if the folder cannot be read.
    """
    where = quote(str(folder))
    if not prefix or not set(prefix) <= set("0123456789abcdef-."):
        raise CoarticError(
            f"{prefix!r} is not the beginning of a run id, such as 3f2a9c; `coartic list {where}` "
            "lists the ids"
        )
    with open_results(folder) as store:
        ids = sorted(store.ids(prefix))
        if not ids:
            raise CoarticError(
                f"{folder} has no run with an id that begins with {prefix!r}; "
                f"`coartic list {where}` lists the ids"
            )
        if len(ids) > 1:
            listed = ", ".join(ids[:4]) + (", ..." if len(ids) > 4 else "")
            raise CoarticError(
                f"{prefix!r} is the beginning of {len(ids)} run ids ({listed}); write more digits"
            )
        return store.run(ids[0])


def trajectory_of(run: Row) -> Trajectory:
    """Execute the solution of a run, and return the configuration at each control tick.

    The solution is executed in the world of the run, but without motor noise. Raises CoarticError
    if the run has no solution, or if the solution cannot be executed, misses a goal, or is too long
    (:func:`.too_long`).
    """
    if "solution" not in run.movements:
        reason = f"{run['status']}, {run['reason']}"
        raise CoarticError(f"run {run['run_id']} has no solution to show: {reason}")
    task, movements = run.cell.arena, run.part("solution")
    exact = run.cell.model.without_noise()
    try:
        if error := too_long(task, movements, exact):
            raise error
        return trajectory(task, movements, exact)
    except (SolutionError, ValueError) as error:
        raise CoarticError(f"run {run['run_id']} cannot be shown: {error}") from None


def perform_in_order(
    jobs: Sequence[Job], workers: int = 1, *, verbose: bool = False
) -> Iterator[tuple[Job, Row]]:
    """Perform jobs in one process for each method, and yield the scored runs.

    The jobs of a method are performed in the order of ``jobs``. If the process of a method ends, a
    new process performs its remaining jobs. The runs are not stored.

    Parameters
    ----------
    jobs : sequence of Job
    workers : int
        Largest number of processes at once; -1 for the number of cores.
    verbose : bool
        True to show what methods print and log.

    Yields
    ------
    Job
        One of ``jobs`` (the same object). Jobs come in the order in which they finish.
    Row
        A scored run of this job.

    Raises
    ------
    CoarticError
        The processes cannot start or work (:meth:`.Local.perform`).
    """
    with closing(Local(workers, verbose=verbose).perform(jobs, in_order=True)) as answers:
        for job, outcomes in answers:
            yield from ((job, run) for run in score(job, outcomes))


def perform_runs_again(runs: Sequence[Row], registered: Registry) -> Iterator[tuple[Row, Row]]:
    """Perform stored runs again with the methods of this installation.

    Parameters
    ----------
    runs : sequence of Row
        Stored runs.
    registered : mapping of str to MethodInfo
        Dict that maps ids to all known methods, among them the methods of all ``runs``.

    Yields
    ------
    Row
        A stored run. Runs come in the order in which the new runs finish.
    Row
        The new run, which is not stored.

    Raises
    ------
    CoarticError
        A method does not accept the parameters of a stored run any more, or processes cannot start.
    """
    stored_runs = dict[int, Row]()
    jobs = list[Job]()
    for run in runs:
        method = registered[run.cell.method.name]
        try:
            method.complete(run.cell.parameters)
        except CoarticError as error:
            version = plain(str(run.environment.get("coartic")), 20)
            raise CoarticError(
                f"run {run['run_id']} cannot be performed here: {error}. Coartic {version}, which "
                "made it, can perform it again."
            ) from None
        jobs.append(replace(run.job, cell=replace(run.cell, method=method)))
        stored_runs[id(jobs[-1])] = run
    with closing(Local().perform(jobs)) as answers:
        for job, outcomes in answers:
            (new_run,) = score(job, outcomes)
            yield stored_runs[id(job)], new_run


def compare_again(
    runs: Sequence[Row], registered: Registry, *, postures: bool = True
) -> Iterator[tuple[Row, list[str]]]:
    """Perform stored runs again, and yield each with what differs (:func:`compare_runs`).

    The arguments ``runs`` and ``registered``, the order and the errors are those of
    :func:`perform_runs_again`.
    """
    for stored, again in perform_runs_again(runs, registered):
        yield stored, compare_runs(stored, again, postures=postures)


def some_runs(folder: Path, count: int, registered: Registry) -> list[Row]:
    """Select stored runs of a folder that can be performed here: every k-th run.

    A run of the folder's plan can be performed here if ``registered`` contains its method with the
    same version or code. If n runs can be performed, k is n divided by ``count``, rounded down, but
    at least 1. Every k-th run is selected, beginning with the first one, until there are ``count``
    runs. The runs are in no defined order.

    Parameters
    ----------
    folder : Path
        Results folder.
    count : int
        Largest number of runs to select, at least 1.
    registered : mapping of str to MethodInfo
        Dict that maps ids to all known methods.

    Returns
    -------
    list of Row
        The selected runs.

    Raises
    ------
    CoarticError
        No run can be performed here, or the folder cannot be read.
    """
    with open_results(folder) as store:
        plan = store.plan()
        can_run = [_can_run(job.cell, registered) for job in plan]
        ids = [
            plan[position].run_id(number)
            for position, number, *_ in store.present()
            if can_run[position]
        ]
        if not ids:
            raise CoarticError(
                f"{folder} has no run that can be performed again: its methods have other "
                "versions, other code or other parameters here"
            )
        step = max(1, len(ids) // count)
        return [store.run(run_id) for run_id in ids[::step][:count]]


def _can_run(cell: Cell, registered: Registry) -> bool:
    """Return whether a method has the same code here, and accepts the parameters of a cell."""
    method = registered.get(cell.method.name)
    if method is None or method.code != cell.method.code:
        return False
    try:
        complete = method.complete(cell.parameters)
    except CoarticError:
        return False
    return method.codes_named_in(complete) == cell.named


def execute_with_noise_again(folder: Path, *, every: bool = False) -> tuple[int, list[str]]:
    """Execute solutions of worlds with motor noise again, and compare the mean ticks.

    Runs whose mean ticks follow another version of the rule of noise are left out.

    Parameters
    ----------
    folder : Path
        Results folder.
    every : bool
        True to execute the solutions of all runs; False to execute that of one run of each cell,
        chosen at random.

    Returns
    -------
    int
        Number of executed solutions.
    list of str
        A sentence for each number that differs from the stored one.

    Raises
    ------
    CoarticError
        The folder cannot be read.
    """
    executed, wrong = 0, list[str]()
    with open_results(folder) as store:
        for run_ids in store.judged():
            for run_id in run_ids if every else [random.choice(run_ids)]:
                stored = store.run(run_id)
                (again,) = judged([stored])
                executed += 1
                wrong += [
                    f"Run {run_id}: {name} is {again[name]}, not {stored[name]}."
                    for name in OF_NOISE
                    if stored[name] != again[name]
                ]
    return executed, wrong


def compare_runs(a: Row, b: Row, *, postures: bool = True) -> list[str]:
    """Compare the results of two runs, and describe the differences.

    The compared results are the status, the reason, the details, the counts, the movements of the
    solution, of the first trial and of the replay, and the rewards of the trials. Times are not
    compared.

    - The ticks with motor noise are compared only if both runs have the same id and the same rule
      of noise.
    - If one of the runs stores only some of its rewards, only the rewards that
      :meth:`.Row.downsample` keeps are compared.

    Parameters
    ----------
    a, b : Row
        The runs.
    postures : bool
        False to leave out details, and targets and paths of movements, which can differ in bits on
        other processors. Hands and ticks of movements are compared all the same.

    Returns
    -------
    list of str
        A phrase for each result that differs; for the rewards it describes the first difference.
        The list is empty if the results are equal.
    """
    if a.is_downsampled or b.is_downsampled:
        a, b = a.downsample(), b.downsample()
    details = ({k: v for k, v in run.details.items() if k != UNREPEATED} for run in (a, b))
    pairs = [("details", *details)] if postures else []
    names = ["status", "reason", "best_trial", "practice", *Meter.COUNTS]
    if a["run_id"] == b["run_id"] and a["noise_rule"] == b["noise_rule"]:
        names += OF_NOISE  # the id is the seed of the noise
    pairs += [(name, a[name], b[name]) for name in names]
    changes = [
        f"{name}: {brief_value(x)} against {brief_value(y)}" for name, x, y in pairs if x != y
    ]
    for part, prefix in PREFIXES.items():
        first, second = (
            [m if postures else m[:4] for m in run.movements.get(part, [])] for run in (a, b)
        )
        if first != second:
            words = [
                f"{run[f'{prefix}reward']} with {run[f'{prefix}hands']}"
                if part in run.movements
                else "nothing"
                for run in (a, b)
            ]
            changes.append(f"{part}: {' against '.join(words)}")
    if a.rewards != b.rewards:
        trials = enumerate(zip_longest(a.rewards, b.rewards, fillvalue="no trial"))
        trial, (x, y) = next((trial, pair) for trial, pair in trials if pair[0] != pair[1])
        changes.append(f"rewards by trial differ, first at trial {trial}: {x} against {y}")
    return changes
