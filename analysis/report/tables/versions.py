"""Two results folders: what differs between them, and their cells side by side."""

from __future__ import annotations

import math
from functools import partial

from analysis.comparisons.versions import SPENT, VersionComparison, VersionRow
from analysis.report.document import Column, DataTable, Row, Value
from analysis.report.tables.common import finite, table, with_interval
from analysis.statistics.equivalence import MARGIN
from analysis.statistics.estimates import FEWEST

_number = partial(Column, kind="number", rests_on=("runs",))


def differing_table(found: VersionComparison) -> DataTable | None:
    """What was asked for, and where it was run, as far as it differs."""
    return table(
        "what-differs",
        "What was asked for and where it was run, where the two differ.",
        (Column("what", "what"), Column("a", "A"), Column("b", "B")),
        [
            Row(row.what, (row.what, row.first or None, row.second or None))
            for row in found.differing
        ],
    )


def versions_table(found: VersionComparison) -> DataTable | None:
    """The cells of both folders, in the order of A's plan."""
    return table(
        "cells",
        "Runs of A and B, cell by cell.",
        (
            Column("task", "task"),
            Column("method", "method"),
            _number("mean_a", "A: mean", unit="ticks", digits=1),
            _number("solved_a", "runs"),
            _number("mean_b", "B: mean", unit="ticks", digits=1),
            _number("solved_b", "runs"),
            _number("identical", "identical runs"),
            _number("shared", "of shared seeds"),
            _number("difference", "B − A", unit="ticks", digits=1, leading=True),
            Column("paired", "paired"),
            _number("p_adjusted", "adjusted p", kind="p", digits=4),
            Column("verdict", "verdict", leading=True),
            *(_number(name, header, unit="×") for name, header in SPENT.items()),
            Column("remarks", "remarks"),
        ),
        [Row(f"{row.task} {row.label}", _values(row)) for row in found.rows],
        (
            "B − A: difference of mean rewards (more is better) with its BCa interval, paired by "
            f"seed where at least {FEWEST} seeds are shared, of independent runs otherwise. p: "
            "two-sided bootstrap test, Holm over the cells tested here; a cell is identical where "
            "all its runs are, and is not tested then. Verdict: by the studentised bootstrap "
            f"interval beside ±{100 * MARGIN:.0f} % of A's mean (docs/statistics.md), by the BCa "
            "interval where so many runs are equal that the former has no end; a difference can "
            "be real (small p) and within the margin.",
            "×: B's median over A's. Times compare code only where processor and load were the "
            "same.",
            "Cells with a run that has no solution are not compared: a mean of the others would "
            "flatter whichever side failed on the harder runs.",
            "Identical runs have the same status, the same solution to the last joint and tick, "
            "and the same reward in every trial. Both folders were checked against their records, "
            "whose solutions were executed again; `coartic reproduce RUN_ID` performs a whole run "
            "again.",
        ),
    )


def _values(row: VersionRow) -> tuple[Value, ...]:
    return (
        row.task,
        row.label,
        finite(row.mean_a),
        row.solved_a,
        finite(row.mean_b),
        row.solved_b,
        row.identical,
        row.shared,
        with_interval(row.difference, row.low, row.high),
        None if row.paired is None else "yes" if row.paired else "no",
        finite(row.p_adjusted),
        row.verdict,
        *(_ratio(*row.spent(name)) for name in SPENT),
        row.remarks or None,
    )


def _ratio(a: float, b: float) -> float | None:
    """B over A; infinite where A spent nothing, None where neither did."""
    if math.isnan(a) or math.isnan(b) or a == b == 0:
        return None
    return b / a if a else math.inf
