"""The CSV files of a results folder: what each column is, and which runs are behind a row."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

import pandas as pd
from pydantic import model_validator

from coartic.analysis.report.document import CellKey, DataTable, RestsOn, Row, Value
from coartic.analysis.report.tables.layout import TableLayout, read_layouts
from coartic.analysis.signatures.locus import families
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.study import Study
from coartic.tables import label_of

_Raw = Mapping[Hashable, Any]
"""A row as pandas has it."""


class FileLayout(TableLayout):
    """A section of ``files.toml``, which says what the fields are."""

    key: tuple[str, ...]
    optimum: str | None = None

    @model_validator(mode="after")
    def _names_columns(self) -> Self:
        named = {*self.key, *filter(None, [self.optimum])}
        unknown = named - {column.name for column in self.columns}
        if unknown:
            raise ValueError(f"no columns {', '.join(sorted(unknown))}")
        return self


@dataclass(frozen=True)
class CsvFile:
    """A file with one number a place: its rows, and the cells that each was computed from, with
    all their runs."""

    layout: FileLayout
    rows: Callable[[Study], pd.DataFrame]
    cells: Callable[[Study, _Raw], Iterable[CellKey]]
    how: Callable[[_Raw], str]
    """What a row's values are, where the columns do not say it."""
    rests_on: Callable[[Study, _Raw], Mapping[str, tuple[RestsOn, ...]]]
    """By column, what a row's values rest on where it is not what the column says."""
    family: Callable[[_Raw], str]
    """Rows of one name depend on each other, in columns with a family."""

    @property
    def name(self) -> str:
        """Of the file."""
        return f"{self.layout.name}.csv"

    def text(self, study: Study) -> str:
        """All of it."""
        return csv_text(self.layout, self.rows(study))

    def table(self, study: Study) -> DataTable:
        """The same as a table whose every value can be traced."""
        layout = self.layout
        rows = tuple(
            Row(
                key,
                tuple(_value(row[column.name]) for column in layout.columns),
                tuple(dict.fromkeys(self.cells(study, row))),
                how=self.how(row),
                rests_on=self.rests_on(study, row),
                family=self.family(row) or key,
                other_arm=row[layout.optimum] if layout.optimum else None,
            )
            for row in self.rows(study).to_dict("records")
            for key in [_joined(row, layout.key)]
        )
        return DataTable(self.name, layout.caption, layout.columns, rows, key=layout.key)


def csv_text(layout: TableLayout, rows: pd.DataFrame) -> str:
    """Rows as CSV. Raises ValueError where they have other columns than the layout says."""
    columns = [column.name for column in layout.columns]
    if list(rows.columns) != columns:
        odd = {*rows.columns} ^ {*columns} or "in another order"
        raise ValueError(f"{layout.name} has other columns than are stated of it: {odd}")
    return rows.to_csv(index=False)


def _value(raw: Any) -> Value:
    """A value of pandas as one of a table."""
    if isinstance(raw, bool):
        return str(raw)
    return None if raw == "" or pd.isna(raw) else raw


def _joined(row: _Raw, columns: Iterable[str]) -> str:
    """Values of some columns as the file has them, with spaces between."""
    return " ".join(filter(None, (str(row[name]) for name in columns)))


def _of_cell(study: Study, row: _Raw) -> Iterator[CellKey]:
    """Of a task's method, which has its variant with it or in a column."""
    yield row["task"], label_of(row["method"], row.get("variant", ""))


def _of_signature(study: Study, row: _Raw) -> Iterator[CellKey]:
    """The same method on all tasks that a value is taken over."""
    task, label = row["task"], label_of(row["method"], row["variant"])
    tasks: tuple[str, ...] = (task, row["against"])
    if not pd.isna(row["moving"]):
        known = families(study.tasks)
        tasks = next(f.tasks for f in known if task in f.tasks and f.moving == row["moving"])
    return ((name, label) for name in tasks if (name, label) in study.cells)


def _of_pair(study: Study, row: _Raw) -> Iterator[CellKey]:
    yield from ((row["task"], row[label]) for label in ("first", "second"))


def _of_all_tasks(study: Study, row: _Raw) -> Iterator[CellKey]:
    scores = study.scores
    own = scores[scores.method == row["method"]]
    return zip(own.task.map(str), own.label.map(str), strict=True)


def _of_claim(study: Study, row: _Raw) -> Iterator[CellKey]:
    runs = set(row["runs"].split())
    return (cell for cell, own in study.run_ids.items() if not runs.isdisjoint(own))


def _of_simulation(study: Study, row: _Raw) -> Mapping[str, tuple[RestsOn, ...]]:
    columns = ("value", "low", "high", "p", "n", "why_not")
    simulated = REGISTER[row["signature"]].simulated
    return dict.fromkeys(columns, ("runs", "simulation")) if simulated else {}


def _of_gaps(study: Study, row: _Raw) -> Mapping[str, tuple[RestsOn, ...]]:
    """Gaps, unlike scores, are not taken from the corrective process alone."""
    columns = ("share", "low", "high", "note")
    return dict.fromkeys(columns, ("runs", "optimum")) if row["kind"] == "gap" else {}


def _of_no_runs(study: Study, row: _Raw) -> Mapping[str, tuple[RestsOn, ...]]:
    return next(entry.origin for entry in study.judged if entry.claim.id == row["id"])


_LAYOUTS = read_layouts("files", FileLayout)


def _file(
    name: str,
    rows: Callable[[Study], pd.DataFrame],
    cells: Callable[[Study, _Raw], Iterable[CellKey]] = _of_cell,
    *,
    how: Callable[[_Raw], str] = lambda row: "",
    rests_on: Callable[[Study, _Raw], Mapping[str, tuple[RestsOn, ...]]] = lambda study, row: {},
    family: Callable[[_Raw], str] = lambda row: "",
) -> CsvFile:
    return CsvFile(_LAYOUTS[name], rows, cells, how, rests_on, family)


METHOD_ROWS = _file("methods", lambda study: study.methods)
"""What ``coartic run`` writes."""
ANALYSES = (
    _file(
        "claims",
        lambda study: study.claims,
        _of_claim,
        how=lambda row: f"{row['test']}.",
        rests_on=_of_no_runs,
        family=lambda row: "" if pd.isna(row["p"]) else str(row["correction"]),
    ),
    _file(
        "comparisons",
        lambda study: study.pairs,
        _of_pair,
        family=lambda row: "" if row["kind"] == "conditions" else str(row["task"]),
    ),
    _file("across_tasks", lambda study: study.overall, _of_all_tasks),
    _file("profiles", lambda study: study.profiles, _of_all_tasks, rests_on=_of_gaps),
    _file(
        "signatures",
        lambda study: study.signatures.drop(columns="label"),
        _of_signature,
        how=lambda row: f"{row['signature']}: {REGISTER[row['signature']].meaning}.",
        rests_on=_of_simulation,
    ),
    _file("anytime", lambda study: study.anytime),
    _file("targets", lambda study: study.targets),
    _file("areas", lambda study: study.areas, family=lambda row: str(row["task"])),
    _file("pareto", lambda study: study.pareto, family=lambda row: str(row["task"])),
)
"""What ``coartic analyse`` writes, in its order."""
FILES = {file.name: file for file in (METHOD_ROWS, *ANALYSES)}
"""All of them by their names."""
