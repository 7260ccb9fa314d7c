"""The one entrance to a results folder: its tables, and all that is computed of them, each once.

``load("results/all")`` reads a folder; everything else is a property, computed when it is first
asked for. Most are functions of the study, whose docstrings say what they hold: ``optima`` is
``optima(study)`` of :mod:`coartic.analysis.results.optima`, kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import pandas as pd

from coartic import MotionModel, Task
from coartic.analysis.claims import judge, register_table
from coartic.analysis.comparisons.anytime import anytime_curves
from coartic.analysis.comparisons.areas import areas
from coartic.analysis.comparisons.methods import method_rows
from coartic.analysis.comparisons.overall import combined, normalised_scores, over_tasks, profiles
from coartic.analysis.comparisons.pairs import compared, pairs_table
from coartic.analysis.comparisons.pareto import pareto_sets
from coartic.analysis.comparisons.progress import best_so_far
from coartic.analysis.comparisons.reached import reached
from coartic.analysis.comparisons.targets import targets
from coartic.analysis.generality.exploration import Contrast, contrasts
from coartic.analysis.generality.presence import Signs, signs
from coartic.analysis.generality.sample import sample
from coartic.analysis.generality.scaling import Growth, scaling
from coartic.analysis.results.folder import CellKey, CellRuns, Results, load_results
from coartic.analysis.results.optima import optima
from coartic.analysis.signatures.register import signature_rows, signatures_table
from coartic.analysis.signatures.trajectories import all_trajectories, movements_by_run
from coartic.files import folder_named
from coartic.text import counted, did_you_mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def load(folder: str | Path) -> Study:
    """Read a results folder.

    Raises CoarticError as :func:`coartic.analysis.results.folder.load_results` does.
    """
    return Study(load_results(folder_named(folder)))


@dataclass(frozen=True, eq=False)
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

    @property
    def model(self) -> MotionModel:
        """The constants of movement of all runs."""
        return self.results.manifest.specification.model

    @cached_property
    def cells(self) -> dict[CellKey, CellRuns]:
        """Rows of the runs, in the order of the plan."""
        return self.results.cells

    @cached_property
    def run_ids(self) -> dict[CellKey, tuple[str, ...]]:
        """Ids of the runs of every cell."""
        return {key: tuple(map(str, cell.runs.run_id)) for key, cell in self.cells.items()}

    movements = cached_property(movements_by_run)
    trajectories = cached_property(all_trajectories)
    optima = cached_property(optima)
    method_rows = cached_property(method_rows)
    pair_rows = cached_property(compared)
    best_so_far = cached_property(best_so_far)
    anytime = cached_property(anytime_curves)
    targets = cached_property(targets)
    reached = cached_property(reached)
    areas = cached_property(areas)
    pareto = cached_property(pareto_sets)
    signature_rows = cached_property(signature_rows)
    instances = cached_property(sample)
    judged = cached_property(judge)

    @cached_property
    def contrasts(self) -> list[Contrast]:
        """More exploration against less on instances of families; none without any."""
        return contrasts(self.instances) if self.instances else []

    @cached_property
    def growth(self) -> list[Growth]:
        """How computing and gaps grow with goals and joints; none without instances."""
        return scaling(self.instances) if self.instances else []

    @cached_property
    def signs(self) -> dict[CellKey, Signs]:
        """Hands and signatures of the learner's runs on instances of families."""
        return signs(self.instances) if self.instances else {}

    @cached_property
    def methods(self) -> pd.DataFrame:
        """``method_rows`` as ``methods.csv`` has them: a column per field."""
        return pd.DataFrame(list(self.method_rows.values()))

    @cached_property
    def pairs(self) -> pd.DataFrame:
        """``pair_rows`` as ``comparisons.csv`` has them: a column per field."""
        return pairs_table(self.pair_rows)

    @cached_property
    def scores(self) -> pd.DataFrame:
        """Normalised rewards of every run, labels in place of methods and variants."""
        return combined(normalised_scores(self))

    @cached_property
    def overall(self) -> pd.DataFrame:
        """Methods over all tasks (:func:`~coartic.analysis.comparisons.overall.over_tasks`)."""
        return over_tasks(self.scores)

    @cached_property
    def profiles(self) -> pd.DataFrame:
        """Shares of runs by threshold (:func:`~coartic.analysis.comparisons.overall.profiles`)."""
        return profiles(self.scores)

    @cached_property
    def signatures(self) -> pd.DataFrame:
        """``signature_rows`` as a table, with the place in columns (docs/signatures.md)."""
        return signatures_table(self.signature_rows)

    @cached_property
    def claims(self) -> pd.DataFrame:
        """``judged`` as ``claims.csv`` has it, one row a claim."""
        return register_table(self.judged)

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """Figures by id (docs/figures.md), each drawn when it is first asked for."""
        from coartic.analysis.figures import Figures

        return Figures(self)

    @cached_property
    def tables(self) -> Mapping[str, pd.DataFrame]:
        """The report's tables by id, with the columns of their CSV files."""
        from coartic.analysis.report.build import report_tables

        return Tables(report_tables(self))


class Tables(dict[str, pd.DataFrame]):
    """Tables by id."""

    def __missing__(self, name: object) -> NoReturn:
        """Raise KeyError, which names the table that may have been meant."""
        hint = did_you_mean(str(name), self) or "; `list(study.tables)` names them"
        raise KeyError(f"no table {name!r}{hint}")
