"""The one entrance to a results folder: its tables, and all that is computed of them, each once.

``load("results/all")`` reads a folder; everything else is a property, computed when it is first
asked for. What computes it takes the study itself, or plain numbers (:mod:`analysis.statistics`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from analysis.claims import Judged, judge, register_table
from analysis.comparisons.anytime import anytime_curves
from analysis.comparisons.areas import areas
from analysis.comparisons.methods import MethodRow, method_rows
from analysis.comparisons.overall import combined, normalised_scores, over_tasks, profiles
from analysis.comparisons.pairs import PairRow, compared, pairs_table
from analysis.comparisons.pareto import pareto_sets
from analysis.comparisons.progress import BestSoFar, best_so_far
from analysis.comparisons.targets import targets
from analysis.results.folder import CellRuns, Results, load_results
from analysis.results.optima import Optimum, optima
from analysis.signatures.rows import SignatureRow
from analysis.signatures.study_rows import signature_rows, signatures_table
from analysis.signatures.trajectories import Trajectories, all_trajectories
from coartic import Task
from coartic.text import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its name with its variant."""


def load(folder: str | Path) -> Study:
    """Read a results folder.

    Raises CoarticError as :func:`analysis.results.folder.load_results` does.
    """
    return Study(load_results(Path(folder)))


@dataclass(frozen=True)
class Study:
    """Stored results and what follows from them."""

    results: Results

    def __repr__(self) -> str:
        runs, cells = counted(len(self.runs), "run"), counted(len(self.cells), "cell")
        suite = self.results.manifest.specification.suite
        return f"Study of {self.results.folder}: {runs} of suite {suite}, {cells}"

    @property
    def runs(self) -> pd.DataFrame:
        """One row a run: rewards, hand sequences, what was spent (docs/results.md)."""
        return self.results.runs

    @property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name."""
        return self.results.tasks

    @cached_property
    def cells(self) -> dict[CellKey, CellRuns]:
        """Rows of the runs, in the order of the plan."""
        return {(cell.task, cell.label): cell for cell in self.results.cells}

    @cached_property
    def run_ids(self) -> dict[CellKey, tuple[str, ...]]:
        """Ids of the runs of every cell."""
        return {key: tuple(map(str, cell.runs.run_id)) for key, cell in self.cells.items()}

    @cached_property
    def trajectories(self) -> dict[CellKey, Trajectories]:
        """Solutions tick by tick."""
        return all_trajectories(self)

    @cached_property
    def optima(self) -> dict[tuple[str, str], Optimum]:
        """Best known solutions by task and other arm (``free``, ``still``)."""
        return optima(self)

    @cached_property
    def method_rows(self) -> dict[CellKey, MethodRow]:
        """Every method on every task: the optimum's searches, then the best mean first."""
        return {(row.task, row.label): row for row in method_rows(self)}

    @cached_property
    def methods(self) -> pd.DataFrame:
        """The same as ``methods.csv`` has them: a column per field."""
        return pd.DataFrame(list(self.method_rows.values()))

    @cached_property
    def pair_rows(self) -> tuple[PairRow, ...]:
        """Methods against each other, one a pair."""
        return compared(self)

    @cached_property
    def pairs(self) -> pd.DataFrame:
        """The same as a table, its columns the fields of
        :class:`~analysis.comparisons.pairs.PairRow`."""
        return pairs_table(self.pair_rows)

    @cached_property
    def scores(self) -> pd.DataFrame:
        """Normalised rewards of every run, labels in place of methods and variants."""
        return combined(normalised_scores(self))

    @cached_property
    def overall(self) -> pd.DataFrame:
        """:func:`analysis.comparisons.overall.over_tasks`: methods over all tasks."""
        return over_tasks(self.scores)

    @cached_property
    def profiles(self) -> pd.DataFrame:
        """:func:`analysis.comparisons.overall.profiles`."""
        return profiles(self.scores)

    @cached_property
    def best_so_far(self) -> Mapping[str, BestSoFar]:
        """Best reward so far of every run, by run id."""
        return best_so_far(self)

    @cached_property
    def anytime(self) -> pd.DataFrame:
        """Mean best reward so far over what is spent."""
        return anytime_curves(self)

    @cached_property
    def targets(self) -> pd.DataFrame:
        """What it takes to come near the optimum, of both other arms."""
        return targets(self)

    @cached_property
    def areas(self) -> pd.DataFrame:
        """Area under the anytime curves, of both other arms."""
        return areas(self)

    @cached_property
    def pareto(self) -> pd.DataFrame:
        """Methods on the front of reward and spend, a bootstrap."""
        return pareto_sets(self)

    @cached_property
    def signature_rows(self) -> list[SignatureRow]:
        """Every value of every signature."""
        return signature_rows(self)

    @cached_property
    def signatures(self) -> pd.DataFrame:
        """The same, one row a value, with the place in columns (docs/signatures.md)."""
        return signatures_table(self.signature_rows)

    @cached_property
    def judged(self) -> list[Judged]:
        """The claims of the paper, each with its verdict."""
        return judge(self)

    @cached_property
    def claims(self) -> pd.DataFrame:
        """The same, one row a claim."""
        return register_table(self.judged)

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """Figures by id (docs/figures.md), each drawn when it is first asked for."""
        from analysis.figures import Figures

        return Figures(self)

    @cached_property
    def tables(self) -> Mapping[str, pd.DataFrame]:
        """The report's tables by id, with the columns of their CSV files."""
        from analysis.report.build import report_tables

        return report_tables(self)
