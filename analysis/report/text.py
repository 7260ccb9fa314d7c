"""What all renderers share: raw values put into words."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from coartic.analysis.methods import short_name
from coartic.analysis.report.document import Column, DataTable, Estimate, Row, Strip, Tone, Value
from coartic.analysis.words import NO_SPREAD, NONE, true_minus, typographic

METHOD_COLUMNS = frozenset({"method", "first", "second"})
"""Names of columns that hold methods with their variants, shown by their short names."""


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

    def raw(self, value: Value) -> tuple[Value, ...]:
        """What it holds of a value: one, or both ends of the interval."""
        estimate = value if isinstance(value, Estimate) else Estimate(math.nan)
        if self.kind == "sd":
            return (estimate.sd,)
        if self.kind == "interval":
            return estimate.low, estimate.high
        return (value.value if isinstance(value, Estimate) else value,)

    def numbers(self, value: Value) -> tuple[str, ...]:
        """The numbers to show in ASCII, such as ``-12.3``; none where there is no value."""
        raw = self.raw(value)
        known = [x for x in raw if isinstance(x, int | float) and not math.isnan(x)]
        if len(known) < len(raw):
            return ()
        column, beyond = self.column, None
        if isinstance(value, Estimate):
            beyond = value.beyond
            if value.digits is not None and self.kind != "interval":
                column = replace(column, digits=value.digits[self.kind == "sd"])
        return tuple(
            number_text(number, column)
            if beyond is None or math.isfinite(number)
            else f">{number_text(beyond, column)}"
            for number in known
        )

    def point(self, value: Value) -> bool:
        """Whether it shows an interval that is a point: no spread, which is not certainty."""
        raw = self.raw(value)
        return self.kind == "interval" and raw[0] is not None and raw[0] == raw[-1]

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

    def named(self, value: Value) -> str:
        """The same, methods by their short names."""
        text = self.text(value)
        return short_name(text) if self.column.name in METHOD_COLUMNS and text != NONE else text


def by_column(table: DataTable) -> list[list[Part]]:
    """What to show of each column: values, then the SDs and intervals where some have them."""
    found = []
    for index, column in enumerate(table.columns):
        values = [row.values[index] for row in table.rows]
        estimates = [value for value in values if isinstance(value, Estimate)]
        own = [Part(index, column, "value")]
        if any(estimate.sd is not None for estimate in estimates):
            own.append(Part(index, column, "sd"))
        if any(estimate.low is not None for estimate in estimates):
            own.append(Part(index, column, "interval"))
        found.append(own)
    return found


def parts(table: DataTable) -> list[Part]:
    """The same, each in a column of its own."""
    return [part for own in by_column(table) for part in own]


def heads(table: DataTable) -> list[str]:
    """What each column shows, with its unit: value, SD and interval together."""
    return [", ".join(part.header for part in own) for own in by_column(table)]


def texts(table: DataTable, row: Row) -> list[str]:
    """What each column shows in a row: value, SD and interval together."""
    found = []
    for own in by_column(table):
        shown = {part.kind: part.text(row.values[part.index]) for part in own}
        known = {kind: t for kind, t in shown.items() if kind == "value" or t != NONE}
        found.append(" ".join(f"± {t}" if kind == "sd" else t for kind, t in known.items()))
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
        if column.kind == "p":  # never 0, which is what rounding may have left of it
            return f"<{10.0**-digits:.{digits}f}"
        return shown.removeprefix("-")
    return shown


def tallied(strip: Strip) -> Mapping[str, int]:
    """How often each verdict was given, in the order in which they come first."""
    return Counter(verdict.verdict for verdict in strip.verdicts)


_TONES: Mapping[str, Tone] = {
    "supported": "good",
    "equivalent": "good",
    "not supported": "bad",
    "different": "bad",
    "cannot tell": "open",
    "undecided": "open",
}


def tone_of(verdict: str) -> Tone:
    """Whether a verdict is in favour or against, marks behind it left aside."""
    return _TONES.get(verdict.removesuffix(" †"), "plain")
