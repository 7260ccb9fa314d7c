"""What all renderers share: raw values put into words."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

from analysis.report.document import Column, DataTable, Estimate, Value
from analysis.table import NONE

NO_SPREAD = "no spread"
MINUS, NARROW_SPACE, TIMES = "−", "\N{NARROW NO-BREAK SPACE}", "×"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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


def true_minus(text: str) -> str:
    """Text with a minus where a hyphen before a digit begins a word, in brackets or not."""
    return re.sub(r"(?<![^\s(\[])-(?=\d)", MINUS, text)


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


def typographic(number: str) -> str:
    """A number of :func:`number_text` with a true minus and its thousands apart."""
    comparison = "<" if number.startswith("<") else ""
    number = number.removeprefix("<")
    sign = MINUS if number.startswith("-") else ""
    number = number.removeprefix("-")
    if number == "inf":
        return f"{sign}∞"
    mantissa, _, power = number.partition("e")
    whole, dot, decimals = mantissa.partition(".")
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", NARROW_SPACE)
    shown = f"{comparison}{sign}{whole}{dot}{decimals}"
    return f"{shown} {TIMES} 10{power.translate(_SUPERSCRIPTS)}" if power else shown


def _number(value: float | str | None) -> float:
    return value if isinstance(value, int | float) else math.nan
