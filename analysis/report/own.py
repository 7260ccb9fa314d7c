"""Tables and figures that files of the user add to a report."""

from __future__ import annotations

import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from coartic.analysis.figures.plot import FIGURES
from coartic.analysis.report.sections import Section
from coartic.analysis.tables import TABLES
from coartic.analysis.words import id_of
from coartic.errors import CoarticError
from coartic.internal.text import error_line
from coartic.internal.user_files import import_from

OWN = "own"
"""Id of the section with tables and figures of the user."""


def own_section(files: Sequence[Path]) -> Section | None:
    """Read the tables and figures of files, and return their section of the page.

    A file makes tables by ``@table`` and figures by ``@figure`` of :mod:`coartic.analysis`. They
    belong to this section alone: :data:`.TABLES` and :data:`.FIGURES` stay as they are. The result
    is None if there are no files.

    Raises
    ------
    CoarticError
        A file does not exist or cannot be imported, makes no table and no figure, or makes one
        without an id or with one that exists already.
    """
    ours = {**TABLES}, {**FIGURES}
    try:
        for file in files:
            before = {**TABLES}, {**FIGURES}
            _import(file)
            made: list[Callable[..., Any]] = [
                *(table.rows for name, table in TABLES.items() if table is not before[0].get(name)),
                *(draw for name, draw in FIGURES.items() if draw is not before[1].get(name)),
            ]
            if not made:
                raise CoarticError(f"{file} makes no table and no figure: use @table or @figure")
            for function in made:
                name, where = id_of(function), f"{file}, line {_line_of(function)}"
                if not name:
                    raise CoarticError(
                        f"{where}: function {function.__name__} must be named list_NAME or "
                        "draw_NAME"
                    )
                if name in {**before[0], **before[1]}:
                    raise CoarticError(
                        f"{where}: id {name!r} exists already; rename function {function.__name__}"
                    )
        tables = tuple(TABLES[name] for name in TABLES if name not in ours[0])
        figures = tuple(FIGURES[name] for name in FIGURES if name not in ours[1])
    finally:
        for registered, before_all in ((TABLES, ours[0]), (FIGURES, ours[1])):
            registered.clear()
            registered.update(before_all)  # type: ignore[arg-type]
    if not files:
        return None
    title = "Own tables and figures"
    return Section(OWN, title, tables, figures, single=False, unfolded=tables)


def _line_of(function: Callable[..., Any]) -> int:
    """Return the line at which a decorated function begins."""
    return int(inspect.unwrap(function).__code__.co_firstlineno)


def _import(file: Path) -> None:
    """Import a file. Raises CoarticError, with the line, if that fails."""
    if not file.is_file():
        raise CoarticError(f"file {file} does not exist")
    path = file.resolve()
    import_from(path.parent)
    spec = importlib.util.spec_from_file_location(f"coartic_report_{file.stem}", path)
    if spec is None or spec.loader is None:
        raise CoarticError(f"{file} is no Python file: its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        lines = [
            each.lineno
            for each in traceback.extract_tb(error.__traceback__)
            if each.filename == str(path)
        ]
        if isinstance(error, SyntaxError) and error.filename == str(path):
            lines.append(error.lineno)
        where = f", line {lines[-1]}" if lines else ""
        raise CoarticError(f"{file}{where}: {error_line(error)}") from None
