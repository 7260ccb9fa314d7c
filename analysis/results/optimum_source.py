"""Where the optimum of a task comes from: this folder's searches, or the shipped data."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.results.laws import BASE
from analysis.results.optima import DATA, METHODS, entries, essence, optima
from analysis.results.folder import CellRuns, Results

SHIPPED = f"shipped data (analysis/results/{DATA.name})"


@dataclass(frozen=True)
class OptimumSource:
    """What the best reward known of one task, under one restriction, rests on."""

    reward: int
    how: str
    """Whether it is proven, and by which runs."""
    cells: tuple[tuple[str, str], ...]
    """Task and label of the folder's own searches that give the reward or its bound."""


def optimum_sources(results: Results) -> dict[tuple[str, str], OptimumSource]:
    """Sources of :func:`analysis.results.optima.optima`, by task and other arm (``free``, ``still``).

    The folder's own searches come first: shipped data are named for what those do not give.
    """
    shipped = {
        (entry["essence"], entry["other_arm"]): entry["run_ids"]
        for entry in entries()
        if entry["base"] == BASE and "reward" in entry
    }
    found = {}
    for (task, arm), best in optima(results).items():
        searches = [
            (cell, _restricted(cell, arm))
            for cell in results.cells
            if cell.task == task and cell.method.startswith(METHODS)
        ]
        kept = {
            what: [(cell.task, cell.label) for cell, runs in searches
                   if value is not None and (runs[column] == value).any()]
            for what, column, value in (
                ("reward", "reward", best.reward), ("bound", "proven_bound", best.bound)
            )
        }  # fmt: skip
        stored = f"{SHIPPED}, runs " + ", ".join(
            shipped.get((essence(results.tasks[task]), arm), ())
        )
        reward, bound = ("searches of this folder" if kept[what] else stored for what in kept)
        where = reward if best.bound is None or reward == bound else (
            f"reward: {reward}; bound: {bound}"
        )  # fmt: skip
        found[task, arm] = OptimumSource(
            best.reward,
            f"{'proven' if best.proven else 'not proven'}; {where}",
            tuple(dict.fromkeys([*kept["reward"], *kept["bound"]])),
        )
    return found


def _restricted(cell: CellRuns, arm: str) -> pd.DataFrame:
    """The cell's solved runs with this other arm and the task's own base."""
    good = cell.good
    asked = [json.loads(text) for text in good.parameters]
    kept = [
        (values.get("base", BASE), values.get("other_arm", "free")) == (BASE, arm)
        for values in asked
    ]
    return good[np.array(kept, dtype=bool)]
