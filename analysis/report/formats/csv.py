"""A document's tables as CSV: raw values, and what they were computed from."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from analysis.report.document import CellKey, DataTable, Document, Estimate, Value, missing
from analysis.report.text import parts


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
    head = ["key"]
    for part in shown:
        name = part.column.name
        head += {
            "value": [name],
            "sd": [f"{name}_sd"],
            "interval": [f"{name}_low", f"{name}_high"],
        }[part.kind]
    lines: list[list[str]] = [[*head, "cells", *(f"{name}_cells" for name in traced)]]
    for row in table.rows:
        line = [row.key]
        for part in shown:
            line += _raw(row.values[part.index], part.kind)
        line.append(_cells(row.cells))
        line += [_cells(row.cells_by_column.get(name, ())) for name in traced]
        lines.append(line)
    return _csv(lines)


def runs_csv(document: Document) -> str:
    """``task``, ``label`` and ``run_id`` of every run behind the tables."""
    return _csv(
        [
            ["task", "label", "run_id"],
            *([*cell, run] for cell, runs in document.runs.items() for run in runs),
        ]
    )


def _raw(value: Value, kind: str) -> list[str]:
    estimate = value if isinstance(value, Estimate) else None
    if kind == "sd":
        return [_text(estimate.sd if estimate else None)]
    if kind == "interval":
        return [_text(estimate.low), _text(estimate.high)] if estimate else ["", ""]
    return [_text(estimate.value if estimate else value)]


def _text(value: Value) -> str:
    # repr of a float (of NumPy's, too) that reads back as the same number.
    if missing(value):
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def _cells(cells: Iterable[CellKey]) -> str:
    return " | ".join(" ".join(cell) for cell in cells)


def _csv(lines: Iterable[list[str]]) -> str:
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerows(lines)
    return file.getvalue()
