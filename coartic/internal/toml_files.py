"""Read TOML files of users, of a bounded size."""

from __future__ import annotations

import errno
import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from coartic.errors import CoarticError
from coartic.internal.limits import MOST_BYTES
from coartic.internal.text import LONGEST_LINE, plain

_MOST_TOML = 1_000_000  # bytes


def read_toml(path: str | Path, *, error: type[CoarticError] = CoarticError) -> dict[str, Any]:
    """Return the content of a TOML file as a dictionary. Raises an exception of class ``error``,
    which names the file, if it cannot be read, has more than 1,000,000 bytes, or is not TOML in
    UTF-8."""
    check_file(path, error=error, most=_MOST_TOML)
    shown = plain(str(path), LONGEST_LINE)
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        return tomllib.loads(text)
    except UnicodeDecodeError:
        raise error(f"{shown}: is not a text file in UTF-8") from None
    except OSError as failure:
        raise error(f"{shown}: cannot be read: {failure.strerror or failure}") from None
    except (ValueError, RecursionError) as failure:  # TOMLDecodeError is a ValueError
        raise error(f"{shown}: is not valid TOML: {plain(str(failure), 80)}") from None


def check_file(
    path: str | Path, *, error: type[CoarticError] = CoarticError, most: int = MOST_BYTES
) -> None:
    """Raise an exception of class ``error``, which names the file, if it is missing, may not be
    read, is no regular file, or has more than ``most`` bytes."""
    shown = plain(str(path), LONGEST_LINE)
    try:
        found = Path(path).stat()
    except (OSError, ValueError) as failure:  # ValueError: a NUL in the name
        reason = getattr(failure, "strerror", None) or failure
        raise error(f"{shown}: cannot be read: {reason}") from None
    if not os.access(path, os.R_OK):
        raise error(f"{shown}: cannot be read: {os.strerror(errno.EACCES)}")
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe or a device"
        raise error(f"{shown}: cannot be read: it is {kind}, not a file")
    if found.st_size > most:
        raise error(f"{shown}: has {found.st_size} bytes; it may have {most} at most")
