"""A document as Markdown (GitHub's), its figures as links to files beside it."""

from __future__ import annotations

from collections.abc import Iterable

from coartic.analysis.markup import markdown as inline_markdown
from coartic.analysis.markup import markdown_text
from coartic.analysis.report.document import Document, Row, Strip
from coartic.analysis.report.formats.templates import template
from coartic.analysis.report.text import Part, parts, tallied
from coartic.text import one_line


def markdown(document: Document, tables: str = "tables") -> str:
    """The document; figures are ``figures/ID.svg``.

    ``tables``: folder beside it with each table as CSV, which the tables name; empty where
    there is none.
    """
    page = template(
        "page.md.jinja", markdown_text, spans, parts, shown_texts, table_line, told_verdicts
    )
    return page.render(document=document, tables=tables).rstrip("\n") + "\n"


def spans(text: str) -> str:
    """Inline markup as Markdown."""
    return inline_markdown(text.strip())


def shown_texts(row: Row, shown: Iterable[Part]) -> list[str]:
    """What a row shows in each of these parts of columns."""
    return [part.text(row.values[part.index]) for part in shown]


def told_verdicts(strip: Strip) -> str:
    """Each verdict in words, or how often each was given where they are counted."""
    if strip.counted:
        return ", ".join(f"{count} {words}" for words, count in tallied(strip).items())
    return "; ".join(f"{verdict.name}: {verdict.verdict}" for verdict in strip.verdicts)


def table_line(cells: Iterable[str]) -> str:
    """A line of a table."""
    return f"|{'|'.join(markdown_text(f' {one_line(cell)} ') for cell in cells)}|"
