"""Signatures between tasks: a goal before different successors, or next to one that moves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from analysis.markup import escaped
from analysis.report.document import CellKey, Column, DataTable, Row, Value
from analysis.report.tables.common import table, table_ids
from analysis.report.tables.signatures import (
    estimate_of,
    holm_adjusted,
    identifier,
    labels_of,
    p_column,
    runs_column,
    spot_of,
    value_column,
)
from analysis.signatures.locus import families
from analysis.signatures.register import CONTEXTS, FAMILIES, REGISTER
from analysis.signatures.rows import Place, SignatureRow

if TYPE_CHECKING:
    from analysis.study import Study

MOST_CONTEXTS = 120
"""Rows of a table that a page shows at once."""
_NO_SLOPE = 1e-12


def contexts_table(study: Study) -> DataTable | None:
    """Postures at a shared goal before different successors; long ones are folded."""
    found: dict[tuple[str, str, str], list[SignatureRow]] = {}
    for row in study.signature_rows:
        if REGISTER[row.signature] in CONTEXTS and row.place.against and not math.isnan(row.value):
            at = str(replace(row.place, longest=None))
            found.setdefault((row.task, at, row.label), []).append(row)
    adjusted: dict[tuple[str, str, str, str], float] = {}
    for task, at in dict.fromkeys(key[:2] for key in found):
        own = [row for key, rows in found.items() if key[:2] == (task, at) for row in rows]
        for (label, spot), p in holm_adjusted(own).items():
            adjusted[task, at, label, spot.signature.name] = p
    tested = {name for *_, name in adjusted}
    rows = []
    for (task, at, label), group in found.items():
        own_rows = {row.signature: row for row in group}
        values: list[Value] = [label, f"{task}, {at}", max(row.n for row in group)]
        for signature in CONTEXTS:
            one = own_rows.get(signature.name)
            values.append(estimate_of(one) if one else None)
            if signature.name in tested:
                values.append(adjusted.get((task, at, label, signature.name)))
        values.append(max((row.place.longest or 0 for row in group), default=0) or None)
        cells = _cells_there(study, [(task, label), (group[0].place.against, label)])
        rows.append(Row(f"{task}, {at}, {label}", tuple(values), cells))
    made = table(
        "contexts",
        "The same goal before different successors.",
        _columns_of_contexts(tested),
        rows,
        (
            "Postures at the same goal before different successors. Runs are those of both tasks. "
            "The distance mixes length unit and rad; the parts are per root of their dimension. "
            "The lead is the time before the hit for which contexts differ, of the shorter "
            "movement's ticks.",
            "p is of the permutation test, adjusted by Holm's method over all tests of the same "
            f"goal, hand and tasks. {len(rows)} rows.",
        ),
    )
    return made and replace(made, folded=len(rows) > MOST_CONTEXTS)


def _columns_of_contexts(tested: set[str]) -> tuple[Column, ...]:
    columns = [Column("method", "method"), Column("where", "where", printed=False), runs_column()]
    for signature in CONTEXTS:
        name = identifier(signature.name)
        columns.append(value_column(signature, name, signature.heading, True))
        if signature.name in tested:
            printed = signature.name == "context dependence"
            columns.append(p_column(name, f"p of {signature.heading}", printed))
    longest = Column("lead_at_most", "at most", "number", "ticks", 0, rests_on=("runs",))
    return (*columns, replace(longest, printed=False))


def slopes_tables(study: Study) -> list[DataTable]:
    """How the posture at a goal follows a neighbouring goal, a table for each goal and hand."""
    found: dict[tuple[str, Place], list[SignatureRow]] = {}
    for row in study.signature_rows:
        if REGISTER[row.signature] in FAMILIES and not math.isnan(row.value):
            found.setdefault((row.task, replace(row.place, joint="")), []).append(row)
    made = [_slopes_at(study, task, place, rows) for (task, place), rows in found.items()]
    return [replace(table, folded=True) for table in made if table is not None]


def _slopes_at(
    study: Study, task: str, place: Place, rows: Sequence[SignatureRow]
) -> DataTable | None:
    """Norm and slopes of all methods; joints that nowhere follow are left out."""
    kept = {row.place.joint for row in rows if abs(row.value) > _NO_SLOPE}
    rows = [row for row in rows if row.place.joint in kept]
    own = {(row.label, spot_of(row)): row for row in rows}
    adjusted = {
        **holm_adjusted(row for row in rows if row.place.joint),
        **holm_adjusted(row for row in rows if not row.place.joint),
    }
    family = next(f for f in families(study.tasks) if task in f.tasks and f.moving == place.moving)
    found = []
    for label in labels_of(study, task):
        cells = _cells_there(study, [(name, label) for name in family.tasks])
        mine = [(spot, row) for (whose, spot), row in own.items() if whose == label]
        for spot, row in sorted(mine, key=lambda pair: bool(pair[0].joint)):
            what = spot.joint or "norm"
            values = (label, what, row.n, estimate_of(row), adjusted.get((label, spot)))
            found.append(Row(f"{label}, {what}", values, cells))
    slope = REGISTER["locus slope"]
    return table(
        f"slopes-{table_ids(study)[task]}-{place.goal}-of-{place.moving}-{place.hand}",
        f"Locus slopes: {place} (first of the tasks: {escaped(task)}).",
        (
            Column("method", "method"),
            Column("joint", "joint"),
            runs_column(printed=True),
            value_column(slope, "slope", "slope", True),
            p_column("slope", "p", True),
        ),
        found,
        (
            "Slopes of the posture at a goal on the position of a neighbouring goal, by joint: "
            "length unit (base) or rad (joints) per length unit. They are those of the mean "
            "posture at each position, with positions − 2 degrees of freedom, for methods that "
            "are run once as for the others; curvature widens their intervals. Joints without "
            "any slope are left out. The norm is that of all joints together; it is never "
            "negative. p is adjusted by Holm's method over the table, norms apart from slopes.",
        ),
    )


def _cells_there(study: Study, cells: Iterable[CellKey]) -> tuple[CellKey, ...]:
    return tuple(cell for cell in cells if cell in study.cells)
