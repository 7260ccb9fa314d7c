"""The one entrance to a results folder: its tables, and all that is computed of them, each once.

``load("results/all")`` reads a folder; everything else is a property, computed when it is first
asked for. What computes it takes the study itself, or plain numbers (:mod:`analysis.statistics`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.claims import Judged, claims_frame, judge
from analysis.comparisons.frontier import (
    anytime_frame,
    area_frame,
    for_both_arms,
    pareto_frame,
    targets_frame,
)
from analysis.comparisons.methods import methods_frame
from analysis.comparisons.overall import combined, overall_frame, profiles_frame
from analysis.comparisons.pairs import pairwise_frame
from analysis.comparisons.progress import Progress, progress
from analysis.results.folder import CellRuns, Results, load_results
from analysis.results.optima import Optimum, optima
from analysis.signatures.rows import SignatureRow
from analysis.signatures.study_rows import signature_rows, signatures_table
from analysis.signatures.trajectories import Trajectories, all_trajectories
from analysis.statistics.across_tasks import scores_frame
from coartic import Task

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its name with its variant."""


def load(folder: str | Path) -> Study:
    """Read a results folder. Raises CoarticError as :func:`~.folder.load_results` does."""
    return Study(load_results(Path(folder)))


@dataclass(frozen=True)
class Study:
    """Stored results and what follows from them."""

    results: Results

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
    def trajectories(self) -> dict[CellKey, Trajectories]:
        """Solutions tick by tick."""
        return all_trajectories(self)

    @cached_property
    def optima(self) -> dict[tuple[str, str], Optimum]:
        """Best known solutions by task and other arm (``free``, ``still``)."""
        return optima(self.results)

    @cached_property
    def methods(self) -> dict[CellKey, dict[str, Any]]:
        """Rows of :func:`analysis.comparisons.methods.methods_frame`."""
        return {
            (row["task"], f"{row['method']} {row['variant']}".strip()): {
                str(key): value for key, value in row.items()
            }
            for row in methods_frame(self.results).to_dict("records")
        }

    @cached_property
    def pairs(self) -> pd.DataFrame:
        """:func:`analysis.comparisons.pairs.pairwise_frame`: methods against each other."""
        return pairwise_frame(self)

    @cached_property
    def scores(self) -> pd.DataFrame:
        """Normalised rewards of every run, labels in place of methods and variants."""
        return combined(scores_frame(self.results))

    @cached_property
    def overall(self) -> pd.DataFrame:
        """:func:`analysis.comparisons.overall.overall_frame`: methods over all tasks."""
        return overall_frame(self.scores)

    @cached_property
    def profiles(self) -> pd.DataFrame:
        """:func:`analysis.comparisons.overall.profiles_frame`."""
        return profiles_frame(self.scores)

    @cached_property
    def progress(self) -> Mapping[str, Progress]:
        """Best reward so far of every run, by run id."""
        return progress(self.results)

    @cached_property
    def anytime(self) -> pd.DataFrame:
        """Mean best reward so far over what is spent."""
        return anytime_frame(self.results, self.progress)

    @cached_property
    def targets(self) -> pd.DataFrame:
        """What it takes to come near the optimum, of both other arms."""
        return for_both_arms(targets_frame, self.results, self.progress)

    @cached_property
    def areas(self) -> pd.DataFrame:
        """Area under the anytime curves, of both other arms."""
        return for_both_arms(area_frame, self.results, self.progress)

    @cached_property
    def pareto(self) -> pd.DataFrame:
        """Methods on the front of reward and spend, a bootstrap."""
        return pareto_frame(self.results)

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
        return claims_frame(self.judged)
