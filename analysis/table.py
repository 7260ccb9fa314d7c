"""Tables of text, for a terminal and for Markdown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from analysis.markup import markdown_text
from analysis.words import NONE, interval, short, tally
from coartic.text import one_line

__all__ = ["NONE", "Table", "interval", "short", "tally"]


@dataclass(frozen=True)
class Table:
    """A table of text, ready for a terminal or for Markdown."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    links: tuple[str, ...] = ()
    """Addresses that the first cells of the rows lead to, in Markdown; none by default."""

    def to_markdown(self) -> str:
        """The table alone, without its title. Its cells are plain text."""

        def line(cells: Iterable[str]) -> str:
            return f"|{'|'.join(cells)}|"

        def texts(cells: Iterable[str]) -> list[str]:
            return [markdown_text(f" {one_line(cell)} ") for cell in cells]

        rows = list(map(texts, self.rows))
        for row, link in zip(rows, self.links, strict=False):
            row[0] = f" [{row[0].strip()}]({link}) "
        rule = line([" --- "] * len(self.columns))
        return "\n".join([line(texts(self.columns)), rule, *map(line, rows)])
