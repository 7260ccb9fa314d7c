"""What tables say whatever their values (``tables.toml``), and how values come into their rows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, model_validator

from coartic.analysis.comparisons.methods import TOLD
from coartic.analysis.report.document import (
    CellKey,
    Column,
    DataTable,
    Estimate,
    RestsOn,
    Row,
    Value,
)
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.words import RECONSTRUCTED, stated

_LETTERS = {"told", "told_more", "told_less"}  # columns with letters of information
_MARKS = {
    "†": RECONSTRUCTED,
    "δ": "Cliff's δ: how often a run of the first is higher than one of the second, less how "
    "often it is lower; −1 to 1.",
}


class TableLayout(BaseModel):
    """A section of ``tables.toml``, which says what the fields are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    caption: str
    rests_on: tuple[RestsOn, ...] = ()
    reading: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    folded: bool = False
    intervals: dict[str, str] = {}
    columns: tuple[Column, ...]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        unknown = self.intervals.keys() - {column.name for column in self.columns}
        if unknown:
            raise ValueError(f"intervals of no columns: {', '.join(sorted(unknown))}")
        for column in self.columns:
            if column.kind != "text" and not column.rests_on:
                raise ValueError(f"what the numbers of {column.name} rest on is not said")
        return self

    def plus(self, columns: Iterable[Column]) -> TableLayout:
        """With further columns, which depend on what there is to be shown."""
        return self.model_copy(update={"columns": (*self.columns, *columns)})

    def reading_with(self, **facts: Any) -> tuple[str, ...]:
        """What is said once of the tables, in inline markup as ``facts`` are."""
        return tuple(text.format(**facts) for text in self.reading)

    def row(self, key: str, of: Any = None, /, cells: Iterable[CellKey] = (), **own: Value) -> Row:
        """A row. Values given by name are taken as they are; every other column is read off
        ``of``, with its interval where ``intervals`` names one.

        Raises ValueError for a value that no column shows, and for a column without a value.
        """
        unknown = own.keys() - {column.name for column in self.columns}
        if unknown:
            raise ValueError(f"table {self.name} has no columns {', '.join(sorted(unknown))}")
        values = (own[c.name] if c.name in own else self._field(of, c.name) for c in self.columns)
        return Row(key, tuple(values), tuple(cells))

    def _field(self, of: Any, name: str) -> Value:
        try:
            value = getattr(of, name)
        except AttributeError:
            raise ValueError(f"table {self.name}: a row has no value for {name}") from None
        if name in self.intervals:
            ends = (getattr(of, f"{self.intervals[name]}{end}") for end in ("low", "high"))
            return with_interval(value, *ends)
        if isinstance(value, float):
            return finite(value)
        return None if value == "" else value

    def table(
        self, rows: Iterable[Row], *of: str, notes: Sequence[str] = (), **facts: Any
    ) -> DataTable | None:
        """The table with the meaning of its marks, or None where it would have no rows.

        ``of``: what the id adds to the name of the section; ``notes``: further ones; ``facts``:
        what is filled into caption and notes, in inline markup.
        """
        found = DataTable(
            "-".join((self.name, *of)),
            self.caption.format(**facts),
            self.columns,
            tuple(rows),
            (*(note.format(**facts) for note in self.notes), *notes),
            self.folded,
        )
        return with_legends(found) if found.rows else None


def with_interval(value: float, low: float, high: float) -> Value:
    """A value with its interval where it has one; None for NaN."""
    ends = () if math.isnan(low) else (float(low), float(high))
    return None if math.isnan(value) else Estimate(float(value), None, *ends)


def estimated(found: Inference | None, scale: float = 1.0) -> Value:
    """An estimate times ``scale`` with its interval where it has one; None for none."""
    if found is None:
        return None
    return with_interval(*(scale * value for value in (found.estimate, found.low, found.high)))


def finite(value: float) -> float | None:
    """None for NaN."""
    return None if math.isnan(value) else float(value)


_L = TypeVar("_L", bound=TableLayout)


def read_layouts(file: str, kind: type[_L]) -> dict[str, _L]:
    """The sections of a file of this folder, by name, in its order.

    Raises pydantic's ValidationError for what does not fit together.
    """
    found = {}
    for name, said in stated(__file__, file).items():
        rests_on = said.get("rests_on", ())
        columns = [_column(*column, rests_on=rests_on) for column in said["columns"].items()]
        found[name] = {**said, "name": name, "columns": columns}
    layouts: TypeAdapter[dict[str, _L]] = TypeAdapter(dict[str, kind])  # type: ignore[valid-type]
    return layouts.validate_python(found)


def _column(name: str, said: dict[str, Any], *, rests_on: Sequence[str]) -> dict[str, Any]:
    number = said.get("kind", "text") != "text"
    default = {"rests_on": rests_on} if number else {}
    return {"name": name, "header": name.replace("_", " "), **default, **said}


LAYOUTS = read_layouts("tables", TableLayout)
"""All tables of pages by name."""


def with_legends(table: DataTable) -> DataTable:
    """The table with a note for every mark that it shows and its notes leave unexplained."""
    notes = list(table.notes)
    if _LETTERS & {column.name for column in table.columns}:
        letters = ", ".join(f"*{letter}* {item.value}" for item, letter in TOLD.items())
        notes.append(f"Told: {letters}.")
    texts = [table.caption, *(column.header for column in table.columns)]
    texts += [value for row in table.rows for value in row.values if isinstance(value, str)]
    notes += [
        note
        for mark, note in _MARKS.items()
        if any(mark in text for text in texts) and not any(mark in text for text in notes)
    ]
    return replace(table, notes=tuple(notes))
