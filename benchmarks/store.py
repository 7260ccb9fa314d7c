"""The run store: one immutable, checksummed record per run, in packs of what was done together.

A pack (:mod:`coartic.runs.packs`) is a text file. It is
written to a temporary file, flushed to disk
and renamed, so its records are there whole or not at all. Nothing in a results folder is ever
unpickled.
"""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from filelock import FileLock, Timeout

from coartic import CoarticError
from coartic.files import clear_leftovers, write_atomically
from coartic.runs.codec import encode
from coartic.runs.packs import Packs, check_layout, is_pack, number_of, packs_in
from coartic.runs.record import Record, RecordError, check_together, in_lots


@dataclass(frozen=True)
class Damage:
    """Something among the records that cannot be trusted."""

    path: Path
    """The pack that it is in."""
    reason: str
    runs: frozenset[str] = frozenset()
    """Runs whose records in the pack are bad, as far as it says."""


class Store:
    """The records of one results folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.records = folder / "records"
        self._lock = FileLock(self.records / ".lock", timeout=0)
        self._packs: Packs | None = None
        self._last: int | None = None  # number of a pack

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Make the folder, keep other writers out meanwhile, and clear what an interrupted one
        left behind.

        Raises CoarticError where it cannot be written, another suite is at work, or there are
        records of an older version.
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
                self._packs = self._last = None
                check_layout(self.folder)
            except OSError as error:
                raise CoarticError(f"cannot write to {self.folder}: {_why(error)}") from None
            yield
        finally:
            self._lock.release()

    def packs(self) -> Packs:
        """The records as they are now; while :meth:`locked`, as they were after the last write."""
        if self._packs is None or not self._lock.is_locked:
            self._packs = Packs(self.folder)
        return self._packs

    def path(self, run_id: str) -> Path:
        """The pack that a run's record is in. Raises RecordError where there is none."""
        return self.packs().path(run_id)

    def read(self, run_id: str) -> Record:
        """A record, checked against its checksum. Raises RecordError otherwise."""
        return self.packs()[run_id]

    def write(self, records: Iterable[Record]) -> None:
        """Keep records that are done together; they replace earlier ones of the same runs.

        Raises CoarticError where the disk does not take them.
        """
        self._packs = None
        for pack in encode(records):
            try:
                write_atomically(self._next_path(), pack)
            except OSError as error:
                raise CoarticError(f"cannot write to {self.records}: {_why(error)}") from None

    def read_known(self, run_ids: Iterable[str]) -> Iterator[Record | Damage]:
        """The records that exist among ``run_ids``, then what is damaged.

        A record is what is written last of it that agrees with itself.
        """
        packs = self.packs()
        doubtful: list[str] = []
        for lot in in_lots(_readable(packs, run_ids, doubtful)):
            try:
                check_together(lot)
            except RecordError:
                doubtful += [record.run_id for record in lot]
            else:
                yield from lot
        damaged = {path: Damage(path, reason) for path, reason in packs.damaged.items()}
        for run_id in doubtful:
            for path in packs.places(run_id):
                try:
                    record = packs.read(run_id, path)
                    record.check()
                except RecordError as error:
                    known = damaged.get(path, Damage(path, str(error)))
                    damaged[path] = replace(known, runs=known.runs | {run_id})
                else:
                    yield record
                    break
        yield from damaged.values()

    def set_aside(self, damage: Damage) -> None:
        """Move a damaged pack out of the way, keeping it, and keep what is good in it.

        The good records are there at any moment. Raises CoarticError where it cannot be done.
        """
        packs, path, good = self.packs(), damage.path, []
        with contextlib.suppress(RecordError):
            for run_id in packs.runs_in(path):
                if run_id not in damage.runs and packs.path(run_id) == path:
                    with contextlib.suppress(RecordError):
                        good.append(packs[run_id])
        self.write(good)
        try:
            path.rename(path.with_name(f"damaged-{uuid.uuid4().hex[:8]}-{path.name}.txt"))
        except OSError as error:
            raise CoarticError(f"{path}: cannot be moved: {_why(error)}") from None

    def drop_superseded(self) -> None:
        """Remove the packs all of whose runs were written again since, and well."""
        packs = self.packs()
        for path in packs.superseded():
            with contextlib.suppress(RecordError):
                for run_id in packs.runs_in(path):
                    packs.read(run_id, packs.path(run_id))
                path.unlink(missing_ok=True)

    def stale(self, run_ids: Collection[str]) -> list[str]:
        """Records of the same specifications made by other code."""
        others = [run_id for run_id in self.packs() if run_id not in run_ids]
        keys = {run_id.partition("-")[0] for run_id in run_ids} if others else set()
        return sorted(run_id for run_id in others if run_id.partition("-")[0] in keys)

    def _next_path(self) -> Path:
        """Of a new pack, above all that there are."""
        if self._last is None:
            self._last = max(map(number_of, packs_in(self.folder)), default=0)
        while True:
            self._last += 1
            path = self.records / f"{self._last:08}.pack"
            if not is_pack(path):
                raise CoarticError(f"{self.records} has no number left for {path.name}")
            if not os.path.lexists(path):
                return path


def _readable(packs: Packs, run_ids: Iterable[str], doubtful: list[str]) -> Iterator[Record]:
    """The newest records of runs that have one; runs whose cannot be read are doubtful."""
    for run_id in run_ids:
        if run_id in packs:
            try:
                yield packs[run_id]
            except RecordError:
                doubtful.append(run_id)


def _why(error: Exception) -> str:
    name, why = getattr(error, "filename", None), getattr(error, "strerror", None) or error
    if isinstance(error, FileExistsError):
        return f"{name} is a file where a folder is needed; move it away"
    return str(why)
