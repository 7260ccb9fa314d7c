"""Runs performed anew, and compared with what is stored of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from coartic.benchmarks.outcome import facts_of, kept
from coartic.benchmarks.pool import Local
from coartic.benchmarks.registry import Registry
from coartic.benchmarks.worker import Job, job_of
from coartic.errors import CoarticError
from coartic.inputs import brief_value
from coartic.method import Meter
from coartic.motion.ticks import Trajectory, trajectory
from coartic.runs.store import FILE, PARTS, Run, StoredRun, open_store
from coartic.tasks.task import Task
from coartic.text import unknown


def find_run(prefix: str, folder: Path) -> tuple[Path, StoredRun]:
    """The one run whose id starts with ``prefix``, in a results folder or any below it, and that
    folder.

    Raises CoarticError where there is none, or more than one.
    """
    if not prefix or not set(prefix) <= set("0123456789abcdef-"):
        raise CoarticError(
            f"{prefix!r} is not a run id. Give the beginning of one, such as 3f2a9c."
        )
    folder_of: dict[str, Path] = {}
    for path in sorted(folder.rglob(FILE)):
        with open_store(path.parent) as store:
            folder_of |= dict.fromkeys(store.ids(prefix), path.parent)
    if not folder_of:
        raise CoarticError(
            f"there is no run {prefix!r} in {folder}. Name another folder with --in."
        )
    if len(folder_of) > 1:
        some = ", ".join(sorted(folder_of)[:4]) + (", ..." if len(folder_of) > 4 else "")
        raise CoarticError(f"{prefix!r} is the beginning of {len(folder_of)} runs: {some}")
    ((run_id, place),) = folder_of.items()
    with open_store(place) as store:
        return place, store.run(run_id)


def trajectory_of(stored: StoredRun) -> Trajectory:
    """The solution of a run tick by tick. Raises CoarticError where it has none."""
    run = stored.run
    if "solution" not in run.movements:
        raise CoarticError(
            f"run {run.run_id} has no solution to show: {run.status}, {run.row['reason']}"
        )
    return trajectory(stored.task, run.movements["solution"], stored.model)


def performed(jobs: Sequence[Job], tasks: Sequence[Task]) -> Iterator[Run]:
    """Runs of one method, each a job of one seed, in this order, in one process of their own."""
    answers = dict(Local(1).perform(jobs))
    for number, (job, task) in enumerate(zip(jobs, tasks, strict=True)):
        name = {
            "run_id": "", "suite_seed": 0, "run": 0, "seed": job.seeds[0],
            "time_limit_s": job.time_limit_s,
        }  # fmt: skip
        yield kept([name], answers[number], task, job.model)[0]


def performed_again(stored: StoredRun, registered: Registry) -> Run:
    """A stored run, performed anew by the code that is here now."""
    if stored.method not in registered:
        raise CoarticError(unknown("method", stored.method, registered))
    entry = registered[stored.method]
    job = job_of(
        entry,
        stored.task.model_dump(mode="json"),
        stored.parameters,
        (stored.run.row["seed"],),
        model=stored.model,
        trial_budget=stored.trial_budget,
        time_limit_s=stored.run.row["time_limit_s"],
    )
    return next(performed([job], [stored.task]))


def some_again(folder: Path, count: int, registered: Registry) -> Iterator[tuple[str, list[str]]]:
    """Perform ``count`` runs of a folder anew, spread over its cells, those of known methods; the
    id of each, and in what it differs from what is stored."""
    with open_store(folder) as store:
        plan = store.plan()
        ids = [
            run_id
            for position, cell in enumerate(plan.cells)
            if cell.method in registered
            and registered[cell.method].code == plan.methods[cell.method].code
            for run_id in plan.run_ids(position)
        ]
        step = max(1, len(ids) // count)
        chosen = [store.run(run_id) for run_id in ids[::step][:count]]
    for stored in chosen:
        yield stored.run.run_id, differences(stored.run, performed_again(stored, registered))


def differences(a: Run, b: Run) -> list[str]:
    """In what the results of two runs differ; times and surroundings apart."""
    changes = [
        f"{name}: {brief_value(a.row[name])} against {brief_value(b.row[name])}"
        for name in ("status", "reason", "proven_bound", "details", *Meter.COUNTS)
        if a.row[name] != b.row[name]
    ]
    for part, prefix in zip(PARTS, ("", "initial_", "replay_"), strict=True):
        first, second = ([*map(facts_of, run.movements.get(part, ()))] for run in (a, b))
        if first != second:
            scores = [
                f"{run.row[f'{prefix}reward']} with {run.row[f'{prefix}hands']}" for run in (a, b)
            ]
            changes.append(f"{part}: {scores[0]} against {scores[1]}")
    if a.rewards != b.rewards:
        changes.append(f"rewards by trial differ{first_difference(a.rewards, b.rewards)}")
    return changes


def first_difference(a: Sequence[Any], b: Sequence[Any]) -> str:
    """Where two lists of rewards differ first, in words."""
    for index, (x, y) in enumerate(zip(a, b, strict=False)):
        if x != y:
            return f", first at trial {index}: {x} against {y}"
    return f": {len(a)} trials against {len(b)}"
