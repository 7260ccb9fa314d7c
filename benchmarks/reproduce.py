"""One run again: find its record, perform it anew, compare."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from coartic import CoarticError, Trajectory, trajectory
from coartic.benchmarks.harness import record_of
from coartic.benchmarks.registry import Registry, unknown
from coartic.benchmarks.sandbox import supervise
from coartic.benchmarks.specification import Limits, RunSpec, Setting
from coartic.benchmarks.store import Store
from coartic.runs.packs import Packs, check_layout
from coartic.runs.record import Record, RecordError


def find_record(prefix: str, folder: Path) -> tuple[Store, Record]:
    """The one record whose id starts with ``prefix``, in a folder or any below it.

    Raises RecordError where there is none, more than one, or it is damaged or forged.
    """
    wanted = _safe(prefix)
    folders = sorted({path.parent for path in folder.glob("**/records") if path.is_dir()})
    for place in folders:
        check_layout(place)
    packs = [(Store(place), Packs(place)) for place in folders]
    found = [(store, run_id) for store, own in packs for run_id in own if run_id.startswith(wanted)]
    ids = sorted({run_id for _, run_id in found})
    if not ids:
        raise RecordError(f"there is no run {prefix!r} in {folder}. Name another folder with --in.")
    if len(ids) > 1:
        shown = ", ".join(ids[:4]) + (", ..." if len(ids) > 4 else "")
        raise RecordError(f"{prefix!r} is the beginning of {len(ids)} runs: {shown}")
    store = found[0][0]
    record = store.read(ids[0])
    record.check()
    return store, record


def trajectory_of(record: Record) -> Trajectory:
    """The solution of a record tick by tick, from nothing but the record.

    Raises CoarticError where the run has no solution.
    """
    if record.solution is None:
        raise CoarticError(
            f"run {record.run_id} has no solution to show: {record.status}, {record.reason}"
        )
    return trajectory(record.task, record.movements(), record.model)


def spec_of(record: Record, known: Registry, limits: Limits) -> RunSpec:
    """The specification of a record, to be performed by the code that is here now."""
    if record.method not in known:
        raise unknown("method", record.method, known)
    specification = record.specification
    setting = Setting(
        task=record.task,
        entry=known[record.method],
        parameters=tuple(specification.parameters.items()),
        limits=Limits(limits.time_s, specification.trial_budget),
        model=record.model,
    )
    return setting.spec(record.run, specification.seed)


def perform_once(spec: RunSpec) -> Record:
    """The record of one run, performed in a process of its own."""
    return record_of(supervise(spec.job()), spec)


def differences(a: Record, b: Record) -> list[str]:
    """In what the results of two records differ; times and surroundings apart."""
    first, second = a.result(), b.result()
    found = [
        f"{name}: {_shown(first[name])} against {_shown(second[name])}"
        for name in ("status", "bound", "details")
        if first[name] != second[name]
    ]
    if a.reason != b.reason:
        found.append(f"reason: {a.reason!r} against {b.reason!r}")
    for name in ("solution", "initial", "replay"):
        if first[name] != second[name]:
            found.append(f"{name}: {_score(first[name])} against {_score(second[name])}")
    ours, theirs = first["meter"] or {}, second["meter"] or {}
    found += [
        f"{name}: {ours.get(name)} against {theirs.get(name)}"
        for name in ours | theirs
        if ours.get(name) != theirs.get(name)
    ]
    if a.rewards != b.rewards:
        found.append(f"rewards by trial differ{_first_difference(a.rewards, b.rewards)}")
    return found


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 200 else f"{text[:200]}..."


def _score(solution: dict[str, Any] | None) -> str:
    if solution is None:
        return "none"
    movements = len(solution["movements"])
    return f"{solution['reward']} with {solution['hands']} in {movements} movements"


def _first_difference(a: Sequence[Any], b: Sequence[Any]) -> str:
    for index, (x, y) in enumerate(zip(a, b, strict=False)):
        if x != y:
            return f", first at trial {index}: {x} against {y}"
    return f": {len(a)} trials against {len(b)}"


def _safe(prefix: str) -> str:
    if not prefix or not set(prefix) <= set("0123456789abcdef-"):
        raise RecordError(f"{prefix!r} is not a run id. Give the beginning of one, such as 3f2a9c.")
    return prefix
