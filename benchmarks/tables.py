"""Writes the tables of a results folder: what :mod:`coartic.runs.tables` makes of its records."""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from coartic.benchmarks.store import Store
from coartic.errors import CoarticError
from coartic.files import check_folder, check_no_report, digest_of, holds, publish, temporary
from coartic.inputs import read_bytes
from coartic.runs.packs import Packs
from coartic.runs.record import check_together, in_lots
from coartic.runs.tables import (
    LARGEST_MANIFEST,
    TABLES,
    Manifest,
    Planned,
    parquet_options,
    row_groups,
    schemas,
)
from coartic.text import plain

OWNER = "run"
"""Whose files of a results folder these are."""
DERIVED = (*(f"{name}.parquet" for name in TABLES), "manifest.json")


def check_results_folder(folder: Path) -> None:
    """Raises CoarticError for a folder in which something is in the way of results."""
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "records").is_dir():
        raise CoarticError(
            f"{folder} is not empty and holds no results of coartic. Choose another folder."
        )
    check_folder(folder, owner=OWNER, alone=False, names=DERIVED, derived=DERIVED)
    check_no_report(folder)


def is_done(store: Store, manifest: Manifest) -> bool:
    """Whether a folder holds the tables of a plan, made of the records that it
    has now by this very version: what was checked then need not be checked again.

    Raises CoarticError where the list of its files is damaged.
    """
    now = manifest.environment
    if now.commit is not None and now.commit.dirty:
        return False  # nobody knows which code made them
    if not holds(store.folder, DERIVED, owner=OWNER):
        return False  # the list has tables and manifest as they were written together
    with contextlib.suppress(CoarticError, ValueError, LookupError, TypeError, RecursionError):
        data = read_bytes(store.folder / "manifest.json", LARGEST_MANIFEST)
        text = data.decode()
        found = json.loads(text)
        if found["tables"] != _digests(store.folder):
            return False
        then = {
            "date": found["environment"]["date"],
            "command": tuple(found["environment"]["command"]),
        }
        made = {
            "environment": now.model_copy(update=then),
            "records": store.packs().digest,
            "tables": found["tables"],
        }
        return manifest.model_copy(update=made).text() == text
    return False


def write_tables(store: Store, manifest: Manifest) -> None:
    """Write all tables of a plan from its records, and the manifest last, all at once.

    Raises CoarticError where a record contradicts itself, and where the disk does not take a
    table.
    """
    plan, packs = manifest.specification, store.packs()
    with contextlib.ExitStack() as stack:
        parts = {name: stack.enter_context(temporary(store.folder)) for name in TABLES}
        writers = {
            name: stack.enter_context(
                pq.ParquetWriter(parts[name], schema, **parquet_options(name))
            )
            for name, schema in schemas(plan).items()
        }
        for name, table in row_groups(plan, _checked(manifest, packs)):
            writers[name].write_table(table, row_group_size=max(1, len(table)))
        for writer in writers.values():
            writer.close()
        digests = {f"{name}.parquet": digest_of(part) for name, part in parts.items()}
        whole = manifest.model_copy(update={"records": packs.digest, "tables": digests})
        files = {f"{name}.parquet": part for name, part in parts.items()}
        publish(
            store.folder,
            {**files, "manifest.json": whole.text().encode()},
            owner=OWNER,
            alone=False,
            derived=DERIVED,
        )


def statuses(folder: Path) -> Counter[str]:
    """How many runs of a finished folder ended in which way."""
    path = folder / "runs.parquet"
    try:
        table = pq.read_table(path, columns=["status"])
    except (pa.ArrowException, OSError) as error:
        raise CoarticError(f"{path} cannot be read: {plain(str(error))}") from None
    counts = table["status"].value_counts().to_pylist()
    return Counter({row["values"]: row["counts"] for row in counts})


def _digests(folder: Path) -> dict[str, str]:
    digests = {}
    for name in TABLES:
        with (folder / f"{name}.parquet").open("rb") as file:
            digests[f"{name}.parquet"] = digest_of(file)
    return digests


def _checked(manifest: Manifest, packs: Packs) -> Iterator[Planned]:
    for cell in manifest.specification.cells:
        for lot in in_lots(packs[run_id] for run_id in manifest.run_ids(cell)):
            check_together(lot)
            for record in lot:
                yield cell, record
