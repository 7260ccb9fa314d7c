"""Signatures between tasks: a goal before different successors, or next to one that moves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

from analysis.markup import escaped
from analysis.report.document import CellKey, Column, DataTable, Row, Value
from analysis.report.tables.common import table, table_ids
from analysis.report.tables.signatures import (
    cells_of,
    holm_adjusted,
    identifier,
    known,
    labels_of,
    p_column,
    reasons_for,
    runs_column,
    value_column,
)
from analysis.signatures.locus import families
from analysis.signatures.register import CONTEXTS, FAMILIES, REGISTER
from analysis.signatures.rows import Place, SignatureRow
from coartic.text import counted

if TYPE_CHECKING:
    from analysis.study import Study

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
            "goal, hand and tasks. Contexts are in the order of the tasks, methods in each by "
            f"mean reward, best first: {counted(len(rows), 'row')} in all.",
            *reasons_for(lacking),
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
    how = "The longest that the lead can be: ticks of the shortest movement to the goal."
    longest = Column("lead_at_most", "at most", "number", "ticks", 0, rests_on=("runs",), how=how)
    return (*columns, replace(longest, printed=False))


def slopes_tables(study: Study) -> list[DataTable]:
    """How the posture at a goal follows a neighbouring goal, a table for each goal and hand."""
    found: dict[tuple[str, Place], list[SignatureRow]] = defaultdict(list)
    for row in study.signature_rows:
        if REGISTER[row.signature] in FAMILIES and known(row):
            found[row.task, replace(row.place, joint="")].append(row)
    made = [_slopes_at(study, task, place, rows) for (task, place), rows in found.items()]
    return [replace(table, folded=True) for table in made if table is not None]


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
