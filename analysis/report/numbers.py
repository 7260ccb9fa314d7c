"""Headline values as LaTeX macros, each with what it was computed from.

A value with macro ``\\coarticAscendingECOneReward`` has companions ``...Low`` and ``...High``
(95 % interval), ``...SD``, ``...N`` (runs) and ``...Full`` (value, interval and runs as text), as
far as there are any.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from analysis.published import published_cell, published_initial
from analysis.results import CellRuns
from analysis.statistics import Inference, difference_of_means, mean, probability_of_improvement
from analysis.study import SEED, Study

PREFIX = "coartic"
Cell = tuple[str, str]
"""Task and label."""

_DIGITS = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_LEARNER = "dual-process/"
_SIGNATURES = {
    "first subtask against initial": ("FirstSubtask", "ticks"),
    "context distance": ("ContextDistance", "length unit, rad"),
    "context dependence": ("ContextDependence", "pooled SD"),
    "motor-equivalent part": ("MotorEquivalent", "length unit, rad"),
    "non-motor-equivalent part": ("NonMotorEquivalent", "length unit, rad"),
}


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
    """What it was computed from; none for what the paper prints and for known optima."""

    def macros(self) -> Iterator[tuple[str, str]]:
        """Macros with the text that each stands for: a number, or a sentence's worth."""
        yield self.macro, self.text(self.value)
        if not math.isnan(self.sd):
            yield f"{self.macro}SD", self.text(self.sd)
        if not math.isnan(self.low):
            yield f"{self.macro}Low", self.text(self.low)
            yield f"{self.macro}High", self.text(self.high)
        if self.n is not None:
            yield f"{self.macro}N", str(self.n)

    def text(self, value: float) -> str:
        """A value with this number's decimals; never minus zero."""
        shown = f"{value:.{self.digits}f}"
        return shown.lstrip("-") if float(shown) == 0 else shown


def words(name: str) -> str:
    """A name in letters alone, as LaTeX's macros need: ``two-armed-1`` is ``TwoArmedOne``.

    The paper's conditions are named without their family: ``dual-process/EC1`` is ``ECOne``.
    """
    name = re.sub(r"(?<=\d)[.](?=\d)", " point ", name.removeprefix(_LEARNER))
    parts = re.findall(r"[A-Za-z]+|\d", name)
    return "".join(_DIGITS[int(p)] if p.isdigit() else p[0].upper() + p[1:] for p in parts)


def headline_numbers(study: Study) -> list[Number]:
    """Every headline value of a results folder. Raises ValueError where two names collide."""
    found = [
        *_tasks(study),
        *itertools.chain.from_iterable(
            _cell(study, key, cell) for key, cell in study.cells.items() if len(cell.good)
        ),
        *_conditions(study),
        *_hands(study),
        *_signatures(study),
    ]
    names = [name for number in found for name, _ in number.macros()]
    twice = (
        {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else ()
    )
    if twice:
        raise ValueError(f"macros with the same name: {', '.join(sorted(twice))}")
    return found


def numbers_tex(numbers: Iterable[Number], about: str) -> str:
    """The macros as a LaTeX file. Numbers go through ``\\coarticnum``, which may be redefined."""
    lines = [
        *(f"% {line}" for line in about.splitlines()),
        "% Redefine \\coarticnum to print numbers your way, with siunitx for example:",
        "%   \\newcommand{\\coarticnum}[1]{\\num{#1}}   before \\input",
        f"\\providecommand{{\\{PREFIX}num}}[1]{{\\ensuremath{{#1}}}}",
    ]
    for number in numbers:
        unit = f", {number.unit}" if number.unit else ""
        lines.append(f"% {number.meaning}{unit}" + (f"; {number.how}" if number.how else ""))
        for name, text in number.macros():
            lines.append(f"\\newcommand{{\\{name}}}{{\\{PREFIX}num{{{text}}}}}")
        if not math.isnan(number.low):
            lines.append(f"\\newcommand{{\\{number.macro}Full}}{{{_full(number)}}}")
    return "\n".join(lines) + "\n"


def _full(number: Number) -> str:
    def tex(value: float) -> str:
        return f"\\{PREFIX}num{{{number.text(value)}}}"

    text = f"{tex(number.value)} [{tex(number.low)}, {tex(number.high)}]"
    if number.n is not None:
        text += f" ($n = {number.n}$)"
    return text


def _number(
    macro: str, meaning: str, found: Inference, cells: tuple[Cell, ...], digits: int, unit: str
) -> Number:
    return Number(
        PREFIX + macro, meaning, found.estimate, digits, unit, found.low, found.high,
        n=sum(found.n), how="; ".join(filter(None, (found.method, found.note))), cells=cells,
    )  # fmt: skip


def _tasks(study: Study) -> Iterator[Number]:
    for task in study.results.tasks:
        for arm in ("free", "still"):
            best = study.optima.get((task, arm))
            if best is None:
                continue
            meaning = f"best reward known of {task}, other arm {arm}"
            how = "proven" if best.proven else "not proven"
            macro = f"{PREFIX}{words(task)}Optimum{'' if arm == 'free' else 'Still'}"
            yield Number(macro, meaning, best.reward, 0, "ticks", how=how)
        printed = published_initial(task)
        if printed is not None:
            meaning = f"published reward of the initial solution of {task}"
            how = "derived from other printed numbers" if printed[2] else "printed"
            yield Number(
                f"{PREFIX}{words(task)}PublishedInitialReward", meaning, printed[1], 0, "ticks",
                how=how,
            )  # fmt: skip


def _cell(study: Study, key: Cell, cell: CellRuns) -> Iterator[Number]:
    task, label = key
    name = words(task) + words(label)
    rewards = cell.good.reward.to_numpy(dtype=np.float64)
    found = mean(rewards, seed=SEED)
    who = f"{label} on {task}"
    spread = float(np.std(rewards, ddof=1)) if len(rewards) > 1 else math.nan
    solved = "" if len(cell.good) == len(cell.runs) else f" ({len(cell.runs)} runs, some failed)"
    yield Number(
        f"{PREFIX}{name}Reward", f"mean learned reward, {who}{solved}", found.estimate, 1,
        "ticks", found.low, found.high, spread, len(rewards),
        "; ".join(filter(None, (found.method, found.note))), (key,),
    )  # fmt: skip
    row = study.methods[key]
    for column, macro, arm in (("gap", "Gap", "free"), ("gap_still", "GapStill", "still")):
        if math.isnan(row[column]):
            continue
        best = study.optima[task, arm].reward
        gap = f"gap to the optimum with the other arm {arm}, {who}"
        for suffix, share, unit in (
            ("", 1.0, "ticks"),
            ("Percent", 100 / -best if best else math.nan, "per cent of the optimum"),
        ):
            if not math.isnan(share):
                yield Number(
                    f"{PREFIX}{name}{macro}{suffix}", gap, (best - found.estimate) * share, 1,
                    unit, (best - found.high) * share, (best - found.low) * share,
                    n=len(rewards), how=found.method, cells=(key,),
                )  # fmt: skip
    for what, meaning, value, digits, unit in (
        ("Trials", "physical trials of a run", row["trials"], 0, "trials"),
        (
            "Evaluations",
            "forward kinematics and Jacobians of a run",
            row["forward_kinematics"] + row["jacobians"],
            0,
            "evaluations",
        ),
        ("SolveSeconds", "wall time of solving", row["solve_s"], 3, "s"),
    ):
        if not math.isnan(value):
            yield Number(
                f"{PREFIX}{name}{what}", f"{meaning}, {who}", value, digits, unit,
                n=len(cell.good), how="median over runs", cells=(key,),
            )  # fmt: skip
    if label.startswith(_LEARNER):
        initial = cell.good.initial_reward.dropna().unique()
        if len(initial) == 1:
            yield Number(
                f"{PREFIX}{name}InitialReward", f"reward of the initial solution, {who}",
                float(initial[0]), 0, "ticks", how="deterministic", cells=(key,),
            )  # fmt: skip
        printed = published_cell(task, label.removeprefix(_LEARNER))
        if printed is not None and printed.summary is not None:
            summary = printed.summary
            yield Number(
                f"{PREFIX}{name}PublishedReward", f"published mean reward, {who}", summary.mean,
                1, "ticks", sd=math.nan if summary.sd is None else summary.sd, n=summary.runs,
                how="derived from other printed numbers" if summary.derived else "printed",
            )  # fmt: skip


def _conditions(study: Study) -> Iterator[Number]:
    """Each condition of the learner against the others of its task that explore less."""
    by_task: dict[str, list[str]] = {}
    for task, label in study.cells:
        if label.startswith(_LEARNER) and label.removeprefix(_LEARNER) in ("EC2", "EC3", "EC4"):
            by_task.setdefault(task, []).append(label)
    for task, labels in by_task.items():
        for lower, higher in itertools.combinations(sorted(labels), 2):
            cells = ((task, higher), (task, lower))
            a, b = (study.cells[key].good.reward.to_numpy(dtype=np.float64) for key in cells)
            if not len(a) or not len(b):
                continue
            name = f"{words(task)}{words(higher)}Minus{words(lower)}"
            what = f"{higher} less {lower} on {task}"
            apart = difference_of_means(a, b, seed=SEED)
            yield _number(
                f"{name}Reward", f"difference of mean rewards, {what}", apart, cells, 1, "ticks"
            )
            better = probability_of_improvement(a, b, seed=SEED)
            yield _number(
                f"{name}Improvement", f"probability of improvement, {what}", better, cells, 2, ""
            )


def _hands(study: Study) -> Iterator[Number]:
    """How many of the learner's runs found each hand sequence."""
    for key, cell in study.cells.items():
        task, label = key
        if not label.startswith(_LEARNER) or len(study.results.tasks[task].hands) < 2:
            continue
        for hands, count in cell.good.hands.value_counts(sort=False).sort_index().items():
            yield Number(
                f"{PREFIX}{words(task)}{words(label)}Hands{hands}",
                f"runs that learned {hands}, {label} on {task}", float(count), 0, "runs",
                how=f"of {len(cell.good)} with a solution", cells=(key,),
            )  # fmt: skip


def _signatures(study: Study) -> Iterator[Number]:
    frame = study.signatures
    frame = frame[frame.signature.isin(list(_SIGNATURES)) & frame.value.notna()]
    for (task, label, signature), rows in frame.groupby(
        ["task", "label", "signature"], sort=False
    ):
        row = rows.iloc[0]
        where = str(row["where"])
        other = re.search(r"against ([^,]+)", where)
        cells = [(str(task), str(label))]
        if other is not None:
            cells.append((other[1], str(label)))
        what, unit = _SIGNATURES[str(signature)]
        yield Number(
            f"{PREFIX}{words(str(task))}{words(str(label))}{what}",
            f"{signature} ({where}), {label} on {task}", float(row["value"]), 2, unit,
            float(row["low"]), float(row["high"]), n=int(row["n"]),
            how="docs/signatures.md", cells=tuple(cells),
        )  # fmt: skip
