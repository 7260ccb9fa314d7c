"""Tables of the report: their decorator, and headers and formats of columns."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from coartic.analysis.settings import names_of_settings
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.words import marked

Row = dict[str, Any]
Rows = Iterator[tuple[str, Row]]
"""Rows of a table with their names."""
SHORT_ID = 8
"""Characters of a run's id that people see: commands take its beginning."""


class Column(NamedTuple):
    """Header and format of a column; ``columns.toml`` explains the fields."""

    header: str = ""
    digits: int | None = None
    percent: bool = False
    p: bool = False
    method: bool = False
    page: bool = True


COLUMNS = {
    name: Column(**row)
    for name, row in tomllib.loads(
        Path(__file__).with_name("columns.toml").read_text("utf-8")
    ).items()
}
"""Headers and formats of columns; other columns go by their names."""


def table(
    columns: str,
) -> Callable[[Callable[[Study], Rows]], Callable[[Study], pd.DataFrame]]:
    """A decorator: what yields named rows for a study becomes a table of the report.

    ``columns`` are those of the CSV file in their order: ``gap[]`` has an interval (``gap_low``
    and ``gap_high``), ``ours±`` a standard deviation (``ours_sd``), and ``on *`` stands for all
    columns that begin so. Every table ends with the ids of the runs behind each row; its
    ``attrs`` have people's names of tasks by id, for headers, and of methods that go by others in
    this folder, and whether the optimum of any task is known.
    """

    def as_table(rows: Callable[[Study], Rows]) -> Callable[[Study], pd.DataFrame]:
        @cached
        @wraps(rows)
        def frame(study: Study) -> pd.DataFrame:
            named = list(rows(study))
            rows_by_name = pd.DataFrame([row for _, row in named], [name for name, _ in named])
            names: list[str] = []
            for column in (*columns.split(", "), "run_ids"):
                if column.endswith("*"):
                    names += [name for name in rows_by_name.columns if name.startswith(column[:-1])]
                elif column.endswith("[]"):
                    names += [column[:-2] + ending for ending in ("", "_low", "_high")]
                elif column.endswith("±"):
                    names += [column[:-1], f"{column[:-1]}_sd"]
                else:
                    names.append(column)
            table = rows_by_name.reindex(columns=names).rename_axis("row")
            table.attrs["tasks"] = {name: marked(task) for name, task in study.tasks.items()}
            table.attrs["methods"] = names_of_settings(study)
            table.attrs["known"] = any(not best.only_here for best in study.optima.values())
            return table

        return frame

    return as_table


def runs_of(*cells: CellRuns) -> Row:
    """The ids of the runs of some cells."""
    return {"run_ids": " ".join(str(run) for cell in cells for run in cell.runs.run_id)}
