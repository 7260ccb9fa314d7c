"""One run again: find its record, perform it anew, compare."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.harness import meter_of, record_of
from benchmarks.methods import Registry, unknown
from benchmarks.sandbox import SandboxError, supervise
from benchmarks.specification import Limits, RunSpec
from benchmarks.store import RecordError, Store
from coartic import CoarticError, MotionModel, Trajectory, parse_task, trajectory
from coartic.frames import movements_from
from coartic.method import Meter
from coartic.text import shell_line


def find_record(prefix: str, folder: Path) -> tuple[Store, dict[str, Any]]:
    """The one record whose id starts with ``prefix``, in a folder or any below it.

    Raises RecordError where there is none, more than one, or it is damaged.
    """
    found = sorted(folder.glob(f"**/records/{_safe(prefix)}*.json"))
    ids = sorted({path.stem for path in found})
    if not ids:
        raise RecordError(f"no run {prefix!r} below {folder}; name another folder with --in")
    if len(ids) > 1:
        shown = ", ".join(ids[:4]) + (", ..." if len(ids) > 4 else "")
        raise RecordError(f"{prefix!r} is the beginning of {len(ids)} runs: {shown}")
    store = Store(found[0].parent.parent)
    return store, store.read(ids[0])


def trajectory_of(record: dict[str, Any]) -> Trajectory:
    """The solution of a record tick by tick, from nothing but the record.

    Raises CoarticError where the run has no solution.
    """
    specification = record["specification"]
    if record["status"] != "ok":
        raise CoarticError(
            f"run {record['run_id']} has no solution to show: {record['status']}, "
            f"{record['reason']}"
        )
    task = parse_task(specification["task"], f"record {record['run_id']}")
    waypoints = [
        {"order": row["order"], "waypoint": index, **point}
        for row in record["solution"]
        for index, point in enumerate(row.get("waypoints") or ())
    ]
    movements = movements_from(task, pd.DataFrame(record["solution"]), pd.DataFrame(waypoints))
    return trajectory(task, movements, MotionModel(**specification["model"]))


def spec_of(record: dict[str, Any], known: Registry, limits: Limits) -> RunSpec:
    """The specification of a record, to be performed by the code that is here now."""
    specification = record["specification"]
    name = specification["method"]
    if name not in known:
        raise unknown("method", name, known)
    return RunSpec(
        task=parse_task(specification["task"], f"record {record['run_id']}"),
        entry=known[name],
        parameters=tuple(specification["parameters"].items()),
        run=record["run"],
        seed=specification["seed"],
        limits=Limits(limits.time_s, specification["trial_budget"]),
    )


def perform_once(spec: RunSpec) -> dict[str, Any]:
    """The record of one run, performed in a process of its own."""
    try:
        _, record = record_of(supervise(spec.job()), spec)
    except SandboxError as error:
        raise CoarticError(str(error)) from None
    performed: dict[str, Any] = json.loads(record)
    return performed


def command_for(record: dict[str, Any], folder: Path) -> str:
    """The command that performs the run of a record again."""
    words: list[str | Path] = ["coartic", "reproduce", record["run_id"], "--in", folder]
    if record["origin"].endswith(".py"):
        words += ["--method-file", Path(record["origin"])]
    return shell_line(*words)


def differences(a: dict[str, Any], b: dict[str, Any]) -> list[str]:
    """In what the results of two records differ; times and surroundings apart."""
    found = [
        f"{name}: {a[name]!r} against {b[name]!r}"
        for name in ("status", "reason", "score", "details")
        if a[name] != b[name]
    ]
    first, second = meter_of(a), meter_of(b)
    found += [
        f"{name}: {first[name]} against {second[name]}"
        for name in Meter.COUNTS
        if first[name] != second[name]
    ]
    if a["solution"] != b["solution"]:
        found.append("the solutions' movements differ")
    if a["rewards"] != b["rewards"]:
        found.append(f"rewards by trial differ{_first_difference(a['rewards'], b['rewards'])}")
    return found


def _first_difference(a: Sequence[Any], b: Sequence[Any]) -> str:
    for index, (x, y) in enumerate(zip(a, b, strict=False)):
        if x != y:
            return f", first at trial {index}: {x} against {y}"
    return f": {len(a)} trials against {len(b)}"


def _safe(prefix: str) -> str:
    if not prefix or not set(prefix) <= set("0123456789abcdef-"):
        raise RecordError(
            f"{prefix!r} is no run id: hexadecimal digits with one '-', of which the beginning "
            "is enough"
        )
    return prefix
