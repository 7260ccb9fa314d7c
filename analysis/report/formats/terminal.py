"""A table for a terminal: as many of its columns as fit."""

from __future__ import annotations

from rich import box
from rich.table import Table
from rich.text import Text

from coartic.analysis.markup import words
from coartic.analysis.report.document import DataTable
from coartic.analysis.report.text import by_column, texts
from coartic.text import one_line

_PADDING = 4  # characters about a column
_SENTENCE = 30  # of a column of text, beyond which it may be broken into lines


def terminal_table(table: DataTable, width: int, where: str = "") -> Table:
    """The table in at most ``width`` characters, below its caption; its notes are left out.

    Names of rows and numbers are never broken. Columns for which there is no room are left out
    from the right, those first that paper has no room for either, leading ones last; the first
    two stay. What is left out is named below, with ``where`` it is. Brackets are text.
    """
    heads = [[one_line(part.header) for part in own] for own in by_column(table)]
    rows = [list(map(one_line, texts(table, row))) for row in table.rows]
    columns = [[row[place] for row in rows] for place in range(len(heads))]
    longest = [max(map(len, head + own)) for head, own in zip(heads, columns, strict=True)]
    least = [
        min(longest[place], _SENTENCE) if column.kind == "text" and place else longest[place]
        for place, column in enumerate(table.columns)
    ]
    shown = list(range(len(columns)))

    def importance(place: int) -> tuple[bool, bool, int]:
        return table.columns[place].leading, table.columns[place].printed, -place

    for place in sorted(shown[2:], key=importance):
        if sum(least[place] + _PADDING for place in shown) <= width:
            break
        shown.remove(place)
    hidden = [column.header for place, column in enumerate(table.columns) if place not in shown]
    more = f"No room here for {one_line('; '.join(hidden))}{where and f' ({where})'}."
    found = Table(
        title=Text(one_line(words(table.caption))),
        title_justify="left",
        caption=Text(more) if hidden else None,
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        highlight=False,
    )
    for place in shown:
        column = table.columns[place]
        whole = place == 0 or column.kind != "text"
        found.add_column(
            Text("\n".join(heads[place])),
            justify="left" if column.kind == "text" else "right",
            overflow="fold",
            no_wrap=whole,
            min_width=least[place],
        )
    for row in rows:
        found.add_row(*(Text(row[place]) for place in shown))
    return found
