"""Where a printed number comes from: what ``coartic trace`` reads and answers."""

from __future__ import annotations

import difflib
import hashlib
import json
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.report.document import CellKey, DataTable, Document, Row
from analysis.report.numbers import Number
from analysis.report.text import parts
from analysis.results import Results
from analysis.table import NONE
from coartic import CoarticError

FILE = "trace.json"
FORMAT = 1


@dataclass(frozen=True)
class Source:
    """The runs of one cell that a number was computed from."""

    task: str
    label: str
    run_ids: tuple[str, ...]
    commits: tuple[str, ...]
    command: str
    """Makes the cell's runs anew."""


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
    environment: dict[str, Any]
    folder: Path
    """The results folder."""


def trace_json(results: Results, document: Document, numbers: Iterable[Number]) -> str:
    """Every macro and table cell with the cells it rests on, and the runs of those."""
    runs = results.runs
    cells: dict[str, Any] = {}
    labels = {(cell.task, cell.label): cell for cell in results.cells}
    for key in document.runs:
        cell = labels[key]
        own = runs[runs.run_id.isin(document.runs[key])]
        cells[_join(key)] = {
            "method": cell.method,
            "runs": list(document.runs[key]),
            "commits": sorted(set(own.commit.astype(str))),
        }
    content = {
        "format": FORMAT,
        "suite": _suite(results),
        "specification": specification_hash(results),
        "environment": results.manifest["environment"],
        "cells": cells,
        "macros": {
            name: {"text": text, "meaning": number.meaning, "how": number.how}
            | {"cells": [_join(key) for key in number.cells]}
            for number in numbers
            for name, text in number.macros()
        },
        "tables": {
            table.id: {
                "caption": table.caption,
                "columns": [column.name for column in table.columns],
                "rows": {
                    row.key: {
                        "text": _texts(table, row),
                        "cells": [_join(key) for key in row.cells],
                        "cells_by_column": {
                            name: [_join(key) for key in keys]
                            for name, keys in row.cells_by_column.items()
                        },
                    }
                    for row in table.rows
                },
            }
            for table in document.tables()
        },
    }
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"))


def specification_hash(results: Results) -> str:
    """SHA-256 of a suite's specification: tasks, methods, parameters, seed, run ids."""
    text = json.dumps(results.manifest["specification"], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


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
    try:
        content = json.loads((home / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CoarticError(f"{home / FILE} cannot be read: {error}") from None
    if content.get("format") != FORMAT:
        raise CoarticError(
            f"{home / FILE} has format {content.get('format')}, this version reads {FORMAT}; "
            f"make the report again with `coartic report {home.parent}`"
        )
    name = name.removeprefix("\\")
    if name in content["macros"]:
        if where:
            raise CoarticError(f"{name} is a macro: it has no rows and columns")
        entry = content["macros"][name]
        found = name, entry["text"], entry["meaning"], entry["how"], entry["cells"]
    elif name in content["tables"]:
        found = _table_cell(content["tables"][name], name, where)
    else:
        known = [*content["macros"], *content["tables"]]
        raise CoarticError(f"no macro or table {name!r} in {home}{_nearest(name, known)}")
    title, text, meaning, how, keys = found
    return Trace(
        title, text, meaning, how,
        tuple(_source(content, key, home.parent) for key in keys),
        content["specification"], content["environment"], home.parent,
    )  # fmt: skip


def trace_text(found: Trace) -> str:
    """A trace for a terminal: one fact a line, then the runs."""
    commit = found.environment["commit"]
    shown = "unknown"
    if commit:
        shown = commit["id"] + (" with changes" if commit["dirty"] else "")
    lines = [
        f"{found.name} = {found.text}",
        found.meaning,
        *([f"how: {found.how}"] if found.how else []),
        f"results: {found.folder}",
        f"specification: {found.specification}",
        f"asked for by: {shlex.join(found.environment['command'])}",
        f"code: coartic {found.environment['coartic']}, commit {shown}, model code "
        f"{found.environment['model_code']}",
        f"environment: Python {found.environment['python']}, {found.environment['platform']}, "
        + ", ".join(f"{k} {v}" for k, v in found.environment["packages"].items()),
    ]
    if not found.sources:
        lines.append("runs: none; this value is published, known or text")
    for source in found.sources:
        lines += [
            "",
            f"{source.task} x {source.label}: {len(source.run_ids)} runs, made at commit "
            + ", ".join(source.commits),
            f"reproduce: {source.command}",
            *(f"  {run}" for run in source.run_ids),
        ]
    return "\n".join(lines)


def _table_cell(
    table: dict[str, Any], name: str, where: Sequence[str]
) -> tuple[str, str, str, str, list[str]]:
    rows, columns = table["rows"], table["columns"]
    if len(where) != 2:
        raise CoarticError(
            f"{name} is a table: name a row and a column of it, one of\n  rows: "
            + ", ".join(map(repr, rows)) + "\n  columns: " + ", ".join(columns)
        )  # fmt: skip
    row, column = where
    if row not in rows:
        raise CoarticError(f"table {name} has no row {row!r}{_nearest(row, rows)}")
    if column not in columns:
        raise CoarticError(f"table {name} has no column {column!r}{_nearest(column, columns)}")
    entry = rows[row]
    cells = entry["cells_by_column"].get(column, entry["cells"])
    text = entry["text"][columns.index(column)]
    return f"{name} [{row}, {column}]", text, table["caption"], "", cells


def _source(content: dict[str, Any], key: str, folder: Path) -> Source:
    cell, suite = content["cells"][key], content["suite"]
    task, _, label = key.partition("|")
    command = [
        "coartic run", suite["name"], f"--tasks {task}", f"--methods {cell['method']}",
        f"--runs {suite['runs']}", f"--seed {suite['seed']}", "--out FOLDER",
    ]  # fmt: skip
    if suite["trials"] is not None:
        command.insert(-2, f"--trials {suite['trials']}")
    if len(cell["runs"]) == 1:
        command = [f"coartic reproduce {cell['runs'][0]} --in {folder}"]
    return Source(task, label, tuple(cell["runs"]), tuple(cell["commits"]), " ".join(command))


def _suite(results: Results) -> dict[str, Any]:
    specification = results.manifest["specification"]
    return {
        "name": specification["suite"],
        **{name: specification[name] for name in ("runs", "trials", "seed")},
    }


def _texts(table: DataTable, row: Row) -> list[str]:
    """What each column shows: value, SD and interval together."""
    shown: list[list[str]] = [[] for _ in table.columns]
    for part in parts(table):
        text = part.text(row.values[part.index])
        if part.kind == "value" or text != NONE:
            shown[part.index].append(f"± {text}" if part.kind == "sd" else text)
    return [" ".join(texts) for texts in shown]


def _join(key: CellKey) -> str:
    return "|".join(key)


def _nearest(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else ""
