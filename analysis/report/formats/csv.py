"""A document's tables as CSV: raw values, and what they were computed from."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable

from coartic.analysis.report.document import CellKey, DataTable, Document, Value
from coartic.analysis.report.text import parts

_ENDINGS = {"value": ("",), "sd": ("_sd",), "interval": ("_low", "_high")}


def table_csv(table: DataTable) -> str:
    """Raw values, one row a row.

    Columns: ``key``, the table's own with ``_sd``, ``_low`` and ``_high`` after those that
    have them, ``cells`` (task and label, the cells apart by `` | ``) and, by column,
    ``NAME_cells`` where it differs. Empty: there is none. Shares are fractions.
    """
    columns = raw_columns(table)
    texts = ([_text(value) for value in column] for column in columns.values())
    return _csv([[*columns], *map(list, zip(*texts, strict=True))])


def raw_columns(table: DataTable) -> dict[str, list[Value]]:
    """The same by column, not yet text; where there is none, NaN of numbers and None of text."""
    found: dict[str, list[Value]] = {"key": [row.key for row in table.rows]}
    for part in parts(table):
        missing = None if part.column.kind == "text" else math.nan
        of_rows = [row.values[part.index] for row in table.rows]
        for place, ending in enumerate(_ENDINGS[part.kind]):
            raw = (part.raw(value)[place] for value in of_rows)
            found[f"{part.column.name}{ending}"] = [missing if x is None else x for x in raw]
    found["cells"] = [_cells(row.cells) or None for row in table.rows]
    for column in table.columns:
        if any(column.name in row.cells_by_column for row in table.rows):
            own = (row.cells_by_column.get(column.name, ()) for row in table.rows)
            found[f"{column.name}_cells"] = [_cells(cells) or None for cells in own]
    return found


def runs_csv(document: Document) -> str:
    """``task``, ``label`` and ``run_id`` of every run behind the tables."""
    lines = ([*cell, run] for cell, runs in document.runs.items() for run in runs)
    return _csv([["task", "label", "run_id"], *lines])


def _text(value: Value) -> str:
    if isinstance(value, float):  # by the text that reads back as the same number
        return "" if math.isnan(value) else repr(float(value))
    return "" if value is None else str(value)


def _cells(cells: Iterable[CellKey]) -> str:
    return " | ".join(" ".join(cell) for cell in cells)


def _csv(lines: Iterable[list[str]]) -> str:
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerows(lines)
    return file.getvalue()
