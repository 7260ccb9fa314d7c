"""Writes the tables of a results folder: what :mod:`coartic.tables` makes of its records."""

from __future__ import annotations

import hashlib
import io

import pyarrow.parquet as pq

from benchmarks.store import Store
from coartic import CoarticError
from coartic.files import write_atomically
from coartic.record import Record
from coartic.tables import Manifest, parquet_options, tables_of


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
    try:
        for name, data in files.items():
            write_atomically(store.folder / name, data)
        write_atomically(store.folder / "manifest.json", text.encode())
    except OSError as error:
        raise CoarticError(f"cannot write to {store.folder}: {error.strerror or error}") from None
    return records
