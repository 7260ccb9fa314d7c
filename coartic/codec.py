"""Records on disk: two lines, the SHA-256 of the second, and JSON.

Whoever changes the second line alone is noticed; whoever makes the first line anew still has
to state a solution that gives the score.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from pydantic import ValidationError

from coartic.inputs import problems_inline, read_bytes
from coartic.record import Record, RecordError

LARGEST_RECORD = 1 << 28
"""Bytes of a record: rewards of ten million trials, twice over."""
_PREFIX = "sha256:"


def encode(record: Record) -> bytes:
    """A record as it is kept on disk."""
    body = record.model_dump_json().encode()
    return f"{_PREFIX}{hashlib.sha256(body).hexdigest()}\n".encode() + body + b"\n"


def decode(data: bytes, source: Path) -> Record:
    """A record from its bytes. Raises RecordError where they are not what was written."""
    head, _, body = data.partition(b"\n")
    body = body.removesuffix(b"\n")
    if not head.startswith(_PREFIX.encode()):
        raise RecordError(f"{source}: is not a run record")
    if head.decode(errors="replace") != f"{_PREFIX}{hashlib.sha256(body).hexdigest()}":
        raise RecordError(f"{source}: is damaged: its checksum does not fit")
    try:
        return Record.model_validate_json(body)
    except ValidationError as error:
        raise RecordError(f"{source}: is damaged: {problems_inline(error)}") from None


def read_record(path: Path) -> Record:
    """The record of a file, which is named by the run's id. Raises RecordError otherwise."""
    if not path.exists():
        raise RecordError(f"no record of run {path.stem} in {path.parent.parent}")
    data = read_bytes(path, LARGEST_RECORD, error=RecordError)
    record = decode(data, path)
    if record.run_id != path.stem:
        raise RecordError(f"{path}: holds the record of run {record.run_id}")
    return record
