"""Two results folders, cell by cell: what differs between them, and what that does to results.

A cell is a task, a method and its variant. It is compared where both folders have it, the
task is the same in all that movement and scoring depend on, and every run has a solution.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import CoarticError
from coartic.analysis.comparisons.methods import MethodRow
from coartic.analysis.comparisons.surroundings import (
    Differing,
    codes,
    differing_tasks,
    surroundings,
)
from coartic.analysis.results.folder import CellRuns
from coartic.analysis.statistics.equivalence import MARGIN, bootstrap_equivalence
from coartic.analysis.statistics.estimates import FEWEST, difference_of_means, paired_by_seed
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm
from coartic.analysis.study import Study, load
from coartic.packs import Packs
from coartic.robot import Array

SPENT = ("trials", "movement_ticks", "forward_kinematics", "jacobians", "solve_s")
"""Spends whose medians are compared."""
VERDICTS = {
    "identical": "identical in every run",
    "equivalent": "not identical, equivalent",
    "undecided": "undecided",
    "different": "different",
    "no interval": "not identical, with too few runs for an interval",
    "not compared": "not compared",
}
"""What becomes of a cell, in words."""


_SIDES = {"n": "runs", "solved": "solved", "mean": "reward", **{name: name for name in SPENT}}
_OF_SIDES = [f"{name}_{side}" for name in _SIDES for side in "ab"]


@dataclass(frozen=True, kw_only=True)
class VersionRow:
    """A cell that both folders have; NaN where there is no number.

    The fields are columns of the table that ``coartic compare --csv`` writes. That has task,
    method and variant as well, and of either side (``_a``, ``_b``) ``n`` runs, ``solved`` with a
    solution, ``mean`` reward in ticks, and medians over runs of what is spent, time in s.
    """

    a: MethodRow
    b: MethodRow
    shared: int
    """Seeds that both have."""
    identical: int
    """Runs among them with the same status, joints, ticks and rewards of all trials."""
    paired: bool | None = None
    """Whether ``difference`` is paired by seed: where at least three are shared."""
    difference: float = math.nan
    """Mean reward of B less that of A."""
    low: float = math.nan
    """Of its 95 % BCa interval."""
    high: float = math.nan
    p: float = math.nan
    """Of the two-sided bootstrap test."""
    p_adjusted: float = math.nan
    """After Holm over all cells tested."""
    margin: float = math.nan
    """Ticks within which the means count as equivalent."""
    verdict: str = "not compared"
    """Of :data:`VERDICTS`; ``remarks`` say why a cell is not compared."""
    remarks: str

    def both(self, name: str) -> tuple[float, float]:
        """A field of A and B; NaN where it is not compared."""
        if self.verdict == "not compared" and name not in ("runs", "solved"):
            return math.nan, math.nan
        return getattr(self.a, name), getattr(self.b, name)

    def columns(self) -> dict[str, Any]:
        """Its values by column."""
        sides = chain.from_iterable(map(self.both, _SIDES.values()))
        return {**vars(self.a), **vars(self), **dict(zip(_OF_SIDES, sides, strict=True))}


@dataclass(frozen=True)
class VersionComparison:
    """What :func:`compare_versions` found."""

    folders: tuple[Path, Path]
    differing: Sequence[Differing]
    """What differs between the folders as a whole."""
    same: Sequence[str]
    """What does not."""
    rows: Sequence[VersionRow]
    """Cells of both folders, in the order of A's plan."""
    only: tuple[dict[str, list[str]], dict[str, list[str]]]
    """Cells that one folder alone has: tasks by method with variant."""
    stale: tuple[int, int]
    """Records in each folder that were made by other code and have no part here."""

    @property
    def cells(self) -> pd.DataFrame:
        """The rows with the columns that :class:`VersionRow` describes."""
        compared = [field.name for field in fields(VersionRow)][2:-1]
        counted, spent = _OF_SIDES[: -2 * len(SPENT)], _OF_SIDES[-2 * len(SPENT) :]
        columns = ["task", "method", "variant", *counted, *compared, *spent, "remarks"]
        return pd.DataFrame([row.columns() for row in self.rows], columns=columns)

    @property
    def summary(self) -> list[str]:
        """How many cells came out which way."""
        found = [row.verdict for row in self.rows]
        counts = {words: found.count(verdict) for verdict, words in VERDICTS.items()}
        parts = [f"{count} {words}" for words, count in counts.items() if count]
        lines = [f"{len(found)} cells in both: {', '.join(parts) or 'nothing to compare'}."]
        for side, tasks in zip("AB", self.only, strict=True):
            if tasks:
                lines.append(f"{sum(map(len, tasks.values()))} cells only in {side}.")
        return lines


def load_pair(first: Path, second: Path) -> tuple[Study, Study]:
    """Two results folders that can be compared.

    Raises CoarticError for one folder given twice, and for one that is no results folder,
    is damaged or has another format (:func:`~coartic.analysis.results.folder.load_results`).
    """
    if first.exists() and second.exists() and first.samefile(second):
        raise CoarticError(
            f"{first} and {second} are one folder: name two, such as results/old results/new"
        )
    return load(first), load(second)


def compare_versions(first: Study, second: Study) -> VersionComparison:
    """Everything that differs between A (``first``) and B (``second``)."""
    differing, same = surroundings(first, second)
    return VersionComparison(
        (first.results.folder, second.results.folder),
        differing,
        same,
        _rows(first, second),
        (_only(first, second), _only(second, first)),
        (_stale(first), _stale(second)),
    )


def _rows(first: Study, second: Study) -> list[VersionRow]:
    """One a cell that both folders have, p-values adjusted over all of them."""
    tasks, ours, theirs = differing_tasks(first, second), codes(first), codes(second)
    rows = []
    for key, cell in first.cells.items():
        if key in second.cells:
            other = ours[cell.method] != theirs[cell.method]
            made = VersionRow(
                a=first.method_rows[key],
                b=second.method_rows[key],
                **_runs(cell, second.cells[key], tasks.get(cell.task), other_code=other),
            )
            rows.append(_compared(made, cell, second.cells[key]))
    adjusted = holm([row.p for row in rows])
    return [replace(row, p_adjusted=p) for row, p in zip(rows, adjusted, strict=True)]


def _runs(
    first: CellRuns, second: CellRuns, differing: list[str] | None, *, other_code: bool
) -> dict[str, Any]:
    """Runs that both have; ``differing``: keys in which the tasks differ, None where in none."""
    ours, theirs = (
        dict(zip(cell.runs.seed, cell.runs.result, strict=True)) for cell in (first, second)
    )
    both = ours.keys() & theirs.keys()
    remarks = [
        f"{side} solved {len(cell.good)} of {len(cell.runs)}"
        for side, cell in (("A", first), ("B", second))
        if len(cell.good) < len(cell.runs) or not len(cell.good)
    ]
    compared = not differing and not remarks
    remarks.append(_parameters(first, second))
    remarks += [] if len(both) else ["no shared seeds"]
    if differing:  # the rewards of two tasks say nothing of each other
        remarks = [f"the tasks of this name differ: {', '.join(differing)}"]
    remarks += ["other code"] if other_code else []
    identical = 0 if differing else sum(ours[seed] == theirs[seed] for seed in both)
    return {
        "shared": len(both),
        "identical": identical,
        "verdict": "no interval" if compared else "not compared",
        "remarks": "; ".join(filter(None, remarks)),
    }


def _compared(row: VersionRow, a: CellRuns, b: CellRuns) -> VersionRow:
    """With the difference of mean rewards, B less A, its interval, test and verdict."""
    if row.verdict == "not compared":
        return row
    # What draws nothing has one result, whatever the seed.
    alike = not row.shared and len({*a.good.result, *b.good.result}) == 1
    if alike or row.identical == len(a.good) == len(b.good):
        return replace(row, verdict="identical", paired=not alike, difference=0.0)
    before, after = paired_by_seed(a.good, b.good)
    paired = len(before) >= FEWEST
    samples: tuple[Array, Array | float] = after - before, 0.0
    if not paired:
        samples = b.rewards, a.rewards
    found = difference_of_means(*samples)
    row = replace(
        row,
        paired=paired,
        difference=found.estimate,
        low=found.low,
        high=found.high,
        p=bootstrap_test(*samples, "two-sided").p,
    )
    margin = MARGIN * abs(row.a.reward)
    if not margin or min(len(a.good), len(b.good)) < FEWEST:
        return row
    agreed = bootstrap_equivalence(*samples, margin)
    # Where most pairs are equal, resamples without any spread leave it without an end.
    if not math.isfinite(agreed.low) or not math.isfinite(agreed.high):
        agreed = replace(agreed, low=found.low, high=found.high)
    return replace(row, margin=margin, verdict=agreed.verdict)


def _only(study: Study, other: Study) -> dict[str, list[str]]:
    """Cells that the other has not."""
    found: dict[str, list[str]] = {}
    for task, label in (key for key in study.cells if key not in other.cells):
        found.setdefault(label, []).append(task)
    return found


def _stale(study: Study) -> int:
    planned = set(study.runs.run_id)
    keys = {run_id.partition("-")[0] for run_id in planned}
    others = (run_id for run_id in Packs(study.results.folder) if run_id not in planned)
    return sum(run_id.partition("-")[0] in keys for run_id in others)


def _parameters(first: CellRuns, second: CellRuns) -> str:
    """Parameters in which the runs of one cell differ: defaults and trials may have changed."""
    if not len(first.runs) or not len(second.runs):
        return ""
    a, b = (json.loads(cell.runs.parameters.iloc[0]) for cell in (first, second))
    return ", ".join(
        f"{name} {a.get(name, 'absent')} → {b.get(name, 'absent')}"
        for name in sorted(a.keys() | b.keys())
        if a.get(name) != b.get(name)
    )
