"""Two results folders: what differs between them, and their cells side by side."""

from __future__ import annotations

import math
from typing import Any

from analysis.comparisons.versions import SPENT, VersionComparison, VersionRow
from analysis.report.document import DataTable, Row
from analysis.report.tables.layout import LAYOUTS, finite
from analysis.statistics.equivalence import MARGIN
from analysis.statistics.estimates import FEWEST

_CELLS = LAYOUTS["cells"]


def differing_table(found: VersionComparison) -> DataTable | None:
    """What was asked for, and where it was run, as far as it differs."""
    layout = LAYOUTS["what-differs"]
    return layout.table(
        layout.row(row.what, row, a=row.first or None, b=row.second or None)
        for row in found.differing
    )


def versions_table(found: VersionComparison) -> DataTable | None:
    """The cells of both folders, in the order of A's plan."""
    return _CELLS.table(map(_row, found.rows), fewest=FEWEST, margin=100 * MARGIN)


def _row(row: VersionRow) -> Row:
    (mean_a, mean_b), (solved_a, solved_b) = row.both("reward"), row.both("solved")
    own: dict[str, Any] = {name: _ratio(*row.both(name)) for name in SPENT} | {
        "mean_a": finite(mean_a),
        "mean_b": finite(mean_b),
        "solved_a": solved_a,
        "solved_b": solved_b,
    }
    return _CELLS.row(
        f"{row.a.task} {row.a.label}",
        row,
        task=row.a.task,
        method=row.a.label,
        paired=None if row.paired is None else "yes" if row.paired else "no",
        **own,
    )


def _ratio(a: float, b: float) -> float | None:
    """B over A; infinite where A spent nothing, None where neither did."""
    if math.isnan(a) or math.isnan(b) or a == b == 0:
        return None
    return b / a if a else math.inf
