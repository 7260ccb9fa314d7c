"""The run store: one immutable, checksummed record per run.

A record is a text file ``records/<run id>.json``: a line with the SHA-256 of the rest,
then JSON. It is written to a temporary file, flushed to disk and renamed, so a record
is there whole or not at all. Nothing in a results folder is ever unpickled.
"""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coartic import CoarticError

_PREFIX = "sha256:"


@dataclass(frozen=True)
class Damage:
    """A record that cannot be trusted."""

    path: Path
    reason: str


class RecordError(CoarticError):
    """A record that is missing or damaged."""


class Store:
    """The records of one results folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.records = folder / "records"

    def open(self) -> None:
        """Make the folder and clear what an interrupted writer left behind.

        Raises CoarticError where it cannot be written.
        """
        probe = self.records / f".{uuid.uuid4().hex}.part"
        try:
            self.records.mkdir(parents=True, exist_ok=True)
            probe.touch()
            for path in self.records.glob(".*.part"):
                path.unlink(missing_ok=True)
        except OSError as error:
            raise CoarticError(
                f"cannot write to {self.folder}: {error.strerror or error}"
            ) from None

    def path(self, run_id: str) -> Path:
        """Where a run's record is kept."""
        return self.records / f"{run_id}.json"

    def write(self, run_id: str, record: str) -> None:
        """Keep a record, given as :func:`encode` makes it.

        Raises CoarticError where the disk does not take it.
        """
        data = record.encode()
        head = f"{_PREFIX}{hashlib.sha256(data).hexdigest()}\n".encode()
        try:
            write_atomically(self.path(run_id), head + data + b"\n")
        except OSError as error:
            raise CoarticError(
                f"cannot write the record of run {run_id}: {error.strerror or error}"
            ) from None

    def read(self, run_id: str) -> dict[str, Any]:
        """A record, checked against its checksum. Raises RecordError otherwise."""
        path = self.path(run_id)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            raise RecordError(f"no record of run {run_id} in {self.folder}") from None
        except OSError as error:
            raise RecordError(f"{path}: cannot be read: {error.strerror or error}") from None
        return decode(data, path)

    def ids(self) -> set[str]:
        """Ids of all records, whole or damaged."""
        return {path.stem for path in self.records.glob("*.json")}

    def read_known(self, run_ids: list[str]) -> Iterator[dict[str, Any] | Damage]:
        """The records that exist among ``run_ids``, or their damage."""
        present = self.ids()
        for run_id in run_ids:
            if run_id not in present:
                continue
            try:
                record = self.read(run_id)
            except RecordError as error:
                yield Damage(self.path(run_id), str(error))
                continue
            if record["run_id"] != run_id:
                yield Damage(self.path(run_id), f"holds the record of run {record['run_id']}")
            else:
                yield record

    def stale(self, run_ids: list[str]) -> list[str]:
        """Records of the same specifications made by other code."""
        current = set(run_ids)
        keys = {run_id.partition("-")[0] for run_id in run_ids}
        return sorted(
            run_id for run_id in self.ids() - current if run_id.partition("-")[0] in keys
        )


def encode(record: dict[str, Any]) -> str:
    """A record as one line of JSON; what JSON has no word for becomes text."""
    return json.dumps(
        record, separators=(",", ":"), allow_nan=False, ensure_ascii=False, default=str
    )


def decode(data: bytes, path: Path) -> dict[str, Any]:
    """A record from its bytes. Raises RecordError where the checksum does not fit."""
    head, _, body = data.partition(b"\n")
    body = body.removesuffix(b"\n")
    if not head.startswith(_PREFIX.encode()):
        raise RecordError(f"{path}: is not a run record")
    if head.decode(errors="replace") != f"{_PREFIX}{hashlib.sha256(body).hexdigest()}":
        raise RecordError(f"{path}: is damaged: its checksum does not fit")
    record: dict[str, Any] = json.loads(body)
    return record


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all, also after a power cut.

    A power cut may undo the rename; then the old file, or none, is there.
    """
    part = path.parent / f".{uuid.uuid4().hex}.part"
    try:
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
