"""Read files, with error messages that name the file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from coartic.errors import CoarticError
from coartic.internal.text import MAX_LINE_LENGTH, plain


def read_toml(path: str | Path, *, error: type[CoarticError] = CoarticError) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises an exception of class ``error`` if the file cannot be read, or is not TOML in UTF-8.
    """
    try:
        return tomllib.loads(read_bytes(path, error=error).decode("utf-8-sig"))
    except ValueError as failure:
        form = "UTF-8" if isinstance(failure, UnicodeError) else "valid TOML"
        shown = plain(str(path), MAX_LINE_LENGTH)
        raise error(f"{shown} is not {form}: {plain(str(failure), 80)}") from None


def read_bytes(path: str | Path, *, error: type[CoarticError] = CoarticError) -> bytes:
    """Return the content of a file.

    Raises an exception of class ``error`` if the file cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as failure:
        shown = plain(str(path), MAX_LINE_LENGTH)
        raise error(f"{shown} cannot be read: {failure.strerror}") from None
