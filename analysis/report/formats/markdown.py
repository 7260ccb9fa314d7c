"""A document as Markdown (GitHub's), its figures as links to files beside it."""

from __future__ import annotations

from collections.abc import Iterable

from analysis.markup import markdown as spans
from analysis.markup import markdown_text
from analysis.report.document import (
    Block,
    Bullets,
    DataTable,
    Document,
    FigureBlock,
    PlayerBlock,
    Prose,
    Section,
)
from analysis.report.text import parts
from coartic.text import one_line


def markdown(document: Document, tables: str = "tables") -> str:
    """The document; figures are ``figures/ID.svg``.

    ``tables``: folder beside it with each table as CSV, which the tables name; empty where
    there is none.
    """
    pieces = [f"# {markdown_text(document.title)}"]
    if document.lead:
        pieces.append(spans(document.lead.strip()))
    for section in document.sections:
        pieces += _section(section, 2, tables)
    return "\n\n".join(pieces) + "\n"


def _section(section: Section, level: int, tables: str) -> list[str]:
    pieces = [f"{'#' * min(level, 6)} {markdown_text(section.title)}"]
    for block in section.blocks:
        pieces += _block(block, tables)
    for below in section.sections:
        pieces += _section(below, level + 1, tables)
    return pieces


def _block(block: Block, tables: str) -> list[str]:
    match block:
        case Prose():
            return [spans(text.strip()) for text in block.paragraphs]
        case Bullets():
            return ["\n".join(f"- {spans(item.strip())}" for item in block.items)]
        case DataTable():
            return _table(block, tables)
        case FigureBlock():
            return [
                f"![{markdown_text(block.alt)}](figures/{block.id}.svg)",
                f"**{markdown_text(block.title)}.** {spans(block.caption)}",
            ]
        case PlayerBlock():
            return [
                f"**{markdown_text(block.title)}** (played in "
                f"[report.html](report.html#{block.id})). {spans(block.caption)}"
            ]


def _table(table: DataTable, tables: str) -> list[str]:
    shown = parts(table)
    lines = [
        _line(part.header for part in shown),
        _line(("---" if part.column.kind == "text" else "---:" for part in shown), escape=False),
        *(_line(part.text(row.values[part.index]) for part in shown) for row in table.rows),
    ]
    data = [f"Data: [{tables}/{table.id}.csv]({tables}/{table.id}.csv)."] if tables else []
    return [spans(table.caption.strip()), "\n".join(lines), *map(spans, table.notes), *data]


def _line(cells: Iterable[str], escape: bool = True) -> str:
    texts = (markdown_text(f" {one_line(cell)} ") if escape else f" {cell} " for cell in cells)
    return f"|{'|'.join(texts)}|"
