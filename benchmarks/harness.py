"""Performs a plan: what the store lacks is run, and kept as soon as it is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.executors import Answer, Executor
from benchmarks.provenance import environment
from benchmarks.specification import RunSpec
from benchmarks.store import Damage, Store, encode
from coartic import CoarticError
from coartic.method import Meter

_ROUNDS = 3  # in a row without a single answer, after which runs are given up
RETRIED = frozenset({"timeout", "crashed"})


@dataclass
class Progress:
    """How far a plan is."""

    total: int
    present: int = 0
    """Runs whose record was there before."""
    done: int = 0
    """Runs performed now."""
    failed: int = 0
    """Of all records, those that are not ok."""
    damaged: list[Damage] = field(default_factory=list)
    stale: list[str] = field(default_factory=list)


Watcher = Callable[[Progress, RunSpec | None], None]


def perform_plan(
    specs: Sequence[RunSpec],
    store: Store,
    executor: Executor,
    *,
    retry_failed: bool = False,
    redo: bool = False,
    watch: Watcher = lambda progress, spec: None,
) -> Progress:
    """Perform every run that the store has no good record of.

    A record is good where its checksum fits. One that timed out under a shorter limit
    than now asked for is redone, and with ``retry_failed`` every timeout and crash is;
    ``redo`` performs everything anew. ``watch`` is called before the first run and after
    each. Raises
    CoarticError where records cannot be written or runs keep getting lost.
    """
    store.open()
    try:
        return _perform(specs, store, executor, retry_failed, redo, watch)
    finally:
        store.close()


def _perform(
    specs: Sequence[RunSpec],
    store: Store,
    executor: Executor,
    retry_failed: bool,
    redo: bool,
    watch: Watcher,
) -> Progress:
    by_id = {spec.run_id: spec for spec in specs}
    progress = Progress(total=len(by_id))
    progress.stale = store.stale(list(by_id))
    missing = dict(by_id)
    if not redo:
        for record in store.read_known(list(by_id)):
            if isinstance(record, Damage):
                progress.damaged.append(record)
                store.set_aside(record.path)
            elif not _to_redo(record, by_id[record["run_id"]], retry_failed):
                del missing[record["run_id"]]
                progress.present += 1
                progress.failed += record["status"] != "ok"
    watch(progress, None)
    idle = 0
    while missing and idle < _ROUNDS:
        idle += 1
        for answer in executor.perform([spec.job() for spec in missing.values()]):
            spec = missing.pop(answer["run_id"])
            status, text = record_of(answer, spec)
            store.write(spec.run_id, text)
            progress.done += 1
            progress.failed += status != "ok"
            idle = 0
            watch(progress, spec)
    if missing:
        raise CoarticError(
            f"{len(missing)} runs were lost again and again (workers die before they answer); "
            "what is done is kept, and the same command goes on from there"
        )
    return progress


def _to_redo(record: dict[str, Any], spec: RunSpec, retry_failed: bool) -> bool:
    if record["status"] not in RETRIED:
        return False
    if retry_failed:
        return True
    had, has = record["timing"]["time_limit_s"], spec.limits.time_s
    return record["status"] == "timeout" and had is not None and (has is None or has > had)


def record_of(answer: Answer, spec: RunSpec) -> tuple[str, str]:
    """Status and record (as text) of an answer, also of one that says how the run failed."""
    if "status" in answer:
        return answer["status"], answer["record"]
    if answer["failure"] == "foreign":
        raise CoarticError(answer["reason"])
    job = spec.job()
    record = {
        "run_id": spec.run_id,
        "run": spec.run,
        "specification": job["specification"],
        "code": job["code"],
        "status": answer["failure"],
        "reason": answer["reason"],
        "score": None,
        "solution": [],
        "told": sorted(spec.entry.method.told),
        "secondary": list(spec.entry.method.secondary),
        "used": [],
        "meter": None,  # went with the worker
        "details": {},
        "rewards": [],
        "timing": {
            "wall_s": answer["wall_s"],
            "cpu_s": None,
            "warm": None,
            "process_peak_mb": None,
            "time_limit_s": spec.limits.time_s,
        },
        "origin": spec.entry.origin,
        "environment": environment(),
    }
    return answer["failure"], encode(record)


def meter_of(record: dict[str, Any]) -> dict[str, Any]:
    """The meter of a record, every entry None where it went with the worker."""
    if record["meter"] is None:
        return dict.fromkeys(Meter().as_dict())
    meter: dict[str, Any] = record["meter"]
    return meter
