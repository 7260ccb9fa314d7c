"""A document as Markdown (GitHub's), its figures as links to files beside it."""

from __future__ import annotations

import re

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
from analysis.report.text import inline, parts
from analysis.table import Table


def markdown(document: Document) -> str:
    """The document; figures are ``figures/ID.svg``, run ids in ``tables/runs.csv``."""
    pieces = [f"# {_plain(document.title)}"]
    if document.lead:
        pieces.append(_spans(document.lead))
    for section in document.sections:
        pieces += _section(section, 2)
    return "\n\n".join(pieces) + "\n"


def _section(section: Section, level: int) -> list[str]:
    pieces = [f"{'#' * min(level, 6)} {_plain(section.title)}"]
    for block in section.blocks:
        pieces += _block(block)
    for below in section.sections:
        pieces += _section(below, level + 1)
    return pieces


def _block(block: Block) -> list[str]:
    match block:
        case Prose():
            return [_spans(text) for text in block.paragraphs]
        case Bullets():
            return ["\n".join(f"- {_spans(item)}" for item in block.items)]
        case DataTable():
            return _table(block)
        case FigureBlock():
            return [
                f"![{_plain(block.alt)}](figures/{block.id}.svg)",
                f"**{_plain(block.title)}.** {_spans(block.caption)}",
            ]
        case PlayerBlock():
            return [
                f"**{_plain(block.title)}** (played in [report.html](report.html#{block.id})). "
                f"{_spans(block.caption)}"
            ]


def _spans(text: str) -> str:
    marks = {"emphasis": "*{}*", "code": "`{}`"}
    return "".join(
        f"[{_plain(span.text)}]({span.address})"
        if span.style == "link" and not span.address.startswith("#")  # it has no such places
        else marks[span.style].format(span.text if span.style == "code" else _plain(span.text))
        if span.style in marks
        else _plain(span.text)
        for span in inline(text)
    )


def _plain(text: str) -> str:
    """Text that Markdown leaves as it is."""
    escaped = re.sub(r"([\\*`\[\]<>])", r"\\\1", text)
    # Within a word an underscore is no mark; at its ends it is.
    return re.sub(r"(?<!\w)_|_(?!\w)", r"\\_", escaped)


def _table(table: DataTable) -> list[str]:
    shown = parts(table)
    lines = Table(
        table.caption,
        tuple(_plain(part.header) for part in shown),
        tuple(
            tuple(_plain(part.text(row.values[part.index])) for part in shown)
            for row in table.rows
        ),
    ).to_markdown()
    head, _, rest = lines.split("\n", 2) if table.rows else (*lines.split("\n"), "")
    rule = "| " + " | ".join("---" if p.column.kind == "text" else "---:" for p in shown) + " |"
    body = "\n".join([head, rule, *([rest] if rest else [])])
    source = f"[tables/{table.id}.csv](tables/{table.id}.csv)"
    return [_spans(table.caption), body, *map(_spans, table.notes), f"Data: {source}."]
