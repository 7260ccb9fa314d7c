"""A document as Markdown (GitHub's), its figures as links to files beside it."""

from __future__ import annotations

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
from analysis.table import Table


def markdown(document: Document) -> str:
    """The document; figures are ``figures/ID.svg``, run ids in ``tables/runs.csv``."""
    pieces = [f"# {markdown_text(document.title)}"]
    if document.lead:
        pieces.append(spans(document.lead))
    for section in document.sections:
        pieces += _section(section, 2)
    return "\n\n".join(pieces) + "\n"


def _section(section: Section, level: int) -> list[str]:
    pieces = [f"{'#' * min(level, 6)} {markdown_text(section.title)}"]
    for block in section.blocks:
        pieces += _block(block)
    for below in section.sections:
        pieces += _section(below, level + 1)
    return pieces


def _block(block: Block) -> list[str]:
    match block:
        case Prose():
            return [spans(text) for text in block.paragraphs]
        case Bullets():
            return ["\n".join(f"- {spans(item)}" for item in block.items)]
        case DataTable():
            return _table(block)
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


def _table(table: DataTable) -> list[str]:
    shown = parts(table)
    lines = Table(
        table.caption,
        tuple(part.header for part in shown),
        tuple(tuple(part.text(row.values[part.index]) for part in shown) for row in table.rows),
    ).to_markdown()
    head, _, rest = lines.split("\n", 2) if table.rows else (*lines.split("\n"), "")
    rule = "| " + " | ".join("---" if p.column.kind == "text" else "---:" for p in shown) + " |"
    body = "\n".join([head, rule, *([rest] if rest else [])])
    source = f"[tables/{table.id}.csv](tables/{table.id}.csv)"
    return [spans(table.caption), body, *map(spans, table.notes), f"Data: {source}."]
