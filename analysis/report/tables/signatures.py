"""Signatures of coarticulation on one task.

Which signature a table shows, and under which heading, is said by the register
(:mod:`coartic.analysis.signatures.register`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Literal, NamedTuple

from coartic.analysis.markup import escaped
from coartic.analysis.report.document import Column, DataTable, Row, Value
from coartic.analysis.report.tables.common import counts, table_ids
from coartic.analysis.report.tables.layout import LAYOUTS, with_interval
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.signatures.rows import Signature, SignatureRow
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import Study

_MAIN, _FURTHER = "main-signatures", "further-goals"
"""Tables of the same signatures: at the first goal or none, and at the others."""
_KINDS = (_MAIN, _FURTHER, "hands", "other-arm", "travel", "synergy", "variance")
_SHORT = (_MAIN, "other-arm")


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
        return f"{heading}, goal {self.goal}" if self.signature.by_goal else heading


def signatures_tables(study: Study, task: str, *, short: bool = False) -> list[DataTable]:
    """The signatures of all methods on one task.

    ``short``: the main ones and those of the other arm alone.
    """
    rows = [row for row in study.signature_rows if row.task == task]
    left_out = "" if len(study.tasks[task].hands) > 1 else "hands"
    kinds = (kind for kind in (_SHORT if short else _KINDS) if kind != left_out)
    return list(filter(None, (_of_task(study, task, kind, rows) for kind in kinds)))


def _of_task(
    study: Study, task: str, kind: str, every: Sequence[SignatureRow]
) -> DataTable | None:
    """Methods by signatures and places; None where no method has a value."""
    shown = _MAIN if kind == _FURTHER else kind
    rows = [row for row in every if REGISTER[row.signature].table == shown]
    spots = _spots(rows, kind)
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
        if kind == "hands":
            cells.append(counts(study.cells[task, label].good.hands))
        for spot, row in values.items():
            cells += cells_of(row, adjusted, spot in tested)
        found.append(Row(label, tuple(cells), ((task, label),)))
    columns: list[Column] = []
    for number, spot in enumerate(spots):
        header = spot.header + _neutral(row for (_, at), row in own.items() if at == spot)
        p = "p" if spot in tested else ""
        columns += columns_of(spot.signature, spot.name, header, p, printed=number < 2)
    reasons = reasons_for(lacking, len(spots))
    name = table_ids(study)[task]
    return LAYOUTS[kind].plus(columns).table(found, name, notes=reasons, task=escaped(task))


def _spots(rows: Sequence[SignatureRow], kind: str) -> list[Spot]:
    """The columns of a table, in the order of the register; of variance goal by goal."""
    order = list(REGISTER)
    found = {spot_of(row) for row in rows if row.unit}
    if kind in (_MAIN, _FURTHER):
        found = {spot for spot in found if ((spot.goal or 1) > 1) == (kind == _FURTHER)}

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


def definitions_table() -> DataTable | None:
    """What every signature says."""
    layout = LAYOUTS["signatures-explained"]
    return layout.table(
        layout.row(signature.name, signature, signature=signature.name)
        for signature in REGISTER.values()
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


def columns_of(
    signature: Signature,
    name: str,
    header: str,
    p: str = "",
    *,
    printed: bool = True,
    p_printed: bool = False,
) -> Iterator[Column]:
    """Values of a signature, then their p-values where those have a header."""
    kind: Literal["share", "number"] = "share" if signature.share else "number"
    unit = signature.unit if signature.unit in ("ticks", "bit", "rad", "pooled SD") else ""
    digits = 0 if signature.share else signature.digits
    of_runs = partial(
        Column, rests_on=("runs", "simulation") if signature.simulated else ("runs",)
    )
    how = f"{signature.name[:1].upper()}{signature.name[1:]}: {signature.meaning}."
    yield of_runs(name, header, kind, unit, digits, how=how, printed=printed)
    if p:
        how = "Adjusted by Holm's method; the tests are those of docs/signatures.md."
        family = "all rows with p-values that are adjusted together"
        p_values = partial(of_runs, kind="p", digits=3, how=how, family=family)
        yield p_values(f"{name}_p", p, printed=p_printed)
