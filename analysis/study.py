"""A results folder as data: its runs, cells, tasks, movements and optima.

``load("results/comparison")`` reads a folder. What is computed from it is a plain function of the
study, in the packages beside this file; :func:`cached` makes such a function compute once a study.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from coartic import MotionModel, Task
from coartic.analysis.results.folder import CellKey, CellRuns, Results, load_results
from coartic.analysis.results.optima import KnownOptimum, known_optima
from coartic.analysis.trajectories import Trajectories, trajectories_of
from coartic.files import folder_named
from coartic.text import counted

Computed = TypeVar("Computed")


def load(folder: str | Path) -> Study:
    """Read a results folder.

    Raises CoarticError as :func:`coartic.analysis.results.folder.load_results` does.
    """
    return Study(load_results(folder_named(folder)))


@dataclass(frozen=True, eq=False)
class Study:
    """The stored results of one folder."""

    results: Results
    _computed: dict[Callable[..., Any], Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        runs, cells = counted(len(self.runs), "run"), counted(len(self.cells), "cell")
        return f"Study of {self.results.folder}: {runs} of suite {self.suite}, {cells}"

    @property
    def suite(self) -> str:
        """Name of the suite that was run."""
        return self.results.manifest.specification.suite

    @property
    def runs(self) -> pd.DataFrame:
        """One row a run: rewards, hand sequences, what was spent (docs/results.md)."""
        return self.results.runs

    @property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name."""
        return self.results.tasks

    @property
    def model(self) -> MotionModel:
        """The constants of movement of all runs."""
        return self.results.manifest.specification.model

    @property
    def sequences(self) -> pd.DataFrame:
        """Reward of the corrective process alone with every hand sequence of each task."""
        return self.results.sequences

    @cached_property
    def cells(self) -> dict[CellKey, CellRuns]:
        """Runs by task and label (method with its variant), in the order of the plan."""
        return self.results.cells

    @cached_property
    def run_ids(self) -> dict[CellKey, tuple[str, ...]]:
        """Ids of the runs of every cell."""
        return {key: tuple(map(str, cell.runs.run_id)) for key, cell in self.cells.items()}

    @cached_property
    def movements(self) -> tuple[dict[str, pd.DataFrame], dict[str, pd.DataFrame]]:
        """Movements of each run's solution, and waypoints of those along a path, by run id."""
        tables = (self.results.solutions(), self.results.paths())
        movements, waypoints = (table[table.run_id.isin(self.runs.run_id)] for table in tables)
        return _by_run(movements), _by_run(waypoints)

    def trajectories(self, task: str, label: str) -> Trajectories:
        """Solutions of a cell, executed again tick by tick, each cell once."""
        key = task, label
        if key not in self._executed:
            self._executed[key] = trajectories_of(
                self.cells[key], self.tasks[task], self.model, self.movements, self.sequences
            )
        return self._executed[key]

    @cached_property
    def _executed(self) -> dict[CellKey, Trajectories]:
        return {}

    @cached_property
    def optima(self) -> dict[tuple[str, str], KnownOptimum]:
        """Best known reward by task and other arm (``"free"``, ``"still"``)."""
        return known_optima(self.results)


def cached(function: Callable[[Study], Computed]) -> Callable[[Study], Computed]:
    """A function of a study that computes its result once for each study."""

    @wraps(function)
    def once(study: Study) -> Computed:
        if function not in study._computed:
            study._computed[function] = function(study)
        result: Computed = study._computed[function]
        return result

    return once


def _by_run(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    return {str(run_id): rows for run_id, rows in table.groupby("run_id")} if len(table) else {}
