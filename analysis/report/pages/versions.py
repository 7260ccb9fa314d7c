"""The page that ``coartic compare`` writes: two results folders."""

from __future__ import annotations

import math
from collections.abc import Iterator

from coartic.analysis.comparisons.versions import SPENT, VersionComparison, VersionRow
from coartic.analysis.markup import code, escaped
from coartic.analysis.report.document import (
    Block,
    Bullets,
    DataTable,
    Document,
    Prose,
    Row,
    Section,
)
from coartic.analysis.report.tables.layout import LAYOUTS, finite
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.statistics.estimates import FEWEST

_CELLS = LAYOUTS["cells"]


def versions_document(found: VersionComparison) -> Document:
    """What differs between the folders, the cells of both, and those of one alone."""
    first, second = found.folders
    differing, cells = differing_table(found), versions_table(found)
    same = Prose((f"The same: {escaped(', '.join(found.same)) or 'nothing'}.",))
    return Document(
        "Two sets of results",
        (
            Section("outcome", "Outcome", (Bullets(tuple(found.summary)),)),
            Section("differing", "What differs", (differing or Prose(("Nothing.",)), same)),
            Section("in-both", "Cells of both folders", tuple(_cells(cells, found))),
            *_only(found),
        ),
        f"A: {code(str(first))}. B: {code(str(second))}.",
    )


def _cells(cells: Block | None, found: VersionComparison) -> Iterator[Block]:
    yield cells or Prose(("None.",))
    stale = [
        f"{side}: {count} records were made by other code and have no part here."
        for side, count in zip("AB", found.stale, strict=True)
        if count
    ]
    if stale:
        yield Bullets(tuple(stale))


def _only(found: VersionComparison) -> Iterator[Section]:
    for side, tasks in zip("AB", found.only, strict=True):
        if tasks:
            items = tuple(escaped(f"{name}: {', '.join(on)}") for name, on in tasks.items())
            yield Section(f"only-{side.lower()}", f"Cells only in {side}", (Bullets(items),))


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
    return _CELLS.row(
        f"{row.a.task} {row.a.label}",
        row,
        (),
        task=row.a.task,
        method=row.a.label,
        mean_a=finite(mean_a),
        mean_b=finite(mean_b),
        solved_a=solved_a,
        solved_b=solved_b,
        paired=None if row.paired is None else "yes" if row.paired else "no",
        **{name: _ratio(*row.both(name)) for name in SPENT},
    )


def _ratio(a: float, b: float) -> float | None:
    """B over A; infinite where A spent nothing, None where neither did."""
    if math.isnan(a) or math.isnan(b) or a == b == 0:
        return None
    return b / a if a else math.inf
