"""Signatures between tasks: a goal before different successors, or next to one that moves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from analysis.markup import escaped
from analysis.report.document import CellKey, Column, DataTable, Row, Value
from analysis.report.tables.common import table_ids
from analysis.report.tables.layout import LAYOUTS
from analysis.report.tables.signatures import (
    cells_of,
    columns_of,
    holm_adjusted,
    identifier,
    known,
    labels_of,
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
    found: dict[tuple[str, str, str], dict[str, SignatureRow]] = defaultdict(dict)
    places: dict[tuple[str, str], list[SignatureRow]] = defaultdict(list)
    for row in study.signature_rows:
        if REGISTER[row.signature] in CONTEXTS and row.place.against and known(row):
            at = str(replace(row.place, longest=None))
            found[row.task, at, row.label][row.signature] = row
            places[row.task, at].append(row)
    adjusted = {row: p for own in places.values() for row, p in holm_adjusted(own).items()}
    tested = {row.signature for row in adjusted}
    rows = []
    for (task, at, label), own in found.items():
        values: list[Value] = [label, f"{task}, {at}", max(row.n for row in own.values())]
        for signature in CONTEXTS:
            values += cells_of(own.get(signature.name), adjusted, signature.name in tested)
        values.append(max(row.place.longest or 0 for row in own.values()) or None)
        against = next(iter(own.values())).place.against
        cells = _cells_there(study, [(task, label), (against, label)])
        rows.append(Row(f"{task}, {at}, {label}", tuple(values), cells))
    layout = LAYOUTS["contexts"].plus(_columns_of_contexts(tested))
    layout = layout.model_copy(update={"folded": len(rows) > MOST_CONTEXTS})
    return layout.table(rows, count=len(rows))


def _columns_of_contexts(tested: set[str]) -> Iterator[Column]:
    for signature in CONTEXTS:
        name, heading = signature.name, signature.heading
        p = f"p of {heading}" if name in tested else ""
        printed = name == "context dependence"
        yield from columns_of(signature, identifier(name), heading, p, p_printed=printed)
    yield Column(
        "lead_at_most", "at most", "number", "ticks", 0, rests_on=("runs",), printed=False
    )


def slopes_tables(study: Study) -> list[DataTable]:
    """How the posture at a goal follows a neighbouring goal, a table for each goal and hand."""
    found: dict[tuple[str, Place], list[SignatureRow]] = defaultdict(list)
    for row in study.signature_rows:
        if REGISTER[row.signature] in FAMILIES and known(row):
            found[row.task, replace(row.place, joint="")].append(row)
    made = (_slopes_at(study, task, place, rows) for (task, place), rows in found.items())
    return list(filter(None, made))


def _slopes_at(
    study: Study, task: str, place: Place, rows: Sequence[SignatureRow]
) -> DataTable | None:
    """Norm and slopes of all methods; joints that nowhere follow are left out."""
    kept = {row.place.joint for row in rows if abs(row.value) > _NO_SLOPE}
    rows = [row for row in rows if row.place.joint in kept]
    norms, slopes = ([row for row in rows if bool(row.place.joint) == of] for of in (False, True))
    adjusted = holm_adjusted(norms) | holm_adjusted(slopes)
    family = next(f for f in families(study.tasks) if task in f.tasks and f.moving == place.moving)
    found = []
    for label in labels_of(study, task):
        cells = _cells_there(study, [(name, label) for name in family.tasks])
        for row in (*norms, *slopes):
            if row.label == label:
                what = row.place.joint or "norm"
                values = (label, what, row.n, *cells_of(row, adjusted, True))
                found.append(Row(f"{label}, {what}", values, cells))
    columns = columns_of(REGISTER["locus slope"], "slope", "slope", "p", p_printed=True)
    return (
        LAYOUTS["slopes"]
        .plus(columns)
        .table(
            found,
            *(table_ids(study)[task], str(place.goal), "of", str(place.moving), place.hand),
            place=place,
            task=escaped(task),
        )
    )


def _cells_there(study: Study, cells: Iterable[CellKey]) -> tuple[CellKey, ...]:
    return tuple(cell for cell in cells if cell in study.cells)
