"""Files (to be replaced at merge)."""

import os
import re
import uuid
from collections.abc import Mapping
from pathlib import Path


def write_atomically(path: Path, data: bytes) -> None:
    part = path.parent / f".coartic-{uuid.uuid4().hex}.part"
    try:
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def clear_leftovers(folder: Path) -> None:
    for path in folder.iterdir():
        if re.fullmatch(r"\.coartic-[0-9a-f]{32}\.part", path.name):
            path.unlink()


def publish(folder: Path, files: Mapping[str, bytes], *, owner: str, alone: bool) -> None:
    for name, data in files.items():
        write_atomically(folder / name, data)
