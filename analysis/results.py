"""A results folder, read back."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.integrity import (
    ANEW,
    check_columns,
    check_learning,
    check_manifest,
    check_paths,
    check_runs,
    check_sequences,
    check_solutions,
    damaged,
)
from coartic import CoarticError, Task, parse_task


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
        """Movements of every run's solution.

        Raises CoarticError where they cannot be read, or are not what the runs made.
        """
        path, table = read_table(self.folder, "solutions", nullable=False)
        check_solutions(path, table, self.runs, self.tasks)
        return table

    def paths(self) -> pd.DataFrame:
        """Waypoints of the movements that follow a path. Raises CoarticError as above."""
        path, table = read_table(self.folder, "paths", nullable=False)
        check_paths(path, table, self.solutions(), self.runs, self.tasks)
        return table

    def learning(self) -> pd.DataFrame:
        """Reward of every trial. Raises CoarticError as above."""
        path, table = read_table(self.folder, "learning")
        check_learning(path, table, self.runs)
        return table


def load_results(folder: Path) -> Results:
    """Read a results folder. Every command that reads one passes here.

    Raises CoarticError where it is not one, is not finished, or is damaged: where its runs are
    not those of its plan and code, say, or their movements do not add up to their reward.
    """
    if not folder.exists():
        raise CoarticError(
            f"{folder} does not exist; name a folder that `coartic run` has written"
        )
    if not folder.is_dir():
        raise CoarticError(f"{folder} is a file, not a results folder")
    source = folder / "manifest.json"
    try:
        manifest = json.loads(source.read_text(encoding="utf-8"))
    except FileNotFoundError:
        if (folder / "records").is_dir():
            raise CoarticError(
                f"{folder} has records of runs but no tables yet: its run was interrupted, or is "
                "still at work; start the same `coartic run` again, which does what is missing"
            ) from None
        raise CoarticError(f"{folder} is not a results folder: {source} is missing") from None
    except (OSError, ValueError) as error:
        raise CoarticError(f"{folder}: results cannot be read: {error}") from None
    check_manifest(source, manifest)
    (path, runs), (other, sequences) = (read_table(folder, name) for name in ("runs", "sequences"))
    results = Results(folder, manifest, runs, sequences)
    specification = manifest["specification"]
    code = {name: method["code"] for name, method in specification["methods"].items()}
    check_runs(path, runs, specification["run_ids"], code)
    check_sequences(other, sequences, results.tasks)
    results.solutions()  # for its checks
    return results


def read_table(folder: Path, name: str, *, nullable: bool = True) -> tuple[Path, pd.DataFrame]:
    """A table of a results folder and its path; nullable types unless it lacks no values.

    Raises CoarticError where it is missing or damaged, or holds another table.
    """
    path = folder / f"{name}.parquet"
    try:
        if nullable:
            table = pd.read_parquet(path, dtype_backend="numpy_nullable")
        else:
            table = pd.read_parquet(path)
    except FileNotFoundError:
        raise CoarticError(f"{path} is missing; {ANEW}") from None
    except (OSError, ValueError) as error:
        damaged(path, str(error).splitlines()[0] if str(error) else type(error).__name__)
    check_columns(path, table)
    return path, table
