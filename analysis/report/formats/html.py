"""A document as one HTML file that needs nothing else: no network, no other files.

``page.html.jinja`` is the page. Every value in it is escaped and shown on one line, but what is
marked here as markup: styles, scripts, drawings, and places where a name may be broken.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from markupsafe import Markup, escape

from coartic.analysis.markup import inline
from coartic.analysis.methods import LEARNER
from coartic.analysis.report.document import (
    CellKey,
    DataTable,
    Document,
    FigureBlock,
    PlayerBlock,
    Row,
)
from coartic.analysis.report.formats.templates import on_one_line, template
from coartic.analysis.report.text import Part, by_column, tallied, tone_of
from coartic.analysis.words import NONE, true_minus
from coartic.text import one_line

_MAGNIFIED = 1.35
_WIDE, _READABLE = 320.0, 1.4  # pt; CSS pixels per pt that text of 7 pt needs
_WORD, _SENTENCE = 18, 60  # characters: up to one stays on a line, beyond the other has room

MOST_ROWS = 8
"""Rows of a table above which it has a field to search them."""
WIDTHS = (24, 32, 40, 48, 56, 64, 72, 999)
"""Of tables, rem: pages narrower than a table's show its rows as cards."""
_RUNS = 4.0  # rem of the last column, which leads to the runs
MOST_LINKS = 4
"""Stretches of run lists linked from one row."""


def html(document: Document) -> str:
    """The document as a page, with its tables linked to the run ids behind them.

    Raises ValueError where a figure's SVG has no ``viewBox``.
    """
    players = any(isinstance(block, PlayerBlock) for block in document.blocks())
    charts = any(figure.chart for figure in document.figures())
    styles = _resource("report.css") + (_resource("player.css") if players else "")
    script = _resource("report.js") + f"(() => {{\n{_resource('sort.js')}}})();\n"
    if players:
        script += f"(() => {{\n{_resource('player.js')}}})();\n"
    page = template(
        "page.html.jinja",
        *(inline, true_minus, by_column, small_print, cell_view, stretches, is_wide),
        *(inlined_svg, script_data, tallied, width_of, heads_of, by_group, is_learner),
        autoescape=True,
        finalize=on_one_line,
    )
    return page.render(
        document=document,
        numbers={cell: number for number, cell in enumerate(document.runs, 1)},
        styles=Markup(styles),
        script=Markup(script),
        vega=Markup(vega() if charts else ""),
        widths=WIDTHS,
        most_rows=MOST_ROWS,
        most_links=MOST_LINKS,
    )


def _resource(name: str) -> str:
    return (files("coartic.analysis.report") / name).read_text(encoding="utf-8")


def small_print(own: list[Part]) -> str:
    """What the small print below a column's values is."""
    small = {"value": "", "sd": "± SD", "interval": f"[{own[0].column.interval}]"}
    return " ".join(filter(None, (small[part.kind] for part in own)))


def width_of(table: DataTable) -> int:
    """Which of :data:`WIDTHS` a table needs, roughly; the last is wider than any page.

    Where there is less room each row stands as a card of its own.
    """
    wide = sum(map(_width_of_column, ([table, own] for own in by_column(table))))
    return next((width for width in WIDTHS if wide + _RUNS <= width), WIDTHS[-1])


def _width_of_column(of: Any) -> float:
    """In rem, of text at 0.85 rem."""
    table, own = of
    column = own[0].column
    longest = {
        part.kind: max((len(part.text(row.values[part.index])) for row in table.rows), default=0)
        for part in own
    }
    beside = longest["value"] + (longest.get("sd", -3) + 3)
    if column.kind == "text":
        beside = min(beside, _WORD if longest["value"] <= _SENTENCE else 2 * _WORD)
    head = max(map(len, own[0].header.split()), default=0)
    return 0.5 * max(beside, 0.85 * longest.get("interval", 0), head) + 0.9


def heads_of(table: DataTable) -> Markup:
    """What each column is, as styles: a card names its values so."""
    rules = (
        f'#{table.id} td:nth-child({place}){{--head:"{_css(own[0].header)}"}}'
        for place, own in enumerate(by_column(table)[1:], 2)
    )
    return Markup("\n".join(rules))


def _css(text: str) -> str:
    """Text within a string of CSS, which nothing in it ends."""
    return re.sub(r"[^\w .,()%±/–−-]", lambda m: f"\\{ord(m[0]):06x}", one_line(text))


def by_group(rows: Iterable[Row]) -> list[tuple[str, list[Row]]]:
    """Rows of one kind together, in the order of the first of each."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.group, []).append(row)
    return list(found.items())


def is_learner(row: Row) -> bool:
    """Whether it is of the paper's learner, which a page marks."""
    return any(label.startswith(LEARNER) for _, label in row.cells) and LEARNER.rstrip("/") in str(
        row.key
    )


@cache
def vega() -> str:
    """What draws the charts: Vega, Vega-Lite and Vega-Embed in one script (BSD-3-Clause)."""
    import vl_convert

    script: str = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")
    return script.replace("</script", "<\\/script")


class CellView(NamedTuple):
    """What a table shows in one place."""

    text: str
    title: str
    """What is said on hover; empty where there is nothing."""
    sd: str | None
    """None where the column has none, empty where this value has none."""
    interval: str
    kind: str
    """CSS classes."""
    cells: tuple[CellKey, ...]
    """What it was computed from, where that is not its row's."""


def cell_view(row: Row, own: list[Part]) -> CellView:
    """A row's value in one column."""
    column, value = own[0].column, row.values[own[0].index]
    shown = {part.kind: part.text(value) for part in own}
    small = {kind: "" if text == NONE else text for kind, text in shown.items()}
    length, kind = len(str(value or "")), ""
    if column.kind == "text":
        kind = "word" if length <= _WORD else "text" if length <= _SENTENCE else "text sentence"
    if column.name == "verdict":
        kind = f"{kind} {tone_of(str(value or ''))}".strip()
    cells = row.cells_by_column.get(column.name, ())
    text, name = shown["value"], own[0].named(value)
    title, interval = text if name != text else "", small.get("interval", "")
    return CellView(breakable(name), title, small.get("sd"), interval, kind, cells)


def breakable(text: str) -> str:
    """Text of a cell; a longer one may break after a slash, as in names of methods."""
    text = one_line(text)
    if len(text) <= _WORD:
        return text
    return Markup("/<wbr>").join(re.split(r"(?<=\w)/(?=\w)", text))


def stretches(cells: Iterable[CellKey], numbers: Mapping[CellKey, int]) -> list[list[int]]:
    """Numbers of cells, neighbours drawn together: first and last."""
    found: list[list[int]] = []
    for number in sorted({numbers[cell] for cell in cells}):
        if found and found[-1][1] == number - 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return found


def is_wide(figure: FigureBlock) -> bool:
    """Whether a narrow page scrolls it. Raises ValueError as :func:`inlined_svg` does."""
    return not figure.narrow and _width(figure, figure.svg) > _WIDE


def _width(figure: FigureBlock, svg: str) -> float:
    """Of the drawing, pt. Raises ValueError where there is no SVG with a ``viewBox``."""
    size = re.search(r'<svg\b[^>]*viewBox="\s*\S+\s+\S+\s+([\d.]+)', svg)
    if not size:
        raise ValueError(f"figure {figure.id}: its svg holds no <svg> element with a viewBox")
    return float(size[1])


def inlined_svg(figure: FigureBlock, narrow: bool = False) -> Markup:
    """A figure's SVG for use inside HTML: named for who cannot see it, its ids its own.

    Prologue and metadata go, and ids get the figure's id before them where they have not, since
    those of several SVGs would meet in one page. ``narrow``: the one drawn for a narrow page. It
    is shown up to half as large again as on paper; a wide one never so small that it cannot be
    read. Raises ValueError where there is no SVG with a ``viewBox``.
    """
    svg = figure.narrow if narrow else figure.svg
    width, root = _width(figure, svg), re.search(r"<svg\b([^>]*)>", svg)
    assert root is not None
    attributes = re.sub(r'\s(role|aria-label|width|height|style)="[^"]*"', "", root[1])
    body = re.sub(r"<metadata>.*?</metadata>\s*", "", svg[root.end() :], flags=re.S)
    fresh = rf'(\sid="|href="#|url\(#)(?!{re.escape(figure.id)}-)'
    body = re.sub(fresh, rf"\g<1>{figure.id}--", body)
    scrolled = width > _WIDE and not figure.narrow
    least = f"; min-width: {_READABLE * width:.0f}px" if scrolled else ""
    return Markup(
        f'<svg{attributes} role="img" aria-label="{escape(one_line(figure.alt))}" '
        f'style="max-width: {_MAGNIFIED * width:.0f}pt{least}">{body.strip()}'
    )


def script_data(data: str) -> Markup:
    """JSON within a script element, which only "<" could end."""
    return Markup(data.replace("<", "\\u003c"))
