"""Tables of the report: their columns with headings and formats, and their rows."""

from __future__ import annotations

import html
import inspect
import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.method_frame import BY_FORMULA, BY_TRIAL, WITHOUT_REWARD
from coartic.analysis.standings import ranked_tasks, reference
from coartic.analysis.study import Study, cached, solved
from coartic.analysis.words import id_of, marked
from coartic.estimates import standard_deviation
from coartic.internal.text import counted

Row = dict[str, Any]
Rows = Iterator[tuple[str, Row]]
"""Names of the rows of a table, each with its row: values by name of the column."""
SHORT_ID = 8
"""Characters of a run's id that people see: commands take its beginning."""


class Column(NamedTuple):
    """A column of a table, with heading and format."""

    name: str
    """Name in the CSV file; the beginning of names if ``ending`` has ``*``."""
    ending: str = ""
    """``[]``: the column has an interval (``gap_low``, ``gap_high``); ``±``: the column has a
    standard deviation (``ours_sd``); ``*``: all columns that begin with the name; ``[*]``: all such
    columns, each with an interval; empty: the column alone."""
    header: str = ""
    """Heading; ``{}`` is the rest of a name after its beginning, such as a task. Shares are in per
    cent if the heading has ``(%)``. Empty: only the CSV file has the column."""
    digits: str = ""
    """Decimals; ``p`` for a p-value; empty: as :func:`.number` chooses."""


def _column_of(text: str) -> Column:
    """Return a column from its text: its name and ending, then ``: heading`` and `` .digits``.

    Examples: ``gap[]: gap (%) .1``; ``reward± .1`` and ``task``, whose heading is the name;
    ``least_p: -``, which only the CSV file has. Endings: see :class:`Column`.
    """
    name, dot, digits = text.rpartition(" .")
    name, _, header = (name if dot else text).partition(": ")
    ending = next((each for each in ("[]", "±", "[*]", "*") if name.endswith(each)), "")
    name = name.removesuffix(ending)
    header = "" if header == "-" else header or name.replace("_", " ")
    return Column(name, ending, header, digits if dot else "")


@dataclass(frozen=True)
class Table:
    """A table of the report: a function of a study."""

    id: str
    caption: str
    columns: tuple[Column, ...]
    """Columns of the CSV file in their order; ``run_ids``, of the runs behind each row, is last."""
    rows: Callable[[Study], Rows]
    """Function of a study that yields pairs of a row's name and its values by column."""

    def __call__(self, study: Study) -> pd.DataFrame:
        """Return the table of a study, a row for each name; its ``attrs`` have titles and other
        names for showing it. It is cached: do not change it."""
        return _rows_of(study, self)

    def _repr_html_(self) -> str:
        """Return HTML for a notebook: what the table has, and its columns with headings."""
        rows = [(column.name + column.ending, column.header) for column in self.columns]
        columns = pd.DataFrame(rows, columns=["column", "heading"]).to_html(index=False)
        words = inspect.getdoc(self.rows) or ""
        return f"<p>Table {self.id}, a function of a study. {html.escape(words)}</p>{columns}"

    def column(self, name: str) -> Column:
        """Return the first column with this name, or with ``*`` or ``[*]`` and a beginning of the
        name. Raises KeyError for other names, such as ``gap_low`` of column ``gap[]``."""
        for column in self.columns:
            begins = column.ending in ("*", "[*]") and name.startswith(column.name)
            if name == column.name or begins:
                return column
        raise KeyError(name)


def table(caption: str, columns: str) -> Callable[[Callable[[Study], Rows]], Table]:
    """Return a decorator that turns a function of a study that yields rows into a table.

    The id of the table is the name of the function without ``list_``, with dashes. ``columns`` has
    the texts of the columns (:func:`_column_of`), separated by semicolons.
    """

    def as_table(rows: Callable[[Study], Rows]) -> Table:
        every = *columns.split("; "), "run_ids: -"
        return Table(id_of(rows), caption, tuple(map(_column_of, every)), rows)

    return as_table


class TableFrame(pd.DataFrame):
    """Rows of a table. ``print`` and notebooks leave out column ``run_ids``."""

    @property
    def _constructor(self) -> type[pd.DataFrame]:
        return TableFrame

    def __repr__(self) -> str:
        with pd.option_context("display.max_columns", 14, "display.precision", 3):
            return repr(pd.DataFrame(self).drop(columns="run_ids", errors="ignore"))

    def _repr_html_(self) -> str:
        return self.drop(columns="run_ids", errors="ignore").to_html(max_rows=20)


_USES = {BY_TRIAL: "trial", BY_FORMULA: "formula", WITHOUT_REWARD: "none"}


@cached
def _rows_of(study: Study, table: Table) -> pd.DataFrame:
    """Return a table of a study as a DataFrame, a row for each name, with the columns of the table
    alone: intervals and deviations written out as ``_low``, ``_high`` and ``_sd``, NaN where a row
    has no entry. Its ``attrs`` are the names for showing the table (:func:`_shown_names`). It is
    cached: do not change it.
    """
    named = list(table.rows(study))
    rows = pd.DataFrame([row for _, row in named], [name for name, _ in named])
    endings = {"[]": ("", "_low", "_high"), "±": ("", "_sd"), "": ("",)}
    names: list[str] = []
    for name, ending, *_ in table.columns:
        if ending in ("*", "[*]"):
            names += [each for each in rows.columns if each.startswith(name)]
        else:
            names += [name + each for each in endings[ending]]
    frame = TableFrame(rows.reindex(columns=names).rename_axis("row"))
    frame.attrs = _shown_names(study)
    return frame


def _shown_names(study: Study) -> dict[Hashable | None, Any]:
    """Return names for showing a table, by kind.

    ``titles``: titles of tasks and families by id and of methods by label, and words for uses of
    the reward; ``under``: column ``under`` of :attr:`.Study.methods`, where it has a method, by
    label; ``own``: labels of methods from files; ``reference``: name of the rewards to which gaps
    are taken; ``compared``: number of compared tasks, such as ``3 tasks``.
    """
    methods, tasks = study.methods, study.tasks
    families = {str(task.family): str(task.family).partition("/")[0] for task in tasks.values()}
    marks = {name: marked(task) for name, task in tasks.items()}
    return {
        "titles": {**families, **marks, **methods.title, **_USES},
        "under": methods.under[methods.under != ""].to_dict(),
        "own": [*methods.index[~methods.built_in]],
        "compared": counted(len(ranked_tasks(study)), "task"),
        "reference": reference(study, study.optima),
    }


def caption_of(table: Table, frame: pd.DataFrame) -> str:
    """Return the caption of a table whose rows are ``frame`` (:class:`Table`), in which ``{tasks}``
    is replaced by the number of compared tasks, and ``{reference}`` by the name of the rewards from
    which gaps count; both are in ``frame.attrs``."""
    caption = table.caption.replace("{tasks}", frame.attrs["compared"])
    return caption.replace("{reference}", frame.attrs["reference"])


def is_setting(frame: pd.DataFrame) -> pd.Series:
    """Return for each row of the frame of a :class:`Table` True if its method is a setting or an
    ablation of a method that is there, too, by :attr:`.Study.methods` (``under``); values of a
    varied parameter are no settings. Methods are in column ``against``, or else in ``method``, or
    else in the index: "there" is in the same one of these."""
    named = next((name for name in ("against", "method") if name in frame), "")
    label = frame[named] if named else frame.index.to_series()
    return label.map(frame.attrs.get("under", {})).isin([*label])


def row_of_cell(study: Study, runs: pd.DataFrame) -> Row:
    """Return entries of a row on the runs of one method on one task: title of the ``task``
    (:func:`.marked`), label of the ``method``, numbers of ``runs`` and ``solved`` runs, mean
    ``reward`` (negative ticks) with ``reward_sd`` and ``reward_median``, mean ``gap`` and
    ``run_ids``.

    Without a solved run reward and gap are NaN. A table leaves out entries without a column.
    """
    rewards = solved(runs).reward.to_numpy(np.float64)
    return {
        "task": marked(study.tasks[runs.task.iloc[0]]),
        "method": runs.label.iloc[0],
        "runs": len(runs),
        "solved": len(rewards),
        "reward": rewards.mean() if len(rewards) else math.nan,
        "reward_sd": standard_deviation(rewards),
        "reward_median": np.median(rewards) if len(rewards) else math.nan,
        "gap": solved(runs).gap.mean(),
        **run_ids(runs),
    }


def run_ids(*parts: pd.DataFrame) -> Row:
    """Return a row with one entry, ``run_ids``: the ids of all runs in ``parts``, frames of runs,
    separated by spaces."""
    return {"run_ids": " ".join(run_id for runs in parts for run_id in runs.run_id)}
