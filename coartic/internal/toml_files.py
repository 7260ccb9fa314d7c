"""Read files, with error messages that begin with the name of the file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from coartic.errors import CoarticError
from coartic.internal.text import MAX_LINE_LENGTH, plain


def read_toml(path: str | Path, *, error: type[CoarticError] = CoarticError) -> dict[str, Any]:
    """Read a TOML file, and return its content as a dict.

    Raises an error of class ``error`` if the file cannot be read, or is not TOML in UTF-8. The
    error message begins with the name of the file.
    """
    try:
        return tomllib.loads(read_bytes(path, error=error).decode("utf-8-sig"))
    except ValueError as failure:
        form = "UTF-8" if isinstance(failure, UnicodeError) else "valid TOML"
        shown = plain(str(path), MAX_LINE_LENGTH)
        raise error(f"{shown} is not {form}: {plain(str(failure), 80)}") from None


def read_bytes(path: str | Path, *, error: type[CoarticError] = CoarticError) -> bytes:
    """Read a file, and return its content.

    Raises an error of class ``error`` if the file cannot be read. The error message begins with the
    name of the file.
    """
    try:
        return Path(path).read_bytes()
    except OSError as failure:
        shown = plain(str(path), MAX_LINE_LENGTH)
        raise error(f"{shown} cannot be read: {failure.strerror}") from None
