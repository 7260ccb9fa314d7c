"""Signatures between tasks: a goal before different successors, or next to one that moves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain

from coartic.analysis.markup import escaped
from coartic.analysis.report.document import CellKey, Column, DataTable, Row, Value
from coartic.analysis.report.tables.common import table_ids
from coartic.analysis.report.tables.layout import LAYOUTS
from coartic.analysis.report.tables.signatures import (
    cells_of,
    columns_of,
    holm_adjusted,
    identifier,
    known,
    labels_of,
    reasons_for,
)
from coartic.analysis.signatures.locus import families
from coartic.analysis.signatures.register import CONTEXTS, FAMILIES, REGISTER
from coartic.analysis.signatures.rows import Place, SignatureRow
from coartic.analysis.study import Study
from coartic.text import counted

MOST_CONTEXTS = 120
"""Rows of a table that a page shows at once."""
_NO_SLOPE = 1e-12


def contexts_table(study: Study) -> DataTable | None:
    """Postures at a shared goal before different successors; long ones are folded."""
    found: dict[tuple[str, Place], dict[str, list[SignatureRow]]] = {}
    tasks = list(study.tasks)
    for row in sorted(study.signature_rows, key=lambda row: tasks.index(row.task)):
        if REGISTER[row.signature] in CONTEXTS and row.place.against:
            place = row.task, replace(row.place, longest=None)
            found.setdefault(place, {}).setdefault(row.label, []).append(row)
    adjusted: dict[SignatureRow, float] = {}
    for by_label in found.values():
        adjusted |= holm_adjusted(filter(known, chain.from_iterable(by_label.values())))
    tested = {row.signature for row in adjusted}
    rows: list[Row] = []
    lacking: dict[str, list[str]] = defaultdict(list)
    for (task, where), by_label in found.items():
        at = f"{task}, {where}"
        for label in labels_of(study, task):
            own = {row.signature: row for row in by_label.get(label, ()) if known(row)}
            if own:
                lacking[label] += (row.why_not for row in by_label[label] if row.why_not)
                values: list[Value] = [label, at, max(row.n for row in own.values())]
                for signature in CONTEXTS:
                    row_of_it = own.get(signature.name)
                    values += cells_of(row_of_it, adjusted, signature.name in tested)
                values.append(max(row.place.longest or 0 for row in own.values()) or None)
                cells = _cells_there(study, [(task, label), (where.against, label)])
                rows.append(Row(f"{at}, {label}", tuple(values), cells, family=at))
    layout = LAYOUTS["contexts"].plus(_columns_of_contexts(tested))
    layout = layout.model_copy(update={"folded": len(rows) > MOST_CONTEXTS})
    return layout.table(rows, notes=reasons_for(lacking), count=counted(len(rows), "row"))


def _columns_of_contexts(tested: set[str]) -> Iterator[Column]:
    for signature in CONTEXTS:
        name, heading = signature.name, signature.heading
        p = f"p of {heading}" if name in tested else ""
        printed = name == "context dependence"
        yield from columns_of(signature, identifier(name), heading, p, p_printed=printed)
    how = "The longest that the lead can be: ticks of the shortest movement to the goal."
    at_most = partial(Column, kind="number", unit="ticks", digits=0, rests_on=("runs",))
    yield at_most("lead_at_most", "at most", how=how, printed=False)


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
                kin = "joints" if row.place.joint else "norms"
                found.append(Row(f"{label}, {what}", values, cells, family=kin))
    columns = columns_of(REGISTER["locus slope"], "slope", "slope", "p", p_printed=True)
    names = table_ids(study)[task], str(place.goal), "of", str(place.moving), place.hand
    layout = LAYOUTS["slopes"].plus(columns)
    return layout.table(found, *names, place=place, task=escaped(task))


def _cells_there(study: Study, cells: Iterable[CellKey]) -> tuple[CellKey, ...]:
    return tuple(cell for cell in cells if cell in study.cells)
