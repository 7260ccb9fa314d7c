"""Packs of records, read and written without the project's code."""

import hashlib
import json

SHARED = ("code", "told", "secondary", "origin", "environment")


def pack_lines(path):
    """The lines of a pack: name, checksum, JSON as bytes."""
    return [line.split(b" ", 2) for line in path.read_bytes().splitlines()]


def write_lines(path, lines):
    """A pack of lines whose names and JSON are given, with checksums that fit."""
    text, common = b"", b""
    for name, content in lines:
        checked = content if name == b"common" else common + b"\n" + content
        common = content if name == b"common" else common
        text += b"%s %s %s\n" % (name, hashlib.sha256(checked).hexdigest().encode(), content)
    path.write_bytes(text)


def read_pack(path):
    """The records of a pack, each with what it has in common with others, by their names."""
    found, common = {}, None
    for name, _, content in pack_lines(path):
        if name == b"common":
            common = json.loads(content)
            continue
        record = {**json.loads(content), **common}
        asked, seed = record.pop("asked"), record.pop("seed")
        found[name.decode()] = {**record, "specification": {**asked, "seed": seed}}
    return found


def write_pack(path, records):
    """A pack of such records by their names, whatever they hold, with checksums that fit."""
    lines = []
    for name, record in records.items():
        own = dict(record)
        common = {key: own.pop(key) for key in SHARED if key in own}
        asked = own.pop("specification")
        if isinstance(asked, dict):
            own |= {"seed": asked["seed"]} if "seed" in asked else {}
            asked = {key: value for key, value in asked.items() if key != "seed"}
        lines += [(b"common", _json({**common, "asked": asked})), (name.encode(), _json(own))]
    write_lines(path, lines)


def packs_of(folder):
    """The packs of a results folder, as they were written."""
    return sorted((folder / "records").glob("*.pack"))


def records_of(folder):
    """All records of a results folder by run id."""
    return {
        run_id: record for path in packs_of(folder) for run_id, record in read_pack(path).items()
    }


def pack_of(folder, run_id):
    """The pack that a run's record is in."""
    return next(path for path in packs_of(folder) if run_id in read_pack(path))


def _json(content):
    return json.dumps(content, separators=(",", ":"), ensure_ascii=False).encode(
        errors="surrogatepass"
    )
