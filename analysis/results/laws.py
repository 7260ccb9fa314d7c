"""Whether what a results folder holds is whole: manifest, records, and tables against them.

A folder says everything more than once, and all of it has to agree: a run's id is the hash of
what was asked for, its stored solution gives its score when it is executed here again, and
every table follows from manifest and records. What does not fit was cut short or altered
afterwards; every check raises CoarticError that says what, and how it is made anew.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NoReturn

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import ValidationError

from coartic import CoarticError, parse_task
from coartic.files import digest_of
from coartic.inputs import open_regular, problems_inline, read_bytes
from coartic.runs.packs import Packs, check_layout
from coartic.runs.record import BUILT_IN, Record, RecordError, check_together, in_lots
from coartic.runs.tables import (
    FORMAT,
    LARGEST_MANIFEST,
    DeclaredMethod,
    Manifest,
    Plan,
    Planned,
    row_groups,
    schemas,
    trials_in,
    variant_of,
)

ANEW = "start the same `coartic run` again: it makes the tables anew from the records"
AGAIN = (
    "start the same `coartic run` again; where it finds nothing to do, delete manifest.json "
    "before that"
)
BASE = "task"  # base locked as the task has it: the case that rewards compare with


def damaged(path: Path, why: str) -> NoReturn:
    """Raise CoarticError: a file of a results folder is not whole."""
    raise CoarticError(f"{path} is damaged ({why}); {ANEW}")


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a results folder, as it was sealed.

    Raises CoarticError where there is none, it has another format, or was altered.
    """
    check_layout(folder)
    path = folder / "manifest.json"
    if not path.exists() and (folder / "records").is_dir():
        raise CoarticError(
            f"{folder} has records of runs but no manifest.json yet: its run was interrupted, or "
            "is still at work; start the same `coartic run` again, which does what is missing"
        )
    if not path.exists():
        raise CoarticError(f"{folder} is not a results folder: {path} is missing")
    try:
        content = json.loads(read_bytes(path, LARGEST_MANIFEST), parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        damaged(path, f"it cannot be read as JSON: {error}")
    if not isinstance(content, dict):
        damaged(path, "it holds no object")
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


def check_tables(folder: Path, manifest: Manifest) -> None:
    """Every table of a folder is what follows from its manifest and records, in all columns.

    Each record is whole, as planned, and true to its solution. Raises CoarticError that names
    the run or the table otherwise.
    """
    plan = manifest.specification
    _check_plan(folder / "manifest.json", plan)
    with contextlib.ExitStack() as stack:
        tables = {
            name: _Table(folder / f"{name}.parquet", schema, stack)
            for name, schema in schemas(plan).items()
        }
        for name, due in row_groups(plan, _checked(folder, manifest)):
            tables[name].check_next(due)
        for table in tables.values():
            table.check_end(manifest)


def _checked(folder: Path, manifest: Manifest) -> Iterator[Planned]:
    """The runs of a plan with their records, each of them and all together checked."""
    packs, proofs = Packs(folder), _Proofs(folder)
    for reason in packs.damaged.values():
        raise CoarticError(f"{reason}; {AGAIN}")
    for cell in manifest.specification.cells:
        method = manifest.specification.methods[cell.method]
        for run, record in enumerate(_sound(packs, manifest.run_ids(cell))):
            problem = _departure(method, run, record)
            if problem is not None:
                why = f"run {record.run_id} is not as planned: it has another {problem}"
                damaged(folder / "manifest.json", why)
            proofs.add(cell.task, record)
            yield cell, record
    proofs.check()


def _sound(packs: Packs, run_ids: Iterable[str]) -> Iterator[Record]:
    """The records of runs, each true to its solution."""
    try:
        for lot in in_lots(packs[run_id] for run_id in run_ids):
            check_together(lot)
            yield from lot
    except RecordError as error:
        raise CoarticError(f"{error}; {AGAIN}") from None


class _Table:
    """A table of a folder, compared with what it has to be, row group by row group."""

    def __init__(self, path: Path, schema: pa.Schema, stack: contextlib.ExitStack) -> None:
        if not path.exists():
            raise CoarticError(f"{path} is missing; {ANEW}")
        self._path, self._row = path, 0
        self._bytes = stack.enter_context(open_regular(path))
        with self._readable():
            self._file = pq.ParquetFile(self._bytes)
            found, meta = self._file.schema_arrow, self._file.metadata
            sizes = [meta.row_group(group).num_rows for group in range(meta.num_row_groups)]
        self._groups = iter([(group, rows) for group, rows in enumerate(sizes) if rows])
        if not found.equals(schema, check_metadata=True):
            differing = {*map(str, found)} ^ {*map(str, schema)}
            what = ", ".join(sorted(differing)[:3]) or "their metadata"
            damaged(path, f"its columns are not those of this table: {what}")

    def check_next(self, due: pa.Table) -> None:
        """The next row group is this one."""
        group, rows = next(self._groups, (-1, 0))
        if rows != len(due):
            damaged(self._path, "it has not the rows that its records give")
        with self._readable():
            found = self._file.read_row_group(group)
        if not found.equals(due):
            damaged(self._path, _difference(found, due, self._row))
        self._row += rows

    def check_end(self, manifest: Manifest) -> None:
        """There is no more, and the file is the one that was written."""
        if next(self._groups, None) is not None:
            damaged(self._path, "it has more rows than its records give")
        if digest_of(self._bytes) != manifest.tables.get(self._path.name):
            damaged(
                self._path, "it says what its records say, but is not the file that was written"
            )

    @contextlib.contextmanager
    def _readable(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError, pa.ArrowException) as error:
            words = str(error).splitlines()
            damaged(self._path, words[0] if words else type(error).__name__)


def _check_plan(path: Path, plan: Plan) -> None:
    """The plan is one that a suite can have."""
    for name, content in plan.tasks.items():
        if parse_task(content, str(path)).name != name:
            damaged(path, f"its task {name!r} has another name")
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
            (cell.variant == variant_of(cell.parameters, method.defaults), "has another variant"),
            (
                method.origin != BUILT_IN or cell.complete == method.defaults | given,
                "has parameters that nobody set",
            ),
            (trials_in(cell.complete) <= plan.trials, "makes more trials than planned"),
        )
        problem = next((words for holds, words in laws if not holds), None)
        if problem is not None:
            damaged(path, f"{where} {problem}")
    if plan.trials != max((trials_in(cell.complete) for cell in plan.cells), default=0):
        damaged(path, "no cell makes as many trials as it says")


def _departure(method: DeclaredMethod, run: int, record: Record) -> str | None:
    """In what a record is not the run that the plan has at its place; None where it is.

    What the run's id is the hash of agrees already.
    """
    agreements = (
        ("number", record.run, run),
        ("origin", record.origin, method.origin),
        ("information", record.told, method.told),
        ("secondary objectives", record.secondary, method.secondary),
    )
    return next((what for what, found, due in agreements if found != due), None)


class _Proofs:
    """No run is better than what another one proves that none can be."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._best: dict[str, tuple[int, str]] = {}
        self._bounds: dict[str, tuple[int, str]] = {}

    def add(self, task: str, record: Record) -> None:
        """One more run of a task."""
        if record.solution is not None:
            own = record.solution.reward, record.run_id
            self._best[task] = max(self._best.get(task, own), own)
        parameters = record.specification.parameters
        narrower = parameters.get("base", BASE) != BASE or parameters.get("other_arm") == "still"
        if record.bound is not None and not narrower:
            proof = record.bound, record.run_id
            self._bounds[task] = min(self._bounds.get(task, proof), proof)

    def check(self) -> None:
        """After the last run."""
        for task, (bound, proof) in self._bounds.items():
            reward, run_id = self._best.get(task, (bound, ""))
            if reward > bound:
                raise CoarticError(
                    f"{self._folder}: run {run_id} has reward {reward}, and run {proof} proves "
                    f"that none exceeds {bound}: one of them is false; `coartic reproduce` "
                    "tells which"
                )


def _difference(found: pa.Table, due: pa.Table, start: int) -> str:
    """The first place where two tables of the same columns and rows differ."""
    for name in due.column_names:
        if found[name].equals(due[name]):
            continue
        pairs = zip(found[name].to_pylist(), due[name].to_pylist(), strict=True)
        row = next((index for index, (a, b) in enumerate(pairs) if a != b), 0)
        who = f" (run {due['run_id'][row]})" if "run_id" in due.column_names else ""
        return f"column {name!r} is not as its records have it, first in row {start + row}{who}"
    return "it is not as its records have it"
