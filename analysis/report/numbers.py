"""Headline values as LaTeX macros, each with what it was computed from.

A value with macro ``\\coarticAscendingECOneReward`` has companions ``...Low`` and ``...High``
(95 % interval), ``...SD``, ``...N`` (runs) and ``...Full`` (value, interval and runs as text), as
far as there are any. A value without ``...N`` has as many runs as its cell's reward.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from coartic.analysis.methods import LEARNER
from coartic.analysis.report.document import CellKey, RestsOn
from coartic.analysis.report.formats.templates import LATEX, template
from coartic.analysis.results.optima import SHIPPED
from coartic.text import one_line

if TYPE_CHECKING:
    from coartic.analysis.study import Study

PREFIX = "coartic"
ORIGINS: dict[RestsOn, str] = {
    "optimum": f"the optimum of the {SHIPPED}",
    "ours": "ours, chosen or assumed, not the paper's (Shah, Barto & Fagg, 2013)",
    "derived": "derived from what the paper prints (Shah, Barto & Fagg, 2013)",
    "paper": "printed in the paper (Shah, Barto & Fagg, 2013)",
    "simulation": "computed from the corrective process alone",
    "runs": "computed of no runs, since none of its cells has any",
    "text": "text",
}
"""What a value is that no runs are behind; the first that it rests on says it."""
_DIGITS = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")


@dataclass(frozen=True)
class Number:
    """One value that a paper may print."""

    macro: str
    meaning: str
    value: float
    digits: int
    """Decimals that are shown."""
    unit: str = ""
    low: float = math.nan
    high: float = math.nan
    sd: float = math.nan
    sd_digits: int | None = None
    """Decimals of the SD, where they are others."""
    n: int | None = None
    how: str = ""
    """How value and interval were obtained."""
    cells: tuple[CellKey, ...] = ()
    """What it was computed from; none for what the paper prints and for shipped optima."""
    of: str = ""
    """What the meaning is said of, such as a method on a task."""
    origin: str = ""
    """What a value without cells is, such as printed in the paper."""

    def __post_init__(self) -> None:
        if not (self.macro.isascii() and self.macro.isalpha()):
            raise ValueError(f"macro {self.macro!r}: letters alone")

    def companions(self) -> Iterator[tuple[str, str]]:
        """What follows the macro's name, first nothing, with the text that it stands for."""
        yield "", self.text(self.value)
        if not math.isnan(self.sd):
            yield "SD", self.text(self.sd, self.sd_digits)
        if not math.isnan(self.low):
            yield "Low", self.text(self.low)
            yield "High", self.text(self.high)
        if self.n is not None:
            yield "N", str(self.n)
        if not math.isnan(self.low):
            yield "Full", self.full(str)

    def full(self, show: Callable[[str], str], n: str = "n") -> str:
        """Value, interval and runs; ``show`` writes a number, ``n`` their symbol."""
        value, low, high = (show(self.text(x)) for x in (self.value, self.low, self.high))
        runs = "" if self.n is None else f"{n} = {self.n}"
        # A point would look like certainty.
        if self.low == self.high:
            return f"{value} (no spread{f', {runs}' if runs else ''})"
        return f"{value} [{low}, {high}]{f' ({runs})' if runs else ''}"

    def text(self, value: float, digits: int | None = None) -> str:
        """A value with this number's decimals, or ``digits``; never minus zero."""
        shown = f"{value:.{self.digits if digits is None else digits}f}"
        return shown.lstrip("-") if float(shown) == 0 else shown


@dataclass(frozen=True)
class Names:
    """Tasks and labels in letters alone, all different."""

    tasks: dict[str, str]
    labels: dict[str, str]

    def renamed(self) -> list[str]:
        """A sentence for each name that another one would have in letters."""
        return [
            f"{name} is {word} in macros, as another name is {words(name)}."
            for names in (self.tasks, self.labels)
            for name, word in names.items()
            if word != words(name)
        ]


def words(name: str) -> str:
    """A name in letters alone, as LaTeX's macros need: ``two-armed-1`` is ``TwoArmedOne``.

    The paper's conditions are named without their family: ``dual-process/EC1`` is ``ECOne``.
    """
    name = re.sub(r"(?<=\d)[.](?=\d)", " point ", name.removeprefix(LEARNER))
    name = re.sub(r"(?<=[_=])-(?=\d)", " minus ", name)
    parts = re.findall(r"[A-Za-z]+|\d", name)
    return "".join(_DIGITS[int(p)] if p.isdigit() else p[0].upper() + p[1:] for p in parts)


def macro_names(study: Study) -> Names:
    """Names of tasks and labels, ``...Alt`` where an earlier one has the same letters."""
    return Names(
        _distinct(study.tasks), _distinct(dict.fromkeys(label for _, label in study.cells))
    )


def numbers_tex(numbers: Iterable[Number], about: Iterable[str]) -> str:
    """The macros as a LaTeX file. Numbers go through ``\\coarticnum``, which may be redefined."""
    layout = template("numbers.tex.jinja", one_line, **LATEX)
    return layout.render(numbers=numbers, about=about, prefix=PREFIX)


def _distinct(names: Iterable[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in names:
        word = words(name)
        while word in found.values():
            word += "Alt"
        found[name] = word
    return found
