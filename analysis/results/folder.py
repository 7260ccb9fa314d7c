"""A results folder, read back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike

from coartic import CoarticError, Task, parse_task
from coartic.analysis.results.laws import check_tables, read_manifest
from coartic.robot import Array
from coartic.runs.tables import Manifest, label_of

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its name with its variant."""


@dataclass(frozen=True)
class CellIdentity:
    """One method with parameters on one task."""

    task: str
    method: str
    variant: str

    @property
    def label(self) -> str:
        """The method with its variant."""
        return label_of(self.method, self.variant)


@dataclass(frozen=True)
class CellRuns(CellIdentity):
    """A cell and its runs."""

    runs: pd.DataFrame

    @cached_property
    def good(self) -> pd.DataFrame:
        """The runs that have a solution."""
        solved = self.runs["status"] == "ok"
        return self.runs if solved.all() else self.runs[solved]

    @cached_property
    def rewards(self) -> Array:
        """Of those runs, shape ``(n,)``."""
        return self.good.reward.to_numpy(dtype=np.float64)


@dataclass(frozen=True)
class Results:
    """The tables of one results folder; their columns are listed in docs/results.md."""

    folder: Path
    manifest: Manifest
    runs: pd.DataFrame
    sequences: pd.DataFrame

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name."""
        source = str(self.folder / "manifest.json")
        content = self.manifest.specification.tasks
        return {name: parse_task(task, source) for name, task in content.items()}

    @cached_property
    def cells(self) -> dict[CellKey, CellRuns]:
        """The cells with their runs, in the order of the plan."""
        found, runs = {}, self.runs
        names_of = ["task", "method", "variant"]
        rows = runs.groupby(names_of, sort=False).indices if len(runs) else {}
        for cell in self.manifest.specification.cells:
            names = cell.task, cell.method, cell.variant
            found[cell.task, cell.label] = CellRuns(*names, _taken(runs, rows.get(names, [])))
        return found

    def solutions(self) -> pd.DataFrame:
        """Movements of every run's solution."""
        return pd.read_parquet(self.folder / "solutions.parquet")

    def paths(self) -> pd.DataFrame:
        """Waypoints of the movements that follow a path."""
        return pd.read_parquet(self.folder / "paths.parquet")

    def learning(self) -> pd.DataFrame:
        """Reward of every trial, all at once; :meth:`rewards` needs memory for some runs only."""
        return read_table(self.folder, "learning")

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Runs that made trials, each with the reward of every trial, NaN where it failed."""
        with pq.ParquetFile(self.folder / "learning.parquet") as file:
            for group in range(file.num_row_groups):  # a run is in one of them
                table = file.read_row_group(group)
                codes, runs = pd.factorize(table["run_id"].to_pandas())
                rewards = table["reward"].cast("float64").to_numpy()
                ends = np.flatnonzero(np.diff(codes)) + 1
                yield from zip(map(str, runs), np.split(rewards, ends), strict=False)  # maybe none


def _taken(frame: pd.DataFrame, rows: ArrayLike) -> pd.DataFrame:
    """Rows by number, without a copy where they follow each other."""
    places = np.asarray(rows, dtype=np.int64)
    if len(places) and places[-1] - places[0] == len(places) - 1 and (np.diff(places) == 1).all():
        return frame.iloc[places[0] : places[-1] + 1]
    return frame.iloc[places]


def load_results(folder: Path) -> Results:
    """Read a results folder. Every command that reads one passes here.

    Stored solutions are executed again, and tables made again from the records (see
    :mod:`coartic.analysis.results.laws`). Raises CoarticError where the folder is not a results
    folder, is not finished, or does not agree with itself.
    """
    if not folder.exists():
        raise CoarticError(f"{folder} does not exist; name a folder that `coartic run` has written")
    if not folder.is_dir():
        raise CoarticError(f"{folder} is a file, not a results folder")
    check_tables(folder, read_manifest(folder))
    return made_here(folder)


def made_here(folder: Path) -> Results:
    """A results folder that this process has just written, from records that it checked.

    Raises CoarticError where it has no manifest.
    """
    manifest = read_manifest(folder)
    return Results(folder, manifest, read_table(folder, "runs"), read_table(folder, "sequences"))


_OF_CELLS = ("told", "parameters", "commit", "code", "packages")
"""Columns of runs that all runs of a cell have alike, or nearly: each text is kept once."""
_SHARED = pd.StringDtype("python")
_NULLABLE: dict[pa.DataType, Any] = {
    pa.string(): pd.StringDtype("pyarrow"),
    pa.int32(): pd.Int32Dtype(),
    pa.int64(): pd.Int64Dtype(),
    pa.float64(): pd.Float64Dtype(),
    pa.bool_(): pd.BooleanDtype(),
}


def read_table(folder: Path, name: str) -> pd.DataFrame:
    """A table of a results folder that lacks values: with nullable types."""
    path = folder / f"{name}.parquet"
    # Read once each, they take a fraction of the memory on the way.
    repeated = [column for column in pq.read_schema(path).names if column in _OF_CELLS]
    with pq.ParquetFile(path, read_dictionary=repeated) as file:
        table = file.read()
    columns: dict[str, Any] = {}  # by hand: pandas takes three times as long
    for field, column in zip(table.schema, table.columns, strict=True):
        if field.name in repeated:
            columns[field.name] = column.to_pandas().astype(object).astype(_SHARED)
        elif field.type in _NULLABLE:
            columns[field.name] = _NULLABLE[field.type].__from_arrow__(column)
        else:
            columns[field.name] = column.to_pandas()
    return pd.DataFrame(columns, copy=False)
