"""Pages of Markdown, put together in one place: what is text stays text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from analysis.markup import markdown, markdown_text
from analysis.table import Table


@dataclass(frozen=True)
class Heading:
    """A heading, in plain text; the page's own is of level 1."""

    level: int
    text: str


Part = Heading | Table | str | Sequence[str]
"""Of a page; a paragraph and the items of a list are inline markup, lines kept as they are."""


def page(parts: Iterable[Part]) -> str:
    """The parts as a page of Markdown."""
    return "\n\n".join(map(_part, parts)) + "\n"


def _part(part: Part) -> str:
    match part:
        case Heading():
            return f"{'#' * part.level} {markdown_text(part.text)}"
        case Table():
            return part.to_markdown()
        case str():
            return _lines(part)
    return "\n".join(f"- {_lines(item)}" for item in part)


def _lines(text: str) -> str:
    return "  \n".join(markdown(line.strip()) for line in text.split("\n"))
