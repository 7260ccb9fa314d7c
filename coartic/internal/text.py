"""Make strings from files and programs printable.

Names, titles and reasons come from files and methods of users. They are shown in terminals, on
pages, in LaTeX and in commands that users paste into a shell. If a string in a file is not
printable, the file is refused (:data:`Line`). An error message of a program is converted to one
printable line (:func:`plain`).
"""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

MAX_LINE_LENGTH = 500
"""Largest number of characters of a title, a description or a citation."""
MAX_REASON_LENGTH = 2000
"""Largest number of characters of a stored reason."""
_MAX_NAMED = 12  # largest number of names in a sentence


def plain(text: str, most: int = MAX_REASON_LENGTH) -> str:
    """Convert a string to one printable line (:func:`one_line`) of limited length.

    White space at both ends is removed. A line with more than ``most`` characters is cut to this
    length, and ends in ``…``.

    Examples
    --------
    >>> plain("  first line\\nsecond line")
    'first line | second line'
    >>> plain("a long reason", 7)
    'a long…'
    """
    line = one_line(text.strip()[: 4 * most])  # bounds the work for a very long string
    return line if len(line) <= most else line[: most - 1] + "…"


def error_line(error: BaseException) -> str:
    """Return the class and the message of an exception, such as ``ValueError: message``.

    The result is one printable line.
    """
    return plain(f"{type(error).__name__}: {error}".removesuffix(": "))


def one_line(text: str) -> str:
    """Convert a string to one printable line.

    The lines of the string are joined by `` | ``. Empty lines, and blanks at the ends of lines, are
    left out. All other characters that are not printable are replaced by their escape sequences,
    such as ``\\x1b``. A string that is printable already is returned unchanged.
    """
    if text.isprintable() or all(map(prints, text)):
        return text
    parts = (part.strip() for part in text.splitlines())
    return " | ".join("".join(map(escape, part)) for part in parts if part)


def prints(c: str) -> bool:
    """Return whether a character is printable, or a space of any width.

    Tabs and line breaks are neither.
    """
    return c.isprintable() or unicodedata.category(c) == "Zs"


def escape(c: str) -> str:
    """Return a character, or its escape sequence, such as ``\\x1b``, if it is not printable."""
    return c if prints(c) else c.encode("unicode_escape").decode()


def pluralize(count: int, thing: str) -> str:
    """Return a count with its noun, such as ``1 run`` or ``2 runs``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def describe_parameters(parameters: Mapping[str, Any]) -> str:
    """Return parameters as a string, such as ``noise_sd=0.1, trials=100``; empty for none."""
    return ", ".join(f"{name}={value}" for name, value in parameters.items())


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a hint such as ``; did you mean 'a'?`` for a misspelt name.

    The hint contains the entry of ``names`` that is most similar to ``name``, where upper and lower
    case are treated as equal. The hint is empty if no entry is similar.
    """
    by_lower_case = {known.lower(): known for known in names}
    nearest = difflib.get_close_matches(name.lower(), by_lower_case, 1)
    return f"; did you mean {by_lower_case[nearest[0]]!r}?" if nearest else ""


BACKWARDS = "{!r} goes backwards; put the lower number first"
"""Template of the error message for a range whose ends are swapped, such as ``50..9``."""
FOREIGN = (
    *(".urdf", ".xml", ".osim", ".mot", ".sto", ".trc"),
    *(".c3d", ".mat", ".xlsx", ".xls", ".ods"),
)
"""Suffixes of files in which other programs store robots or recordings."""


def foreign_file(path: str, wanted: str = "a task is a TOML file, see docs/howto/task.md") -> str:
    """Return an error message if the name of a file has a suffix in :data:`FOREIGN`.

    The message ends with ``wanted``, which says what coartic reads instead. For any other name the
    message is empty.
    """
    if not path.lower().endswith(FOREIGN):
        return ""
    ending = path.lower().rpartition(".")[2]
    return f"{plain(path, MAX_LINE_LENGTH)}: coartic does not read .{ending} files; {wanted}"


def unknown(kind: str, name: object, names: Iterable[str]) -> str:
    """Return an error message for an unknown name.

    Parameters
    ----------
    kind : str
        What the name should stand for, such as ``task``.
    name : object
        The unknown name.
    names : iterable of str
        The known names.

    Returns
    -------
    str
        If ``name`` is the name of a file of another program, such as ``arm.urdf``, the message is
        that of :func:`foreign_file`. Otherwise the message suggests the most similar known name, or
        lists the first 12 known names if no known name is similar.

    Examples
    --------
    >>> unknown("task", "ascendin", ["ascending", "descending"])
    "task 'ascendin' is unknown; did you mean 'ascending'?"
    """
    if isinstance(name, str) and (sentence := foreign_file(name)):
        return f"{sentence}."
    known = list(names)
    end = ", ...; `coartic list` shows all." if len(known) > _MAX_NAMED else "."
    listed = f". Known: {', '.join(known[:_MAX_NAMED])}{end}"
    hint = (did_you_mean(name, known) if isinstance(name, str) else "") or listed
    return f"{kind} {plain(repr(name), MAX_LINE_LENGTH)} is unknown{hint}"


def _refuse_unprintable(text: str) -> str:
    """Return a string unchanged; raise a validation error if a character is not printable."""
    if wrong := next((c for c in text if not prints(c)), ""):
        message = f"should be one printable line, without {escape(wrong)}"
        raise PydanticCustomError("not_plain", "{words}", {"words": message})
    return text


printable = AfterValidator(_refuse_unprintable)
"""Validator of pydantic that refuses a string with a character that is not printable, such as a
line break."""
Line = Annotated[str, Field(max_length=MAX_LINE_LENGTH), printable]
"""Type of a string, such as a title, that is one printable line of at most :data:`MAX_LINE_LENGTH`
characters. It may be empty."""
