"""Define the tables of the report: functions of a study that return frames.

:data:`TABLES` maps the id of each table to the table. The decorator :func:`table` makes a table
from a caption, a string that describes its columns, and a function that yields its rows:

- The string contains a line for each column, or for a group of columns whose names have the same
  prefix. The line has the name of the column, its heading, its number of decimals, and ``tex`` if
  LaTeX includes the column.
- The function yields a pair for each row: the name of the row, and a dict that maps names of
  columns to values.
- For each column that is not a group with a common prefix, at least one row must have an entry,
  which may be NaN. Each entry of a row must belong to a column. A table may have no rows.
"""

from __future__ import annotations

import html
import inspect
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pandas.io.formats.style import Styler

from coartic.analysis.methods import (
    BY_FORMULA,
    BY_TRIAL,
    WITHOUT_REWARD,
)
from coartic.analysis.standings import (
    ranked_tasks,
    reference,
)
from coartic.analysis.study import Study, check_study, ending_of, when_of
from coartic.analysis.words import (
    NARROW_SPACE,
    NONE,
    RECONSTRUCTED,
    id_of,
    in_brackets,
    latex,
    marked,
    number,
)
from coartic.internal.text import one_line, pluralize
from coartic.runs.plan import world_title

Row = dict[str, Any]
Rows = Iterator[tuple[str, Row]]
"""Iterator over the rows of a table. Each item is a pair: the name of the row, and a dict that maps
names of columns to values."""
SHORT_ID = 8
"""Number of characters of a run's id that tables show; commands accept such a prefix."""
_FORMULA = ("=", "+", "-", "@")
"""First characters of strings that spreadsheets treat as formulas."""
_USES = {BY_TRIAL: "trial", BY_FORMULA: "formula", WITHOUT_REWARD: "none"}


class Column(NamedTuple):
    """A column of a table, with heading and format."""

    name: str
    """Name of the column in the CSV file. If ``ending`` contains ``*``, it is the common prefix of
    the names of several columns."""
    ending: str = ""
    """Which columns of the CSV file belong to this column:

    - empty: only the column ``name``;
    - ``[]``: this column, and the ends of its interval (such as ``gap_low`` and ``gap_high``);
    - ``±``: this column, and its standard deviation (such as ``ours_sd``);
    - ``*``: all columns whose names start with ``name``;
    - ``[*]``: all columns whose names start with ``name``, each with the ends of its interval.
    """
    heading: str = ""
    """Heading on the page and in LaTeX. ``{}`` stands for the part of the column's name after the
    prefix; the name of a task or family is replaced by its title. If the heading contains ``(%)``,
    the values are multiplied by 100. If the heading is empty, only the CSV file has the column."""
    digits: str = ""
    """Number of decimals, or ``p`` for a p-value. If it is empty, :func:`.number` chooses the
    number of decimals."""
    in_latex: bool = False
    """True if LaTeX also has the column, which must then have a heading."""


def column_of(line: str) -> Column:
    """Parse a line of a table's definition, which describes a column.

    A line, such as ``gap[] | gap (%) | 1 | tex``, has up to four parts: the name of the column with
    its ending (:class:`Column`), the heading, the number of decimals, and ``tex`` if LaTeX includes
    the column. Parts at the end can be left out.
    """
    name, heading, digits, tex = (*map(str.strip, line.split("|")), "", "", "")[:4]
    ending = next((ending for ending in ("[]", "±", "[*]", "*") if name.endswith(ending)), "")
    return Column(name.removesuffix(ending), ending, heading, digits, tex == "tex")


@dataclass(frozen=True)
class Table:
    """A table of the report: a function of a study."""

    id: str
    caption: str
    """Caption. ``{tasks}`` stands for the number of ranked tasks, such as ``4 tasks``.
    ``{reference}`` stands for the name of the rewards from which gaps are measured
    (:func:`.reference`), such as ``best known reward``."""
    columns: tuple[Column, ...]
    """Columns of the CSV file, in order. The last column, ``run_ids``, contains the ids of the runs
    to which the row refers."""
    rows: Callable[[Study], Rows]
    """Function of a study that yields the rows, each as a pair: the name of the row, and a dict
    that maps names of columns to values."""
    with_settings: bool = False
    """True if page and LaTeX also show the settings and ablations of other methods in the table
    (:func:`is_setting`). The CSV file always has these rows."""
    of_folder: bool = False
    """True for a table about all worlds of a folder at once."""

    def __call__(self, study: Study) -> pd.DataFrame:
        """Return the table of a study as a frame, indexed by row names.

        The ends of intervals are in columns whose names end in ``_low`` and ``_high``, and standard
        deviations in columns whose names end in ``_sd``. Columns ``method`` and ``against`` contain
        labels of methods. If the study has warnings about methods (:attr:`.Study.marks`), column
        ``note`` contains them. Raises CoarticError for a study of several worlds.
        """
        if not self.of_folder:
            check_study(study)
        return _frame_of(self, study).copy()


TABLES: dict[str, Table] = {}
"""Maps the id of each table to the table, in the order of this module."""


def table(
    caption: str, columns: str, *, with_settings: bool = False, of_folder: bool = False
) -> Callable[[Callable[[Study], Rows]], Table]:
    """Return a decorator that turns a function that yields rows into a :class:`Table`.

    The decorator adds the table to :data:`TABLES`. The id of the table is the name of the function
    without ``list_``, with dashes instead of underscores.

    Parameters
    ----------
    caption : str
        Caption (:attr:`Table.caption`).
    columns : str
        A line for each column (:func:`column_of`).
    with_settings : bool
        True to show also settings and ablations (:attr:`Table.with_settings`).
    of_folder : bool
        True for a table about all worlds of a folder at once.
    """
    parts = [column_of(line) for line in columns.splitlines() if line.strip()]

    def as_table(rows: Callable[[Study], Rows]) -> Table:
        with_ids = *parts, Column("run_ids")
        name = id_of(rows)
        made = TABLES[name] = Table(name, caption, with_ids, rows, with_settings, of_folder)
        return made

    return as_table


@lru_cache(maxsize=64)  # of two or three studies
def _frame_of(table: Table, study: Study) -> pd.DataFrame:
    """Return a table of a study as a frame (:meth:`Table.__call__`).

    Raises ValueError if an entry of a row has no column, or if the table has rows, but none of them
    has an entry for one of the columns. (A column with ``*`` in its ending needs no entries.)
    """
    named = list(table.rows(study))
    rows = pd.DataFrame([row for _, row in named], [name for name, _ in named])
    endings = {"[]": ("", "_low", "_high"), "±": ("", "_sd"), "": ("",)}
    names: list[str] = []
    for name, ending, *_ in table.columns:
        if ending in ("*", "[*]"):
            names += [column for column in rows.columns if column.startswith(name)]
        else:
            names += [name + end for end in endings[ending]]
    if wrong := {*names} ^ {*rows.columns} if named else ():
        code = inspect.unwrap(table.rows).__code__
        raise ValueError(
            f"table {table.id} ({Path(code.co_filename).name}, line {code.co_firstlineno}): the "
            f"rows and the columns must have the same names; only one of them has {sorted(wrong)}"
        )
    return _with_marks(rows.reindex(columns=names), study).rename_axis("row")


def _with_marks(rows: pd.DataFrame, study: Study) -> pd.DataFrame:
    """Add the warnings about methods (:attr:`.Study.marks`) to column ``note`` of a table.

    The warnings are those about the methods in columns ``method`` and ``against``. If the table has
    no column ``note``, such a column is inserted before column ``run_ids``. If the table has no
    methods, or the study has no warnings, the table is returned unchanged.
    """
    columns = [name for name in ("method", "against") if name in rows]
    if not (study.marks and columns):
        return rows
    notes = []
    for row in rows.to_dict("records"):
        methods = dict.fromkeys(str(study.methods.method_id.get(row[name])) for name in columns)
        marks = itertools.chain(*(study.marks.get(method, ()) for method in methods))
        notes.append("; ".join(filter(None, [row.get("note"), *marks])))
    if "note" not in rows:
        rows.insert(len(rows.columns) - 1, "note", "")
    return rows.assign(note=notes)


def is_setting(study: Study, frame: pd.DataFrame) -> pd.Series:
    """Return whether each row is about a setting or ablation of another method of the table.

    The row is about the method in column ``against``, if the table has this column, otherwise about
    the method in column ``method``. If this method is a setting or an ablation of another method,
    column ``parent`` of :attr:`.Study.methods` names the other method. The result is a Series of
    booleans with the index of ``frame``. All are False for a table without column ``method``.
    """
    if "method" not in frame:
        return pd.Series(False, frame.index)
    label = frame["against" if "against" in frame else "method"]
    return label.map(study.methods.parent).isin([*label])


def caption_of(table: Table, study: Study) -> str:
    """Return the caption of a table with the placeholders replaced (:attr:`Table.caption`).

    In another world than the paper's, the name of the world is added in parentheses. A number of
    trials (:attr:`.Study.after`) is added to the captions of tables about runs.
    """
    when = "" if table.id == "tasks" else when_of(study)
    if table.of_folder:
        return table.caption + when
    caption = table.caption.replace("{tasks}", pluralize(len(ranked_tasks(study)), "task"))
    caption = caption.replace("{reference}", reference(study, study.optima))
    return caption + when + (f" ({world_title(study.world)})" if study.world else "")


def csv_of_worlds(frames: Mapping[str, pd.DataFrame]) -> str:
    """Return a table of all worlds of a folder as the text of one CSV file (:func:`csv_of`).

    ``frames`` maps each world (:attr:`.Study.worlds`) to the table in this world; at least one of
    the tables must have rows. Column ``world``, after the names of the rows, names the world of
    each row. The column is left out if the paper's world is the only one.
    """
    if [*frames] == [""]:
        return csv_of(frames[""])
    parts = []
    for world, frame in frames.items():
        parts.append(frame.copy())
        parts[-1].insert(0, "world", world)
    rows = pd.concat([part for part in parts if len(part)])
    return csv_of(rows.assign(run_ids=rows.pop("run_ids")))


def csv_of(frame: pd.DataFrame) -> str:
    """Return a table as the text of a CSV file.

    The first column, ``row``, contains the names of the rows. An apostrophe is put before each
    string that a spreadsheet would read as a formula.
    """

    def guarded(value: Any) -> Any:
        return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value

    return frame.map(guarded).rename(index=guarded).to_csv(lineterminator="\n")


class ShownColumn(NamedTuple):
    """A column of a table as page and LaTeX show it."""

    heading: str
    texts: list[str]
    """A string for each row: the value, with its standard deviation or interval if it has one. A
    missing value is ``–``."""
    is_number: bool
    """True if the values are numbers or booleans. Numbers may be missing."""


def shown_columns(
    table: Table, study: Study, frame: pd.DataFrame, *, in_latex: bool = False
) -> dict[str, ShownColumn]:
    """Return a dict that maps names to columns as page and LaTeX show them.

    A column is included if it has a heading and at least one value. A standard deviation or an
    interval is shown in the column of its number. Names of tasks and families and labels of methods
    are replaced by titles, with † after reconstructed tasks. The use of the reward is replaced by
    ``trial``, ``formula`` or ``none``.

    Parameters
    ----------
    table : Table
    study : Study
        Study of one world.
    frame : DataFrame
        Rows of the table of this study, all or some.
    in_latex : bool
        True to return only the columns that LaTeX includes (:attr:`Column.in_latex`).
    """
    titles = {
        **{str(task.family): str(task.family).split("/")[0] for task in study.tasks.values()},
        **{name: marked(task) for name, task in study.tasks.items()},
        **study.methods.title,
        **dict(study.elsewhere.get("title", {})),
        **_USES,
    }
    to = "" if table.of_folder else reference(study, study.optima)
    shown = dict[str, ShownColumn]()
    for column in table.columns:
        if not column.heading or (in_latex and not column.in_latex):
            continue
        names = [column.name]
        if "*" in column.ending:
            names = [name for name in map(str, frame) if name.startswith(column.name)]
        ends = [f"{name}{end}" for name in names for end in ("_low", "_high", "_sd")]
        for name in names:
            values = frame[name]
            is_end = column.ending == "[*]" and name in ends
            if is_end or not (values.notna() & (values != "")).any():
                continue
            what = name.removeprefix(column.name)
            heading = column.heading.replace("{}", titles.get(what, what))
            if to != "optimum":
                heading = f"gap to the {to} (%)" if heading == "gap (%)" else heading
            if to == "best of this folder" and heading == "best known":
                heading = to
            if not pd.api.types.is_numeric_dtype(values.infer_objects()):
                words = {
                    value: titles.get(value) or one_line(str(value)) for value in values.unique()
                }
                texts = [NONE if pd.isna(value) else words[value] or NONE for value in values]
                shown[name] = ShownColumn(heading, texts, is_number=False)
                continue
            of_number = [name, f"{name}_low", f"{name}_high"] if "[" in column.ending else [name]
            of_number += [f"{name}_sd"] if column.ending == "±" else []
            in_per_cent = "(%)" in column.heading  # not in the title of a task
            rows = frame[of_number].astype(float).to_numpy() * (100.0 if in_per_cent else 1.0)
            if column.ending == "±":
                heading += " ± SD"
            elif (
                len(of_number) > 1 and not np.isnan(rows[:, 1]).all() and "[" not in column.heading
            ):
                heading += f" [95{NARROW_SPACE}%]"
            texts = [number_text(column, *row) for row in rows.tolist()]
            shown[name] = ShownColumn(heading, texts, is_number=True)
    return shown


def number_text(column: Column, value: float, *spread: float) -> str:
    """Return a number as a string, with its standard deviation or its interval.

    ``spread`` is empty, the standard deviation, or the two ends of the interval. A standard
    deviation or interval that is NaN, and an interval of length 0, are left out. A p-value below
    0.001 becomes ``< 0.001``.
    """
    decimals = int(column.digits) if column.digits.isdigit() else None
    if column.digits == "p":
        return "< 0.001" if value < 0.001 else number(value, 3)
    text = number(value, decimals)
    if len(spread) == 2:
        return f"{text} {in_brackets(*spread, decimals)}".strip()
    return text + "".join(f" ± {number(sd, decimals)}" for sd in spread if not math.isnan(sd))


def _unformatted(headings: Iterable[str]) -> list[str]:
    """Return headings for :meth:`.Styler.relabel_index`, which passes them to ``str.format``."""
    return [heading.replace("{", "{{").replace("}", "}}") for heading in headings]


def html_of(table: Table, study: Study, frame: pd.DataFrame) -> str:
    """Return rows of a table as HTML, made by pandas' Styler.

    - If the table has a column with the gap on each task (prefix ``on``), each cell has an id. The
      page uses the id to link the cell to the runs that can be played. The cell in row 2 and column
      3, counted from 0, has the id ``T_ID_row2_col3``. ``ID`` is the id of the table with the
      suffix of the world (:func:`.ending_of`).
    - Cells without a value are empty.
    - Cells of columns that are not numbers have the class ``text``.
    - Cells in rows of methods from files have the class ``own``, unless all rows are such rows.
    """
    columns = shown_columns(table, study, frame)
    built_in = {""}
    for methods in filter(len, (study.methods, study.elsewhere)):
        built_in |= {*methods.index[methods.built_in.astype(bool)]}
    is_own = ~frame.get("method", pd.Series("", frame.index)).isin(built_in).to_numpy()
    own = np.where(is_own & (not is_own.all()), "own ", "")
    texts = {
        name: ["" if text == NONE else text.replace(" †", "\N{NO-BREAK SPACE}†") for text in texts]
        for name, (_, texts, _) in columns.items()
    }
    kinds = {name: "" if column.is_number else "text" for name, column in columns.items()}
    cells = pd.DataFrame(texts)
    classes = pd.DataFrame({name: own + kind for name, kind in kinds.items()})
    has_ids = any(column.name == "on " for column in table.columns)  # ids are half of the page
    uuid = table.id + ending_of(study)
    styler = Styler(cells, uuid=uuid, uuid_len=len(uuid), cell_ids=has_ids)
    styler.hide(axis="index")
    styler.set_td_classes(classes).format(escape="html")
    styler.set_table_styles(
        {name: [{"selector": "th", "props": "text-align: left"}]
         for name, kind in kinds.items() if kind}
    )  # fmt: skip
    headings = _unformatted(html.escape(column.heading) for column in columns.values())
    caption = f"<span>{html.escape(caption_of(table, study))}</span>"
    page = styler.relabel_index(headings, axis="columns").set_caption(caption).to_html()
    page = re.sub(r' class="data row\d+ col\d+" ', "", re.sub(r"\n\s+", "\n", page))
    return re.sub(r"data row\d+ col\d+ ", "", page)  # no style needs them; they are half the page


def latex_of(table: Table, study: Study, frame: pd.DataFrame, notes: Sequence[str] = ()) -> str:
    """Return rows of a table as LaTeX with booktabs and longtable, made by pandas' Styler.

    The table contains the columns with :attr:`Column.in_latex`, except columns without a value. The
    sentences in ``notes`` follow below the table. If a dagger occurs in the table or in a note, a
    sentence that explains the dagger is added.
    """
    columns = shown_columns(table, study, frame, in_latex=True)
    cells = pd.DataFrame({name: map(latex, column.texts) for name, column in columns.items()})
    headings = _unformatted(latex(column.heading) for column in columns.values())
    body = (
        cells.style.hide(axis="index")
        .relabel_index(headings, axis="columns")
        .to_latex(
            environment="longtable",
            hrules=True,
            column_format="".join("r" if column.is_number else "l" for column in columns.values()),
            caption=latex(caption_of(table, study)),
            label=f"tab:coartic-{table.id}{ending_of(study)}",
        )
    )
    if latex("†") in body or any("†" in note for note in notes):
        notes = [*notes, RECONSTRUCTED]
    needs = "% needs \\usepackage{booktabs,longtable} and \\usepackage[T1]{fontenc}; letters that\n"
    needs += "% pdfLaTeX does not know need XeLaTeX or LuaLaTeX and a font that has them"
    return "\n".join([needs, body, *map(latex, notes), ""])


def run_ids(*parts: pd.DataFrame) -> Row:
    """Return the entry ``run_ids`` of a row: a dict with the single key ``run_ids``.

    The value consists of the ids of all runs, separated by spaces. ``parts`` are frames of runs.
    """
    return {"run_ids": " ".join(" ".join(runs.run_id.tolist()) for runs in parts)}


def named(study: Study, runs: pd.DataFrame) -> Row:
    """Return the entries of a row that name its task, method and runs.

    ``runs`` are runs of one method on one task. The entries are ``task`` (title of the task,
    :func:`.marked`), ``method`` (label of the method), ``runs`` (number of runs) and ``run_ids``
    (ids of the runs).
    """
    task, label = marked(study.tasks[runs.task.iloc[0]]), runs.label.iloc[0]
    return {"task": task, "method": label, "runs": len(runs), **run_ids(runs)}
