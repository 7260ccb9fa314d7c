"""Text from elsewhere: what is let in, and how it is shown.

Names, titles and reasons come from files and methods of others, and go to terminals, pages,
LaTeX and commands to paste. What a person writes in a file is refused if it is not printable
(:data:`Line`); what a program says is kept as one printable line (:func:`plain`).
"""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

LONGEST_LINE = 500
"""Most characters of a title, a description or a citation."""
LONGEST_REASON = 2000
"""Most characters of a reason that is kept."""
_MOST_NAMED = 12  # in a sentence


def plain(text: str, most: int = LONGEST_REASON) -> str:
    """Return text as one printable line (:func:`one_line`), without blanks at its ends; a line of
    more than ``most`` characters is cut to that length and ends in ``…``. Only 4 ``most``
    characters, from the first that is no blank, count."""
    line = one_line(text.strip()[: 4 * most])  # an escape takes longer than what it shows
    return line if len(line) <= most else line[: most - 1] + "…"


def error_line(error: BaseException) -> str:
    """Return an exception as one printable line (:func:`plain`), such as ``ValueError: text``."""
    return plain(f"{type(error).__name__}: {error}".removesuffix(": "))


def one_line(text: str) -> str:
    """Return text as one printable line, itself if it is one. Otherwise lines are joined by
    `` | ``, without empty lines and without blanks (tabs, too) at the ends of lines; other
    characters that do not print become escapes, such as ``\\x1b``."""
    if text.isprintable() or all(map(prints, text)):
        return text
    parts = (part.strip() for part in text.splitlines())
    return " | ".join("".join(map(escape, part)) for part in parts if part)


def prints(c: str) -> bool:
    """Return whether a character is printable, or a space of any width (Unicode category Zs); tabs
    and line ends are not printable."""
    return c.isprintable() or unicodedata.category(c) == "Zs"


def escape(c: str) -> str:
    """Return a character, or its escape, such as ``\\x1b``, if it is not printable."""
    return c if prints(c) else c.encode("unicode_escape").decode()


def counted(count: int, thing: str) -> str:
    """Return a count with its noun, such as ``1 run`` or ``2 runs``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return ``; did you mean 'a'?`` with the name that is spelt most like ``name``, capitals
    aside; an empty string if no name is alike."""
    known = {each.lower(): each for each in names}
    nearest = difflib.get_close_matches(name.lower(), known, 1)
    return f"; did you mean {known[nearest[0]]!r}?" if nearest else ""


FOREIGN = (
    *(".urdf", ".xml", ".osim", ".mot", ".sto", ".trc"),
    *(".c3d", ".mat", ".xlsx", ".xls", ".ods"),
)
"""Endings of files of robots and recordings that other programs write."""


def foreign_file(path: str, wanted: str = "a task is a TOML file, see docs/howto/task.md") -> str:
    """Return a sentence that coartic does not read a file of another program, known by its ending
    (:data:`FOREIGN`); an empty text for any other path. ``wanted`` is the end of the sentence, on
    files that are read."""
    if not path.lower().endswith(FOREIGN):
        return ""
    ending = path.lower().rpartition(".")[2]
    return f"{plain(path, LONGEST_LINE)}: coartic reads no .{ending} file; {wanted}"


def unknown(kind: str, name: object, names: Iterable[str]) -> str:
    """Return a sentence that no ``kind``, such as ``task``, is called ``name``, with the nearest of
    ``names`` (:func:`did_you_mean`), or, if no name is near, with all names, of more than 12 the
    first 12; for a file of another program return a sentence that coartic does not read it."""
    if isinstance(name, str) and (words := foreign_file(name)):
        return f"{words}."
    several = list(names)
    others = len(several) - _MOST_NAMED
    more = f" and {counted(others, 'other')}" if others > 0 else ""
    listed = f". Known: {', '.join(several[:_MOST_NAMED])}{more}."
    hint = (did_you_mean(name, several) if isinstance(name, str) else "") or listed
    return f"unknown {kind} {plain(repr(name), LONGEST_LINE)}{hint}"


def _refuse_unprintable(text: str) -> str:
    """Return the text itself. Raises a validation error if :func:`prints` refuses a character, such
    as the end of a line."""
    if wrong := next((c for c in text if not prints(c)), ""):
        words = f"should be one line of printable text, without {escape(wrong)}"
        raise PydanticCustomError("not_plain", "{words}", {"words": words})
    return text


printable = AfterValidator(_refuse_unprintable)
"""Validator that refuses text that is not one printable line."""
Line = Annotated[str, Field(max_length=LONGEST_LINE), printable]
"""Printable line, such as a title, of at most :data:`LONGEST_LINE` characters."""
