"""The run store: one immutable, checksummed record per run.

A record is a text file ``records/<run id>.json``: a line with the SHA-256 of the rest,
then JSON. It is written to a temporary file, flushed to disk and renamed, so a record
is there whole or not at all. Nothing in a results folder is ever unpickled.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from coartic import CoarticError
from coartic.files import write_atomically as write_atomically

_PREFIX = "sha256:"
KEYS = frozenset(
    (
        *("run_id", "run", "specification", "code", "status", "reason", "score", "solution"),
        *("told", "secondary", "used", "meter", "details", "rewards", "timing", "origin"),
        "environment",
    )
)
"""What every record holds."""


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
        self._lock: IO[bytes] | None = None

    def open(self) -> None:
        """Make the folder, lock it against other writers until this process ends, and
        clear what an interrupted one left behind.

        Raises CoarticError where it cannot be written or another suite is at work.
        """
        probe = self.records / f".{uuid.uuid4().hex}.part"
        try:
            self.records.mkdir(parents=True, exist_ok=True)
            probe.touch()
            self._lock = (self.records / ".lock").open("wb")
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                probe.unlink()
                self.close()
                raise CoarticError(
                    f"another suite is at work in {self.folder}; wait for it, or choose "
                    "another --out"
                ) from None
            for path in self.records.glob(".*.part"):
                path.unlink(missing_ok=True)
        except OSError as error:
            raise CoarticError(
                f"cannot write to {self.folder}: {error.strerror or error}"
            ) from None

    def close(self) -> None:
        """Let other writers in."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def set_aside(self, path: Path) -> None:
        """Move something that is no good record out of the way, keeping it."""
        try:
            path.rename(path.with_name(f"damaged-{uuid.uuid4().hex[:8]}-{path.name}.txt"))
        except OSError as error:
            raise CoarticError(f"{path}: cannot be moved: {error.strerror or error}") from None

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
            if path.exists() and not path.is_file():
                raise RecordError(f"{path}: is not a file")
            data = path.read_bytes()
        except FileNotFoundError:
            raise RecordError(f"no record of run {run_id} in {self.folder}") from None
        except OSError as error:
            raise RecordError(f"{path}: cannot be read: {error.strerror or error}") from None
        record = decode(data, path)
        if record["run_id"] != run_id:
            raise RecordError(f"{path}: holds the record of run {record['run_id']}")
        return record

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
                yield self.read(run_id)
            except RecordError as error:
                yield Damage(self.path(run_id), str(error))

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
    try:
        record = json.loads(body)
        missing = KEYS - record.keys()
    except (ValueError, AttributeError):
        raise RecordError(f"{path}: is damaged: no record behind its checksum") from None
    if missing:
        raise RecordError(f"{path}: is damaged: {', '.join(sorted(missing))} missing")
    found: dict[str, Any] = record
    return found
