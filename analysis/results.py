"""A results folder, read back."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import CoarticError, Task, parse_task

FORMAT = 3  # of the tables, as benchmarks.tables writes them


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

    @property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name."""
        source = str(self.folder / "manifest.json")
        content = self.manifest["specification"]["tasks"]
        return {name: parse_task(task, source) for name, task in content.items()}

    @property
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
        """Movements of every run's best trial."""
        return pd.read_parquet(self.folder / "solutions.parquet")

    def paths(self) -> pd.DataFrame:
        """Waypoints of the movements that follow a path."""
        return pd.read_parquet(self.folder / "paths.parquet")

    def learning(self) -> pd.DataFrame:
        """Reward of every trial."""
        return pd.read_parquet(self.folder / "learning.parquet", dtype_backend="numpy_nullable")


def load_results(folder: Path) -> Results:
    """Read a results folder. Raises CoarticError where it is not one or is damaged."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        runs = pd.read_parquet(folder / "runs.parquet", dtype_backend="numpy_nullable")
        sequences = pd.read_parquet(folder / "sequences.parquet", dtype_backend="numpy_nullable")
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
    return Results(folder, manifest, runs, sequences)
