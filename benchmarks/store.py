"""The run store: one immutable, checksummed record per run.

A record (:mod:`coartic.record`) is a text file ``records/<run id>.json``. It is written to a
temporary file, flushed to disk and renamed, so a record is there whole or not at all.
Nothing in a results folder is ever unpickled.
"""

from __future__ import annotations

import contextlib
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock, Timeout

from coartic import CoarticError
from coartic.codec import encode, read_record
from coartic.files import clear_leftovers, write_atomically
from coartic.record import Record, RecordError


@dataclass(frozen=True)
class Damage:
    """A record that cannot be trusted."""

    path: Path
    reason: str


class Store:
    """The records of one results folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.records = folder / "records"
        self._lock = FileLock(self.records / ".lock", timeout=0)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Make the folder, keep other writers out meanwhile, and clear what an interrupted one
        left behind.

        Raises CoarticError where it cannot be written or another suite is at work.
        """
        probe = self.records / f".coartic-{uuid.uuid4().hex}.part"
        try:
            self.records.mkdir(parents=True, exist_ok=True)
            self._lock.acquire()
        except Timeout:
            raise CoarticError(
                f"another suite is at work in {self.folder}; wait for it, or choose another --out"
            ) from None
        except (OSError, NotImplementedError) as error:
            raise CoarticError(f"cannot write to {self.folder}: {_why(error)}") from None
        try:
            try:
                probe.touch()
                for folder in (self.folder, self.records):
                    clear_leftovers(folder)
            except OSError as error:
                raise CoarticError(f"cannot write to {self.folder}: {_why(error)}") from None
            yield
        finally:
            self._lock.release()

    def set_aside(self, path: Path) -> None:
        """Move something that is no good record out of the way, keeping it."""
        try:
            path.rename(path.with_name(f"damaged-{uuid.uuid4().hex[:8]}-{path.name}.txt"))
        except OSError as error:
            raise CoarticError(f"{path}: cannot be moved: {_why(error)}") from None

    def path(self, run_id: str) -> Path:
        """Where a run's record is kept."""
        return self.records / f"{run_id}.json"

    def write(self, record: Record) -> None:
        """Keep a record. Raises CoarticError where the disk does not take it."""
        try:
            write_atomically(self.path(record.run_id), encode(record))
        except OSError as error:
            raise CoarticError(
                f"cannot write the record of run {record.run_id}: {_why(error)}"
            ) from None

    def read(self, run_id: str) -> Record:
        """A record, checked against its checksum. Raises RecordError otherwise."""
        return read_record(self.path(run_id))

    def ids(self) -> set[str]:
        """Ids of all records, whole or damaged."""
        return {path.stem for path in self.records.glob("*.json")}

    def read_known(self, run_ids: list[str]) -> Iterator[Record | Damage]:
        """The records that exist among ``run_ids``, or their damage."""
        present = self.ids()
        for run_id in run_ids:
            if run_id not in present:
                continue
            try:
                record = self.read(run_id)
                record.check()
                yield record
            except RecordError as error:
                yield Damage(self.path(run_id), str(error))

    def stale(self, run_ids: list[str]) -> list[str]:
        """Records of the same specifications made by other code."""
        current = set(run_ids)
        keys = {run_id.partition("-")[0] for run_id in run_ids}
        return sorted(
            run_id for run_id in self.ids() - current if run_id.partition("-")[0] in keys
        )


def _why(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
