"""Writes the tables of a results folder: what :mod:`coartic.tables` makes of its records."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

import pyarrow.parquet as pq

from benchmarks.store import Store
from coartic.files import check_folder, check_no_report, publish
from coartic.record import Record
from coartic.tables import TABLES, Manifest, parquet_options, tables_of

OWNER = "run"
"""Whose files of a results folder these are, and ``comparison.md`` and ``methods.csv``."""
PAGES = ("comparison.md", "methods.csv")
DERIVED = (*(f"{name}.parquet" for name in TABLES), "manifest.json")


def check_results_folder(folder: Path) -> None:
    """Raises CoarticError where something in a folder is in the way of its tables, and for a
    report's folder."""
    names = (*DERIVED, *PAGES)
    check_folder(folder, owner=OWNER, alone=False, names=names, derived=DERIVED)
    check_no_report(folder)


def write_tables(store: Store, manifest: Manifest) -> dict[str, Record]:
    """Write all tables of a plan from its records, each atomically, and the manifest last.

    Returns the records by run id. Raises CoarticError where one contradicts itself, and where
    the disk does not take a table.
    """
    records = {run_id: store.read(run_id) for run_id in manifest.specification.run_ids}
    for record in records.values():
        record.check()
    files = {}
    for name, table in tables_of(manifest, records).items():
        sink = io.BytesIO()
        pq.write_table(table, sink, **parquet_options(name))
        files[f"{name}.parquet"] = sink.getvalue()
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    text = manifest.model_copy(update={"tables": digests}).text()
    files["manifest.json"] = text.encode()
    publish(store.folder, files, owner=OWNER, alone=False, derived=files)
    return records
