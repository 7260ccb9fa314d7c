"""What users hand in: files, read bounded, and how much a plan may ask for."""

from __future__ import annotations

import io
import os
import re
import stat
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from coartic.errors import CoarticError
from coartic.text import plain

D = TypeVar("D")

MOST_BYTES = 1_000_000
"""Of a file: a thousand times a usual task, and parsed within a second or so."""
MOST_CELLS = 10_000
"""Of a suite: sixty times the largest one shipped."""
MOST_RUNS = 1_000_000
"""Of a cell."""
MOST_PLANNED = 2_000_000
"""Runs of a plan, which is held in memory."""
MOST_TRIALS = 10_000_000
"""Of a run: a thousand times the paper's; their rewards are kept."""
MOST_SECONDS = 1_000_000
"""Of a run: eleven days; the system's clocks of waiting end at twice that."""
MOST_SEED = 2**63 - 1

_SHOWN = 20  # problems of one file
_BRIEF = 80  # characters of a value in a sentence
# A key of many parts takes the parser time in the square of their number.
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")


def read_text(
    path: str | Path, most: int = MOST_BYTES, *, error: type[CoarticError] = CoarticError
) -> str:
    """The text of a regular file of at most ``most`` bytes in UTF-8, with ``\\n`` as line end.

    Raises ``error`` for anything else: no pipe is waited for, no device read without end.
    """
    content = read_bytes(path, most, error=error)
    try:  # Notepad's mark, too
        return io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig").read()
    except UnicodeDecodeError:
        raise error(f"{plain(str(path))}: is not a text file in UTF-8") from None


def read_bytes(path: str | Path, most: int, *, error: type[CoarticError] = CoarticError) -> bytes:
    """The content of a regular file of at most ``most`` bytes; raises ``error`` otherwise."""
    shown = plain(str(path))
    try:
        with open(path, "rb", opener=_open_at_once) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise error(f"{shown}: is not a regular file")
            content = file.read(most + 1)
    except OSError as failure:
        raise error(f"{shown}: cannot be read: {failure.strerror or failure}") from None
    except ValueError:  # what no file can be named
        raise error(f"{shown}: is not the name of a file") from None
    if len(content) > most:
        raise error(f"{shown}: is longer than {most:_} bytes, the most that is read")
    return content


def _open_at_once(path: str, flags: int) -> int:
    """A pipe without a writer would block."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def read_toml(path: str | Path, *, error: type[CoarticError] = CoarticError) -> dict[str, Any]:
    """The content of a TOML file. Raises ``error`` for one that cannot be used."""
    text, shown = read_text(path, error=error), plain(str(path))
    if _DEEP_KEY.search(text):
        raise error(f"{shown}: is not used: a key has more than 32 dotted parts")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as failure:  # TOMLDecodeError is a ValueError
        raise error(f"{shown}: is not valid TOML: {brief(str(failure))}") from None


def brief(text: str) -> str:
    """A text as one short printable line, with its length where it is cut."""
    if len(text) <= _BRIEF:
        return plain(text)
    return f"{plain(text[:60])}... ({len(text)} characters)"


def brief_value(value: object) -> str:
    """A value as it would be written in Python, as :func:`brief` shows it."""
    try:
        return brief(repr(value))
    except ValueError:  # Python's own bound, which hexadecimal input evades
        return "a number of more than 4300 digits"


def problems(source: str, details: Sequence[D], explain: Callable[[D], str]) -> str:
    """One line for each problem of a file, the first :data:`_SHOWN` of them."""
    shown = plain(source)
    lines = list(dict.fromkeys(f"{shown}: {plain(explain(d))}" for d in details[:_SHOWN]))
    if len(details) > _SHOWN:
        lines.append(f"{shown}: has {len(details) - _SHOWN} more problems")
    return "\n".join(lines)
