"""Make strings from files and programs safe to show.

Names, titles and reasons come from files and methods of users. They appear in terminals, pages,
LaTeX and commands to paste. A string in a file must be printable, or the file is refused
(:data:`Line`). A message of a program is converted to one printable line (:func:`plain`).
"""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

MAX_LINE_LENGTH = 500
"""Largest number of characters of a title, a description or a citation."""
MAX_REASON_LENGTH = 2000
"""Largest number of characters of a stored reason."""
_MAX_NAMED = 12  # largest number of names in a sentence


def plain(text: str, most: int = MAX_REASON_LENGTH) -> str:
    """Return a string as one printable line (:func:`one_line`) of at most ``most`` characters.

    Blanks at both ends are removed. A longer line is cut and ends in ``…``.
    """
    line = one_line(text.strip()[: 4 * most])  # bounds the work for a very long string
    return line if len(line) <= most else line[: most - 1] + "…"


def error_line(error: BaseException) -> str:
    """Return an exception as one printable line, such as ``ValueError: message``."""
    return plain(f"{type(error).__name__}: {error}".removesuffix(": "))


def one_line(text: str) -> str:
    """Return a string as one printable line.

    Lines are joined by `` | ``, without empty lines and without blanks at the ends of lines. Other
    characters that are not printable become escapes, such as ``\\x1b``.
    """
    if text.isprintable() or all(map(prints, text)):
        return text
    parts = (part.strip() for part in text.splitlines())
    return " | ".join("".join(map(escape, part)) for part in parts if part)


def prints(c: str) -> bool:
    """Return whether a character is printable or a space of any width, but not a tab or line
    end."""
    return c.isprintable() or unicodedata.category(c) == "Zs"


def escape(c: str) -> str:
    """Return a character; if it is not printable, return its escape, such as ``\\x1b``."""
    return c if prints(c) else c.encode("unicode_escape").decode()


def pluralize(count: int, thing: str) -> str:
    """Return a count with its noun, such as ``1 run`` or ``2 runs``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a hint, such as ``; did you mean 'a'?``, with the most similar name.

    The hint names the entry of ``names`` that is most similar to ``name``, ignoring case. Return an
    empty string if no name is similar.
    """
    by_lower_case = {known.lower(): known for known in names}
    nearest = difflib.get_close_matches(name.lower(), by_lower_case, 1)
    return f"; did you mean {by_lower_case[nearest[0]]!r}?" if nearest else ""


BACKWARDS = "{!r} goes backwards; put the lower number first"
"""Error message for a range, such as ``50..9``."""
FOREIGN = (
    *(".urdf", ".xml", ".osim", ".mot", ".sto", ".trc"),
    *(".c3d", ".mat", ".xlsx", ".xls", ".ods"),
)
"""Suffixes of files in which other programs store robots or recordings."""


def foreign_file(path: str, wanted: str = "a task is a TOML file, see docs/howto/task.md") -> str:
    """Return a sentence if the suffix of a file is one of another program (:data:`FOREIGN`).

    The end of the sentence is ``wanted``, which says what coartic reads instead. Return an empty
    string for any other file.
    """
    if not path.lower().endswith(FOREIGN):
        return ""
    ending = path.lower().rpartition(".")[2]
    return f"{plain(path, MAX_LINE_LENGTH)}: coartic does not read .{ending} files; {wanted}"


def unknown(kind: str, name: object, names: Iterable[str]) -> str:
    """Return an error message for an unknown name.

    The message suggests the most similar of ``names``. If no name is similar, it lists the first 12
    names. If ``name`` is the name of a file from another program, such as ``arm.urdf``, the message
    is the sentence of :func:`foreign_file` instead. ``kind`` is what the name stands for, such as
    ``task``.
    """
    if isinstance(name, str) and (sentence := foreign_file(name)):
        return f"{sentence}."
    known = list(names)
    end = ", ...; `coartic list` shows all." if len(known) > _MAX_NAMED else "."
    listed = f". Known: {', '.join(known[:_MAX_NAMED])}{end}"
    hint = (did_you_mean(name, known) if isinstance(name, str) else "") or listed
    return f"{kind} {plain(repr(name), MAX_LINE_LENGTH)} is unknown{hint}"


def _refuse_unprintable(text: str) -> str:
    """Return a string; raise a validation error if a character is not printable."""
    if wrong := next((c for c in text if not prints(c)), ""):
        message = f"should be one printable line, without {escape(wrong)}"
        raise PydanticCustomError("not_plain", "{words}", {"words": message})
    return text


printable = AfterValidator(_refuse_unprintable)
"""Validator that refuses strings that are not one printable line."""
Line = Annotated[str, Field(max_length=MAX_LINE_LENGTH), printable]
"""Printable line, such as a title, of at most :data:`MAX_LINE_LENGTH` characters."""
