"""Perform stored runs again, and compare the results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

from coartic.benchmarks.pool import Local
from coartic.benchmarks.registry import Registry
from coartic.benchmarks.scoring import score
from coartic.errors import CoarticError, SolutionError
from coartic.internal.limits import brief_value
from coartic.internal.text import plain
from coartic.method import Meter
from coartic.pictures.trajectories import Trajectory, trajectory
from coartic.runs.plan import Job
from coartic.runs.record import PARTS, UNREPEATED, Run, too_long
from coartic.runs.store import open_store


def find_run(prefix: str, folder: Path) -> Run:
    """Return the run of a results folder whose id begins with ``prefix``.

    Raises CoarticError if there is no such run, or more than one, for an empty prefix, and for a
    folder that cannot be read.
    """
    if not prefix or not set(prefix) <= set("0123456789abcdef-."):
        raise CoarticError(
            f"{prefix!r} is not a run id. Give the beginning of one, such as 3f2a9c: "
            "column run_ids of a report's tables names the runs of each row."
        )
    with open_store(folder) as store:
        ids = sorted(store.ids(prefix))
        if not ids:
            raise CoarticError(f"there is no run {prefix!r} in {folder}")
        if len(ids) > 1:
            some = ", ".join(ids[:4]) + (", ..." if len(ids) > 4 else "")
            raise CoarticError(f"{prefix!r} is the beginning of {len(ids)} runs: {some}")
        return store.run(ids[0])


def trajectory_of(run: Run) -> Trajectory:
    """Return the movements of a run's solution, executed and sampled at each tick. Raises
    CoarticError if the run has no solution, or its solution cannot be executed or is too long."""
    if "solution" not in run.scores:
        why = f"{run.outcome.status}, {run.outcome.reason}"
        raise CoarticError(f"run {run.id} has no solution to show: {why}")
    task, movements = run.cell.task, run.solution.movements
    try:
        if error := too_long(task, movements):
            raise error
        return trajectory(task, movements)
    except (SolutionError, ValueError) as error:
        raise CoarticError(f"run {run.id} cannot be shown: {error}") from None


def perform_in_order(
    jobs: Sequence[Job], workers: int = 1, *, verbose: bool = False
) -> Iterator[Run]:
    """Perform jobs, and yield the scored runs, which are not stored, as they finish. A new process
    performs all jobs of a method in order, while it lives; at most ``workers`` processes (-1: one
    a core) run at once. ``verbose`` shows what methods print and log."""
    with closing(Local(workers, verbose=verbose).perform(jobs, in_order=True)) as answers:
        for job, outcomes in answers:
            yield from score(job, outcomes)


def perform_runs_again(runs: Sequence[Run], registered: Registry) -> Iterator[tuple[Run, Run]]:
    """Perform stored runs again, by the methods that are here, and yield pairs of a stored run and
    the new run, which is not stored, as they finish. ``registered`` must have the methods.

    Raises CoarticError if a method no longer takes the parameters of a run.
    """
    of_job = dict[int, Run]()
    jobs = list[Job]()
    for run in runs:
        method = registered[run.cell.method.name]
        try:
            method.complete(run.cell.parameters)
        except CoarticError as error:
            version = plain(str((run.outcome.environment or {}).get("coartic")), 20)
            raise CoarticError(
                f"run {run.id} cannot be performed here: {error}. Version {version} of coartic "
                "made it."
            ) from None
        jobs.append(replace(run.job, cell=replace(run.cell, method=method)))
        of_job[id(jobs[-1])] = run
    with closing(Local().perform(jobs)) as answers:
        for job, outcomes in answers:
            (again,) = score(job, outcomes)
            yield of_job[id(job)], again


def some_runs(folder: Path, count: int, registered: Registry) -> list[Run]:
    """Return at most ``count`` (1 or more) runs of a folder's plan, at equal steps, of methods that
    have in ``registered`` the same version or code as in the run. Raises CoarticError if there is
    no such run."""
    with open_store(folder) as store:
        plan = store.plan()
        ids = [
            plan[position].run_id(number)
            for position, number, *_ in store.present()
            if (method := plan[position].cell.method).name in registered
            and registered[method.name].code == method.code
        ]
        if not ids:
            raise CoarticError(
                f"{folder} has no run of a method that has the same version or code here"
            )
        step = max(1, len(ids) // count)
        return [store.run(run_id) for run_id in ids[::step][:count]]


def compare_runs(a: Run, b: Run) -> list[str]:
    """Return the differences between the results of two runs, in words, an empty list for equal
    results: status, reason, details, counts, ticks with motor noise, movements and rewards. Rewards
    that a run does not keep do not count."""
    if a.is_downsampled or b.is_downsampled:
        a, b = a.downsample(), b.downsample()
    first, second = (
        run.to_row()
        | {"details": {k: v for k, v in run.outcome.details.items() if k != UNREPEATED}}
        for run in (a, b)
    )
    names = ["status", "reason", "details", *Meter.COUNTS]
    if a.id == b.id:  # from which the motor noise is drawn
        names.append("noisy_ticks")
    changes = [
        f"{name}: {brief_value(first[name])} against {brief_value(second[name])}"
        for name in names
        if first[name] != second[name]
    ]
    for part in PARTS:
        if a.movement_data(part) != b.movement_data(part):
            scores = [run.scores.get(part) for run in (a, b)]
            words = [f"{each.reward} with {each.hands}" if each else "nothing" for each in scores]
            changes.append(f"{part}: {' against '.join(words)}")
    rewards = a.outcome.rewards, b.outcome.rewards
    if rewards[0] != rewards[1]:
        pairs = enumerate(zip_longest(*rewards, fillvalue="no trial"))
        trial, (x, y) = next((trial, pair) for trial, pair in pairs if pair[0] != pair[1])
        changes.append(f"rewards by trial differ, first at trial {trial}: {x} against {y}")
    return changes
