"""What makes a function a table of the report, and the words of columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from typing import Any, NamedTuple

import pandas as pd

from coartic.analysis.cells import CellRuns
from coartic.analysis.study import Study, cached

Row = dict[str, Any]
Rows = Iterator[tuple[str, Row]]
"""Rows of a table with their names."""
TABLES: dict[str, Callable[[Study], pd.DataFrame]] = {}
"""Every table of the report by its id: the name of its function, with dashes."""


class Column(NamedTuple):
    """How a column is called and shown."""

    header: str = ""
    """What stands above it; its name where nothing is given."""
    digits: int | None = None
    """Decimals; without them integers are whole and others have three figures."""
    percent: bool = False
    """Whether it is a share that is shown in per cent."""
    p: bool = False
    """Whether it is a p-value."""
    method: bool = False
    """Whether it is a method's label, shown by its name with the id in small print."""
    page: bool = True
    """Whether the page shows it; the CSV file always has it."""


COLUMNS = {
    "method": Column(method=True),
    "p_holm": Column("p (corrected)", p=True),
    "run_ids": Column("run ids", page=False),
}
"""How columns are called and shown; those that are not here go by their names."""


def table(
    columns: str, **words: Column
) -> Callable[[Callable[[Study], Rows]], Callable[[Study], pd.DataFrame]]:
    """A decorator: what yields named rows for a study becomes a table of the report.

    ``columns`` are those of the CSV file in their order: ``gap[]`` has an interval (``gap_low``
    and ``gap_high``), ``ours±`` a standard deviation (``ours_sd``), and ``on *`` stands for all
    columns that begin so. ``words`` say how columns are shown that no other table has. Every
    table ends with the ids of the runs behind each row.
    """

    def as_table(rows: Callable[[Study], Rows]) -> Callable[[Study], pd.DataFrame]:
        @cached
        @wraps(rows)
        def frame(study: Study) -> pd.DataFrame:
            return frame_of(rows(study), f"{columns}, run_ids")

        COLUMNS.update(words)
        TABLES[rows.__name__.replace("_", "-")] = frame
        return frame

    return as_table


def frame_of(rows: Iterable[tuple[str, Row]], columns: str) -> pd.DataFrame:
    """Named rows as a table with these columns (:func:`table`)."""
    named = list(rows)
    frame = pd.DataFrame([row for _, row in named], [name for name, _ in named])
    names: list[str] = []
    for column in columns.split(", "):
        if column.endswith("*"):
            names += [name for name in frame.columns if name.startswith(column[:-1])]
        elif column.endswith("[]"):
            names += [column[:-2] + ending for ending in ("", "_low", "_high")]
        elif column.endswith("±"):
            names += [column[:-1], f"{column[:-1]}_sd"]
        else:
            names.append(column)
    return frame.reindex(columns=names).rename_axis("row")


def runs_of(*cells: CellRuns) -> Row:
    """The ids of the runs of some cells."""
    return {"run_ids": " ".join(str(run) for cell in cells for run in cell.runs.run_id)}
