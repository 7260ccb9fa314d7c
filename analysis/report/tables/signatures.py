"""Signatures of coarticulation, on one task and between tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analysis.markup import escaped
from analysis.report.document import Column, DataTable, Row, Value
from analysis.report.tables.common import finite, table, table_ids, with_interval
from analysis.signatures.page import CONTEXTS, OTHER, main_columns, other_arm_columns, place
from analysis.signatures.page import Column as SignatureColumn

if TYPE_CHECKING:
    from analysis.study import Study

MOST_CONTEXTS = 120
_UNITS = ("ticks", "share", "bit", "count", "rad", "1")


def signatures_tables(study: Study, task: str) -> list[DataTable]:
    """The main signatures of all methods on one task, and what the other arm does."""
    content = study.results.tasks[task]
    found = [
        _signatures(study, task, "main-signatures", "Main signatures", main_columns(content)),
        _signatures(
            study,
            task,
            "other-arm",
            "The arm that is not chosen",
            other_arm_columns(content),
            OTHER,
        )
        if len(content.hands) > 1
        else None,
    ]
    return [table for table in found if table is not None]


def contexts_table(study: Study) -> DataTable | None:
    """Postures at a shared goal before different successors."""
    names = (
        "context distance", "context dependence", "motor-equivalent part",
        "non-motor-equivalent part", "lead time",
    )  # fmt: skip
    frame = study.signatures
    frame = frame[frame.signature.isin(names) & frame.value.notna()]
    frame = frame.assign(at=frame["where"].str.replace(r", of at most \d+$", "", regex=True))
    rows = []
    for (task, at, label), own in frame.groupby(["task", "at", "label"], sort=False):
        by_name = {row["signature"]: row for row in own.to_dict("records")}
        other = str(at).partition("against ")[2]
        cells = [(str(task), str(label))]
        if (other, str(label)) in study.cells:
            cells.append((other, str(label)))
        dependence = by_name.get("context dependence")
        rows.append(
            Row(
                f"{task}, {at}, {label}",
                (
                    str(label),
                    f"{task}, {at}",
                    *(_estimate(by_name[n]) if n in by_name else None for n in names),
                    finite(dependence["p"]) if dependence else None,
                ),
                tuple(cells),
            )
        )
    if len(rows) > MOST_CONTEXTS:  # families of variants have too many to be read here
        return None
    heads = ("distance", "dependence", "motor-equivalent", "non-motor-equivalent", "lead")
    units = ("", "pooled SD", "", "", "ticks")
    return table(
        "contexts",
        "The same goal before different successors.",
        (
            Column("method", "method"),
            Column("where", "where", printed=False),
            *(
                Column(f"context_{i}", head, "number", unit)
                for i, (head, unit) in enumerate(zip(heads, units, strict=True))
            ),
            Column("p", "p of dependence", "p", digits=4),
        ),
        rows,
        (f"{CONTEXTS} p is of the permutation test, uncorrected; {len(rows)} rows.",),
    )


def _signatures(
    study: Study,
    task: str,
    name: str,
    title: str,
    columns: list[SignatureColumn],
    note: str = "",
) -> DataTable | None:
    frame = study.signatures
    frame = frame[(frame.task == task) & frame.value.notna()]
    values = {
        (row["label"], row["signature"], place(row)): row for row in frame.to_dict("records")
    }
    rows = []
    for own, label in study.method_rows:
        if own != task:
            continue
        entries = [values.get((label, column.signature, column.place)) for column in columns]
        if any(entries):
            cells = tuple(None if entry is None else _estimate(entry) for entry in entries)
            rows.append(Row(label, (label, *cells), ((task, label),)))
    heads = []
    for index, column in enumerate(columns):
        head, _, unit = column.head.rpartition(", ")
        if unit not in _UNITS:
            head, unit = column.head, ""
        unit = "" if unit == "1" else unit
        heads.append(
            Column(
                f"signature_{index}",
                head,
                "number",
                unit,
                printed=index < 2,
            )
        )
    return table(
        f"{name}-{table_ids(study)[task]}",
        f"{title} on {escaped(task)}.",
        (Column("method", "method"), *heads),
        rows,
        (note,) if note else (),
    )


def _estimate(row: dict[Any, Any]) -> Value:
    return with_interval(float(row["value"]), float(row["low"]), float(row["high"]))
