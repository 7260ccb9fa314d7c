"""A document as one HTML file that needs nothing else: no network, no other files.

``page.html.jinja`` is the page. Every value in it is escaped and shown on one line, but what is
marked here as markup: styles, scripts, drawings, and places where a name may be broken.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import groupby
from typing import get_args

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from analysis.markup import inline
from analysis.report.document import (
    Block,
    CellKey,
    DataTable,
    Document,
    FigureBlock,
    PlayerBlock,
    Row,
)
from analysis.report.text import Part, parts
from analysis.words import NONE, true_minus
from coartic.text import one_line

_MAGNIFIED = 1.5
_WIDE, _READABLE = 320.0, 1.4  # pt; CSS pixels per pt that text of 7 pt needs
_WORD, _SENTENCE = 18, 60  # characters: up to one stays on a line, beyond the other has room

MOST_ROWS = 15
"""Rows of a table that are shown at once; the rest is scrolled to, or asked for."""
MOST_LISTED = 12
"""Subsections of one section that the contents show."""
MOST_LINKS = 4
"""Stretches of run lists linked from one row."""


def html(document: Document) -> str:
    """The document as a page, with its tables linked to the run ids behind them.

    Raises ValueError where a figure's SVG has no ``viewBox``.
    """
    players = any(isinstance(block, PlayerBlock) for block in document.blocks())
    styles = _resource("report.css") + (_resource("player.css") if players else "")
    script = _resource("report.js") + f"(() => {{\n{_resource('sort.js')}}})();\n"
    if players:
        script += f"(() => {{\n{_resource('player.js')}}})();\n"
    return _template().render(
        document=document,
        numbers={cell: number for number, cell in enumerate(document.runs, 1)},
        styles=Markup(styles),
        script=Markup(script),
        most_rows=MOST_ROWS,
        most_listed=MOST_LISTED,
        most_links=MOST_LINKS,
    )


@cache
def _template() -> Template:
    page = Environment(
        loader=PackageLoader("analysis.report", "formats"),
        autoescape=True,
        finalize=_on_one_line,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    page.filters |= {
        "inline": inline,
        "true_minus": true_minus,
        "table_view": table_view,
        "figure_view": figure_view,
        "data": _script_data,
    }
    page.tests |= {kind.__name__.lower(): kind.__instancecheck__ for kind in get_args(Block)}
    return page.get_template("page.html.jinja")


def _on_one_line(value: object) -> object:
    return one_line(value) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _resource(name: str) -> str:
    return (files("analysis.report") / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class HeadView:
    """A column's header with what the small print below its values is."""

    text: str
    small: str
    kind: str
    """CSS classes, here as below."""


@dataclass(frozen=True)
class CellView:
    """What a table shows in one place."""

    text: str
    sd: str | None
    """None where the column has none, empty where this value has none."""
    interval: str
    kind: str
    runs: int = 0
    """Number of the list of runs that it rests on, where these are not its row's."""
    title: str = ""
    """Those runs in words."""


@dataclass(frozen=True)
class RowView:
    """A row: its name, its other cells, and the lists of runs behind it."""

    name: CellView
    cells: tuple[CellView, ...]
    link: str
    stretches: tuple[tuple[int, int], ...]
    """First and last of lists that are neighbours."""


@dataclass(frozen=True)
class TableView:
    """A table as a page shows it: values, their SDs and intervals in one column."""

    heads: tuple[HeadView, ...]
    rows: tuple[RowView, ...]
    sourced: bool
    """Whether there is a column of runs."""


def table_view(table: DataTable, numbers: Mapping[CellKey, int]) -> TableView:
    """The table in words; ``numbers`` are those of the lists of runs, by cell."""
    columns = [list(own) for _, own in groupby(parts(table), key=lambda part: part.index)]
    rows = []
    for row in table.rows:
        name, *cells = (_cell(row, own, numbers) for own in columns)
        stretches = _stretches({numbers[cell] for cell in row.cells})
        rows.append(RowView(name, tuple(cells), row.link, stretches))
    heads = tuple(map(_head, columns))
    return TableView(heads, tuple(rows), any(row.cells for row in table.rows))


def _head(own: list[Part]) -> HeadView:
    small = {"value": "", "sd": "± SD", "interval": f"[{own[0].column.interval}]"}
    below = " ".join(filter(None, (small[part.kind] for part in own)))
    return HeadView(own[0].header, below, "text" if own[0].column.kind == "text" else "")


def _cell(row: Row, own: list[Part], numbers: Mapping[CellKey, int]) -> CellView:
    value = row.values[own[0].index]
    shown = {part.kind: part.text(value) for part in own}
    small = {kind: "" if text == NONE else text for kind, text in shown.items()}
    length, kind = len(str(value or "")), ""
    if own[0].column.kind == "text":
        kind = "word" if length <= _WORD else "text" if length <= _SENTENCE else "text sentence"
    cells = row.cells_by_column.get(own[0].column.name)
    return CellView(
        breakable(shown["value"]),
        small.get("sd"),
        small.get("interval", ""),
        kind,
        numbers[cells[0]] if cells else 0,
        f"Runs: {'; '.join(map(', '.join, cells))}" if cells else "",
    )


def breakable(text: str) -> str:
    """Text of a cell; a longer one may break after a slash, as in names of methods."""
    text = one_line(text)
    if len(text) <= _WORD:
        return text
    return Markup("/<wbr>").join(re.split(r"(?<=\w)/(?=\w)", text))


def _stretches(numbers: set[int]) -> tuple[tuple[int, int], ...]:
    """Neighbouring numbers drawn together: first and last."""
    stretches: list[tuple[int, int]] = []
    for number in sorted(numbers):
        if stretches and stretches[-1][1] == number - 1:
            stretches[-1] = stretches[-1][0], number
        else:
            stretches.append((number, number))
    return tuple(stretches)


@dataclass(frozen=True)
class FigureView:
    """A drawing as a page has it."""

    svg: Markup
    kind: str
    wide: bool
    """Whether a narrow page scrolls it."""


def figure_view(figure: FigureBlock) -> FigureView:
    """The drawing with its ground. Raises ValueError as :func:`inlined_svg` does."""
    wide = _width(figure) > _WIDE
    # What is not drawn in the page's ink needs a white ground in the dark as well.
    kinds = ["paper"] * ("currentColor" not in figure.svg) + ["wide"] * wide
    return FigureView(inlined_svg(figure), " ".join(kinds), wide)


def _width(figure: FigureBlock) -> float:
    """Of the drawing, pt. Raises ValueError where there is no SVG with a ``viewBox``."""
    size = re.search(r'<svg\b[^>]*viewBox="\s*\S+\s+\S+\s+([\d.]+)', figure.svg)
    if not size:
        raise ValueError(f"figure {figure.id}: its svg holds no <svg> element with a viewBox")
    return float(size[1])


def inlined_svg(figure: FigureBlock) -> Markup:
    """A figure's SVG for use inside HTML: named for who cannot see it, its ids its own.

    Prologue and metadata go, and ids get the figure's id before them where they have not,
    since those of several SVGs would meet in one page. It is shown up to half as large again
    as on paper; a wide one never so small that it cannot be read.
    Raises ValueError where there is no SVG with a ``viewBox``.
    """
    width, root = _width(figure), re.search(r"<svg\b([^>]*)>", figure.svg)
    assert root is not None
    attributes = re.sub(r'\s(role|aria-label|width|height|style)="[^"]*"', "", root[1])
    body = re.sub(r"<metadata>.*?</metadata>\s*", "", figure.svg[root.end() :], flags=re.S)
    fresh = rf'(\sid="|href="#|url\(#)(?!{re.escape(figure.id)}-)'
    body = re.sub(fresh, rf"\g<1>{figure.id}--", body)
    least = f"; min-width: {_READABLE * width:.0f}px" if width > _WIDE else ""
    return Markup(
        f'<svg{attributes} role="img" aria-label="{escape(one_line(figure.alt))}" '
        f'style="max-width: {_MAGNIFIED * width:.0f}pt{least}">{body.strip()}'
    )


def _script_data(player: PlayerBlock) -> Markup:
    """JSON within a script element, which only "<" could end."""
    return Markup(player.data.replace("<", "\\u003c"))
