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
    shown = parts(table)
    traced = [
        column.name
        for column in table.columns
        if any(column.name in row.cells_by_column for row in table.rows)
    ]
    names = [f"{part.column.name}{end}" for part in shown for end in _ENDINGS[part.kind]]
    lines = [["key", *names, "cells", *(f"{name}_cells" for name in traced)]]
    for row in table.rows:
        values = (raw for part in shown for raw in part.raw(row.values[part.index]))
        cells = (row.cells, *(row.cells_by_column.get(name, ()) for name in traced))
        lines.append([row.key, *map(_text, values), *map(_cells, cells)])
    return _csv(lines)


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
