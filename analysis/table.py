"""Tables of text, for a terminal and for Markdown, and the numbers in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from analysis.markup import markdown_text
from analysis.statistics.estimates import Inference
from coartic.text import one_line

NONE = "–"


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


def short(value: float) -> str:
    """With three figures: 950, 12.3 k, 4.98 M, 0.21; ∞, and a dash for NaN."""
    if math.isnan(value):
        return NONE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    for size, unit in ((1e6, " M"), (1e3, " k")):
        if abs(value) >= 0.9995 * size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"


def interval(found: Inference, style: str = ".1f") -> str:
    """``2.1 [1.3, 2.9]``; without the brackets where there is no interval.

    An interval that is a point would look like certainty: it is given in words.
    """
    text = format(found.estimate, style)
    if math.isnan(found.low) or math.isnan(found.high):
        return text
    if found.low == found.high:
        return f"{text} (no spread in {' and '.join(map(str, found.n))} runs)"
    return f"{text} [{found.low:{style}}, {found.high:{style}}]"


def tally(of: Mapping[Any, int]) -> str:
    """``LRLR 17, RRLR 3``, the commonest first; a dash for none."""
    ordered = sorted(of.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{name} {count}" for name, count in ordered) or NONE
