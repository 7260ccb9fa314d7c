"""A results folder with what is computed of it, each once: for claims, tables and figures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from analysis.comparisons.frontier import pareto_frame
from analysis.comparisons.methods import methods_frame
from analysis.comparisons.progress import Progress, progress
from analysis.results.folder import CellRuns, Results
from analysis.results.optima import Optimum, optima
from analysis.signatures import signatures_frame
from analysis.signatures.cell import Cell, cells_of

SEED = 0
"""Of every resampling; it has nothing to do with the seeds of the runs."""


@dataclass(frozen=True)
class Study:
    """Stored results and what follows from them. Keys are a task's name and a label.

    A label is a method with its variant, as :attr:`analysis.results.folder.CellRuns.label`.
    """

    results: Results

    @cached_property
    def cells(self) -> dict[tuple[str, str], CellRuns]:
        """Rows of the runs, in the order of the plan."""
        return {(cell.task, cell.label): cell for cell in self.results.cells}

    @cached_property
    def trajectories(self) -> dict[tuple[str, str], Cell]:
        """Solutions tick by tick."""
        return {
            (cell.task.name, f"{cell.method} {cell.variant}".strip()): cell
            for cell in cells_of(self.results)
        }

    @cached_property
    def signatures(self) -> pd.DataFrame:
        """:func:`analysis.signatures.signatures_frame` with a column ``label``."""
        frame = signatures_frame(self.results, list(self.trajectories.values()), seed=SEED)
        return frame.assign(label=(frame.method + " " + frame.variant).str.strip())

    @cached_property
    def methods(self) -> dict[tuple[str, str], dict[str, Any]]:
        """Rows of :func:`analysis.comparisons.methods.methods_frame`."""
        return {
            (row["task"], f"{row['method']} {row['variant']}".strip()): {
                str(key): value for key, value in row.items()
            }
            for row in methods_frame(self.results).to_dict("records")
        }

    @cached_property
    def optima(self) -> dict[tuple[str, str], Optimum]:
        """Best known solutions by task and other arm (``free``, ``still``)."""
        return optima(self.results)

    @cached_property
    def pareto(self) -> pd.DataFrame:
        """:func:`analysis.comparisons.frontier.pareto_frame`, a bootstrap."""
        return pareto_frame(self.results)

    @cached_property
    def steps(self) -> dict[str, Progress]:
        """Best reward so far of every run, by run id."""
        return dict(progress(self.results))
