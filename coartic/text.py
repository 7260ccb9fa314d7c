"""Text from elsewhere: what is let in, and how it is shown.

Names, titles and reasons come from files and methods of others, and go to terminals, pages,
LaTeX and commands to paste. What a person writes in a file is refused where it is not plain
(:data:`Line`); what a program says is kept, made plain (:func:`plain`).
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

LONGEST_LINE = 500
"""Characters of a title, a description or a citation."""
LONGEST_REASON = 2000
"""Characters of a reason that is kept."""


def plain(text: str, most: int = LONGEST_REASON) -> str:
    """Text as one printable line of at most ``most`` characters.

    Lines are joined by `` | ``; what else does not print (control characters, escape sequences,
    marks that turn the direction of writing) is shown as its escape, such as ``\\x1b``.
    """
    line = " | ".join(part.strip() for part in text.splitlines() if part.strip())
    shown = "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in line[: most + 1]
    )
    return shown if len(shown) <= most else shown[: most - 1] + "…"


def _printable(text: str) -> str:
    for c in text:
        if not c.isprintable():
            escape = c.encode("unicode_escape").decode()
            raise PydanticCustomError(
                "not_plain",
                "should be one line of printable text, without {escape}",
                {"escape": escape},
            )
    return text


printable = AfterValidator(_printable)
"""Refuses what is not one line of printable text."""
Line = Annotated[str, Field(max_length=LONGEST_LINE), printable]
"""One line of printable text, such as a title or a citation."""
