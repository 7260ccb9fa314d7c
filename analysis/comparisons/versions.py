"""Two results folders, cell by cell: what differs between them, and what that does to results.

A cell is a task, a method and its variant. It is compared where both folders have it, the
task is the same in all that movement and scoring depend on, and every run has a solution.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.comparisons.methods import solve_times
from analysis.markup import code, escaped
from analysis.page import Heading, Part, page
from analysis.results.folder import CellRuns, Results, load_results
from analysis.statistics.equivalence import MARGIN, bootstrap_equivalence
from analysis.statistics.estimates import (
    FEWEST,
    SEED,
    bootstrap_test,
    difference_of_means,
    holm,
    paired_by_seed,
    paired_difference,
)
from analysis.table import NONE, Table
from coartic import CoarticError

SPENT = ("trials", "movement_ticks", "forward_kinematics", "jacobians", "solve_s")
"""Spends whose medians are compared; the last one is wall time, s."""
_WORDS = {"title", "description", "provenance"}  # of a task; they change no result
_VERDICTS = (
    ("identical", "identical in every run"),
    ("equivalent", "not identical, equivalent"),
    ("undecided", "undecided"),
    ("different", "different"),
    ("no interval", "not identical, with too few runs for an interval"),
    ("not compared", "not compared"),
)


@dataclass(frozen=True)
class VersionComparison:
    """What :func:`compare_versions` found, ready for a terminal, Markdown and CSV."""

    folders: tuple[Path, Path]
    differing: Table
    """What differs between the folders as a whole."""
    same: list[str]
    """What does not."""
    cells: pd.DataFrame
    """One row per cell of both folders; columns as :func:`cells_frame` says."""
    only: tuple[dict[str, list[str]], dict[str, list[str]]]
    """Cells that one folder alone has: tasks by method with variant."""
    notes: list[str]
    """In inline markup."""

    @property
    def summary(self) -> list[str]:
        """How many cells came out which way."""
        counts = self.cells.verdict.value_counts()
        parts = [f"{counts[key]} {words}" for key, words in _VERDICTS if counts.get(key)]
        lines = [f"{len(self.cells)} cells in both: {', '.join(parts) or 'nothing to compare'}."]
        for side, tasks in zip("AB", self.only, strict=True):
            if tasks:
                lines.append(f"{sum(map(len, tasks.values()))} cells only in {side}.")
        return lines

    @property
    def table(self) -> Table:
        """The cells as text, in the order of A's plan."""
        return Table(
            "Cells of both folders",
            (
                "task",
                "method",
                "A: mean (n)",
                "B: mean (n)",
                "identical runs",
                "B − A [95 %]",
                "adjusted p",
                f"verdict (margin ±{MARGIN:.0%})",
                "trials",
                "ticks",
                "kinematics",
                "Jacobians",
                "solve s",
                "remarks",
            ),
            tuple(_text(row) for row in self.cells.to_dict("records")),
        )

    def to_markdown(self) -> str:
        """The whole page."""
        first, second = self.folders
        parts: list[Part] = [
            Heading(1, "Two sets of results"),
            f"A: {code(str(first))}. B: {code(str(second))}.",
            self.summary,
            Heading(2, self.differing.title),
            self.differing if self.differing.rows else "Nothing.",
            f"The same: {', '.join(self.same) or 'nothing'}.",
            Heading(2, self.table.title),
            self.table,
            self.notes,
        ]
        for side, tasks in zip("AB", self.only, strict=True):
            if tasks:
                parts.append(Heading(2, f"Cells only in {side}"))
                parts.append([escaped(f"{name}: {', '.join(on)}") for name, on in tasks.items()])
        return page(parts)


def load_pair(first: Path, second: Path) -> tuple[Results, Results]:
    """Two results folders that can be compared.

    Raises CoarticError for one folder given twice, and for one that is no results folder,
    is damaged or has another format (:func:`~analysis.results.folder.load_results`).
    """
    if first.exists() and second.exists() and first.samefile(second):
        raise CoarticError(
            f"{first} and {second} are one folder: name two, such as results/old results/new"
        )
    return load_results(first), load_results(second)


def compare_versions(first: Results, second: Results) -> VersionComparison:
    """Everything that differs between A (``first``) and B (``second``)."""
    differing, same = _surroundings(first, second)
    here, there = _cells(first), _cells(second)
    return VersionComparison(
        (first.folder, second.folder),
        differing,
        same,
        cells_frame(first, second),
        (_only(here, there), _only(there, here)),
        _notes(first, second),
    )


def cells_frame(first: Results, second: Results) -> pd.DataFrame:
    """One row per cell that both folders have, in the order of the first one's plan.

    ``n_*`` runs, ``solved_*`` those with a solution, ``mean_*`` reward; ``shared`` seeds and
    ``identical`` runs among them: the same status, joints, ticks and rewards of all trials.
    ``difference`` is the mean of B less that of A with its 95 % BCa interval (``low``,
    ``high``), ``paired`` by seed where at least three are shared; ``p`` is of the two-sided
    bootstrap test, ``p_adjusted`` after Holm over all cells tested. ``verdict`` is
    ``identical`` (every run), ``equivalent``, ``undecided`` or ``different``
    (:class:`~analysis.statistics.equivalence.Equivalence`, ``margin`` in ticks), ``no interval``
    (fewer than three runs) or ``not compared`` (``remarks`` say why). ``SPENT_*`` are medians
    over runs, time in s.
    """
    here, there = _cells(first), _cells(second)
    tasks = _differing_tasks(first, second)
    code = _codes(first), _codes(second)
    rows = []
    for key, cell in here.items():
        if key not in there:
            continue
        row = _row(cell, there[key], tasks.get(cell.task))
        if code[0][cell.method] != code[1][cell.method]:
            row["remarks"] = "; ".join(filter(None, [row["remarks"], "other code"]))
        rows.append(row)
    frame = pd.DataFrame(rows, columns=_COLUMNS)
    return frame.assign(p_adjusted=holm(frame.p.astype(float).tolist()))


_COLUMNS = [
    *("task", "method", "variant", "n_a", "n_b", "solved_a", "solved_b", "mean_a", "mean_b"),
    *("shared", "identical", "paired", "difference", "low", "high", "p", "p_adjusted"),
    *("margin", "verdict"),
    *(f"{name}_{side}" for name in SPENT for side in "ab"),
    "remarks",
]


def _row(first: CellRuns, second: CellRuns, task: list[str] | None) -> dict[str, Any]:
    a, b = first.good, second.good
    both = first.runs.merge(second.runs, on="seed", suffixes=("_a", "_b"), validate="1:1")
    same = both.result_a == both.result_b
    row: dict[str, Any] = {
        "task": first.task,
        "method": first.method,
        "variant": first.variant,
        "n_a": len(first.runs),
        "n_b": len(second.runs),
        "solved_a": len(a),
        "solved_b": len(b),
        "shared": len(both),
        "identical": int(same.sum()),
        "verdict": "not compared",
        "remarks": _parameters(first, second),
    }
    if task is not None:  # the rewards of two tasks say nothing of each other
        return row | {
            "identical": 0,
            "remarks": f"the tasks of this name differ: {', '.join(task)}",
        }
    failed = [
        f"{side} solved {len(good)} of {len(cell.runs)}"
        for side, good, cell in (("A", a, first), ("B", b, second))
        if len(good) < len(cell.runs) or not len(good)
    ]
    if failed:
        return row | {"remarks": "; ".join(filter(None, [*failed, row["remarks"]]))}
    row["mean_a"], row["mean_b"] = float(a.reward.mean()), float(b.reward.mean())
    row |= {
        f"{name}_{side}": _spent(runs, name)
        for name in SPENT
        for side, runs in zip("ab", (a, b), strict=True)
    }
    everything = row["identical"] == len(a) == len(b)
    return row | (_EQUAL if everything else _difference(a, b))


_EQUAL = {"verdict": "identical", "paired": True, "difference": 0.0}


def _difference(a: pd.DataFrame, b: pd.DataFrame) -> dict[str, Any]:
    """Difference of mean rewards, B less A, with interval, test and verdict."""
    before, after = paired_by_seed(a, b)
    paired = len(before) >= FEWEST
    if paired:
        interval = paired_difference(after, before, seed=SEED)
        samples: tuple[Any, Any] = (after - before, 0.0)
    else:
        before, after = (runs.reward.to_numpy(dtype=np.float64) for runs in (a, b))
        interval = difference_of_means(after, before, seed=SEED)
        samples = (after, before)
    found = {
        "paired": paired,
        "difference": interval.estimate,
        "low": interval.low,
        "high": interval.high,
        "p": bootstrap_test(*samples, "two-sided", seed=SEED).p,
        "verdict": "no interval",
    }
    margin = MARGIN * abs(float(a.reward.mean()))
    if margin and min(len(before), len(after)) >= FEWEST:
        agreed = bootstrap_equivalence(*samples, margin, seed=SEED)
        # Where most pairs are equal, resamples without any spread leave it without an end.
        if not math.isfinite(agreed.low) or not math.isfinite(agreed.high):
            agreed = replace(agreed, low=interval.low, high=interval.high)
        found |= {"margin": margin, "verdict": agreed.verdict}
    return found


def _spent(runs: pd.DataFrame, name: str) -> float:
    values = (solve_times(runs) if name == "solve_s" else runs[name]).dropna()
    return float(values.median()) if len(values) else math.nan


def _cells(results: Results) -> dict[tuple[str, str], CellRuns]:
    """Cells by task and label; a cell that the plan names twice has its runs once."""
    return {
        (cell.task, cell.label): replace(cell, runs=cell.runs.drop_duplicates("run_id"))
        for cell in results.cells
    }


def _only(
    cells: dict[tuple[str, str], CellRuns], others: dict[tuple[str, str], CellRuns]
) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for task, label in cells:
        if (task, label) not in others:
            found.setdefault(label, []).append(task)
    return found


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


def _differing_tasks(first: Results, second: Results) -> dict[str, list[str]]:
    """Tasks of one name, and the keys in which they differ."""
    here, there = _tasks(first), _tasks(second)
    found = {}
    for name in here.keys() & there.keys():
        keys = sorted(here[name].keys() | there[name].keys())
        differing = [key for key in keys if here[name].get(key) != there[name].get(key)]
        if differing:
            found[name] = differing
    return found


def _tasks(results: Results) -> dict[str, dict[str, Any]]:
    """What movement and scoring depend on in each task."""
    return {
        name: {key: value for key, value in task.items() if key not in _WORDS}
        for name, task in results.manifest.specification.tasks.items()
    }


def _codes(results: Results) -> dict[str, str]:
    methods = results.manifest.specification.methods
    return {name: method.code for name, method in methods.items()}


def _surroundings(first: Results, second: Results) -> tuple[Table, list[str]]:
    """What was asked for and where it was run: a table of what differs, and what does not."""
    a, b = _facts(first), _facts(second)
    rows = [(name, a[name], b[name]) for name in a if a[name] != b[name]]
    same = [name for name in a if a[name] and a[name] == b[name]]
    for what, kinds, ours, theirs in (
        ("task", "tasks", *_task_texts(first, second)),
        ("code of", "methods", _codes(first), _codes(second)),
        ("library", "libraries", _packages(first), _packages(second)),
    ):
        shared = [name for name in ours if name in theirs]
        differing = [name for name in shared if ours[name] != theirs[name]]
        rows += [(f"{what} {name}", ours[name], theirs[name]) for name in differing]
        here, there = (
            ", ".join(name for name in side if name not in shared) for side in (ours, theirs)
        )
        if here or there:
            rows.append((f"{kinds} of one folder only", here, there))
        if shared:
            count = f"{len(shared) - len(differing)} of {len(shared)} shared {kinds}"
            same.append(f"code of {count}" if what == "code of" else count)
    text = tuple((what, here or NONE, there or NONE) for what, here, there in rows)
    return Table("What differs", ("what", "A", "B"), text), same


def _facts(results: Results) -> dict[str, str]:
    specification, limits = results.manifest.specification, results.manifest.limits
    environment = results.manifest.environment
    commit = environment.commit
    facts = {
        **{name: getattr(specification, name) for name in ("suite", "seed", "runs", "trials")},
        "time limit (s)": limits.time_s,
        "trial budget": limits.trials,
        "rows of runs.parquet": len(results.runs),
        "coartic": environment.coartic,
        "code of the model": environment.model_code,
        "commit": commit and commit.id[:12] + "+" * commit.dirty,
        "commits of the runs": _list(
            text[:12] + "+" * text.endswith("+") for text in results.runs.commit.dropna()
        ),
        "library versions of the runs": _list(results.runs["packages"].dropna()),
        **{
            name: getattr(environment, name)
            for name in ("python", "platform", "processor", "cores")
        },
    }
    return {name: "" if value is None else str(value) for name, value in facts.items()}


def _task_texts(first: Results, second: Results) -> tuple[dict[str, str], dict[str, str]]:
    """By task the keys, with their values, in which it differs from the other of its name."""
    differing = _differing_tasks(first, second)
    here, there = (
        {
            name: ", ".join(f"{key} {task.get(key)}" for key in differing.get(name, ()))
            for name, task in _tasks(results).items()
        }
        for results in (first, second)
    )
    return here, there


def _packages(results: Results) -> dict[str, str]:
    return results.manifest.environment.packages


def _list(values: Iterable[Any]) -> str:
    return ", ".join(sorted(set(map(str, values))))


def _notes(first: Results, second: Results) -> list[str]:
    notes = [
        "A cell is identical where all its runs are, and is not tested then.",
        "B − A: difference of mean rewards (more is better) with its BCa interval, paired by "
        f"seed where at least {FEWEST} seeds are shared (marked ‖), of independent runs "
        "otherwise. p: two-sided bootstrap test, Holm over the cells tested here. Verdict: by "
        f"the studentised bootstrap interval beside ±{MARGIN:.0%} of A's mean "
        "(docs/statistics.md), by the BCa interval where so many runs are equal that the former "
        "has no end; a difference can be real (small p) and within the margin.",
        "Trials, ticks, kinematics, Jacobians and solve time: B's median over A's. Times "
        "compare code only where processor and load were the same.",
        "Cells with a run that has no solution are not compared: a mean of the others would "
        "flatter whichever side failed on the harder runs.",
        "Identical runs have the same status, the same solution to the last joint and tick, and "
        "the same reward in every trial. Both folders were checked against their records, whose "
        "solutions were executed again; `coartic reproduce RUN_ID` performs a whole run again.",
    ]
    for side, results in zip("AB", (first, second), strict=True):
        planned = set(results.runs.run_id)
        keys = {run_id.partition("-")[0] for run_id in planned}
        stale = sum(
            path.stem not in planned and path.stem.partition("-")[0] in keys
            for path in (results.folder / "records").glob("*.json")
        )
        if stale:
            notes.append(f"{side}: {stale} records were made by other code and have no part here.")
    return notes


def _text(row: dict[Any, Any]) -> tuple[str, ...]:
    def mean(side: str) -> str:
        value = row[f"mean_{side}"]
        return f"{NONE if math.isnan(value) else f'{value:.1f}'} ({row[f'solved_{side}']})"

    difference = NONE
    if not math.isnan(row["difference"]):
        difference = f"{row['difference']:+.1f}" if row["difference"] else "0"
        if not math.isnan(row["low"]):
            difference += f" [{row['low']:+.1f}, {row['high']:+.1f}]"
            difference += " ‖" if row["paired"] else ""
    return (
        row["task"],
        f"{row['method']} {row['variant']}".strip(),
        mean("a"),
        mean("b"),
        f"{row['identical']} of {row['shared']}" if row["shared"] else "no seed shared",
        difference,
        NONE if math.isnan(row["p_adjusted"]) else f"{row['p_adjusted']:.2g}",
        row["verdict"],
        *(_ratio(row[f"{name}_a"], row[f"{name}_b"]) for name in SPENT),
        row["remarks"] or NONE,
    )


def _ratio(a: float, b: float) -> str:
    """B over A; both numbers where one of them is 0."""
    if math.isnan(a) or math.isnan(b) or a == b == 0:
        return NONE
    if not a or not b:
        return f"{a:.3g} → {b:.3g}"
    return f"{b / a:.3g}"
