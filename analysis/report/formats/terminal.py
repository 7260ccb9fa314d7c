"""A table for a terminal: as many of its columns as fit."""

from __future__ import annotations

from rich import box
from rich.table import Table
from rich.text import Text

from analysis.markup import words
from analysis.report.document import DataTable
from analysis.report.text import heads, texts
from coartic.text import counted, one_line

_PADDING = 4  # characters about a column
_SENTENCE = 30  # of a column of text, beyond which it may be broken into lines


def terminal_table(table: DataTable, width: int) -> Table:
    """The table in at most ``width`` characters, below its caption; its notes are left out.

    Names of rows and numbers are never broken. Columns for which there is no room are left out
    from the right, those first that paper has no room for either, and their number is said
    below; the first two stay. Brackets are text.
    """
    columns = [
        list(map(one_line, column))
        for column in zip(heads(table), *(texts(table, row) for row in table.rows), strict=True)
    ]
    least = [
        min(longest, _SENTENCE) if column.kind == "text" and place else longest
        for place, (column, longest) in enumerate(
            zip(table.columns, (max(map(len, column)) for column in columns), strict=True)
        )
    ]
    shown = list(range(len(columns)))
    for place in sorted(shown[2:], key=lambda place: (table.columns[place].printed, -place)):
        if sum(least[place] + _PADDING for place in shown) <= width:
            break
        shown.remove(place)
    hidden = len(columns) - len(shown)
    more = f"({counted(hidden, 'more column')}, for which there is no room here)"
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
            Text(columns[place][0]),
            justify="left" if column.kind == "text" else "right",
            overflow="fold",
            no_wrap=whole,
            min_width=least[place],
        )
    for row in zip(*(columns[place][1:] for place in shown), strict=True):
        found.add_row(*map(Text, row))
    return found
