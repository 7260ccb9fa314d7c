"""Tables of the report: their columns with headings and formats, and their rows."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import pandas as pd

from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.words import id_of, marked

Row = dict[str, Any]
Rows = Iterator[tuple[str, Row]]
"""Rows of a table with their names."""
SHORT_ID = 8
"""Characters of a run's id that people see: commands take its beginning."""


class Column(NamedTuple):
    """A column of a table, with its heading and format."""

    name: str
    """Name in the CSV file, or its beginning if ``ending`` is ``*``."""
    ending: str = ""
    """``[]``: an interval belongs to it (``gap_low``, ``gap_high``); ``±``: a standard deviation
    (``ours_sd``); ``*``: it stands for all columns that begin with the name."""
    header: str = ""
    """Heading; ``{}`` is what follows the beginning of a name, such as a task. A heading with
    ``(%)`` has shares in per cent. Empty: only the CSV file has the column."""
    digits: str = ""
    """Decimals; ``p`` for a p-value; without, integers are whole and others have three figures."""


def column_of(text: str) -> Column:
    """Return a column by its text: ``gap[]: gap (%) .1``, ``task``, or ``least_p: -`` for a column
    that only the CSV file has."""
    name, dot, digits = text.rpartition(" .")
    name, _, header = (name if dot else text).partition(": ")
    ending = next((each for each in ("[]", "±", "*") if name.endswith(each)), "")
    name = name.removesuffix(ending)
    header = "" if header == "-" else header or name.replace("_", " ")
    return Column(name, ending, header, digits if dot else "")


@dataclass(frozen=True)
class Table:
    """A table of the report: a function of a study."""

    id: str
    columns: tuple[Column, ...]
    """Columns of the CSV file in their order; ``run_ids``, of the runs behind each row, is last."""
    rows: Callable[[Study], Rows]

    def __call__(self, study: Study) -> pd.DataFrame:
        """Return the table of a study; its ``attrs`` are as :func:`shown_names` returns them."""
        return rows_of(study, self)

    def column(self, name: str) -> Column:
        """Return the column to which a name in the CSV file belongs."""
        exact = [c for c in self.columns if c.ending != "*" and c.name == name]
        return (exact or [c for c in self.columns if c.ending == "*" and name.startswith(c.name)])[
            0
        ]


def table(columns: str) -> Callable[[Callable[[Study], Rows]], Table]:
    """A decorator: what yields named rows for a study becomes a table of the report, whose id is
    the name of the function.

    ``columns``: the texts of its columns (:func:`column_of`), with semicolons between them.
    """

    def as_table(rows: Callable[[Study], Rows]) -> Table:
        every = *columns.split("; "), "run_ids: -"
        return Table(id_of(rows), tuple(map(column_of, every)), rows)

    return as_table


@cached
def rows_of(study: Study, table: Table) -> pd.DataFrame:
    """Return the rows of a table by their names."""
    named = list(table.rows(study))
    rows = pd.DataFrame([row for _, row in named], [name for name, _ in named])
    endings = {"[]": ("", "_low", "_high"), "±": ("", "_sd"), "": ("",)}
    names: list[str] = []
    for name, ending, *_ in table.columns:
        if ending == "*":
            names += [each for each in rows.columns if each.startswith(name)]
        else:
            names += [name + each for each in endings[ending]]
    frame = rows.reindex(columns=names).rename_axis("row")
    frame.attrs = shown_names(study)
    return frame


def shown_names(study: Study) -> dict[Hashable | None, Any]:
    """Return what is needed to show a table: ``titles`` of tasks, families and methods by id,
    ``under`` of settings and ablations by label, labels of ``own`` methods (from files), and
    whether the optimum of any task is ``known``."""
    methods, tasks = study.methods, study.tasks
    families = {str(task.family): str(task.family).partition("/")[0] for task in tasks.values()}
    marks = {name: marked(task) for name, task in tasks.items()}
    return {
        "titles": {**families, **marks, **methods.title},
        "under": methods.under[methods.under != ""].to_dict(),
        "own": [*methods.index[~methods.built_in]],
        "known": any(not best.only_here for best in study.optima.values()),
    }


def runs_of(*cells: CellRuns) -> Row:
    """Return the ids of the runs of some cells."""
    return {"run_ids": " ".join(str(run) for cell in cells for run in cell.runs.run_id)}
