"""From a row of a report's table to the runs behind it."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from coartic import CoarticError
from coartic.analysis.methods import name_of
from coartic.text import did_you_mean, plain


def tables_of(folder: Path) -> dict[str, Path]:
    """CSV files of the tables by id, of the one report in a folder or below it.

    Raises CoarticError where there is none, or more than one.
    """
    here = folder.resolve()
    files = [path for path in folder.glob("**/tables/*.csv") if path.is_file()]
    files = [path for path in files if path.resolve().is_relative_to(here)]  # and no link elsewhere
    reports = sorted({path.parent for path in files})
    if not reports:
        raise CoarticError(f"there is no report in {folder}. `coartic report FOLDER` writes one.")
    if len(reports) > 1:
        shown = ", ".join(str(path.parent) for path in reports[:4])
        raise CoarticError(f"there are several reports in {folder}: name one with --in ({shown}).")
    return {path.stem: path for path in sorted(files) if path.parent == reports[0]}


def row_and_runs(table: Path, row: str | None) -> tuple[list[str], list[str]]:
    """The values of a row, a line each, and the ids of its runs; without a row the rows' names.

    Raises CoarticError for a row that the table does not have.
    """
    try:
        frame = pd.read_csv(table, dtype=str, index_col="row", keep_default_na=False)
        if "run_ids" not in frame or not frame.index.is_unique:
            raise ValueError("its rows do not name runs")
    except ValueError as error:
        raise CoarticError(f"{table} is no table of a report: {plain(str(error))}") from None
    if row is None:
        return list(frame.index), []
    named = {name_of(name): name for name in frame.index}
    row = named.get(row, row)
    if row not in frame.index:
        hint = did_you_mean(row, frame.index) or "; without a row, the command lists them"
        raise CoarticError(f"table {table.stem} has no row {row!r}{hint}")
    values = frame.loc[row]
    shown = [f"{name}: {value}" for name, value in values.items() if value and name != "run_ids"]
    return shown, values.run_ids.split()
