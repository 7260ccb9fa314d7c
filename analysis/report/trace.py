"""Where a printed number comes from: what ``coartic trace`` reads and answers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.report.document import RestsOn
from analysis.report.trace_file import (
    FILE,
    Environment,
    TracedCell,
    TracedColumn,
    TracedMacro,
    TracedOptimum,
    TracedRow,
    TraceFile,
    read_trace,
)
from analysis.results.optima import SHIPPED
from coartic import CoarticError, builtin_tasks
from coartic.stored import content_hash
from coartic.text import did_you_mean, one_line, shell_line

_COMPANIONS = {
    "SD": "SD over runs of: ",
    "Low": "lower end of the interval of: ",
    "High": "upper end of the interval of: ",
    "N": "number of runs of: ",
}
_ORIGINS: dict[RestsOn, str] = {
    "optimum": f"the optimum of the {SHIPPED}",
    "paper": "published in the paper (Shah, Barto & Fagg, 2013)",
    "simulation": "computed from the corrective process alone (sequences.parquet)",
    "runs": "computed of no runs, since none of its cells has any",
    "text": "text",
}
"""What a value is that no runs are behind; the first that it rests on says it."""


@dataclass(frozen=True)
class Source:
    """The runs of one cell that a number was computed from."""

    task: str
    label: str
    run_ids: tuple[str, ...]
    commits: tuple[str, ...]
    command: str
    """Makes the cell's runs anew; empty where it takes files of the user's own."""
    makes: int
    """Runs that the command makes: those of the method's other variants, too."""


@dataclass(frozen=True)
class Trace:
    """One printed number with everything it rests on."""

    name: str
    text: str
    meaning: str
    how: str
    sources: tuple[Source, ...]
    specification: str
    """SHA-256 of the suite's specification."""
    environment: Environment
    origin: str
    """What the value is where there are no runs behind it."""
    folder: Path | None
    """The results folder, where the report lies in it."""


def find_report(folder: Path) -> Path:
    """The one report in a folder or below it. Raises CoarticError for none or several."""
    for home in (folder, folder / "report"):
        if (home / FILE).is_file():
            return home
    found = sorted(path.parent for path in folder.glob(f"**/{FILE}"))
    if not found:
        raise CoarticError(
            f"no report in {folder}; make one with `coartic report DIR`, or name another folder "
            "with --in"
        )
    if len(found) > 1:
        raise CoarticError(
            f"{len(found)} reports below {folder}: {', '.join(map(str, found))}; choose with --in"
        )
    return found[0]


def trace(home: Path, name: str, where: Sequence[str] = ()) -> Trace:
    """What is behind a macro, or behind the cell of a table (``where``: row and column).

    ``home`` is the report's folder. Raises CoarticError where it cannot be read, or has
    nothing of that name.
    """
    content, name = read_trace(home), name.removeprefix("\\")
    macros = {
        macro + suffix: (entry, suffix)
        for macro, entry in content.macros.items()
        for suffix in entry.texts
    }
    if name in macros:
        if where:
            raise CoarticError(f"{name} is a macro: it has no rows and columns")
        found = _of_macro(name, *macros[name])
    elif name in content.tables:
        found = _of_table(content, name, where)
    else:
        known = [*macros, *content.tables]
        raise CoarticError(f"no macro or table {name!r} in {home}{did_you_mean(name, known)}")
    return Trace(
        name=found.name,
        text=found.text,
        meaning=found.meaning,
        how=found.how,
        sources=tuple(_source(content, content.cells[place]) for place in found.cells),
        specification=content.specification,
        environment=content.environment,
        origin=found.origin,
        folder=_results_folder(home.parent, content.specification),
    )


def trace_text(found: Trace) -> str:
    """A trace for a terminal: one fact a line, then the runs."""
    made = found.environment
    commit = made.commit.id + " with changes" * made.commit.dirty if made.commit else "unknown"
    packages = ", ".join(f"{name} {version}" for name, version in made.packages.items())
    lines = [
        f"{found.name} = {found.text}",
        found.meaning,
        *([f"how: {found.how}"] if found.how else []),
        f"results: {found.folder or 'not beside this report; its FOLDER has the specification'}",
        f"specification: {found.specification}",
        f"asked for by: {shell_line(*made.command)}",
        f"code: coartic {made.coartic}, commit {commit}, model code {made.model_code}",
        f"environment: Python {made.python}, {made.platform}, {packages}",
    ]
    if not found.sources:
        lines.append(f"runs: none; this value is {found.origin}")
    one = "one: " + shell_line("coartic", "reproduce", "RUN", "--in", found.folder or "FOLDER")
    for source in found.sources:
        count = len(source.run_ids)
        commits = ", ".join(source.commits)
        lines += [
            "",
            f"{source.task} x {source.label}: {count} runs, made at commit {commits}",
        ]
        if source.command:
            lines.append(f"anew: {source.command}")
            if source.makes > count:
                lines.append(f"  makes {source.makes} runs, of which these {count}")
        lines += [one, *(f"  {run}" for run in source.run_ids)]
    return "\n".join(map(one_line, lines))


@dataclass(frozen=True)
class _Found:
    """What was asked for: a trace whose cells are still places."""

    name: str
    text: str
    meaning: str
    how: str
    cells: tuple[int, ...]
    origin: str


def _of_macro(name: str, entry: TracedMacro, suffix: str) -> _Found:
    of = f", {entry.of}" if entry.of else ""
    meaning = f"{_COMPANIONS.get(suffix, '')}{entry.meaning}{of}"
    return _Found(name, entry.texts[suffix], meaning, entry.how, entry.cells, entry.origin)


def _of_table(content: TraceFile, name: str, where: Sequence[str]) -> _Found:
    table = content.tables[name]
    columns = [column.name for column in table.columns]
    if len(where) != 2:
        raise CoarticError(
            f"{name} is a table: name a row and a column of it, one of\n  rows: "
            f"{', '.join(map(repr, table.rows))}\n  columns: {', '.join(columns)}"
        )
    row, asked = where
    if row not in table.rows:
        raise CoarticError(f"table {name} has no row {row!r}{did_you_mean(row, table.rows)}")
    if asked not in columns:
        raise CoarticError(f"table {name} has no column {asked!r}{did_you_mean(asked, columns)}")
    entry, place = table.rows[row], columns.index(asked)
    column = table.columns[place]
    known = _optima(content, column, entry)
    how = [f"{column.head}.", *table.notes]
    how += [
        f"Optimum of {best.task}, other arm {best.other_arm}, {best.reward}: {best.how}."
        for best in known
    ]
    own = entry.cells if "runs" in column.rests_on or not column.rests_on else ()
    cells = [*entry.cells_by_column.get(asked, own), *(c for best in known for c in best.cells)]
    return _Found(
        f"{name} [{row}, {asked}]",
        entry.texts[place],
        table.caption,
        " ".join(how),
        tuple(dict.fromkeys(cells)),
        _ORIGINS[next((o for o in _ORIGINS if o in column.rests_on), "text")],
    )


def _optima(content: TraceFile, column: TracedColumn, row: TracedRow) -> list[TracedOptimum]:
    """The optima that a column's value is computed from, of the tasks of its row's cells."""
    if "optimum" not in column.rests_on:
        return []
    tasks = {content.cells[place].task for place in row.cells}
    return [
        best
        for best in content.optima
        if best.task in tasks and best.other_arm == column.other_arm
    ]


def _source(content: TraceFile, cell: TracedCell) -> Source:
    makes = (
        len(other.runs)
        for other in content.cells
        if (other.task, other.method) == (cell.task, cell.method)
    )
    return Source(
        cell.task, cell.label, cell.runs, cell.commits, _command(content, cell), sum(makes)
    )


def _command(content: TraceFile, cell: TracedCell) -> str:
    """Makes a cell's runs anew; empty where it takes files of the user's own."""
    own = any(word.endswith((".toml", ".py")) for word in content.environment.command)
    if own or cell.task not in builtin_tasks():
        return ""
    suite = content.suite
    options = {
        "--tasks": cell.task,
        "--methods": cell.method,
        "--runs": suite.runs,
        "--trials": suite.trials,
        "--seed": suite.seed,
    }
    asked = [
        word for name, value in options.items() if value is not None for word in (name, str(value))
    ]
    line = [*asked, "--out", "NEW"]
    # After --, a name is not taken for an option.
    line = [*line, "--", suite.name] if suite.name.startswith("-") else [suite.name, *line]
    return shell_line("coartic", "run", *line)


def _results_folder(folder: Path, specification: str) -> Path | None:
    """The folder if it holds the results that a report with this specification is of."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        same = content_hash(manifest["specification"]) == specification
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return folder if same else None
