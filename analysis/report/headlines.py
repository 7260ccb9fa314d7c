"""Which values of a results folder a paper may print: rewards, gaps, spends, hands, signatures.

Cells with parameters that differ from the method's defaults have their reward only.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import TypeAdapter

from coartic.analysis.comparisons.methods import solve_times
from coartic.analysis.methods import LEARNER
from coartic.analysis.published import published_cell, published_initial
from coartic.analysis.report.document import CellKey
from coartic.analysis.report.numbers import ORIGINS, PREFIX, Names, Number, macro_names, words
from coartic.analysis.results.folder import CellRuns
from coartic.analysis.signatures.register import PER_DIMENSION, REGISTER
from coartic.analysis.signatures.rows import SignatureRow
from coartic.analysis.statistics.estimates import (
    Inference,
    difference_of_means,
    mean,
    probability_of_improvement,
)
from coartic.analysis.statistics.spread import sd
from coartic.analysis.study import Study
from coartic.analysis.words import stated

Kind = tuple[str, int, str]
"""Meaning, decimals and unit."""
_KINDS = TypeAdapter(dict[str, Kind]).validate_python(stated(__file__))
"""By the end of the macro's name."""


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
    cells: tuple[CellKey, ...] = ()

    def value(self, what: str, value: float, kind: Kind | None = None, **known: Any) -> Number:
        """``kind``: of :data:`_KINDS` by default; ``known``: further fields of the number."""
        meaning, digits, unit = kind or _KINDS[what]
        fields = {"digits": digits, "unit": unit, "cells": self.cells, "of": self.of, **known}
        return Number(f"{PREFIX}{self.stem}{what}", meaning, value, **fields)

    def inferred(self, what: str, found: Inference, kind: Kind, **known: Any) -> Number:
        interval = {"low": found.low, "high": found.high, "n": sum(found.n), "how": _how(found)}
        return self.value(what, found.estimate, kind, **interval, **known)


def _of(names: Names, *cells: CellKey) -> _About:
    """What is said of the first of the cells."""
    task, label = cells[0]
    return _About(names.tasks[task] + names.labels[label], f"{label} on {task}", cells)


def _tasks(study: Study, names: Names) -> Iterator[Number]:
    for task in study.tasks:
        about = _About(names.tasks[task], task)
        for arm, what in (("free", "Optimum"), ("still", "OptimumStill")):
            best = study.optima.get((task, arm))
            if best is not None:
                origin = "" if best.cells else ORIGINS["optimum"]
                yield about.value(what, best.reward, how=best.how, cells=best.cells, origin=origin)
        printed = published_initial(task)
        if printed is not None:
            source = _published(printed.place, "derived" if printed.derived else "paper")
            yield about.value("PublishedInitialReward", printed.reward, **source)


def _published(place: str, source: Literal["paper", "derived"]) -> dict[str, Any]:
    """How the paper gives a number, and its place there."""
    origin = f"{ORIGINS[source]}; {place}"
    return {"how": origin, "origin": origin, "cells": ()}


def _cells(study: Study, names: Names) -> Iterator[Number]:
    """Of every cell with a solution; with parameters of their own the reward only."""
    for (task, label), cell in study.cells.items():
        if not len(cell.good):
            continue
        about = _of(names, (task, label))
        reward = _reward(about, cell)
        yield reward
        if not cell.variant:
            yield from _gaps(study, about, reward)
            yield from _spent(about, cell)
            yield from _learner(about, cell)


def _reward(about: _About, cell: CellRuns) -> Number:
    solved = "" if len(cell.good) == len(cell.runs) else f" ({len(cell.runs)} runs, some failed)"
    found = mean(cell.rewards)
    kind = (f"mean learned reward{solved}", 1, "ticks")
    return about.inferred("Reward", found, kind, sd=sd(cell.rewards))


def _gaps(study: Study, about: _About, reward: Number) -> Iterator[Number]:
    """From the mean reward to the optimum, and to that with the other arm still if it is lower."""
    ((task, label),) = about.cells
    row = study.method_rows[task, label]
    free, still = (study.optima.get((task, arm)) for arm in ("free", "still"))
    gaps = [("Gap", free, row.gap)]
    if still is not None and (free is None or still.reward != free.reward):
        gaps.append(("GapStill", still, row.gap_still))
    for what, best, known in gaps:
        if best is None or math.isnan(known):
            continue
        how = f"{reward.how}; from the optimum {best.reward}: {best.how}"
        cells = tuple(dict.fromkeys([*about.cells, *best.cells]))
        for suffix, scale in (("", 1.0), ("Percent", 100 / -best.reward if best.reward else 0)):
            # The higher the reward, the smaller the gap.
            gap, low, high = (
                (best.reward - value) * scale for value in (reward.value, reward.high, reward.low)
            )
            if scale:
                yield about.value(f"{what}{suffix}", gap, low=low, high=high, how=how, cells=cells)


def _spent(about: _About, cell: CellRuns) -> Iterator[Number]:
    """Medians of what a run spends."""
    for what, values in (
        ("Trials", cell.runs.trials),
        ("Evaluations", cell.runs.forward_kinematics + cell.runs.jacobians),
        ("SolveSeconds", solve_times(cell.good)),
    ):
        known = values.dropna()
        if len(known):
            n = len(known) if len(known) != len(cell.good) else None
            yield about.value(what, float(known.median()), n=n)


def _learner(about: _About, cell: CellRuns) -> Iterator[Number]:
    """What the paper's learner begins with, and what the paper prints of it."""
    if not cell.method.startswith(LEARNER):
        return
    initial = cell.good.initial_reward.dropna().unique()
    if len(initial) == 1:
        alone: dict[str, Any] = {
            "how": "deterministic",
            "cells": (),
            "origin": ORIGINS["simulation"],
        }
        yield about.value("InitialReward", float(initial[0]), **alone)
    condition = cell.method.removeprefix(LEARNER)
    printed = published_cell(cell.task, condition)
    if printed is not None and printed.summary is not None:
        summary = printed.summary
        place = f"Results, Exploration Condition {condition.removeprefix('EC')}"
        source = _published(place, summary.source)
        if summary.source_of_runs == "ours":
            source["how"] += f"; its {summary.runs} runs are an assumption of ours"
        source |= {"sd": math.nan if summary.sd is None else summary.sd, "n": summary.runs}
        if summary.digits is not None:
            source["digits"], source["sd_digits"] = summary.digits
        yield about.value("PublishedReward", summary.mean, **source)


def _conditions(study: Study, names: Names) -> Iterator[Number]:
    """Each condition of the learner against the others of its task that explore less."""
    for task in study.tasks:
        conditions = (f"{LEARNER}EC{number}" for number in (2, 3, 4))
        labels = [label for label in conditions if (task, label) in study.cells]
        for lower, higher in itertools.combinations(labels, 2):
            cells = ((task, higher), (task, lower))
            a, b = (study.cells[key].rewards for key in cells)
            if not len(a) or not len(b):
                continue
            stem = f"{names.tasks[task]}{names.labels[higher]}Minus{names.labels[lower]}"
            about = _About(stem, f"{higher} less {lower} on {task}", cells)
            apart = difference_of_means(a, b)
            yield about.inferred("Reward", apart, ("difference of mean rewards", 1, "ticks"))
            better = probability_of_improvement(a, b)
            yield about.inferred("Improvement", better, ("probability of improvement", 2, ""))


def _hands(study: Study, names: Names) -> Iterator[Number]:
    """How many of the learner's runs found each hand sequence."""
    for (task, label), cell in study.cells.items():
        if not label.startswith(LEARNER) or cell.variant or len(study.tasks[task].hands) < 2:
            continue
        about = _of(names, (task, label))
        for hands, count in cell.good.hands.value_counts(sort=False).sort_index().items():
            kind = f"runs that learned {hands}", 0, "runs"
            how = f"of {len(cell.good)} with a solution"
            yield about.value(f"Hands{words(str(hands))}", float(count), kind, how=how)


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
        about = _of(names, (task, label), *([other] if other in study.cells else []))
        kind = f"{name}{place}", 2, signature.unit.removesuffix(PER_DIMENSION)
        n = row.n if row.n != len(study.cells[task, label].good) else None
        known = {"low": row.low, "high": row.high, "n": n, "how": "docs/signatures.md"}
        yield about.value(signature.macro, row.value, kind, **known)
