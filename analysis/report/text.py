"""What all renderers share: raw values put into words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from analysis.report.document import Column, DataTable, Estimate, Row, Value
from analysis.words import NO_SPREAD, NONE, true_minus, typographic


@dataclass(frozen=True)
class Part:
    """A column as it is shown: values, their SDs or their intervals."""

    index: int
    """Of the table's column."""
    column: Column
    kind: Literal["value", "sd", "interval"]

    @property
    def numeric(self) -> bool:
        """Whether it holds single numbers."""
        return self.column.kind != "text" and self.kind != "interval"

    @property
    def header(self) -> str:
        """Header with unit."""
        if self.kind == "sd":
            return "SD"
        if self.kind == "interval":
            return self.column.interval
        unit = "%" if self.column.kind == "share" else self.column.unit
        return f"{self.column.header} ({unit})" if unit else self.column.header

    def numbers(self, value: Value) -> tuple[str, ...]:
        """The numbers to show in ASCII, such as ``-12.3``; none where there is no value."""
        estimate = value if isinstance(value, Estimate) else Estimate(_number(value))
        raw = {
            "value": (estimate.value,),
            "sd": (estimate.sd,),
            "interval": (estimate.low, estimate.high),
        }[self.kind]
        known = [number for number in raw if number is not None and not math.isnan(number)]
        if len(known) < len(raw):
            return ()
        return tuple(number_text(number, self.column) for number in known)

    def point(self, value: Value) -> bool:
        """Whether it shows an interval that is a point: no spread, which is not certainty."""
        return (
            self.kind == "interval" and isinstance(value, Estimate)
            and value.low is not None and value.low == value.high
        )  # fmt: skip

    def text(self, value: Value) -> str:
        """A value in words and typographic numbers."""
        if self.point(value):
            return NO_SPREAD
        if self.column.kind == "text":
            return true_minus(str(value)) if self.kind == "value" and value else NONE
        numbers = [typographic(number) for number in self.numbers(value)]
        if not numbers:
            return NONE
        return f"[{', '.join(numbers)}]" if self.kind == "interval" else numbers[0]


def parts(table: DataTable) -> list[Part]:
    """The columns to show: SDs and intervals beside the values that have them."""
    found = []
    for index, column in enumerate(table.columns):
        estimates = [
            row.values[index] for row in table.rows if isinstance(row.values[index], Estimate)
        ]
        found.append(Part(index, column, "value"))
        if any(isinstance(e, Estimate) and e.sd is not None for e in estimates):
            found.append(Part(index, column, "sd"))
        if any(isinstance(e, Estimate) and e.low is not None for e in estimates):
            found.append(Part(index, column, "interval"))
    return found


def heads(table: DataTable) -> list[str]:
    """What each column shows, with its unit: value, SD and interval together."""
    shown: list[list[str]] = [[] for _ in table.columns]
    for part in parts(table):
        shown[part.index].append(part.header)
    return [", ".join(headers) for headers in shown]


def texts(table: DataTable, row: Row) -> list[str]:
    """What each column shows in a row: value, SD and interval together."""
    shown: list[list[str]] = [[] for _ in table.columns]
    for part in parts(table):
        text = part.text(row.values[part.index])
        if part.kind == "value" or text != NONE:
            shown[part.index].append(f"± {text}" if part.kind == "sd" else text)
    return [" ".join(words) for words in shown]


def number_text(value: float, column: Column) -> str:
    """A number in ASCII with the column's decimals: ``-12.3``, ``<0.001``, ``1.2e-7``."""
    number = 100.0 * value if column.kind == "share" else value
    if math.isinf(number):
        return "inf" if number > 0 else "-inf"
    digits = column.digits
    if digits is None:
        if isinstance(number, int):
            return str(number)
        size = abs(number)
        if 0 < size < 1e-4:
            mantissa, _, power = f"{number:.1e}".partition("e")
            return f"{mantissa}e{int(power)}"
        # Of what is written with three figures: 0.9996 is 1.00.
        size = float(f"{size:.2e}")
        digits = min(max(0, 2 - math.floor(math.log10(size))), 6) if size else 0
    shown = f"{number:.{digits}f}"
    if float(shown) == 0:
        if column.kind == "p" and number > 0:
            return f"<{10.0**-digits:.{digits}f}"
        return shown.removeprefix("-")
    return shown


def _number(value: float | str | None) -> float:
    return value if isinstance(value, int | float) else math.nan
