"""Where a printed number comes from: what ``coartic trace`` answers."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from coartic import CoarticError
from coartic.analysis.markup import words
from coartic.analysis.report.document import CellKey, DataTable
from coartic.analysis.report.formats.templates import on_one_line, template
from coartic.analysis.report.numbers import ORIGINS
from coartic.analysis.report.tables.files import FILES, METHOD_ROWS
from coartic.analysis.report.tables.layout import LAYOUTS
from coartic.analysis.report.text import heads, texts
from coartic.analysis.report.trace_file import (
    FILE,
    Source,
    TraceFile,
    read_trace,
    trace_content,
)
from coartic.analysis.study import load
from coartic.inputs import brief
from coartic.stored import content_hash
from coartic.text import counted, did_you_mean, shell_line

_COMPANIONS = {
    "SD": "SD over runs of: ",
    "Low": "lower end of the interval of: ",
    "High": "upper end of the interval of: ",
    "N": "number of runs of: ",
}
_MOST_NAMED = 20  # rows or folders in a message


@dataclass(frozen=True)
class Trace:
    """One printed number with everything it rests on."""

    name: str
    text: str
    meaning: str
    how: str
    origin: str
    """What the value is where there are no runs behind it."""
    cells: tuple[CellKey, ...]
    home: Path
    """The report's folder."""
    file: TraceFile
    note: str = ""
    """What does not fit."""
    rests_on: tuple[str, ...] = ()
    """Kinds of what the value of a table rests on."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """The runs of its cells."""
        by_cell = {(source.task, source.label): source for source in self.file.sources}
        return tuple(by_cell[cell] for cell in self.cells)

    @property
    def folder(self) -> Path | None:
        """The results folder, where the report lies in it."""
        folder = self.home.parent
        try:
            manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
            same = content_hash(manifest["specification"]) == self.file.specification
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return folder if same else None


def find_trace(folder: Path, name: str, where: Sequence[str] = ()) -> Trace:
    """:func:`trace` in the one report in a folder or below it, :func:`trace_in_file` of a name
    of :data:`~.tables.files.FILES` in the one results folder there.

    Raises CoarticError for none or several, and as these do.
    """
    if not name.endswith(".csv"):
        return trace(find_report(folder), name, where)
    of_report = [folder.parent] if (folder / FILE).is_file() else []
    places = folder, *of_report
    results = _found(folder, "manifest.json", places, "results folder", "coartic run SUITE")
    return trace_in_file(results, name, where)


def find_report(folder: Path) -> Path:
    """The one report in a folder or below it. Raises CoarticError for none or several."""
    return _found(folder, FILE, (folder, folder / "report"), "report", "coartic report DIR")


def _found(folder: Path, file: str, places: Iterable[Path], what: str, command: str) -> Path:
    """The first of some places that has a file, or the one folder below that has it."""
    for home in places:
        if (home / file).is_file():
            return home
    found = sorted(path.parent for path in folder.glob(f"**/{file}"))
    if not found:
        raise CoarticError(
            f"no {what} in {folder}; make one with `{command}`, or name another folder with --in"
        )
    if len(found) > 1:
        raise CoarticError(
            f"{len(found)} {what}s below {folder}: {_first(map(str, found))}; choose with --in"
        )
    return found[0]


def trace_in_file(folder: Path, name: str, where: Sequence[str]) -> Trace:
    """What is behind a value of a CSV file in a results folder (``where``: row and column).

    Raises CoarticError where the folder cannot be read, or has nothing of that name.
    """
    if name not in FILES:
        near = did_you_mean(name, FILES) or f"; there are {', '.join(FILES)}"
        raise CoarticError(f"no file {brief(name)} of `coartic run` or `analyse`{near}")
    study = load(folder)
    table, text = FILES[name].table(study), FILES[name].text(study)
    found = _of_table(
        folder / "report", trace_content(study, [table], (), study.run_ids), table, where
    )
    path, why = folder / name, "is not there"
    if path.is_file():
        if path.read_bytes() == text.encode():
            return found
        why = "is not what the records give"
    made = "coartic run" if FILES[name] is METHOD_ROWS else "coartic analyse"
    return replace(found, note=f"{path} {why}; `{made}` makes it")


def trace(home: Path, name: str, where: Sequence[str] = ()) -> Trace:
    """What is behind a macro, or behind the cell of a table (``where``: row and column).

    ``home`` is the report's folder. Raises CoarticError where it cannot be read, or has
    nothing of that name.
    """
    content, name = read_trace(home), name.removeprefix("\\")
    macros = {
        number.macro + suffix: (number, suffix, text)
        for number in content.numbers
        for suffix, text in number.companions()
    }
    tables = {table.id: table for table in content.tables}
    if name in macros:
        if where:
            raise CoarticError(f"{name} is a macro: it has no rows and columns")
        number, suffix, text = macros[name]
        of = f", {number.of}" if number.of else ""
        meaning = f"{_COMPANIONS.get(suffix, '')}{number.meaning}{of}"
        return Trace(name, text, meaning, number.how, number.origin, number.cells, home, content)
    if name in tables:
        return _of_table(home, content, tables[name], where)
    known = [*macros, *tables, *FILES]
    raise CoarticError(f"no macro or table {name!r} in {home}{did_you_mean(name, known)}")


def trace_text(found: Trace) -> str:
    """A trace for a terminal: one fact a line, then the runs."""
    page = template("trace.txt.jinja", counted, shell, finalize=on_one_line)
    return page.render(found=found, made=found.file.environment, folder=found.folder).rstrip("\n")


def shell(command: Iterable[str | Path]) -> str:
    """A command to paste."""
    return shell_line(*command)


def _first(names: Iterable[str]) -> str:
    """As many names as a message has room for."""
    shown = [*names]
    left = len(shown) - _MOST_NAMED
    return ", ".join(shown[:_MOST_NAMED]) + (f" and {left} more" if left > 0 else "")


def _of_table(home: Path, content: TraceFile, table: DataTable, where: Sequence[str]) -> Trace:
    rows = {row.key: row for row in table.rows}
    columns = {column.name: place for place, column in enumerate(table.columns)}
    if len(where) != 2:
        raise CoarticError(
            f"{table.id} is a table: name a row and a column of it, one of\n  rows"
            f"{table.key and ' by ' + ', '.join(table.key)}: {_first(map(repr, rows))}\n"
            f"  columns: {', '.join(columns)}"
        )
    known: dict[str, Collection[str]] = {"row": rows, "column": columns}
    for (what, names), name in zip(known.items(), where, strict=True):
        if name not in names:
            near = did_you_mean(name, names) or f"; `coartic trace {table.id}` lists them"
            raise CoarticError(f"table {table.id} has no {what} {brief(name)!r}{near}")
    row, place = rows[where[0]], columns[where[1]]
    column, tasks = table.columns[place], {task for task, _ in row.cells}
    rests_on = row.rests_on.get(column.name, column.rests_on)
    known_best = [
        (f"Optimum of {task}, other arm {arm}, {best.reward}: {best.how}.", best.cells)
        for task, arm, best in content.optima
        if "optimum" in rests_on
        and task in tasks
        and (row.other_arm or column.other_arm) in (arm, "both")
    ]
    # The tables of methods share what stands above them all.
    above = LAYOUTS["methods"].reading_with() if table.id.startswith("methods-") else ()
    how = dict.fromkeys(map(words, filter(None, (column.how, row.how, *above, *table.notes))))
    own = row.cells if "runs" in rests_on or not rests_on else ()
    cells = [*row.cells_by_column.get(column.name, own)]
    kin = [*(other.cells for other in table.rows if other.family == row.family), table.unshown]
    if column.family and row.values[place] is not None and len(list(filter(None, kin))) > 1:
        how[f"It depends on all of its family: {column.family}."] = None
        cells += chain.from_iterable(kin)
    cells += chain.from_iterable(searches for _, searches in known_best)
    return Trace(
        f"{table.id} [{row.key}, {column.name}]",
        texts(table, row)[place],
        table.caption,
        " ".join([f"{heads(table)[place]}.", *how, *(said for said, _ in known_best)]),
        ORIGINS[next((o for o in ORIGINS if o in rests_on), "text")],
        tuple(dict.fromkeys(cells)),
        home,
        content,
        rests_on=rests_on,
    )
