"""Records as bytes: a *pack* of lines, each with its own SHA-256.

A line is a name, a checksum and JSON, with a space between. ``common`` names what all the lines
after it have in common, up to the next such line; every other line is a run, named by its id,
and its checksum is of both JSONs. A line that was changed, or stands under another common one,
is noticed, and the others are as good as before. Whoever makes the checksums anew still has to
state a solution that gives the score.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import NamedTuple

from pydantic import ValidationError

from coartic.inputs import problems_inline
from coartic.runs.record import Asked, Common, Own, Record, RecordError
from coartic.runs.stored import Seed

FULL = 1 << 26
"""Bytes of lines in a pack beyond which another one is begun."""
_COMMON = b"common"
_HEAD = re.compile(rb"(common|[0-9a-f]{16}-[0-9a-f]+) ([0-9a-f]{64}) (?=.)", re.DOTALL)


class _CommonLine(Common):
    asked: Asked


class _RunLine(Own):
    seed: Seed


class Line(NamedTuple):
    """The record of a run as it was found, not yet read."""

    run_id: str
    common: bytes
    """The JSON before it, whatever it is; empty where there is none."""
    checksum: bytes
    pack: bytes
    begin: int
    end: int

    @property
    def own(self) -> bytes:
        """Its JSON."""
        return self.pack[self.begin : self.end]


def encode(records: Iterable[Record]) -> Iterator[bytes]:
    """Packs of records, each of about :data:`FULL` bytes at most, or of one run."""
    pack: list[bytes] = []
    size, before = 0, b""
    for record in records:
        common, own = _parts(record)
        line = _line(record.run_id.encode(), own, common, own)
        if pack and size + len(line) + len(common) > FULL:
            yield b"".join(pack)
            pack, size, before = [], 0, b""
        if common != before:
            line = _line(_COMMON, common, common) + line
        pack.append(line)
        size, before = size + len(line), common
    if pack:
        yield b"".join(pack)


def lines(data: bytes) -> tuple[list[Line], bool]:
    """The runs of a pack, and whether it is otherwise whole: nothing else is in it, no common
    line was changed, its last line has an end. Runs' own checksums are not looked at."""
    found, common, clean = [], b"", data.endswith(b"\n")
    begin, size = 0, len(data)
    while begin < size:
        end = data.find(b"\n", begin)
        end = size if end < 0 else end
        head = _HEAD.match(data, begin, end)
        if head is None:
            clean = False
        elif head[1] == _COMMON:
            common = data[head.end() : end]
            clean = clean and head[2] == _checksum(common)
        else:
            found.append(Line(head[1].decode(), common, head[2], data, head.end(), end))
        begin = end + 1
    return found, clean


def decode(line: Line) -> Record:
    """The record of a line. Raises RecordError where it is not what was written."""
    if line.checksum != _checksum(line.common, line.own):
        raise RecordError(f"run {line.run_id} is damaged: its checksum does not fit")
    try:
        common = _common(line.common)
        own = _RunLine.model_validate_json(line.own)
    except ValidationError as error:
        raise RecordError(f"run {line.run_id} is damaged: {problems_inline(error)}") from None
    if own.run_id != line.run_id:
        raise RecordError(f"run {line.run_id} is damaged: it holds the record of {own.run_id}")
    fields = {**common.__dict__, **own.__dict__}
    fields["specification"] = fields.pop("asked").with_seed(fields.pop("seed"))
    return Record.model_construct(**fields)


@lru_cache(maxsize=64)
def _common(text: bytes) -> _CommonLine:
    """Read once for all the runs that share it."""
    return _CommonLine.model_validate_json(text)


def _parts(record: Record) -> tuple[bytes, bytes]:
    """What a record has in common with others, and its own, as JSON."""
    asked, shared, own = (
        {name: getattr(of, name) for name in kind.model_fields}
        for of, kind in ((record.specification, Asked), (record, Common), (record, Own))
    )
    common = _CommonLine.model_construct(asked=Asked.model_construct(**asked), **shared)
    line = _RunLine.model_construct(seed=record.specification.seed, **own)
    return common.model_dump_json().encode(), line.model_dump_json().encode()


def _line(name: bytes, content: bytes, *checked: bytes) -> bytes:
    return b"%s %s %s\n" % (name, _checksum(*checked), content)


def _checksum(*parts: bytes) -> bytes:
    return hashlib.sha256(b"\n".join(parts)).hexdigest().encode()
