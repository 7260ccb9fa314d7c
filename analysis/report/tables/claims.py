"""The register of claims in short."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from analysis.claims.register import FITTED, RULES
from analysis.report.document import Column, DataTable, Row
from analysis.report.tables.common import finite, table

if TYPE_CHECKING:
    from analysis.study import Study


def claims_table(study: Study) -> DataTable | None:
    """Every claim with its verdict, p-values and place; rows lead to the claims' sections."""
    by_run = {str(run): key for key, cell in study.cells.items() for run in cell.runs.run_id}
    rows = [
        Row(
            entry.claim.id,
            (
                entry.claim.id,
                entry.claim.statement,
                entry.marked,
                finite(entry.adjusted_p),
                finite(entry.adjusted_contrary_p),
                ", ".join(filter(None, (entry.claim.place, entry.claim.figure))) or None,
            ),
            tuple(dict.fromkeys(by_run[run] for run in entry.run_ids)),
            link=f"#claim-{entry.claim.id}",
        )
        for entry in study.judged
    ]
    tested = sum(not math.isnan(entry.p) for entry in study.judged)
    contraries = sum(not math.isnan(entry.contrary_p) for entry in study.judged)
    family = "all claims that could be tested, over which Holm adjusts"
    adjusted = partial(Column, rests_on=("runs",), family=family)
    return table(
        "claims",
        "What the paper says of its model, and what it does not compare.",
        (
            Column("claim", "claim"),
            Column("statement", "statement", rests_on=("text",), printed=False),
            adjusted("verdict", "verdict"),
            adjusted("adjusted_p", "adjusted p", "p", digits=4),
            adjusted("adjusted_contrary_p", "of the contrary", "p", digits=4),
            Column("place", "place in the paper", rests_on=("paper",), printed=False),
        ),
        rows,
        (
            RULES,
            f"Adjusted by Holm over the {tested} claims that could be tested here, for the "
            f"contrary over {contraries}.",
            FITTED,
        ),
    )
