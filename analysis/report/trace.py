"""Where a printed number comes from: what ``coartic trace`` reads and answers."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.markup import words
from analysis.report.document import DataTable, Document
from analysis.report.numbers import Number
from analysis.report.tables.methods import READING_OF_METHODS
from analysis.report.text import heads, texts
from analysis.results.folder import Results
from analysis.results.optima import SHIPPED, optima
from coartic import CoarticError, builtin_tasks
from coartic.stored import content_hash
from coartic.text import json_text, one_line, shell_line

FILE = "trace.json"
FORMAT = 3
_OPTIMUM = re.compile(r"optimum|proof|gap|gap_share|gap_still|score|within_\d+(_reached)?")
"""Columns of what is computed from the optimum."""
_COMPANIONS = {
    "SD": "SD over runs of: ",
    "Low": "lower end of the interval of: ",
    "High": "upper end of the interval of: ",
    "N": "number of runs of: ",
}


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
    environment: dict[str, Any]
    origin: str
    """What the value is where there are no runs behind it."""
    folder: Path | None
    """The results folder, where the report lies in it."""


def trace_json(results: Results, document: Document, numbers: Iterable[Number]) -> str:
    """Every macro and table cell with the cells it rests on, and the runs of those.

    Cells are named by their place in the list ``cells``. The same results give the same text,
    wherever they lie: of paths in the command that asked for them only the last part is kept.
    """
    commits = results.runs.set_index("run_id").commit.astype(object).fillna("unknown")
    labels = {(cell.task, cell.label): cell for cell in results.cells}
    places = {key: place for place, key in enumerate(document.runs)}
    environment = results.manifest.environment.model_dump(mode="json")
    command = [Path(part).name if Path(part).is_absolute() else part
               for part in environment["command"]]  # fmt: skip
    content = {
        "format": FORMAT,
        "suite": _suite(results),
        "specification": specification_hash(results),
        "environment": {**environment, "command": command},
        "cells": [
            {
                "task": task,
                "label": label,
                "method": labels[task, label].method,
                "runs": list(runs),
                "commits": sorted(set(commits[list(runs)])),
            }
            for (task, label), runs in document.runs.items()
        ],
        "macros": {
            number.macro: {
                "texts": dict(number.companions()),
                "meaning": number.meaning,
                "of": number.of,
                "how": number.how,
                "origin": number.origin,
                "cells": [places[key] for key in number.cells],
            }
            for number in numbers
        },
        "optima": [
            {
                "task": task,
                "other_arm": arm,
                "reward": source.reward,
                "how": source.how,
                "cells": [places[key] for key in source.cells],
            }
            for (task, arm), source in optima(results).items()
        ],
        "tables": {
            table.id: {
                "caption": table.caption,
                "notes": _notes(table),
                "columns": [column.name for column in table.columns],
                "heads": heads(table),
                "text": [column.name for column in table.columns if column.kind == "text"],
                "rows": {
                    row.key: {
                        "texts": texts(table, row),
                        "cells": [places[key] for key in row.cells],
                        "cells_by_column": {
                            name: [places[key] for key in keys]
                            for name, keys in row.cells_by_column.items()
                        },
                    }
                    for row in table.rows
                },
            }
            for table in document.tables()
        },
    }
    return json_text(content)


def specification_hash(results: Results) -> str:
    """SHA-256 of a suite's specification: tasks, methods, parameters, seed, run ids."""
    return content_hash(results.manifest.specification.model_dump(mode="json"))


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
    again = f"make the report again with `{shell_line('coartic', 'report', home.parent)}`"
    form = content.get("format") if isinstance(content, dict) else None
    if form != FORMAT:
        raise CoarticError(
            f"{home / FILE} has format {form}, this version reads {FORMAT}; {again}"
        )
    try:
        return _find(content, home, name.removeprefix("\\"), where)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise CoarticError(f"{home / FILE} is damaged ({error!r}); {again}") from None


def _find(content: dict[str, Any], home: Path, name: str, where: Sequence[str]) -> Trace:
    macros = {
        macro + suffix: (macro, suffix)
        for macro, entry in content["macros"].items()
        for suffix in entry["texts"]
    }
    if name in macros:
        if where:
            raise CoarticError(f"{name} is a macro: it has no rows and columns")
        macro, suffix = macros[name]
        entry = content["macros"][macro]
        text, how, keys = entry["texts"][suffix], entry["how"], entry["cells"]
        title, meaning, origin = name, _meaning(entry, suffix), entry["origin"]
    elif name in content["tables"]:
        title, text, meaning, how, keys, origin = _table_cell(content, name, where)
    else:
        known = [*macros, *content["tables"]]
        raise CoarticError(f"no macro or table {name!r} in {home}{_nearest(name, known)}")
    return Trace(
        title, text, meaning, how,
        tuple(_source(content, content["cells"][key]) for key in keys),
        content["specification"], content["environment"], origin,
        _results_folder(home.parent, content["specification"]),
    )  # fmt: skip


def trace_text(found: Trace) -> str:
    """A trace for a terminal: one fact a line, then the runs."""
    commit = found.environment["commit"]
    shown = "unknown"
    if commit:
        shown = commit["id"] + (" with changes" if commit["dirty"] else "")
    lines = [
        f"{found.name} = {found.text}",
        f"{found.meaning}",
        *([f"how: {found.how}"] if found.how else []),
        f"results: {found.folder or 'not beside this report; its FOLDER has the specification'}",
        f"specification: {found.specification}",
        f"asked for by: {shell_line(*map(str, found.environment['command']))}",
        f"code: coartic {found.environment['coartic']}, commit {shown}, model code "
        f"{found.environment['model_code']}",
        f"environment: Python {found.environment['python']}, {found.environment['platform']}, "
        + ", ".join(f"{k} {v}" for k, v in found.environment["packages"].items()),
    ]
    if not found.sources:
        lines.append(f"runs: none; this value is {found.origin}")
    for source in found.sources:
        lines += [
            "",
            f"{source.task} x {source.label}: {len(source.run_ids)} runs, made at commit "
            + ", ".join(source.commits),
            *([f"anew: {source.command}"] if source.command else []),
            *(
                [f"  makes {source.makes} runs, of which these {len(source.run_ids)}"]
                if source.command and source.makes > len(source.run_ids)
                else []
            ),
            "one: " + shell_line("coartic", "reproduce", "RUN", "--in", found.folder or "FOLDER"),
            *(f"  {run}" for run in source.run_ids),
        ]
    return "\n".join(map(one_line, lines))


def _table_cell(
    content: dict[str, Any], name: str, where: Sequence[str]
) -> tuple[str, str, str, str, list[int], str]:
    """Title, text, meaning, how, places of cells and origin."""
    table = content["tables"][name]
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
    entry, place = rows[row], columns.index(column)
    cells = entry["cells_by_column"].get(column, entry["cells"])
    known = _optima(content, name, column, entry["cells"]) if place else []
    if column in ("optimum", "proof"):
        cells = []
    cells = list(dict.fromkeys([*cells, *(cell for best in known for cell in best["cells"])]))
    how = " ".join([f"{table['heads'][place]}.", *table["notes"]])
    for best in known:
        how += f" Optimum of {best['task']}, other arm {best['other_arm']}, {best['reward']}: "
        how += f"{best['how']}."
    return (
        f"{name} [{row}, {column}]", entry["texts"][place], table["caption"], how, cells,
        _origin(table, name, row, column),
    )  # fmt: skip


def _optima(
    content: dict[str, Any], table: str, column: str, cells: Sequence[int]
) -> list[dict[str, Any]]:
    """The optima that a table's column is computed from, of the tasks of a row's cells."""
    if not _OPTIMUM.fullmatch(column) and not table.startswith("areas-"):
        return []
    arm = "still" if column == "gap_still" else "free"
    tasks = {content["cells"][cell]["task"] for cell in cells}
    return [
        best for best in content["optima"] if best["task"] in tasks and best["other_arm"] == arm
    ]


def _origin(table: dict[str, Any], name: str, row: str, column: str) -> str:
    """What a table's value is that no runs are behind."""
    if column in ("optimum", "proof"):
        return f"the optimum of the {SHIPPED}"
    if column.startswith("published") or (name, column) == ("claims", "place"):
        return "published in the paper (Shah, Barto & Fagg, 2013)"
    if name == "exhaustive":
        return f"computed from the corrective process alone on {row} (sequences.parquet)"
    claim = name.removeprefix("evidence-")
    if claim != name:
        own = shell_line("coartic", "trace", "claims", claim, "verdict")
        return f"text; the runs of the claim: {own}"
    return "text" if column in table["text"] else "computed without runs"


def _meaning(entry: dict[str, Any], suffix: str) -> str:
    of = f", {entry['of']}" if entry["of"] else ""
    return f"{_COMPANIONS.get(suffix, '')}{entry['meaning']}{of}"


def _source(content: dict[str, Any], cell: dict[str, Any]) -> Source:
    suite, command = content["suite"], ""
    files = [name for name in content["environment"]["command"] if name.endswith((".toml", ".py"))]
    if cell["task"] in builtin_tasks() and not files:
        options = {"tasks": cell["task"], "methods": cell["method"]}
        options |= {name: suite[name] for name in ("runs", "trials", "seed")}
        asked = [
            word for name, value in options.items() if value is not None
            for word in (f"--{name}", str(value))
        ]  # fmt: skip
        name = suite["name"]
        line = [name, *asked, "--out", "NEW"]
        if name.startswith("-"):  # after --, since it would be taken for an option
            line = [*line[1:], "--", name]
        command = shell_line("coartic", "run", *line)
    return Source(
        cell["task"], cell["label"], tuple(cell["runs"]), tuple(cell["commits"]), command,
        sum(
            len(other["runs"])
            for other in content["cells"]
            if (other["task"], other["method"]) == (cell["task"], cell["method"])
        ),
    )  # fmt: skip


def _results_folder(folder: Path, specification: str) -> Path | None:
    """The folder if it holds the results that a report with this specification is of."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        same = content_hash(manifest["specification"]) == specification
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return folder if same else None


def _suite(results: Results) -> dict[str, Any]:
    specification = results.manifest.specification
    return {
        "name": specification.suite,
        "runs": specification.runs,
        "trials": specification.trials,
        "seed": specification.seed,
    }


def _notes(table: DataTable) -> list[str]:
    """A table's notes as plain text; those of methods share what stands above them all."""
    above = READING_OF_METHODS if table.id.startswith("methods-") else ()
    return list(dict.fromkeys(words(note) for note in (*above, *table.notes)))


def _nearest(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else ""
