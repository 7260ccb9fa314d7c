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
import itertools
import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pandas.io.formats.style import Styler

from coartic.analysis.control import (
    contexts_of_control,
    control_of,
    explores_idle_arm,
    selects,
    shared_goals,
    with_control,
)
from coartic.analysis.methods import (
    BY_FORMULA,
    BY_TRIAL,
    EC1,
    EC4,
    WITHOUT_REWARD,
    are_numbers,
    default_name,
)
from coartic.analysis.optima import relative_gap
from coartic.analysis.running_times import (
    SPENDS,
    best_after,
    budget_for,
    improvements,
    runs_with_targets,
    share_reached,
    solve_times,
    times_of,
    times_on_tasks,
)
from coartic.analysis.signatures import SAME, SIGNATURES, Signature, TwoContexts
from coartic.analysis.standings import (
    cells_of,
    compared_runs,
    ranked_tasks,
    ranking_budget,
    reference,
    runs_by_method,
    runs_on,
    solved_tasks,
    standings,
)
from coartic.analysis.statistics import (
    Scores,
    bootstrap_test,
    exchange_test,
    holm,
    other_tasks,
    stratified_test,
)
from coartic.analysis.study import Study, check_study, solved, typical_run
from coartic.analysis.words import (
    NARROW_SPACE,
    NONE,
    RECONSTRUCTED,
    commonest,
    ending_of,
    id_of,
    in_brackets,
    latex,
    marked,
    number,
    tally,
)
from coartic.estimates import (
    FEWER_RESAMPLES,
    LEVEL,
    MIN_VALUES,
    Estimate,
    difference_of_means,
    mean,
    mean_of_means,
    standard_deviation,
)
from coartic.internal.text import one_line, pluralize
from coartic.motion.execution import initial_reward
from coartic.robot import Array
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

    def __call__(self, study: Study) -> pd.DataFrame:
        """Return the table of a study as a frame, indexed by row names.

        The ends of intervals are in columns whose names end in ``_low`` and ``_high``, and standard
        deviations in columns whose names end in ``_sd``. Columns ``method`` and ``against`` contain
        labels of methods. If the study has warnings about methods (:attr:`.Study.marks`), column
        ``note`` contains them. The frame is cached: do not change it. Raises CoarticError for a
        study of several worlds.
        """
        check_study(study)
        return _frame_of(self, study)


TABLES: dict[str, Table] = {}
"""Maps the id of each table to the table, in the order of this module."""


def table(
    caption: str, columns: str, *, with_settings: bool = False
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
    """
    parts = [column_of(line) for line in columns.splitlines() if line.strip()]

    def as_table(rows: Callable[[Study], Rows]) -> Table:
        with_ids = *parts, Column("run_ids")
        made = TABLES[id_of(rows)] = Table(id_of(rows), caption, with_ids, rows, with_settings)
        return made

    return as_table


@lru_cache(maxsize=64)  # of two or three studies
def _frame_of(table: Table, study: Study) -> pd.DataFrame:
    """Return a table of a study as a frame (:meth:`Table.__call__`).

    Raises KeyError if an entry of a row has no column, or if the table has rows, but none of them
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
        raise KeyError(
            f"table {table.id}: the rows and the columns must have the same names; only one of "
            f"them has {sorted(wrong)}"
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

    In another world than the paper's, the name of the world is added in parentheses.
    """
    caption = table.caption.replace("{tasks}", pluralize(len(ranked_tasks(study)), "task"))
    caption = caption.replace("{reference}", reference(study, study.optima))
    return caption + f" ({world_title(study.world)})" * bool(study.world)


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
    to, shown = reference(study, study.optima), dict[str, ShownColumn]()
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
            of_number += [f"{name}_sd"] * (column.ending == "±")
            rows = frame[of_number].astype(float).to_numpy() * (100.0 if "(%)" in heading else 1.0)
            if column.ending == "±":
                heading += " ± SD"
            elif len(of_number) > 1 and not np.isnan(rows[:, 1]).all() and "[" not in heading:
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
    headings = [html.escape(column.heading) for column in columns.values()]
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
    headings = [latex(column.heading) for column in columns.values()]
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


def _named(study: Study, runs: pd.DataFrame) -> Row:
    """Return the entries of a row that name its task, method and runs.

    ``runs`` are runs of one method on one task. The entries are ``task`` (title of the task,
    :func:`.marked`), ``method`` (label of the method), ``runs`` (number of runs) and ``run_ids``
    (ids of the runs).
    """
    task, label = marked(study.tasks[runs.task.iloc[0]]), runs.label.iloc[0]
    return {"task": task, "method": label, "runs": len(runs), **run_ids(runs)}


ROUNDING = 1e-9
"""Largest posture difference, in length units and rad, that can be due to rounding."""
_EARLY = 1_000
"""Number of trials after which column ``gap_early`` of the ranking reports the gap."""
BUDGETS = (100, 1_000, 10_000)
"""Numbers of trials after which the table of learning reports rewards."""
COSTS = (
    ("trials_to_quarter", "trials", 0.25),
    ("trials_to_half", "trials", 0.5),
    ("forward_kinematics_to_half", "forward_kinematics", 0.5),
    ("seconds_to_half", "solve_s", 0.5),
)
"""Columns of :func:`list_runtimes`. Each entry consists of the name of the column, the kind of cost
(one of :data:`.SPENDS`), and the fraction of the targets that must be reached."""


@lru_cache(maxsize=4)
def _counts_against_learner(study: Study) -> dict[str, dict[str, int]]:
    """Count the individual tasks on which each method is better or worse than the learner.

    The learner is EC1 on a task for one arm, and EC4 on a task for two arms. A task is counted if

    - both methods solved all their runs on the task, and
    - the means of their values differ significantly. The p-values are Holm-adjusted over the tasks
      of the method.

    The test is the two-sided exchange test (:func:`.exchange_test`). For a deterministic method,
    whose value is exact, it is the bootstrap test (:func:`.bootstrap_test`). The tests are not
    paired, although runs with the same number have the same seed.

    Returns
    -------
    dict
        Maps the label of each method to a dict with the numbers of tasks on which it is ``better``
        and ``worse``. A method is left out if there is no test of it, or if even the smallest
        ``least_p`` of its tests (:class:`.Estimate`) would not be significant after the adjustment.
    """
    counts = dict[str, dict[str, int]]()
    for label, stochastic in study.methods.stochastic.items():
        ahead, tests = list[bool](), list[Estimate]()
        for name, task in study.individual_tasks.items():
            runs = study.cells.get((name, str(label)))
            learner = study.cells.get((name, EC4 if len(task.hands) > 1 else EC1))
            if runs is None or learner is None or runs is learner:
                continue
            rewards, learned = (solved(cell).value.to_numpy(np.float64) for cell in (runs, learner))
            if len(rewards) == len(runs) and len(learned) == len(learner):
                ahead.append(bool(rewards.mean() > learned.mean()))
                if min(len(learned), len(rewards) if stochastic else MIN_VALUES) < MIN_VALUES:
                    tests.append(Estimate(math.nan))
                elif stochastic:
                    tests.append(exchange_test(learned, rewards, "two-sided"))
                else:
                    tests.append(bootstrap_test(learned, float(rewards[0]), "two-sided"))
        least = [test.least_p for test in tests if not math.isnan(test.least_p)]
        if least and len(least) * min(least) < LEVEL:
            sure = [
                better
                for better, p in zip(ahead, holm([test.p for test in tests]), strict=True)
                if p < LEVEL
            ]
            counts[str(label)] = {"better": sum(sure), "worse": len(sure) - sum(sure)}
    return counts


def _mean_gap_after(study: Study, trials: int) -> pd.Series:
    """Return the mean gap of each method after a number of trials, over tasks.

    The gap of a run is the gap of its best trial among the first ``trials`` trials. If the rewards
    of the trials of a run are not stored, the final gap of the run is used. The result is the mean
    over tasks of the mean over runs. It is NaN for a method if one of its runs had not found a
    solution by then. In a world with noise, where the best trial so far is partly luck, the result
    is NaN for all methods. The Series is indexed by the labels of the rows of the ranking.
    """
    runs = compared_runs(study)
    if study.is_noisy:
        return pd.Series(math.nan, runs.ranked_as.unique())
    learned = improvements(study)
    best = [
        float(best_after(learned[run_id], trials))
        if not math.isnan(reward) and len(learned.get(run_id, ((),))[0])
        else reward
        for run_id, reward in zip(runs.run_id, runs.reward.astype(float), strict=True)
    ]
    gaps = pd.Series(relative_gap(best, runs.best_known.astype(float)), runs.index)
    cells = gaps.groupby([runs.ranked_as, runs.task])
    by_task = cells.mean().where(cells.count() == cells.size())
    methods = by_task.groupby(level=0)
    return methods.mean().where(methods.count() == methods.size())


def _standing_rows(study: Study, *, ranked: bool) -> Rows:
    """Yield the rows of table ``ranking`` or, if ``ranked`` is False, of table ``not-ranked``.

    The rows are in the order of :func:`.standings`.
    """
    rows = standings(study)
    rows = rows[(rows.why == "") == ranked]
    single = [task for task in ranked_tasks(study) if task in study.individual_tasks]
    early = _mean_gap_after(study, _EARLY).to_dict() if ranked and len(rows) else {}
    for label, row in rows.iterrows():
        runs = runs_by_method(study).get(str(label), compared_runs(study)[:0])
        gaps = runs.groupby("task").gap.mean()
        counts = [
            counts
            for name in runs.label.unique()
            if (counts := _counts_against_learner(study).get(name))
        ]
        entries: Row = {"method": label}
        entries |= {name: row[name] for name in ("gap", "gap_low", "gap_high")}
        entries |= {name: row[name] for name in ("information", "note", "runs")}
        entries |= {
            name: sum(count[name] for count in counts) if counts else math.nan
            for name in ("better", "worse")
        }
        entries |= {f"on {task}": gaps.get(task, math.nan) for task in single}
        if ranked:
            names = ("without_gain", "share", "share_low", "share_high")
            entries |= {name: row[name] for name in names} | {"gap_early": early[label]}
            entries |= {name: runs[name].mean() for name in ("forward_kinematics", "cpu_s")}
        else:
            entries |= {name: row[name] for name in ("why", "tasks", "failed")}
        yield str(label), entries | run_ids(runs)


@table(
    "Gap and share of the possible gain, means over {tasks}, and gap on each",
    """
    method             | method                            |   | tex
    gap[]              | gap (%)                           | 1 | tex
    share[]            | share of the gain (%)             | 0 | tex
    information        | use of the reward
    better             | better than the learner on (tasks)
    worse              | worse on (tasks)
    gap_early
    on *               | {} (%)                            | 1 | tex
    note               | note                              |   | tex
    without_gain
    forward_kinematics
    cpu_s
    runs               | runs
    """,
    with_settings=True,
)
def list_ranking(study: Study) -> Rows:
    """Yield a row for each ranked method (:func:`.standings`), the smallest gap first.

    A row contains means over tasks of the gap, of the share of the possible gain, and of the gap
    after 1,000 trials (``gap_early``). It also contains the gap on each individual task that has a
    best known reward, and mean costs over runs: the number of forward-kinematics evaluations and
    the CPU time (in s). Columns ``better`` and ``worse`` are numbers of individual tasks on which
    the method differs significantly from the learner. Gaps and shares are fractions.
    """
    return _standing_rows(study, ranked=True)


@table(
    "Methods that are not ranked",
    """
    method      | method                             |   | tex
    why         | why not                            |   | tex
    gap[]       | gap (%)                            | 1
    information | use of the reward
    better      | better than the learner on (tasks)
    worse       | worse on (tasks)
    on *        | {} (%)                             | 1 | tex
    note        | note                               |   | tex
    tasks       | solved tasks
    runs        | runs
    failed      | failed runs
    """,
    with_settings=True,
)
def list_not_ranked(study: Study) -> Rows:
    """Yield a row for each method that is not ranked (:func:`.standings`), with the reason.

    For each individual task with a best known reward, a row contains the mean gap of the solved
    runs, a fraction. If the method solved all runs on all ranked tasks, but was asked for another
    number of trials than the ranked methods, the row also contains its mean gap over tasks.
    """
    return _standing_rows(study, ranked=False)


@table(
    "Gap of each method less the gap of the one that it is compared with, on the tasks that the "
    "latter solved (positive: the method in the first column is worse; p is corrected over the "
    "comparisons with it, intervals are not)",
    """
    method       | method                   |   | tex
    against      | compared with            |   | tex
    difference[] | difference of gaps (%)   | 1 | tex
    p_holm       | p (corrected)            | p | tex
    tasks        | tasks                    |   | tex
    runs         | runs
    """,
)
def list_differences(study: Study) -> Rows:
    """Yield the difference between each method's mean gap and that of a reference method.

    The difference is the mean gap of the method minus the mean gap of the reference method, a
    fraction. Both means are over the tasks on which the reference method solved all runs. The rows
    with the same reference method are in ascending order of the difference. The reference method is

    - :attr:`.Study.against`, if it is not empty;
    - otherwise, if the study varies parameters and a setting is ranked, the first setting of the
      ranking;
    - otherwise each method from a file in turn, if it solved all its runs on some task. A method
      from a file is compared only with the built-in methods that use the reward in the same way.

    A method is left out if

    - on one of the tasks of the comparison, the method has no runs or a failed run;
    - it was asked for another number of trials than the reference method, unless all numbers of
      trials are ranked together (:func:`.ranking_budget` is None);
    - it is a setting or an ablation of a method that ran (column ``parent`` of
      :attr:`.Study.methods`).

    Intervals are for other runs on the same tasks. The p-values are two-sided
    (:func:`.stratified_test`) and Holm-adjusted over the rows with the same reference method.
    """
    methods, rows = study.methods, standings(study)
    solved_some = [label for label in rows.index if solved_tasks(study, str(label))]
    chosen = [study.against] if study.against else []
    if not study.varied.empty and not study.against:
        chosen = [*rows.index[rows.why == ""][:1]]
    own = [label for label in solved_some if not methods.built_in[label]]
    for against in chosen or own:
        tasks, found = solved_tasks(study, against), list[tuple[Estimate, str]]()
        asked = {*runs_on(study, against, tasks).budget.dropna()}
        alike = methods.built_in & (methods.information == methods.information[against])
        if chosen:
            alike = methods.index != against
        for row in methods.index[alike & (methods.parent == "")].intersection(rows.index):
            runs = runs_on(study, row, tasks) if tasks else compared_runs(study)[:0]
            names = runs.label.unique()
            name = names[0] if len(names) == 1 else row
            budgets = {*runs.budget.dropna()}
            is_fair = budgets == asked or not (budgets and asked) or ranking_budget(study) is None
            if len(runs) and runs.value.notna().all() and is_fair and name != against:
                gaps = [_gaps_by_task(study, of, tasks) for of in (name, against)]
                found.append((_difference_of_gaps(*gaps), name))
        adjusted = holm([difference.p for difference, _ in found]) if found else []
        in_order = sorted(zip(found, adjusted, strict=True), key=lambda item: item[0][0].value)
        for (difference, name), p in in_order:
            runs = runs_on(study, name, tasks)
            entries: Row = {"method": name, "against": against}
            entries |= {"tasks": len(tasks), "runs": len(runs)}
            entries |= {**difference.columns("difference"), "p_holm": p}
            yield f"{against} {name}", entries | run_ids(runs, runs_on(study, against, tasks))


_Gaps = Sequence[Array | float]
"""A list with an entry for each task: the gaps of a method's runs, shape ``(runs,)``, or a float
that is the exact gap of a deterministic method."""


def _gaps_by_task(study: Study, method: str, tasks: Sequence[str]) -> _Gaps:
    """Return the gaps of a method on each task, in the order of ``tasks``.

    ``method`` is the label of the method or of a row of the ranking, with runs on all tasks in
    ``tasks``. For each task, the result contains an array with the gaps of the runs or, for a
    deterministic method, a float: the exact gap.
    """
    by_task = runs_on(study, method, tasks).groupby("task").gap
    gaps = [by_task.get_group(task).to_numpy(np.float64) for task in tasks]
    return gaps if study.methods.stochastic[method] else [float(of.mean()) for of in gaps]


def _mean_of_gaps(gaps: _Gaps) -> Estimate:
    """Return the mean gap over tasks, with its interval for other runs.

    The result is the mean over tasks of the mean over runs. There is no interval if all gaps are
    exact, or if a sample has fewer than five runs.
    """
    return _sum_of_gaps([(1 / len(gaps), of) for of in gaps])


def _difference_of_gaps(first: _Gaps, second: _Gaps) -> Estimate:
    """Return the mean gap of a first method minus the mean gap of a second method.

    Both means are over the same tasks. The interval is for other runs on these tasks. The p-value
    is that of :func:`.stratified_test`. There is no interval and no p-value if all gaps are exact,
    or if a sample has fewer than five runs.
    """
    parts = [(sign / len(of), gaps) for sign, of in ((1, first), (-1, second)) for gaps in of]
    p = stratified_test([*zip(first, second, strict=True)])
    return replace(_sum_of_gaps(parts), p=p)


def _sum_of_gaps(parts: Sequence[tuple[float, Array | float]]) -> Estimate:
    """Return a weighted sum of mean gaps, with its interval for other runs.

    Each part is a pair: a weight, and either an array with the gaps of the runs on a task or a
    float, the exact gap. There is no interval if all gaps are exact, or if an array has fewer than
    five gaps.
    """
    exact = sum(weight * gaps for weight, gaps in parts if isinstance(gaps, float))
    drawn = [(weight, gaps) for weight, gaps in parts if not isinstance(gaps, float)]
    if not drawn:
        return Estimate(exact)
    weights, samples = zip(*drawn, strict=True)
    sampled = mean_of_means(samples, weights, FEWER_RESAMPLES)
    return Estimate(sampled.value + exact, sampled.low + exact, sampled.high + exact)


class ValueOfParameter(NamedTuple):
    """A value of a parameter that a study varies, with the settings that are compared."""

    value: Any
    labels: list[str]
    """Labels of the settings with this value that are compared (:func:`values_of_parameters`).
    Settings at the same position in the lists of two values of a parameter have equal values of all
    other parameters."""
    at_best: str
    """Label of the compared setting with this value whose other parameters have the same values as
    in the best setting; empty if there is none."""


@lru_cache(maxsize=4)
def values_of_parameters(study: Study) -> dict[str, list[ValueOfParameter]]:
    """Return the values of each varied parameter, with the settings that can be compared.

    The values of a parameter are compared at equal values of all other parameters. Only ranked
    settings are compared. A combination of values of the other parameters is used only if it was
    ranked together with each ranked value of the parameter.

    Returns
    -------
    dict of str to list of ValueOfParameter
        Maps the name of each parameter to its values; numbers are in ascending order. A list is
        empty if no combination can be used, or if only one value is ranked. The dict is empty if
        the study does not vary parameters, or if fewer than two settings are ranked. The dict is
        cached: do not change it.
    """
    ranked = standings(study).query("why == ''").index
    varied = study.varied[study.varied.index.isin(ranked)]
    if len(varied) < 2:
        return {}
    found = dict[str, list[ValueOfParameter]]()
    for parameter in map(str, varied.columns):
        by_others, values = defaultdict[str, dict[str, str]](dict), dict[str, Any]()
        for label, setting in zip(map(str, varied.index), varied.to_dict("records"), strict=True):
            value = setting.pop(parameter)
            values[repr(value)] = value
            by_others[repr(setting)][repr(value)] = label
        complete = [labels for labels in by_others.values() if len(labels) == len(values)]
        at_best = next((labels for labels in complete if ranked[0] in labels.values()), {})
        in_order = [*values]
        if are_numbers(values.values()):
            in_order.sort(key=values.__getitem__)
        found[parameter] = [
            ValueOfParameter(
                values[text], [labels[text] for labels in complete], at_best.get(text, "")
            )
            for text in in_order
            if complete and len(values) > 1
        ]
    return found


def gaps_of_settings(study: Study, labels: Sequence[str]) -> pd.Series:
    """Return the mean gap over settings, for each task and number of a run.

    Runs with the same number on a task have the same seed in all settings. Therefore the mean of
    their gaps is the unit of resampling. ``labels`` are the labels of the settings. The result is a
    Series of fractions, indexed by task and number of the run. A pair of task and number is left
    out if one of the settings has no such run.
    """
    runs = compared_runs(study)
    runs = runs[runs.label.isin(labels)]
    by_run = runs.groupby(["task", "run"], sort=False).gap.agg(["mean", "size"])
    return by_run["mean"][by_run["size"] == len(labels)]


@table(
    "Gap by value of each varied parameter, means over the values of the other parameters",
    """
    parameter    | parameter                                        |   | tex
    value        | value                                            |   | tex
    gap[]        | gap (%)                                          | 1 | tex
    at_best      | gap at the best setting of the others (%)        | 1 | tex
    difference[] | difference from the best value (%)               | 1 | tex
    p_holm       | p (corrected)                                    | p | tex
    default      | default
    equal
    settings     | settings
    runs         | runs
    """,
)
def list_parameters(study: Study) -> Rows:
    """Yield a row for each value of each varied parameter whose values can be compared.

    :func:`values_of_parameters` says which values can be compared. A parameter is left out if, for
    one of its values, the compared settings have no run number in common on some task. Columns:

    - ``gap``: mean gap over the compared settings with this value and over tasks, a fraction, with
      its interval for other runs on the same tasks;
    - ``at_best``: gap of the setting that has this value, and differs from the setting with the
      smallest gap in this parameter at most. It is NaN if this setting is not compared;
    - ``difference`` and ``p_holm``: difference from the value with the smallest gap, and its
      p-value (:func:`.stratified_test`), Holm-adjusted over the values of the parameter. Both are
      NaN for the value with the smallest gap itself;
    - ``default``: name of the default value (:func:`.default_name`); empty for any other value;
    - ``equal``: True if the parameter has no effect, that is, each run has the same score at all
      values.
    """
    tasks, ranks, methods = ranked_tasks(study), standings(study), study.methods
    for parameter, values in values_of_parameters(study).items():
        samples = list[_Gaps]()
        for value in values:
            gaps = gaps_of_settings(study, value.labels)
            by_task = [gaps[task].to_numpy(np.float64) for task in tasks if task in gaps]
            is_random = any(methods.stochastic[value.labels])
            samples.append(by_task if is_random else [float(of.mean()) for of in by_task])
        if not values or min(map(len, samples)) < len(tasks):  # no run that all settings have
            continue
        estimates = [*map(_mean_of_gaps, samples)]
        best = int(np.argmin([estimate.value for estimate in estimates]))
        differences = [_difference_of_gaps(sample, samples[best]) for sample in samples]
        p = holm([each.p for place, each in enumerate(differences) if place != best])
        p.insert(best, math.nan)
        base = str(methods.method_id[values[0].labels[0]])
        default = study.declared[base].defaults.get(parameter)
        same = _are_equal(study, [value.labels for value in values])
        rows = zip(values, estimates, differences, p, strict=True)
        for place, (value, estimate, difference, adjusted) in enumerate(rows):
            runs = compared_runs(study)
            runs = runs[runs.label.isin(value.labels)]
            difference = Estimate(math.nan) if place == best else difference
            entries: Row = {"parameter": parameter, "value": one_line(str(value.value))}
            entries |= {**estimate.columns("gap"), **difference.columns("difference")}
            entries["at_best"] = ranks.gap[value.at_best] if value.at_best else math.nan
            entries |= {"p_holm": adjusted, "equal": same}
            is_default = repr(value.value) == repr(default)
            entries["default"] = default_name(base) * is_default
            entries |= {"settings": len(value.labels), "runs": len(runs)}
            yield f"{parameter} {value.value}", entries | run_ids(runs)


def _are_equal(study: Study, settings: Sequence[Sequence[str]]) -> bool:
    """Return True if a parameter has no effect: all its values give the same scores.

    ``settings`` contains a list of labels of settings for each value of the parameter. Settings at
    the same position in two lists differ only in this parameter. Their runs with the same task and
    number are compared by their scores (column ``value`` of :attr:`.Study.runs`).
    """
    by_run = compared_runs(study).set_index(["task", "run"])
    for labels in zip(*settings, strict=True):
        first, *others = (by_run.value[by_run.label == label].sort_index() for label in labels)
        if not all(first.equals(other) for other in others):
            return False
    return True


@table(
    "Postures at a goal that two tasks share",
    """
    method                  | method                                                | | tex
    place                   | shared goal                                           | | tex
    verdict                 | verdict
    runs                    | runs                                                  | | tex
    distance[]              | posture difference                                    | 2 | tex
    distance_base[]         | of the base (length units)                            | 2
    distance_joints[]       | of the joints (rad)                                   | 2
    lean[]                  | lean (share of the way to the next posture)           | 2 | tex
    lean_base[]             | lean of the base                                      | 2 | tex
    lean_joints[]           | lean of the joints                                    | 2 | tex
    lean_start              | lean at the start
    lean_runs               | runs of the lean
    next_apart
    next_apart_base
    next_apart_joints
    standardised_difference
    p_holm                  | p (corrected)                                         | p | tex
    control                 | random search                                         | 2 | tex
    control_runs            | its runs
    p_random_search         | p beyond random search                                | p | tex
    equivalent
    other
    """,
    with_settings=True,
)
def list_contexts(study: Study) -> Rows:
    """Yield a row for each method, pair of tasks, shared goal, and hand (:func:`.shared_goals`).

    A row contains, among other columns,

    - the posture difference between the two tasks and the lean (:func:`.lean`), for the whole
      posture, for the base alone (``_base``) and for the joints alone (``_joints``);
    - ``verdict``: a verdict on the posture difference in words;
    - ``p_holm``: p-value of the permutation test of the posture difference, Holm-adjusted over the
      rows of the method;
    - ``control`` and ``p_random_search``: posture difference of random search, and p-value of the
      test against random search (:meth:`.TwoContexts.p_beyond`), which is not adjusted. Both are
      NaN if there is no such random search (:func:`.contexts_of_control`).
    """
    for label in study.methods.index:
        contexts = list(shared_goals(study, label))
        spreads = [shared.standardised_posture_difference for shared in contexts]
        tested = zip(contexts, np.isnan(spreads).tolist(), strict=True)
        p = holm([math.nan if no_spread else shared.p for shared, no_spread in tested])
        for shared, adjusted in zip(contexts, p, strict=True):
            first, second = shared.tasks
            row: Row = {
                "method": label,
                "place": f"goal {shared.goal} of {first.label} and {second.label}",
                "runs": shared.n,
                **shared.difference.columns("distance"),
                **shared.lean.more.columns("lean"),
                **_columns_by_part(shared),
                "lean_start": shared.lean.at_start,
                "lean_runs": sum(shared.lean.more.n),
                "next_apart": shared.lean.apart,
                "standardised_difference": shared.standardised_posture_difference,
                "p_holm": adjusted,
                "equivalent": shared.parts[0],
                "other": shared.parts[1],
                **dict.fromkeys(("control", "control_runs", "p_random_search"), math.nan),
                **run_ids(*(study.cells[task.name, label] for task in shared.tasks)),
            }
            if (control := contexts_of_control(study, shared)) is not None:
                row["control"], row["control_runs"] = control.posture_difference, control.n
                row["p_random_search"] = shared.p_beyond(control)
            row["verdict"] = _verdict_of(study, shared, row)
            yield f"{first.name} {second.name} {label} goal {shared.goal} {shared.hand}", row


def _columns_by_part(shared: TwoContexts) -> Row:
    """Return the columns of a comparison for the base alone and for the joints alone.

    The columns contain the posture difference and the lean, both with their intervals, and the
    distance between the mean next postures.
    """
    row: Row = {}
    for part in ("base", "joints"):
        of_part = shared.of_part(part)
        row |= of_part.difference.columns(f"distance_{part}")
        row |= of_part.lean.more.columns(f"lean_{part}")
        row[f"next_apart_{part}"] = of_part.lean.apart
    return row


def _columns_of(signature: Signature) -> str:
    """Return the lines that define the columns of a signature, for :func:`table`."""
    name, decimals = signature.column, signature.decimals
    tex, of_control = ("tex" * (part in signature.in_latex) for part in ("value", "control"))
    return f"""
    {name}[]            | {signature.heading} | {decimals} | {tex}
    {name}_control      | random search | {decimals} | {of_control}
    {name}_difference[]
    {name}_p            | p | p | {tex}
    {name}_control_runs
    """


@table(
    "Signatures of coarticulation, means over runs, next to random search",
    """
    task             | task                       | | tex
    method           | method                     | | tex
    hands            | hands                      | | tex
    runs             | runs                       | | tex
    control_runs
    control_idle_arm
    """
    + "".join(map(_columns_of, SIGNATURES.values())),
)
def list_signatures(study: Study) -> Rows:
    """Yield the mean signatures of each method on each individual task.

    Searches for the optimum are left out. For each other method on each task, there are

    - a row for each hand sequence for which at least one signature is compared: at least a tenth of
      the method's solved runs have the hand sequence and a value of this signature
      (:func:`.with_control`);
    - a row for the choice of hands itself, with an empty entry in column ``hands``, if the task is
      for two arms and has at least two goals.

    Signatures are means over runs. If a method selects its solution from trials
    (:func:`.selects`), and the study has runs of random search to compare with, the rows also
    contain the mean signatures of random search and the p-value of the one-sided exchange test,
    which is not adjusted for multiple tests. If the task is for two arms, column
    ``control_idle_arm`` then says how random search treats the idle arm: ``with noise``, or
    ``still`` as under EC3.
    """
    labels = study.methods.index[~study.methods.is_search]
    # The row of the choice of hands is above those of hand sequences.
    ordered = sorted(SIGNATURES.values(), key=lambda signature: signature.by_hands)
    columns = {signature.name: signature.column for signature in ordered}
    endings = "_low", "_high", "_control", "_difference", "_difference_low", "_difference_high"
    none = {
        f"{column}{ending}": math.nan
        for column in columns.values()
        for ending in ("", *endings, "_p", "_control_runs")
    }
    for name, label in itertools.product(study.individual_tasks, labels):
        cell = study.cells.get((name, label))
        if cell is None or not len(solved(cell)):
            continue
        rows = dict[str, Row]()
        for signature, column in columns.items():
            for hands, (values, control) in with_control(study, signature, name, label).items():
                row = rows.setdefault(hands, {"runs": len(values), "control_runs": len(control)})
                row |= mean(values).columns(column) | {f"{column}_control_runs": len(control)}
                if len(control) and selects(study, label):
                    row |= {
                        f"{column}_control": control.mean(),
                        **difference_of_means(values, control).columns(f"{column}_difference"),
                        f"{column}_p": exchange_test(values, control).p,
                    }
        for hands, row in rows.items():
            search = control_of(study, name, label, hands) if selects(study, label) else ""
            row["control_idle_arm"] = None
            if search and len(study.tasks[name].hands) > 1:
                explored = explores_idle_arm(study, name, search)
                row["control_idle_arm"] = "with noise" if explored else "still"
            key = " ".join(filter(None, (name, label, hands)))
            yield key, none | _named(study, cell) | row | {"hands": hands}


def _verdict_of(study: Study, shared: TwoContexts, row: Row) -> str:
    """Return the verdict on whether the posture at a shared goal depends on later goals.

    - The postures of a stochastic method differ if the permutation test is significant after the
      Holm adjustment. They are the same if the bootstrap test shows that their difference is below
      :data:`.SAME`. If both hold, the postures are different, but the difference is negligible.
    - The postures of a deterministic method differ if their difference exceeds :data:`ROUNDING`.
      They are the same if their difference is below :data:`.SAME`.
    - If postures differ by more than a negligible difference, and the method selects its solution
      from trials, the difference must also be significantly larger than that of random search.

    Parameters
    ----------
    study : Study
    shared : TwoContexts
        The runs on two tasks at the shared goal.
    row : dict
        The other columns of the row of :func:`list_contexts`.

    Returns
    -------
    str
        The verdict, such as ``different postures``, ``the same posture`` or ``too few runs``.
    """
    method: Any = study.methods.loc[shared.method]
    if method.stochastic:
        if math.isnan(shared.p):
            return "too few runs"
        differs = (shared.p if math.isnan(row["p_holm"]) else row["p_holm"]) < LEVEL
        is_same = shared.p_same < LEVEL
    else:
        differs = shared.posture_difference > ROUNDING
        is_same = shared.posture_difference < SAME
    if is_same:
        return "different, negligible" if differs else "the same posture"
    if not differs:
        return "no significant difference"
    if not selects(study, shared.method):
        return "different postures"
    if math.isnan(row["control"]):
        return "undecided: no random search of as many trials"
    if math.isnan(row["p_random_search"]):
        return "undecided: too few runs of random search"
    is_beyond = row["p_random_search"] < LEVEL
    return "different postures" if is_beyond else "no more than random search"


@table(
    "Ticks of each movement less those of the corrective process alone with the same hands, means "
    "over runs",
    """
    task         | task
    method       | method
    runs         | runs
    by_goal_[*]  | goal {} | 1
    sum[]        | sum | 1
    """,
)
def list_saved(study: Study) -> Rows:
    """Yield the ticks of each method for each goal, minus those of the corrective process alone.

    There is a row for each individual task and each method that solved a run on the task; searches
    for the optimum are left out. Columns ``by_goal_1``, ``by_goal_2`` and so on, and their sum in
    column ``sum``, are means over runs: the ticks of the run minus the ticks of the corrective
    process alone with the same hand sequence. Only the first 500 solved runs are used. A run is
    left out if the corrective process does not complete the task with the hands of the run. A row
    without runs is left out.
    """
    for (task, label), runs in study.cells.items():
        if (
            task not in study.individual_tasks
            or study.methods.is_search[label]
            or not len(solved(runs))
        ):
            continue
        changes = study.executed(task, label).against_same_hands
        changes = changes[~np.isnan(changes).any(axis=1)]
        if len(changes):
            row: Row = {"task": task, "method": label, "runs": len(changes)}
            for goal, ticks in enumerate(changes.T, 1):
                row |= mean(ticks).columns(f"by_goal_{goal}")
            row |= mean(changes.sum(axis=1)).columns("sum")
            yield f"{task} {label}", row | run_ids(runs)


@table(
    "Cost of reaching shares of the targets",
    """
    method         | method                                  |   | tex
    reached        | targets reached (%)                     | 0 | tex
    trials         | trials                                  | 0
    trials_to_quarter[]          | trials to a quarter of the targets
    trials_to_half[]             | trials to half of the targets | | tex
    forward_kinematics_to_half[] | forward-kinematics evaluations to half of the targets | | tex
    seconds_to_half[]            | seconds to half of the targets
    half on *
    """,
)
def list_runtimes(study: Study) -> Rows:
    """Yield the cost at which each method reaches a quarter and half of the targets.

    There is a row for each method of :func:`.runs_with_targets`. Methods without a solution, or
    with an unknown number of trials on a task, are left out. In a world with noise there are no
    rows. Columns:

    - the columns of :data:`COSTS`; NaN if the cost of the method's runs on a task is unknown;
    - ``reached``: the fraction of targets that the method reaches at any cost;
    - ``trials``: the largest number of trials of a run;
    - ``half on TASK``, only for a method that uses the reward of each trial: the median, over runs
      on this task, of the number of trials to the target halfway between the reward of the
      corrective process alone with its best hands and the best known reward. The median is infinite
      if more than half of the runs do not reach this target.
    """
    for method, runs in runs_with_targets(study).items():
        times = {spend: times_on_tasks(study, runs, spend) for spend in SPENDS}
        if runs.value.isna().all() or not all(map(len, times["trials"])):
            continue
        reached = share_reached(times["trials"])
        row: Row = {"method": method, "reached": reached, "trials": runs.trials.max()}
        for name, spend, share in COSTS:
            is_known = all(map(len, times[spend]))
            cost = budget_for(times[spend], share) if is_known else Estimate(math.nan)
            row |= cost.columns(name)
        if study.methods.information[method] == BY_TRIAL:
            for task, label in cells_of(runs):
                half = times_of(study, task, label, "trials", (0.5,))
                row[f"half on {task}"] = float(np.quantile(half, 0.5, method="inverted_cdf"))
        yield method, row | run_ids(runs)


@table(
    "Best reward so far, mean over runs (ticks)",
    """
    task            | task                           |   | tex
    method          | method                         |   | tex
    runs            | runs                           |   | tex
    corrective_best | corrective process, best hands | 1
    after_100       | after 100 trials               | 1 | tex
    after_1000      | after 1000 trials              | 1 | tex
    after_10000     | after 10\u202f000 trials          | 1 | tex
    """,
)
def list_learning(study: Study) -> Rows:
    """Yield the mean best reward of each method after 100, 1,000 and 10,000 trials.

    There is a row for each individual task and each method, provided that each run of the method on
    the task is solved, made at least 100 trials, and has stored rewards of its trials. Searches for
    the optimum are left out. In a world with noise there are no rows.

    Columns ``after_100``, ``after_1000`` and ``after_10000`` are means over runs of the best reward
    so far, in negative ticks. A mean is NaN if a run made fewer trials than that, or had not found
    a solution by then. Column ``corrective_best`` is the reward of the corrective process alone
    with its best hands (:attr:`.Study.corrective_best`).
    """
    if study.is_noisy:  # the best trial so far is partly luck
        return
    learned = improvements(study)
    for (task, label), runs in study.cells.items():
        is_shown = task in study.individual_tasks and not study.methods.is_search[label]
        is_solved = len(solved(runs)) == len(runs) and learned.keys() >= {*runs.run_id}
        fewest = runs.trials.min()
        if not (is_shown and is_solved and fewest >= BUDGETS[0]):  # with fewer nothing is learned
            continue
        row = _named(study, runs) | {"corrective_best": study.corrective_best[task]}
        for budget in BUDGETS:
            best = [best_after(learned[run_id], budget) for run_id in runs.run_id]
            row[f"after_{budget}"] = np.mean(best) if budget <= fewest else math.nan
        yield f"{task} {label}", row


@lru_cache(maxsize=4)
def _instances(study: Study) -> dict[str, list[str]]:
    """Return a dict that maps each family to the names of its instances.

    Instances are random tasks of a family. Instances without a best known reward, and families
    without any other instance, are left out. The dict is cached: do not change it.
    """
    families: dict[str, list[str]] = {}
    for name in study.optima:
        if (family := study.tasks[name].family) is not None:
            families.setdefault(family, []).append(name)
    return families


@lru_cache(maxsize=4)
def instance_runs(study: Study) -> pd.DataFrame:
    """Return the runs of each method on the instances on which all its runs are solved.

    Instances without a best known reward are left out. Runs are sorted by family and instance, in
    the order of :func:`_instances`. Column ``method`` contains the label of the row of the ranking
    to which the run belongs. The frame is cached: do not change it.
    """
    runs = compared_runs(study)
    names = [*itertools.chain.from_iterable(_instances(study).values())]
    failed = runs.value.isna().groupby([runs.ranked_as, runs.task]).transform("any")
    runs = runs[runs.task.isin(names) & ~failed]
    place = pd.Categorical(runs.task, names)
    runs = runs.assign(place=place, method=runs.ranked_as)
    return runs.sort_values("place", kind="stable")


def gaps_by_family(study: Study, runs: pd.DataFrame) -> Scores:
    """Return a dict that maps each family to a method's gaps on its instances.

    Parameters
    ----------
    study : Study
    runs : DataFrame
        The method's rows of :func:`instance_runs`.

    Returns
    -------
    dict
        Maps each family to a list with an array for each instance: the gaps of the runs on this
        instance, fractions, shape ``(runs,)``. A family is left out if one of its instances with a
        best known reward has no run in ``runs``.
    """
    return {
        str(family): [
            gaps.to_numpy(np.float64) for _, gaps in of_family.groupby("task", sort=False).gap
        ]
        for family, of_family in runs.groupby("family", sort=False)
        if of_family.task.nunique() == len(_instances(study)[str(family)])
    }


@table(
    "Gap to the {reference}, in per cent of it: mean over instances",
    """
    method    | method    |   | tex
    instances | instances
    missing   | missing
    gap[]     | gap (%)   | 1 | tex
    in [*]    | {} (%)    | 1 | tex
    """,
)
def list_family_gaps(study: Study) -> Rows:
    """Yield each method's mean gap on instances, for each family and over families.

    A family *has two arms* if its tasks may be solved with both hands. Only instances with a best
    known reward are used. Columns:

    - ``in FAMILY``: mean gap over the instances of the family, a fraction. It is NaN unless the
      method has runs on all instances of the family, and all these runs are solved;
    - ``gap``: mean of ``in FAMILY`` over all families with two arms. It is NaN if one of them is
      NaN, or if there is no such family;
    - ``instances``: number of instances on which the method has runs and all of them are solved;
    - ``missing``: number of all other instances.

    ``instances`` and ``missing`` count only instances of families with two arms. For a method that
    ran on no such family, they count the instances of the families on which the method ran.
    Intervals are for other tasks of the families. Methods without runs on instances are left out.
    Rows are in ascending order of ``gap``; rows in which it is NaN come last.
    """
    solved_runs, rows, families = instance_runs(study), list[tuple[str, Row]](), _instances(study)
    two_armed = {family for family in families if len(study.tasks[families[family][0]].hands) > 1}
    for method, of_method in runs_by_method(study).items():
        runs, ran = solved_runs[solved_runs.method == method], {*of_method.family.dropna()}
        scores, over = gaps_by_family(study, runs), two_armed if two_armed & ran else ran
        solved = runs[runs.family.isin(over)].task.nunique()
        missing = sum(len(families[family]) for family in over) - solved
        row: Row = {"method": method, "instances": solved, "missing": missing}
        gap = Estimate(math.nan)
        if two_armed and two_armed <= scores.keys():
            gap = other_tasks({family: scores[family] for family in scores if family in two_armed})
        row |= gap.columns("gap")
        for family in families:
            has_all = family in scores
            in_family = other_tasks({family: scores[family]}) if has_all else Estimate(math.nan)
            row |= in_family.columns(f"in {family}")
        if ran:
            rows.append((method, row | run_ids(runs)))
    yield from sorted(rows, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


@table(
    "Tasks with their initial and best possible rewards (ticks)",
    """
    task       | task            |   | tex
    arms       | arms            |   | tex
    base       | base            |   | tex
    initial    | initial         |   | tex
    best_hands | best hands
    optimum    | best known      |   | tex
    source     | best known from
    bound      | proven bound    |   | tex
    """,
)
def list_tasks(study: Study) -> Rows:
    """Yield the best known reward of each task, and the rewards of the corrective process alone.

    There is a row for each individual task. Columns ``initial`` and ``best_hands`` are the rewards
    of the corrective process alone with the initial hands of the task and with the best hands. A
    reward is missing if the corrective process does not complete the task with these hands.
    ``best_hands`` is also missing if the task has more than 4,096 hand sequences. In a world with
    noise, ``initial`` is missing, and ``best_hands`` is :attr:`.Study.corrective_best`. Columns
    ``optimum``, ``source`` and ``bound`` are the best known reward, its source and its proven bound
    (:class:`.BestKnown`). All rewards are negative ticks.
    """
    for name, task in study.individual_tasks.items():
        best, locked = study.optima.get(name), " and ".join(task.locked_base)
        alone = study.sequences(name).reward.dropna()
        with_best = float(alone.max()) if len(alone) else math.nan
        initial = None if study.is_noisy else initial_reward(task, study.models[name])
        row: Row = {
            "task": marked(task),
            "arms": len(task.hands),
            "base": f"locked in {locked}" if locked else "free",
            "initial": initial,
            "best_hands": study.corrective_best[name] if study.is_noisy else with_best,
            "optimum": best.reward if best else None,
            "source": best.source if best else None,
            "bound": best.bound if best else None,
            "run_ids": best.run_id if best else "",
        }
        yield name, row


@table(
    "Reward, gap to the {reference}, hands and runs, and costs of a run (medians)",
    """
    task               | task                           |   | tex
    method             | method                         |   | tex
    runs               | runs                           |   | tex
    solved
    reward±            | reward                         | 1 | tex
    reward_median
    gap                | gap (%)                        | 1 | tex
    hands              | hands                          |   | tex
    trials             | trials                         |   | tex
    forward_kinematics | forward-kinematics evaluations
    solve_s            | solving time (s)
    median_run         | median run
    """,
    with_settings=True,
)
def list_methods(study: Study) -> Rows:
    """Yield the rewards, hands and median costs of each method on each individual task.

    Rewards are negative ticks; in a world with noise they are minus the mean ticks of a run. Within
    a task, searches for the optimum come first, and the other methods follow. Both groups are in
    descending order of the mean reward. Column ``gap`` is the mean gap of the solved runs, a
    fraction. Column ``hands`` lists the hand sequences of the solved runs with their frequencies
    (:func:`.tally`), or contains the hand sequence of the only solved run. Column ``median_run``
    contains the first eight characters of the id of the solved run whose score is nearest to the
    median; the entry is missing if no run is solved.
    """
    places, rows = {task: place for place, task in enumerate(study.individual_tasks)}, []
    for (task, label), runs in study.cells.items():
        if task not in places:
            continue
        good = solved(runs)
        rewards = good.value.to_numpy(np.float64)
        row = _named(study, runs) | {
            "solved": len(good),
            "reward": rewards.mean() if len(good) else math.nan,
            "reward_sd": standard_deviation(rewards),
            "reward_median": np.median(rewards) if len(good) else math.nan,
            "gap": good.gap.mean(),
            "hands": tally(good.hands) if len(good) > 1 else "".join(good.hands),
            "trials": runs.trials.astype(float).median(),
            "forward_kinematics": runs.forward_kinematics.astype(float).median(),
            "solve_s": solve_times(good).astype(float).median(),
            "median_run": typical_run(good)[:SHORT_ID] if len(good) else None,
        }
        below = -row["reward"] if len(good) else math.inf
        rows.append(((places[task], not study.methods.is_search[label], below), label, row))
    for (place, *_), label, row in sorted(rows, key=lambda item: item[0]):
        yield f"{[*places][place]} {label}", row


@table(
    "Runs without a solution",
    """
    task    | task
    method  | method
    failed  | failed runs
    runs    | runs
    reasons | reasons
    """,
)
def list_failed(study: Study) -> Rows:
    """Yield the number of failed runs of each method on each task, with reasons.

    There is a row for each pair of a task and a method with at least one failed run. Column
    ``reasons`` contains the three most frequent reasons with their numbers of runs.
    """
    for (task, label), runs in study.cells.items():
        if len(solved(runs)) < len(runs):
            failed = runs[runs.status != "ok"]
            reasons = "; ".join(commonest(failed.reason.fillna("")))
            row = _named(study, runs) | {"failed": len(failed), "reasons": reasons}
            yield f"{task} {label}", row | run_ids(failed)
