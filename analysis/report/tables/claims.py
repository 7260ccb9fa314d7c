"""The register of claims in short."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from analysis.claims.register import Judged
from analysis.report.document import Column, DataTable, Row
from analysis.report.tables.common import finite, table

if TYPE_CHECKING:
    from analysis.study import Study


def claims_table(study: Study, judged: Sequence[Judged]) -> DataTable | None:
    """The register in short."""
    by_run = {str(run): key for key, cell in study.cells.items() for run in cell.runs.run_id}
    rows = [
        Row(
            entry.claim.id,
            (
                entry.claim.id,
                entry.claim.statement,
                entry.verdict + (" †" if entry.claim.fitted else ""),
                finite(entry.adjusted_p),
                finite(entry.adjusted_contrary_p),
                ", ".join(filter(None, (entry.claim.place, entry.claim.figure))) or None,
            ),
            tuple(dict.fromkeys(by_run[run] for run in entry.run_ids)),
        )
        for entry in judged
    ]
    return table(
        "claims",
        "What the paper says of its model, and what it does not compare.",
        (
            Column("claim", "claim"),
            Column("statement", "statement", printed=False),
            Column("verdict", "verdict"),
            Column("adjusted_p", "adjusted p", "p", digits=4),
            Column("adjusted_contrary_p", "of the contrary", "p", digits=4),
            Column("place", "place in the paper", printed=False),
        ),
        rows,
        (
            "Supported: what the claim says is seen, and its p (the largest of its tests) is "
            "below 5 % after Holm's correction over the claims; not supported: the contrary's is, "
            "or what can be counted is not there. No p: counted, or nothing to test.",
        ),
    )
