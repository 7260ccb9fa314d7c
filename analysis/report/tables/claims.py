"""The register of claims in short."""

from __future__ import annotations

import math
from dataclasses import replace

from analysis.claims.register import FITTED, RULES
from analysis.report.document import DataTable
from analysis.report.tables.layout import LAYOUTS
from analysis.study import Study


def claims_table(study: Study) -> DataTable | None:
    """Every claim with its verdict, p-values and place; rows lead to the claims' sections."""
    layout, rows = LAYOUTS["claims"], []
    by_run = {str(run): key for key, cell in study.cells.items() for run in cell.runs.run_id}
    for entry in study.judged:
        row = layout.row(
            entry.claim.id,
            entry,
            dict.fromkeys(by_run[run] for run in entry.run_ids),
            claim=entry.claim.id,
            statement=entry.claim.statement,
            verdict=entry.marked,
            place=", ".join(filter(None, (entry.claim.place, entry.claim.figure))) or None,
        )
        rows.append(replace(row, link=f"#claim-{entry.claim.id}"))
    return layout.table(
        rows,
        rules=RULES,
        tested=sum(not math.isnan(entry.p) for entry in study.judged),
        contraries=sum(not math.isnan(entry.contrary_p) for entry in study.judged),
        fitted=FITTED,
    )
