"""The learner against the others, pair by pair: what is gained and what it costs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from analysis.comparisons.pairs import PairRow
from analysis.comparisons.targets import SHARES
from analysis.markup import escaped
from analysis.report.document import DataTable
from analysis.report.tables.common import table_ids
from analysis.report.tables.layout import LAYOUTS, Layout
from analysis.study import Study
from analysis.words import typographic

_KINDS = ("conditions", "method", "variant")


def pairwise_table(study: Study, task: str) -> DataTable | None:
    """The learner against the others on one task: differences, tests, effect sizes."""
    return _pairs(study, task, LAYOUTS["compared"])


def cost_table(study: Study, task: str) -> DataTable | None:
    """The same pairs: what the second spends and is told, and how many runs it would take."""
    best = study.optima.get((task, "free"))
    ticks = ", ".join(f"{abs(share * best.reward):.1f}" for share in SHARES) if best else ""
    return _pairs(study, task, LAYOUTS["costs"], ticks=f" ({ticks} ticks)" if ticks else "")


def reading_of_pairs(study: Study) -> tuple[str, ...]:
    """Who is compared with whom, and what the numbers of the tables do not say."""
    return LAYOUTS["compared"].read(pairing=_pairing(study))


def _pairing(study: Study) -> str:
    """What sharing seeds does to these runs."""
    known = [row for row in study.pair_rows if row.pairs and not np.isnan(row.correlation)]
    parts = []
    for of_variants, text in ((True, "variants of one condition"), (False, "other pairs")):
        rows = [row for row in known if (row.kind == "variant") == of_variants]
        if rows:
            paired, alone = (
                np.array([getattr(row, f"{of}high") - getattr(row, f"{of}low") for row in rows])
                for of in ("", "independent_")
            )
            median = np.median([row.correlation for row in rows])
            correlation = typographic(f"{median:.2f}")
            parts.append(
                f"{text} correlate by {correlation} (median of {len(rows)}), their "
                f"intervals are {np.nanmedian(paired / alone):.2f} times as wide as unpaired ones"
            )
    if not parts:
        return ""
    return (
        " A shared seed gives the same random numbers, which methods that draw them differently "
        "put to different use, so that it pairs little but variants of the learner: here "
        f"{', '.join(parts)}. The paper's design is unpaired, and so are the tests."
    )


def _pairs(study: Study, task: str, layout: Layout, **facts: str) -> DataTable | None:
    """Conditions, methods, variants; of each the best second first."""
    pairs = sorted(
        (row for row in study.pair_rows if row.task == task),
        key=lambda row: (
            _KINDS.index(row.kind),
            row.first,
            -np.nan_to_num(row.mean_second, nan=-np.inf),
        ),
    )
    rows = [
        layout.row(
            f"{pair.first} - {pair.second}", pair, ((task, pair.first), (task, pair.second))
        )
        for pair in pairs
    ]
    failed = escaped(", ".join(_failed(pairs)))
    notes = (f"Runs without a solution are left out: {failed}.",) if failed else ()
    return layout.table(rows, table_ids(study)[task], notes=notes, task=escaped(task), **facts)


def _failed(pairs: list[PairRow]) -> Iterator[str]:
    """Methods with runs that have no solution, each once."""
    found = {pair.first: (pair.n_first, pair.runs_first) for pair in pairs}
    found |= {pair.second: (pair.n_second, pair.runs_second) for pair in pairs}
    return (f"{name} solved {n} of {runs}" for name, (n, runs) in found.items() if n < runs)
