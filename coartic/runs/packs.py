"""The packs of a results folder: ``records/00000001.pack`` and so on, each written once.

A run that is in more than one pack has the record of the highest number.
"""

from __future__ import annotations

import hashlib
import re
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from coartic.errors import CoarticError
from coartic.inputs import read_bytes
from coartic.runs.codec import Line, decode, lines
from coartic.runs.record import Record, RecordError

LARGEST_PACK = 1 << 28
"""Bytes of a pack: rewards of ten million trials, twice over."""
_PACK = re.compile(r"(\d{8}|[1-9]\d{8,17})\.pack")
_OLD = re.compile(r"[0-9a-f]{16}-[0-9a-f]+\.json")
_OPEN = 1 << 26  # bytes of packs kept in memory, or one pack


def packs_in(folder: Path) -> list[Path]:
    """What is named as a pack of a results folder, in the order of the numbers."""
    return sorted(filter(is_pack, (folder / "records").glob("*.pack")), key=number_of)


def is_pack(path: Path) -> bool:
    """Whether a file is named as a pack."""
    return _PACK.fullmatch(path.name) is not None


def check_layout(folder: Path) -> None:
    """Raises CoarticError for records as versions up to 0.1 kept them, a file each."""
    if any(_OLD.fullmatch(path.name) for path in (folder / "records").glob("*.json")):
        raise CoarticError(
            f"{folder} has records of an older version, each in a file of its own, which this "
            "version does not read; choose another --out"
        )


def number_of(path: Path) -> int:
    """The number of a pack; higher ones replace what lower ones say."""
    return int(path.stem)


class Packs(Mapping[str, Record]):
    """The records of a results folder by run id, as they are when this is made.

    A record is read when it is asked for: RecordError where there is none or it is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.paths = packs_in(folder)
        self.damaged: dict[Path, str] = {}
        """Packs with something in them that is no record, and what is the matter."""
        self._newest: dict[str, Path] = {}
        self._older: dict[str, list[Path]] = {}
        self._open: OrderedDict[Path, dict[str, Line]] = OrderedDict()
        self._sizes: dict[Path, int] = {}
        digest = hashlib.sha256()
        for path in self.paths:
            try:
                data = read_bytes(path, LARGEST_PACK, error=RecordError)
            except RecordError as error:
                self.damaged[path] = str(error)
                continue
            digest.update(f"{path.name} {hashlib.sha256(data).hexdigest()}\n".encode())
            found, clean = lines(data)
            if not clean:
                self.damaged[path] = f"{path}: a line of it is damaged"
            for line in found:
                before = self._newest.get(line.run_id, path)
                if before != path:
                    self._older.setdefault(line.run_id, []).append(before)
                self._newest[line.run_id] = path
        self.digest = digest.hexdigest()
        """Of all packs' names and contents."""

    def __iter__(self) -> Iterator[str]:
        return iter(self._newest)

    def __len__(self) -> int:
        return len(self._newest)

    def __contains__(self, run_id: object) -> bool:
        return run_id in self._newest

    def __getitem__(self, run_id: str) -> Record:
        return self.read(run_id, self.path(run_id))

    def path(self, run_id: str) -> Path:
        """The pack that a run's record is in. Raises RecordError where there is none."""
        try:
            return self._newest[run_id]
        except KeyError:
            raise RecordError(f"no record of run {run_id} in {self.folder}") from None

    def places(self, run_id: str) -> list[Path]:
        """All packs with a record of a run, the newest first."""
        newest = [self._newest[run_id]] if run_id in self else []
        return newest + self._older.get(run_id, [])[::-1]

    def superseded(self) -> list[Path]:
        """Packs all of whose runs have records in higher ones."""
        used = {*self._newest.values(), *self.damaged}
        return [path for path in self.paths if path not in used]

    def read(self, run_id: str, path: Path) -> Record:
        """The record of a run in one of its :meth:`places`. Raises RecordError where it is bad."""
        line = self._lines(path).get(run_id)
        if line is None:
            raise RecordError(f"{path}: run {run_id} is in it no more")
        try:
            return decode(line)
        except RecordError as error:
            raise RecordError(f"{path}: {error}") from None

    def runs_in(self, path: Path) -> list[str]:
        """Ids of the runs that have a record in a pack, good or bad."""
        return list(self._lines(path))

    def _lines(self, path: Path) -> dict[str, Line]:
        if path not in self._open:
            data = read_bytes(path, LARGEST_PACK, error=RecordError)
            self._open[path] = {line.run_id: line for line in lines(data)[0]}
            self._sizes[path] = len(data)
            while len(self._open) > 1 and sum(self._sizes.values()) > _OPEN:
                dropped, _ = self._open.popitem(last=False)
                del self._sizes[dropped]
        self._open.move_to_end(path)
        return self._open[path]


class Chosen(Mapping[str, Record]):
    """The records of some runs, in their order, each read when it is asked for."""

    def __init__(self, packs: Packs, run_ids: Iterable[str]) -> None:
        """Raises RecordError where a run has no record."""
        self._packs, self._ids = packs, dict.fromkeys(run_ids)
        for run_id in self._ids:
            packs.path(run_id)

    def __iter__(self) -> Iterator[str]:
        return iter(self._ids)

    def __len__(self) -> int:
        return len(self._ids)

    def __contains__(self, run_id: object) -> bool:
        return run_id in self._ids

    def __getitem__(self, run_id: str) -> Record:
        if run_id not in self._ids:
            raise KeyError(f"run {run_id} is not among these")
        return self._packs[run_id]
