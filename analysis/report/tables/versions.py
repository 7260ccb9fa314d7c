"""Two results folders: what differs between them, and their cells side by side."""

from __future__ import annotations

import math
from typing import Any

from analysis.comparisons.versions import SPENT, VersionComparison, VersionRow
from analysis.report.document import DataTable, Row
from analysis.report.tables.layout import LAYOUTS
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
    ratios: dict[str, Any] = {name: _ratio(*row.spent(name)) for name in SPENT}
    return _CELLS.row(
        f"{row.task} {row.label}",
        row,
        method=row.label,
        paired=None if row.paired is None else "yes" if row.paired else "no",
        **ratios,
    )


def _ratio(a: float, b: float) -> float | None:
    """B over A; infinite where A spent nothing, None where neither did."""
    if math.isnan(a) or math.isnan(b) or a == b == 0:
        return None
    return b / a if a else math.inf
