"""A results folder, read back."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import CoarticError, Task, parse_task

FORMAT = 3  # of the tables, as benchmarks.tables writes them
_ANEW = "start the same `coartic run` again: it makes the tables anew from the records"


@dataclass(frozen=True)
class CellRuns:
    """One method with parameters on one task, and its runs."""

    task: str
    method: str
    variant: str
    runs: pd.DataFrame

    @property
    def label(self) -> str:
        """The method with its variant."""
        return f"{self.method} {self.variant}".strip()

    @property
    def good(self) -> pd.DataFrame:
        """The runs that have a solution."""
        return self.runs[self.runs["status"] == "ok"]


@dataclass(frozen=True)
class Results:
    """The tables of one results folder; their columns are listed in docs/results.md."""

    folder: Path
    manifest: dict[str, Any]
    runs: pd.DataFrame
    sequences: pd.DataFrame

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name."""
        source = str(self.folder / "manifest.json")
        content = self.manifest["specification"]["tasks"]
        return {name: parse_task(task, source) for name, task in content.items()}

    @cached_property
    def cells(self) -> list[CellRuns]:
        """The cells with their runs, in the order of the plan."""
        return [
            CellRuns(
                cell["task"],
                cell["method"],
                cell["variant"],
                self.runs[
                    (self.runs["task"] == cell["task"])
                    & (self.runs["method"] == cell["method"])
                    & (self.runs["variant"] == cell["variant"])
                ],
            )
            for cell in self.manifest["specification"]["cells"]
        ]

    def solutions(self) -> pd.DataFrame:
        """Movements of every run's solution. Raises CoarticError where they cannot be read.

        That includes a run with a solution whose movements are missing.
        """
        table = read_table(self.folder, "solutions", nullable=False)
        solved = self.runs.run_id[self.runs.status == "ok"]
        lost = solved[~solved.isin(table.run_id)]
        if len(lost):
            raise CoarticError(
                f"{self.folder / 'solutions.parquet'} is damaged (it lacks the movements of "
                f"{len(lost)} runs, {lost.iloc[0]} the first of them); {_ANEW}"
            )
        return table

    def paths(self) -> pd.DataFrame:
        """Waypoints of the movements that follow a path. Raises CoarticError as above."""
        return read_table(self.folder, "paths", nullable=False)

    def learning(self) -> pd.DataFrame:
        """Reward of every trial. Raises CoarticError as above."""
        return read_table(self.folder, "learning")


def load_results(folder: Path) -> Results:
    """Read a results folder. Raises CoarticError where it is not one or is damaged."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise CoarticError(
            f"{folder} is not a results folder: {error.filename} is missing"
        ) from None
    except (OSError, ValueError) as error:
        raise CoarticError(f"{folder}: results cannot be read: {error}") from None
    if manifest.get("format") != FORMAT:
        raise CoarticError(
            f"{folder}: its tables have format {manifest.get('format')}, this version reads "
            f"{FORMAT}; run the same `coartic run` again to make them anew from the records"
        )
    return Results(folder, manifest, read_table(folder, "runs"), read_table(folder, "sequences"))


def read_table(folder: Path, name: str, *, nullable: bool = True) -> pd.DataFrame:
    """A table of a results folder, with nullable types unless it has no missing values.

    Raises CoarticError where it is missing or damaged, or holds another table.
    """
    path = folder / f"{name}.parquet"
    try:
        if nullable:
            table = pd.read_parquet(path, dtype_backend="numpy_nullable")
        else:
            table = pd.read_parquet(path)
    except FileNotFoundError:
        raise CoarticError(f"{path} is missing; {_ANEW}") from None
    except (OSError, ValueError) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CoarticError(f"{path} is damaged ({why}); {_ANEW}") from None
    key = "task" if name == "sequences" else "run_id"
    if key not in table.columns:
        raise CoarticError(f"{path} is damaged (it has no column {key!r}); {_ANEW}")
    return table
