"""Signatures of coarticulation on one task.

Which signature a table shows, and under which heading, is said by the register
(:mod:`analysis.signatures.register`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, NamedTuple

from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Row, Value
from analysis.report.tables.common import counts, table, table_ids, with_interval
from analysis.signatures.register import REGISTER
from analysis.signatures.rows import Signature, SignatureRow
from analysis.statistics.hypotheses import holm

if TYPE_CHECKING:
    from analysis.study import Study


class _Kind(NamedTuple):
    """A table of one task."""

    id: str
    title: str
    shows: str
    """What signatures of the register name as their table."""
    note: str = ""


_KINDS = (
    _Kind("main-signatures", "Main signatures", "main-signatures"),
    _Kind("further-goals", "Signatures at further goals", "main-signatures"),
    _Kind(
        "hands",
        "Hands",
        "hands",
        "Hand sequences with the number of runs; ticks less those of the corrective process "
        "alone with each run's own hands, which is what a sacrifice is judged by; and by goal, "
        "the share of runs that hit it with the hand that is quickest for it by itself.",
    ),
    _Kind(
        "other-arm",
        "The arm that is not chosen",
        "other-arm",
        "How much nearer the waiting hand is to its next goal than in the initial solution when "
        "each goal is hit (a ratio; 1: there already): in all; seen from the base, which leaves "
        "out what a base does that moved otherwise than in the initial solution; and by what the "
        "arm did since its own last hit, 0 where it keeps still while it waits.",
    ),
    _Kind("travel", "Travel of the arm that is not chosen", "travel"),
    _Kind(
        "synergy",
        "Synergy, ΔV z",
        "synergy",
        "ΔV z at each goal, over the runs with a method's commonest hand sequence; p of the test "
        "against its neutral value, ½ ln(d_ucm/d_ort). **It is above neutral nearly everywhere, "
        "and says little**: a hit confines the hand to a disc of the task's radius, so that runs "
        "cannot differ much in directions that move it, whatever the method.",
    ),
    _Kind(
        "variance",
        "Synergy, V_ucm, V_ort and ΔV",
        "variance",
        "Variance over runs per dimension within (V_ucm) and orthogonal to (V_ort) the "
        "uncontrolled manifold, squared units, and ΔV, their difference over the total.",
    ),
)


class Spot(NamedTuple):
    """A signature at one place of a task, whatever differs between methods: a column."""

    signature: Signature
    goal: int | None
    joint: str

    @property
    def name(self) -> str:
        """Of the column."""
        goal = "" if self.goal is None else f"goal {self.goal}"
        return identifier(self.signature.name, goal, self.joint)

    @property
    def header(self) -> str:
        """Of the column."""
        heading = self.signature.heading
        if self.joint:
            return f"{self.joint.replace('_', ' ')} {heading}"
        by_goal = self.signature.extent.endswith("by goal")
        return f"{heading}, goal {self.goal}" if by_goal else heading


def signatures_tables(study: Study, task: str, *, short: bool = False) -> list[DataTable]:
    """The signatures of all methods on one task; all but the main ones folded.

    ``short``: the main ones and those of the other arm alone.
    """
    rows = [row for row in study.signature_rows if row.task == task]
    found = []
    for kind in _KINDS:
        main = kind.id in ("main-signatures", "other-arm")
        if (short and not main) or (kind.id == "hands" and len(study.tasks[task].hands) < 2):
            continue
        made = _of_task(study, task, kind, rows)
        if made is not None:
            found.append(replace(made, folded=not main))
    return found


def _of_task(
    study: Study, task: str, kind: _Kind, every: Sequence[SignatureRow]
) -> DataTable | None:
    """Methods by signatures and places; None where no method has a value."""
    rows = [row for row in every if REGISTER[row.signature].table == kind.shows]
    spots = _spots(rows, kind.id)
    own = {(row.label, spot_of(row)): row for row in rows}
    adjusted = holm_adjusted(row for row in own.values() if spot_of(row) in spots)
    tested = {spot_of(row) for row in adjusted}
    found, lacking = [], {}
    for label in labels_of(study, task):
        values = {spot: own.get((label, spot)) for spot in spots}
        whole = {row.signature: row.why_not for row in rows if row.label == label and not row.unit}
        lacking[label] = [
            row.why_not if row else whole.get(spot.signature.name, "not in every run's sequence")
            for spot, row in values.items()
            if row is None or math.isnan(row.value)
        ]
        if len(lacking[label]) == len(spots):
            continue
        cells: list[Value] = [label, max(row.n for row in values.values() if row and known(row))]
        if kind.id == "hands":
            cells.append(counts(study.cells[task, label].good.hands))
        for spot, row in values.items():
            cells += cells_of(row, adjusted, spot in tested)
        found.append(Row(label, tuple(cells), ((task, label),)))
    columns = [Column("method", "method"), runs_column()]
    if kind.id == "hands":
        how = "Hand sequences of the solutions, with their number of runs."
        columns.append(Column("hands", "hands", rests_on=("runs",), how=how))
    for number, spot in enumerate(spots):
        header = spot.header + _neutral(row for (_, at), row in own.items() if at == spot)
        columns.append(value_column(spot.signature, spot.name, header, number < 2))
        columns += [p_column(spot.name, "p")] if spot in tested else []
    return table(
        f"{kind.id}-{table_ids(study)[task]}",
        f"{kind.title} on {escaped(task)}.",
        tuple(columns),
        found,
        tuple(filter(None, (kind.note, *reasons_for(lacking, len(spots))))),
    )


def _spots(rows: Sequence[SignatureRow], kind: str) -> list[Spot]:
    """The columns of a table, in the order of the register; of variance goal by goal."""
    order = list(REGISTER)
    found = {spot_of(row) for row in rows if row.unit}
    if kind in ("main-signatures", "further-goals"):
        found = {spot for spot in found if ((spot.goal or 1) > 1) == (kind == "further-goals")}

    def place(spot: Spot) -> tuple[int, int, int, str]:
        first = spot.goal or 0 if kind == "variance" else 0
        return first, order.index(spot.signature.name), spot.goal or 0, spot.joint

    return sorted(found, key=place)


def spot_of(row: SignatureRow) -> Spot:
    """Where a value stands in a table."""
    return Spot(REGISTER[row.signature], row.place.goal, row.place.joint)


def _neutral(rows: Iterable[SignatureRow]) -> str:
    """The neutral values, one for all methods and hands as a rule, for a header."""
    places = dict.fromkeys(row.place.neutral for row in rows)
    known = dict.fromkeys(f"{value:.3f}" for value in places if value is not None)
    return f", neutral {' or '.join(known)}" if known else ""


def reasons_for(lacking: Mapping[str, Sequence[str]], columns: int = 0) -> list[str]:
    """Why methods have no value in some, or all, of the columns, in inline markup."""
    some: dict[str, dict[str, None]] = {}
    every: dict[str, list[str]] = {}
    for label, reasons in lacking.items():
        if len(reasons) == columns > 0:
            every.setdefault(reasons[0], []).append(label)
            continue
        for why in reasons:
            some.setdefault(why, {})[label] = None
    lines = [f"Empty: {why} ({', '.join(labels)})." for why, labels in some.items()]
    lines += [f"Without values: {', '.join(labels)} ({why})." for why, labels in every.items()]
    return [escaped(line) for line in lines]


def definitions_table() -> DataTable:
    """What every signature says."""
    return DataTable(
        "signatures-explained",
        "What the signatures say.",
        (
            Column("signature", "signature"),
            Column("extent", "unit, range"),
            Column("meaning", "what it says"),
        ),
        tuple(
            Row(signature.name, (signature.name, signature.extent, signature.meaning))
            for signature in REGISTER.values()
        ),
    )


def labels_of(study: Study, task: str) -> list[str]:
    """Methods of a task, best mean reward first."""
    return [label for name, label in study.method_rows if name == task]


def known(row: SignatureRow) -> bool:
    """Whether there is a value."""
    return not math.isnan(row.value)


def holm_adjusted(rows: Iterable[SignatureRow]) -> dict[SignatureRow, float]:
    """Holm-adjusted p of those that have one."""
    tests = [row for row in rows if not math.isnan(row.p)]
    return dict(zip(tests, holm([row.p for row in tests]), strict=True))


def cells_of(
    row: SignatureRow | None, adjusted: Mapping[SignatureRow, float], tested: bool
) -> list[Value]:
    """The value with its interval, then its p where the column is ``tested``."""
    value = with_interval(row.value, row.low, row.high) if row else None
    return [value, adjusted.get(row) if row else None] if tested else [value]


def identifier(*words: str) -> str:
    """A column's name: the words in small ASCII letters."""
    text = " ".join(words).lower().replace("δ", "d")
    return re.sub(r"\W+", "_", text.strip())


def runs_column(*, printed: bool = False) -> Column:
    """Runs that went into a row."""
    how = "Runs that went into the row's values; the most, where they differ."
    return Column("runs", "runs", "number", rests_on=("runs",), how=how, printed=printed)


def value_column(signature: Signature, name: str, header: str, printed: bool) -> Column:
    """Values of a signature, with its unit and decimals."""
    kind: Literal["share", "number"] = "share" if signature.share else "number"
    unit = signature.unit if signature.unit in ("ticks", "bit", "rad", "pooled SD") else ""
    digits = 0 if signature.share else signature.digits
    how = f"{signature.name[:1].upper()}{signature.name[1:]}: {signature.meaning}."
    return Column(name, header, kind, unit, digits, rests_on=("runs",), how=how, printed=printed)


def p_column(name: str, header: str, printed: bool = False) -> Column:
    """p-values beside the values of a column, of the tests that docs/signatures.md describes."""
    return Column(
        f"{name}_p",
        header,
        "p",
        digits=3,
        rests_on=("runs",),
        how="Adjusted by Holm's method; the tests are those of docs/signatures.md.",
        family="all rows with p-values that are adjusted together",
        printed=printed,
    )
