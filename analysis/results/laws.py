"""Whether what a results folder holds is whole: manifest, records, and tables against them.

A folder says everything more than once, and all of it has to agree: a run's id is the hash of
what was asked for, its stored solution gives its score when it is executed here again, and
every table follows from manifest and records. What does not fit was cut short or altered
afterwards; every check raises CoarticError that says what, and how it is made anew.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import ValidationError

from coartic import PAPER, CoarticError, parse_task
from coartic.codec import read_record
from coartic.inputs import problems_inline, read_bytes
from coartic.record import BUILT_IN, Record, RecordError, run_seed
from coartic.tables import (
    FORMAT,
    Manifest,
    Plan,
    PlannedCell,
    tables_of,
    trials_in,
    variant_of,
)

ANEW = "start the same `coartic run` again: it makes the tables anew from the records"
LARGEST_TABLE = 1 << 32
"""Bytes of a table or a manifest."""
BASE = "task"  # base locked as the task has it: the case that rewards compare with


def damaged(path: Path, why: str) -> NoReturn:
    """Raise CoarticError: a file of a results folder is not whole."""
    raise CoarticError(f"{path} is damaged ({why}); {ANEW}")


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a results folder, as it was sealed.

    Raises CoarticError where there is none, it has another format, or was altered.
    """
    path = folder / "manifest.json"
    if not path.exists() and (folder / "records").is_dir():
        raise CoarticError(
            f"{folder} has records of runs but no manifest.json yet: its run was interrupted, or "
            "is still at work; start the same `coartic run` again, which does what is missing"
        )
    if not path.exists():
        raise CoarticError(f"{folder} is not a results folder: {path} is missing")
    try:
        content = json.loads(read_bytes(path, LARGEST_TABLE), parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise CoarticError(f"{path}: results cannot be read: {error}") from None
    if not isinstance(content, dict):
        damaged(path, f"it holds a {type(content).__name__}, not an object")
    if content.get("format") != FORMAT:
        raise CoarticError(
            f"{path}: its tables have format {content.get('format')!r}, this version reads "
            f"{FORMAT}; start the same `coartic run` again with another --out"
        )
    seal = content.pop("seal", None)
    try:
        manifest = Manifest.model_validate_json(json.dumps(content))
    except ValidationError as error:
        damaged(path, problems_inline(error))
    if manifest.seal() != seal:
        damaged(path, "it is not as it was written: its seal does not fit")
    return manifest


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")


def read_records(folder: Path, manifest: Manifest) -> dict[str, Record]:
    """The records of a plan by run id: each whole, as planned, and true to its solution.

    Raises CoarticError that names the run otherwise.
    """
    path = folder / "manifest.json"
    _check_plan(path, manifest.specification)
    records: dict[str, Record] = {}
    for cell in manifest.specification.cells:
        for run, run_id in enumerate(cell.run_ids):
            try:
                record = read_record(folder / "records" / f"{run_id}.json")
                record.check()
            except RecordError as error:
                raise CoarticError(f"{error}; start the same `coartic run` again") from None
            problem = _departure(manifest, cell, run, record)
            if problem is not None:
                damaged(path, f"run {run_id} is not as planned: it has another {problem}")
            records[run_id] = record
    _check_bounds(folder, records)
    return records


def check_tables(folder: Path, manifest: Manifest, records: Mapping[str, Record]) -> None:
    """Every table of a folder is what follows from its manifest and records, in all columns."""
    for name, due in tables_of(manifest, records).items():
        path = folder / f"{name}.parquet"
        if not path.exists():
            raise CoarticError(f"{path} is missing; {ANEW}")
        data = read_bytes(path, LARGEST_TABLE)
        try:
            found = pq.read_table(pa.BufferReader(data))
        except (OSError, ValueError, pa.ArrowException) as error:
            damaged(path, str(error).splitlines()[0] if str(error) else type(error).__name__)
        if not found.schema.equals(due.schema, check_metadata=True):
            differing = {*map(str, found.schema)} ^ {*map(str, due.schema)}
            what = ", ".join(sorted(differing)[:3]) or "their metadata"
            damaged(path, f"its columns are not those of this table: {what}")
        if not found.equals(due):
            damaged(path, _difference(found, due))
        if hashlib.sha256(data).hexdigest() != manifest.tables.get(path.name):
            damaged(path, "it says what its records say, but is not the file that was written")


def _check_plan(path: Path, plan: Plan) -> None:
    """The plan is one that a suite can have."""
    for name, content in plan.tasks.items():
        if parse_task(content, str(path)).name != name:
            damaged(path, f"its task {name!r} has another name")
    seen: set[str] = set()
    labels = {(cell.task, cell.method, cell.variant) for cell in plan.cells}
    if len(labels) < len(plan.cells):
        damaged(path, "two of its cells have the same task, method and variant")
    for cell in plan.cells:
        where = f"its cell {cell.task} x {cell.method} {cell.variant}".rstrip()
        if cell.task not in plan.tasks or cell.method not in plan.methods:
            damaged(path, f"{where} is of a task or method that it does not describe")
        method = plan.methods[cell.method]
        # What a suite sets: parameters of the cell, and trials, which are the suite's.
        given = {k: v for k, v in cell.complete.items() if k == "trials"} | cell.parameters
        laws = (
            (
                len(cell.run_ids) == (plan.runs if method.stochastic else 1),
                "has another number of runs",
            ),
            (cell.variant == variant_of(cell.parameters, method.defaults), "has another variant"),
            (
                method.origin != BUILT_IN or cell.complete == method.defaults | given,
                "has parameters that nobody set",
            ),
            (trials_in(cell.complete) <= plan.trials, "makes more trials than planned"),
            (seen.isdisjoint(cell.run_ids), "has a run that is planned twice"),
        )
        problem = next((words for holds, words in laws if not holds), None)
        if problem is not None:
            damaged(path, f"{where} {problem}")
        seen.update(cell.run_ids)
    if plan.trials != max((trials_in(cell.complete) for cell in plan.cells), default=0):
        damaged(path, "no cell makes as many trials as it says")


def _departure(manifest: Manifest, cell: PlannedCell, run: int, record: Record) -> str | None:
    """In what a record is not the run that the plan has at its place; None where it is."""
    plan, own = manifest.specification, record.specification
    method = plan.methods[cell.method]
    agreements = (
        ("task", own.task, plan.tasks[cell.task]),
        ("method", own.method, cell.method),
        ("parameters", own.parameters, cell.complete),
        ("model", own.model, PAPER._asdict()),
        ("number", record.run, run),
        ("seed", own.seed, run_seed(plan.seed, cell.task, run)),
        ("trial budget", own.trial_budget, manifest.limits.trials),
        ("code", record.code, method.code),
        ("origin", record.origin, method.origin),
        ("information", record.told, method.told),
        ("secondary objectives", record.secondary, method.secondary),
    )
    return next((what for what, found, due in agreements if found != due), None)


def _check_bounds(folder: Path, records: Mapping[str, Record]) -> None:
    """No run is better than what another one proves that none can be."""
    for proof in records.values():
        parameters = proof.specification.parameters
        narrower = parameters.get("base", BASE) != BASE or parameters.get("other_arm") == "still"
        if proof.bound is None or narrower:
            continue
        for record in records.values():
            same = record.specification.task == proof.specification.task
            if same and record.solution and record.solution.reward > proof.bound:
                raise CoarticError(
                    f"{folder}: run {record.run_id} has reward {record.solution.reward}, and run "
                    f"{proof.run_id} proves that none exceeds {proof.bound}: one of them is "
                    "false; `coartic reproduce` tells which"
                )


def _difference(found: pa.Table, due: pa.Table) -> str:
    """The first place where two tables of the same columns differ."""
    if len(found) != len(due):
        return f"it has {len(found)} rows where its records give {len(due)}"
    for name in due.column_names:
        if found[name].equals(due[name]):
            continue
        pairs = zip(found[name].to_pylist(), due[name].to_pylist(), strict=True)
        row = next((index for index, (a, b) in enumerate(pairs) if a != b), 0)
        who = f" (run {due['run_id'][row]})" if "run_id" in due.column_names else ""
        return f"column {name!r} is not as its records have it, first in row {row}{who}"
    return "it is not as its records have it"
