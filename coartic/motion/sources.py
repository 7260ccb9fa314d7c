"""The sources that results come from, and their version."""

from __future__ import annotations

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).parent.parent


def model_files() -> list[Path]:
    """The files of this package that results come from."""
    single = (PACKAGE / name for name in ("robot.py", "model.py", "method.py", "tasks/task.py"))
    rooms = ((PACKAGE / room).glob("*.py") for room in ("motion", "learner"))
    return sorted([*single, *(path for room in rooms for path in room)])


def hash_of_sources() -> str:
    """Hash of :func:`model_files`: the version of the model's code."""
    texts = (path.name.encode() + b"\0" + path.read_bytes() for path in model_files())
    return hashlib.sha256(b"\0".join(texts)).hexdigest()[:16]


FINGERPRINT = hash_of_sources()
"""The version of the model's code when the package was imported."""
