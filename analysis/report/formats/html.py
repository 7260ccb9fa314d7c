"""A document as one HTML file that needs nothing else: no network, no other files."""

from __future__ import annotations

import html as entities
import re
from collections.abc import Mapping
from importlib.resources import files

from analysis.markup import inline
from analysis.report.document import (
    Block,
    Bullets,
    CellKey,
    DataTable,
    Document,
    FigureBlock,
    PlayerBlock,
    Prose,
    Row,
    Section,
)
from analysis.report.text import Part, parts
from analysis.words import NONE, true_minus
from coartic.text import one_line

_MAGNIFIED = 1.5
_WIDE, _READABLE = 320.0, 1.4  # pt; CSS pixels per pt that text of 7 pt needs
_WORD, _SENTENCE = 18, 60  # characters: up to one stays on a line, beyond the other has room
_MOST_LINKS = 4  # stretches of run lists linked from one row

MOST_ROWS = 15
"""Rows of a table that are shown at once; the rest is scrolled to, or asked for."""

MOST_LISTED = 12
"""Subsections of one section that the contents show."""
_READING = (
    "Small print below a number is its interval. A table is sorted by a click on a column's "
    "header; its last column leads to the runs behind each row. What is folded (▸) is found by "
    "the browser's search as well, and printed."
)


def html(document: Document) -> str:
    """The document as a page, with its tables linked to the run ids behind them."""
    numbers = {cell: number for number, cell in enumerate(document.runs, 1)}
    body = "\n".join(_section(section, 2, numbers) for section in document.sections)
    players = any(isinstance(block, PlayerBlock) for block in document.blocks())
    styles = _resource("report.css") + (_resource("player.css") if players else "")
    script = _resource("report.js") + f"(() => {{\n{_resource('sort.js')}}})();\n"
    if players:
        script += f"(() => {{\n{_resource('player.js')}}})();\n"
    lead = f"<p>{_spans(document.lead)}</p>\n" if document.lead else ""
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="coartic">
<title>{escape(document.title)}</title>
<link rel="icon" href="data:,">
<style>
{styles}</style>
</head>
<body>
<a class="skip" href="#content">To the content</a>
<header>
<div>
<h1>{escape(document.title)}</h1>
{lead}<p class="reading">{_READING}</p>
</div>
<button type="button" id="theme" hidden>Dark colours</button>
</header>
<div class="columns">
<nav id="contents" aria-label="Contents">
<details open>
<summary>Contents</summary>
{_contents(document)}
</details>
</nav>
<main id="content" tabindex="-1">
{body}
{_runs(document, numbers)}</main>
</div>
<a class="up" href="#contents">Contents</a>
<script>
{script}</script>
</body>
</html>
"""


def escape(text: str) -> str:
    """Plain text as one line of HTML, in attributes as well."""
    return entities.escape(one_line(text))


def _resource(name: str) -> str:
    return (files("analysis.report") / name).read_text(encoding="utf-8")


def _contents(document: Document) -> str:
    def items(sections: tuple[Section, ...]) -> str:
        return "".join(
            f'<li><a href="#{section.id}">{escape(section.title)}</a>'
            + (f"<ol>{items(section.sections)}</ol>" if _listed(section) else "")
            + "</li>\n"
            for section in sections
        )

    runs = '<li><a href="#runs">Runs behind the tables</a></li>\n' if document.runs else ""
    return f"<ol>\n{items(document.sections)}{runs}</ol>"


def _listed(section: Section) -> bool:
    """Whether the contents show a section's subsections: not where they are very many."""
    return 0 < len(section.sections) <= MOST_LISTED


def _section(section: Section, level: int, numbers: Mapping[CellKey, int]) -> str:
    heading = min(level, 6)
    title = f'<h{heading} id="{section.id}">{escape(section.title)}</h{heading}>'
    content = "\n".join(
        [
            *(_block(block, numbers) for block in section.blocks),
            *(_section(below, level + 1, numbers) for below in section.sections),
        ]
    )
    if section.folded:
        return f"<details><summary>{title}</summary>\n{content}\n</details>"
    # Landmarks are for the main sections; more of them would guide nobody.
    label = f' aria-labelledby="{section.id}"' if level == 2 else ""
    return f"<section{label}>\n{title}\n{content}\n</section>"


def _block(block: Block, numbers: Mapping[CellKey, int]) -> str:
    match block:
        case Prose():
            return "\n".join(f"<p>{_spans(text)}</p>" for text in block.paragraphs)
        case Bullets():
            items = "\n".join(f"<li>{_spans(item)}</li>" for item in block.items)
            return f"<ul>\n{items}\n</ul>"
        case DataTable():
            return _table(block, numbers)
        case FigureBlock():
            return _figure(block)
        case PlayerBlock():
            return _player(block)


def _spans(text: str) -> str:
    def mark(style: str, words: str, address: str) -> str:
        if style == "link":
            return f'<a href="{escape(address)}">{escape(words)}</a>'
        tag = {"emphasis": "em", "strong": "strong", "code": "code"}.get(style)
        words = words if style == "code" else true_minus(words)
        return f"<{tag}>{escape(words)}</{tag}>" if tag else escape(words)

    return "".join(mark(span.style, span.text, span.address) for span in inline(text))


def _table(table: DataTable, numbers: Mapping[CellKey, int]) -> str:
    columns: dict[int, list[Part]] = {}
    for part in parts(table):
        columns.setdefault(part.index, []).append(part)
    shown = list(columns.values())
    sourced = any(row.cells for row in table.rows)
    heads = [f'<th scope="col"{_kind(own[0])}>{_header(own)}</th>' for own in shown]
    if sourced:
        heads.append('<th scope="col">Runs</th>')
    rows = "\n".join(_row(row, shown, sourced, numbers) for row in table.rows)
    notes = "".join(f'<p class="notes">{_spans(note)}</p>\n' for note in table.notes)
    caption = f'<span id="{table.id}-caption">{_spans(table.caption)}</span>'
    size = f"{len(table.rows)} row{'' if len(table.rows) == 1 else 's'}"
    # The summary of a folded table names it; once is enough.
    own = f"<caption>{caption}</caption>\n" if not table.folded else ""
    named = f' aria-labelledby="{table.id}-caption"'
    text = f"""<div class="scroll" role="region"{named} tabindex="0">
<table id="{table.id}"{named if table.folded else ""}>
{own}<thead><tr>{"".join(heads)}</tr></thead>
<tbody>
{rows}
</tbody>
</table>
</div>"""
    if len(table.rows) > MOST_ROWS:
        every = f'<label class="all"><input type="checkbox"> Show all {size} at once</label>'
        text = f'<div class="long">\n{text}\n{every}\n</div>'
    text = f"{text}\n{notes}"
    if not table.folded:
        return text
    summary = f"<summary>{caption} <small>{size}</small></summary>"
    return f"<details>{summary}\n{text}</details>"


def _header(own: list[Part]) -> str:
    """Of a column, with what its small print is."""
    kinds = {part.kind for part in own}
    small = (["± SD"] if "sd" in kinds else []) + (
        [f"[{own[0].column.interval}]"] if "interval" in kinds else []
    )
    below = f"<small>{escape(' '.join(small))}</small>" if small else ""
    return f"{escape(own[0].header)}{below}"


def _row(row: Row, shown: list[list[Part]], sourced: bool, numbers: Mapping[CellKey, int]) -> str:
    cells = []
    for place, parts_ in enumerate(shown):
        text = _cell(row, parts_, numbers)
        if place == 0:
            if row.link:
                text = f'<a href="{escape(row.link)}">{text}</a>'
            cells.append(f'<th scope="row">{text}</th>')
        else:
            kind = _kind(parts_[0])
            length = len(str(row.values[parts_[0].index] or ""))
            if kind and (length <= _WORD or length > _SENTENCE):
                kind = ' class="word"' if length <= _WORD else ' class="text sentence"'
            cells.append(f"<td{kind}>{text}</td>")
    if sourced:
        cells.append(f"<td>{_links(row.cells, numbers)}</td>")
    return f"<tr>{''.join(cells)}</tr>"


def _cell(row: Row, own: list[Part], numbers: Mapping[CellKey, int]) -> str:
    """A value, its SD beside it and its interval below."""
    text = ""
    for part in own:
        words = _words(part.text(row.values[part.index]))
        if part.kind == "sd":
            # Empty where there is none, so that the values stay below each other.
            text += f"<span>{f' ± {words}' if words != NONE else ''}</span>"
        elif part.kind == "interval":
            text += f"<small>{words}</small>" if words != NONE else ""
        else:
            text += words
            cells = row.cells_by_column.get(part.column.name)
            if cells:
                title = escape("; ".join(f"{task}, {label}" for task, label in cells))
                text = f'<a href="#runs-{numbers[cells[0]]}" title="Runs: {title}">{text}</a>'
    return text


def _words(text: str) -> str:
    """Text of a cell, which may break after a slash, as in names of methods."""
    text = escape(text)
    return text if len(text) <= _WORD else re.sub(r"(?<=\w)/(?=\w)", "/<wbr>", text)


def _kind(part: Part) -> str:
    return ' class="text"' if part.column.kind == "text" else ""


def _links(cells: tuple[CellKey, ...], numbers: Mapping[CellKey, int]) -> str:
    """Links to lists of runs; neighbouring lists are drawn together."""
    stretches: list[list[int]] = []
    for number in sorted({numbers[cell] for cell in cells}):
        if stretches and stretches[-1][1] == number - 1:
            stretches[-1][1] = number
        else:
            stretches.append([number, number])
    links = [
        f'<a href="#runs-{first}">{first}{f"–{last}" if last > first else ""}</a>'
        for first, last in stretches[:_MOST_LINKS]
    ]
    if len(stretches) > _MOST_LINKS:
        links.append("…")
    return ", ".join(links)


def _figure(figure: FigureBlock) -> str:
    # What is not drawn in the page's ink needs a white ground in the dark as well.
    kinds = [] if "currentColor" in figure.svg else ["paper"]
    hint, reach = "", ""
    if _width(figure) > _WIDE:
        kinds.append("wide")
        hint = '<span class="hint">Scroll the figure sideways. </span>'
        reach = f' role="group" aria-label="Figure: {escape(figure.title)}" tabindex="0"'
    ground = f' class="{" ".join(kinds)}"' if kinds else ""
    return f"""<figure id="{figure.id}">
<div{ground}{reach}>{inlined_svg(figure)}</div>
<figcaption>{hint}<strong>{escape(figure.title)}.</strong> {_spans(figure.caption)}</figcaption>
</figure>"""


def _width(figure: FigureBlock) -> float:
    """Of the drawing, pt. Raises ValueError where there is no SVG with a ``viewBox``."""
    size = re.search(r'<svg\b[^>]*viewBox="\s*\S+\s+\S+\s+([\d.]+)', figure.svg)
    if not size:
        raise ValueError(f"figure {figure.id}: its svg holds no <svg> element with a viewBox")
    return float(size[1])


def inlined_svg(figure: FigureBlock) -> str:
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
    return (
        f'<svg{attributes} role="img" aria-label="{escape(figure.alt)}" '
        f'style="max-width: {_MAGNIFIED * width:.0f}pt{least}">{body.strip()}'
    )


def _player(player: PlayerBlock) -> str:
    # Within a script element only "<" could end it.
    data = player.data.replace("<", "\\u003c")
    return f"""<figure class="plays">
<div class="player" id="{player.id}">
<p class="without">The movements are played by JavaScript, which is switched off here.</p>
</div>
<script type="application/json" id="{player.id}-data">{data}</script>
<figcaption><strong>{escape(player.title)}.</strong> {_spans(player.caption)}</figcaption>
</figure>"""


def _runs(document: Document, numbers: Mapping[CellKey, int]) -> str:
    if not document.runs:
        return ""
    lists = "\n".join(
        _run_list(number, cell, document.runs[cell]) for cell, number in numbers.items()
    )
    return f"""<section class="runs" aria-labelledby="runs">
<h2 id="runs">Runs behind the tables</h2>
<p>The tables' last columns name these lists. <code>coartic show RUN_ID</code> prints everything
about a run, <code>coartic reproduce RUN_ID</code> performs it again.</p>
{lists}
</section>
"""


def _run_list(number: int, cell: CellKey, runs: tuple[str, ...]) -> str:
    count = f"{len(runs)} run{'' if len(runs) == 1 else 's'}"
    return (
        f'<details id="runs-{number}"><summary>{number}. {escape(", ".join(cell))}: {count}'
        f"</summary><p><code>{escape(' '.join(runs))}</code></p></details>"
    )
