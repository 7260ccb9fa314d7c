"""Headline values as LaTeX macros, each with what it was computed from.

A value with macro ``\\coarticAscendingECOneReward`` has companions ``...Low`` and ``...High``
(95 % interval), ``...SD``, ``...N`` (runs) and ``...Full`` (value, interval and runs as text), as
far as there are any. A value without ``...N`` has as many runs as its cell's reward. Cells with
parameters that differ from the method's defaults have their reward only.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from analysis.comparisons.methods import solve_times
from analysis.methods import LEARNER
from analysis.published import published_cell, published_initial
from analysis.results.folder import CellRuns
from analysis.results.optima import SHIPPED
from analysis.signatures.register import PER_DIMENSION, REGISTER
from analysis.signatures.rows import SignatureRow
from analysis.statistics.estimates import (
    SEED,
    Inference,
    difference_of_means,
    mean,
    probability_of_improvement,
)
from analysis.statistics.spread import sd
from coartic.text import one_line

if TYPE_CHECKING:
    from analysis.study import Study

PREFIX = "coartic"
Cell = tuple[str, str]
"""Task and label."""

_DIGITS = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_INITIAL = {"ascending": 1, "descending": 1, "two-armed-1": 2, "two-armed-2": 3}
"""Exploration condition under which the paper speaks of a task's initial solution."""


@dataclass(frozen=True)
class Number:
    """One value that a paper may print."""

    macro: str
    meaning: str
    value: float
    digits: int
    """Decimals that are printed."""
    unit: str = ""
    low: float = math.nan
    high: float = math.nan
    sd: float = math.nan
    n: int | None = None
    how: str = ""
    """How value and interval were obtained."""
    cells: tuple[Cell, ...] = ()
    """What it was computed from; none for what the paper prints and for shipped optima."""
    of: str = ""
    """What the meaning is said of, such as a method on a task."""
    origin: str = ""
    """What a value without cells is, such as published in the paper."""

    def __post_init__(self) -> None:
        if not (self.macro.isascii() and self.macro.isalpha()):
            raise ValueError(f"macro {self.macro!r}: letters alone")

    def companions(self) -> Iterator[tuple[str, str]]:
        """What follows the macro's name, first nothing, with the text that it stands for."""
        yield "", self.text(self.value)
        if not math.isnan(self.sd):
            yield "SD", self.text(self.sd)
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

    def text(self, value: float) -> str:
        """A value with this number's decimals; never minus zero."""
        shown = f"{value:.{self.digits}f}"
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
        _distinct(study.results.tasks), _distinct(dict.fromkeys(label for _, label in study.cells))
    )


def headline_numbers(study: Study) -> list[Number]:
    """Every headline value of a results folder, no two with a macro of the same name."""
    names = macro_names(study)
    found = [
        *_tasks(study, names),
        *_cells(study, names),
        *_conditions(study, names),
        *_hands(study, names),
        *_signatures(study, names),
    ]
    taken: set[str] = set()
    numbers = []
    for number in found:
        # Names of task and method run together: a + b-c and a-b + c are both ABC.
        while any(number.macro + suffix in taken for suffix, _ in number.companions()):
            number = replace(number, macro=f"{number.macro}Alt")
        taken.update(number.macro + suffix for suffix, _ in number.companions())
        numbers.append(number)
    return numbers


def numbers_tex(numbers: Iterable[Number], about: Iterable[str]) -> str:
    """The macros as a LaTeX file. Numbers go through ``\\coarticnum``, which may be redefined."""
    lines = [
        *map(_comment, about),
        "% Intervals are at 95 %; `coartic trace MACRO` says how they were made, of which runs.",
        "% Redefine \\coarticnum to print numbers your way, with siunitx for example:",
        "%   \\newcommand{\\coarticnum}[1]{\\num{#1}}   before \\input",
        f"\\providecommand{{\\{PREFIX}num}}[1]{{\\ensuremath{{#1}}}}",
    ]
    of = ""
    for number in numbers:
        unit = f", {number.unit}" if number.unit else ""
        how = f"; {number.how}" if number.how and math.isnan(number.low) else ""
        if number.of != of:
            of = number.of
            lines.append(_comment(f"{of}:"))
        lines.append(_comment(f"{number.meaning}{unit}{how}"))
        for suffix, text in number.companions():
            content = number.full(_tex, "$n$") if suffix == "Full" else _tex(text)
            lines.append(f"\\newcommand{{\\{number.macro}{suffix}}}{{{content}}}")
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    return f"% {one_line(text)}"


def _tex(number: str) -> str:
    return f"\\{PREFIX}num{{{number}}}"


def _distinct(names: Iterable[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in names:
        word = words(name)
        while word in found.values():
            word += "Alt"
        found[name] = word
    return found


def _how(found: Inference) -> str:
    """The method where it gave an interval, else why there is none."""
    if math.isnan(found.low):
        return "one run" if found.n == (1,) else found.note or found.method
    return "; ".join(filter(None, (found.method, found.note)))


@dataclass(frozen=True)
class _About:
    """What several numbers are said of: they share the beginning of their macros and cells."""

    stem: str
    of: str
    cells: tuple[Cell, ...] = ()

    def value(self, what: str, meaning: str, value: float, digits: int, unit: str) -> Number:
        macro = f"{PREFIX}{self.stem}{what}"
        return Number(macro, meaning, value, digits, unit, cells=self.cells, of=self.of)

    def inferred(
        self, what: str, meaning: str, found: Inference, digits: int, unit: str
    ) -> Number:
        number = self.value(what, meaning, found.estimate, digits, unit)
        n, how = sum(found.n), _how(found)
        return replace(number, low=found.low, high=found.high, n=n, how=how)


def _tasks(study: Study, names: Names) -> Iterator[Number]:
    for task in study.tasks:
        about = _About(names.tasks[task], task)
        for arm, suffix in (("free", "Optimum"), ("still", "OptimumStill")):
            best = study.optima.get((task, arm))
            if best is not None:
                meaning = f"best reward known, other arm {arm}"
                number = about.value(suffix, meaning, best.reward, 0, "ticks")
                origin = "" if best.cells else f"the optimum of the {SHIPPED}"
                yield replace(number, how=best.how, cells=best.cells, origin=origin)
        printed = published_initial(task)
        if printed is not None:
            meaning = "published reward of the initial solution"
            number = about.value("PublishedInitialReward", meaning, printed[1], 0, "ticks")
            yield _published(number, _INITIAL[task], derived=printed[2])


def _published(number: Number, condition: int, *, derived: bool) -> Number:
    """The number with how the paper gives it, and its place there."""
    how = "derived from other printed numbers" if derived else "printed"
    place = f"Results, Exploration Condition {condition}"
    origin = f"published in the paper (Shah, Barto & Fagg, 2013; {place})"
    return replace(number, how=f"{how}; {place}", origin=origin, cells=())


def _cells(study: Study, names: Names) -> Iterator[Number]:
    """Of every cell with a solution; with parameters of their own the reward only."""
    for (task, label), cell in study.cells.items():
        if not len(cell.good):
            continue
        stem = names.tasks[task] + names.labels[label]
        about = _About(stem, f"{label} on {task}", ((task, label),))
        reward = _reward(about, cell)
        yield reward
        if not cell.variant:
            yield from _gaps(study, about, reward)
            yield from _spent(about, cell)
            yield from _learner(about, cell)


def _reward(about: _About, cell: CellRuns) -> Number:
    rewards = cell.good.reward.to_numpy(dtype=np.float64)
    solved = "" if len(cell.good) == len(cell.runs) else f" ({len(cell.runs)} runs, some failed)"
    found = mean(rewards, seed=SEED)
    number = about.inferred("Reward", f"mean learned reward{solved}", found, 1, "ticks")
    return replace(number, sd=sd(rewards))


def _gaps(study: Study, about: _About, reward: Number) -> Iterator[Number]:
    """From the mean reward to the optimum, and to that with the other arm still if it is lower."""
    ((task, label),) = about.cells
    row = study.method_rows[task, label]
    free, still = (study.optima.get((task, arm)) for arm in ("free", "still"))
    gaps = []
    if free is not None and not math.isnan(row.gap):
        gaps.append(("Gap", "gap to the optimum", free))
    lower = still is not None and (free is None or still.reward != free.reward)
    if still is not None and lower and not math.isnan(row.gap_still):
        gaps.append(("GapStill", "gap to the optimum, other arm still", still))
    for what, meaning, best in gaps:
        units = [("", 1.0, "ticks")]
        if best.reward:
            units.append(("Percent", 100 / -best.reward, "% of the optimum"))
        for suffix, scale, unit in units:
            gap = (best.reward - reward.value) * scale
            yield replace(
                about.value(f"{what}{suffix}", meaning, gap, 1, unit),
                low=(best.reward - reward.high) * scale,
                high=(best.reward - reward.low) * scale,
                how=f"{reward.how}; from the optimum {best.reward}: {best.how}",
                cells=tuple(dict.fromkeys([*about.cells, *best.cells])),
            )


def _spent(about: _About, cell: CellRuns) -> Iterator[Number]:
    """Medians of what a run spends."""
    evaluations = "forward kinematics and Jacobians of a run"
    spent = cell.runs.forward_kinematics + cell.runs.jacobians
    for what, meaning, values, digits, unit in (
        ("Trials", "physical trials of a run", cell.runs.trials, 0, "trials"),
        ("Evaluations", evaluations, spent, 0, "evaluations"),
        ("SolveSeconds", "wall time of solving", solve_times(cell.good), 3, "s"),
    ):
        known = values.dropna()
        if len(known):
            median = float(known.median())
            number = about.value(what, f"median of {meaning}", median, digits, unit)
            yield replace(number, n=len(known) if len(known) != len(cell.good) else None)


def _learner(about: _About, cell: CellRuns) -> Iterator[Number]:
    """What the paper's learner begins with, and what the paper prints of it."""
    if not cell.method.startswith(LEARNER):
        return
    initial = cell.good.initial_reward.dropna().unique()
    if len(initial) == 1:
        meaning = "reward of the initial solution"
        number = about.value("InitialReward", meaning, float(initial[0]), 0, "ticks")
        yield replace(number, how="deterministic")
    condition = cell.method.removeprefix(LEARNER)
    printed = published_cell(cell.task, condition)
    if printed is not None and printed.summary is not None:
        summary = printed.summary
        number = about.value("PublishedReward", "published mean reward", summary.mean, 1, "ticks")
        spread = math.nan if summary.sd is None else summary.sd
        number = replace(number, sd=spread, n=summary.runs)
        yield _published(number, int(condition.removeprefix("EC")), derived=summary.derived)


def _conditions(study: Study, names: Names) -> Iterator[Number]:
    """Each condition of the learner against the others of its task that explore less."""
    by_task: dict[str, list[str]] = {}
    for task, label in study.cells:
        if label.startswith(LEARNER) and label.removeprefix(LEARNER) in ("EC2", "EC3", "EC4"):
            by_task.setdefault(task, []).append(label)
    for task, labels in by_task.items():
        for lower, higher in itertools.combinations(sorted(labels), 2):
            cells = ((task, higher), (task, lower))
            a, b = (study.cells[key].good.reward.to_numpy(dtype=np.float64) for key in cells)
            if not len(a) or not len(b):
                continue
            stem = f"{names.tasks[task]}{names.labels[higher]}Minus{names.labels[lower]}"
            about = _About(stem, f"{higher} less {lower} on {task}", cells)
            apart = difference_of_means(a, b, seed=SEED)
            yield about.inferred("Reward", "difference of mean rewards", apart, 1, "ticks")
            better = probability_of_improvement(a, b, seed=SEED)
            yield about.inferred("Improvement", "probability of improvement", better, 2, "")


def _hands(study: Study, names: Names) -> Iterator[Number]:
    """How many of the learner's runs found each hand sequence."""
    for (task, label), cell in study.cells.items():
        if not label.startswith(LEARNER) or cell.variant or len(study.tasks[task].hands) < 2:
            continue
        stem = f"{names.tasks[task]}{names.labels[label]}Hands"
        about = _About(stem, f"{label} on {task}", ((task, label),))
        for hands, count in cell.good.hands.value_counts(sort=False).sort_index().items():
            found = words(str(hands)), f"runs that learned {hands}"
            number = about.value(*found, float(count), 0, "runs")
            yield replace(number, how=f"of {len(cell.good)} with a solution")


def _signatures(study: Study, names: Names) -> Iterator[Number]:
    places: dict[tuple[str, str, str], list[SignatureRow]] = {}
    for row in study.signature_rows:
        if REGISTER[row.signature].macro and not row.variant and not math.isnan(row.value):
            places.setdefault((row.task, row.label, row.signature), []).append(row)
    for (task, label, name), rows in places.items():
        if len(rows) > 1:  # several places: a table's, not a headline
            continue
        (row,) = rows
        signature = REGISTER[name]
        other = (row.place.against, label)
        place = f" ({row.place})" if str(row.place) else ""
        yield Number(
            f"{PREFIX}{names.tasks[task]}{names.labels[label]}{signature.macro}",
            f"{name}{place}", row.value, 2, signature.unit.removesuffix(PER_DIMENSION),
            row.low, row.high,
            n=row.n if row.n != len(study.cells[task, label].good) else None,
            how="docs/signatures.md",
            cells=((task, label), *([other] if other in study.cells else [])),
            of=f"{label} on {task}",
        )  # fmt: skip
