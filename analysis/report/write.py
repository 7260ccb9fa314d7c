"""A report's folder: the page, the Markdown, tables and figures."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TypeVar

from analysis.report.document import Document
from analysis.report.html import html
from analysis.report.latex import latex_inputs, latex_tables
from analysis.report.markdown import markdown
from analysis.report.tables_csv import runs_csv, table_csv
from coartic import CoarticError

Plot = TypeVar("Plot")


def write_report(
    document: Document,
    plots: Iterable[Plot],
    folder: Path,
    extra: Mapping[str, str] | None = None,
    *,
    save: Callable[[Plot, Path], object],
) -> None:
    """Write ``folder`` anew: what it held is replaced when all of the new report is there.

    ``report.html`` stands alone; ``report.md`` links to ``figures/``, where ``save`` puts
    each plot, at least as ``ID.svg``; ``tables/`` holds CSV and LaTeX, ``tables.tex`` inputs
    the latter; ``extra`` are further text files by name. The same document gives the same
    bytes. Raises ValueError where a figure of the document is not among the plots,
    CoarticError where the folder is not a report or cannot be written.
    """
    if not _replaceable(folder):
        raise CoarticError(
            f"{folder} is there and is no report: it has no report.html; move it away"
        )
    part = folder.with_name(f".{folder.name}.part")
    old = folder.with_name(f".{folder.name}.old")
    try:
        shutil.rmtree(part, ignore_errors=True)
        (part / "tables").mkdir(parents=True)
        (part / "figures").mkdir()
        for plot in plots:
            save(plot, part / "figures")
        lost = [f.id for f in document.figures() if not (part / f"figures/{f.id}.svg").is_file()]
        if lost:
            raise ValueError(f"figures without a plot: {', '.join(lost)}")
        for name, text in {**_texts(document), **(extra or {})}.items():
            (part / name).write_text(text, encoding="utf-8", newline="\n")
        _replace(part, folder, old)
    except OSError as error:
        raise CoarticError(f"cannot write {folder}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _texts(document: Document) -> dict[str, str]:
    """Every text file of the report by its path in the folder."""
    texts = {
        "report.html": html(document),
        "report.md": markdown(document),
        "tables.tex": latex_inputs(document),
        "tables/runs.csv": runs_csv(document),
    }
    texts |= {f"tables/{table.id}.csv": table_csv(table) for table in document.tables()}
    texts |= {f"tables/{name}.tex": text for name, text in latex_tables(document).items()}
    return texts


def _replaceable(folder: Path) -> bool:
    """Whether there is nothing, an empty folder or an older report."""
    if not folder.is_dir():
        return not folder.exists()
    return (folder / "report.html").is_file() or not any(folder.iterdir())


def _replace(new: Path, folder: Path, old: Path) -> None:
    """Put a folder in another's place; the other stays where that fails."""
    if folder.exists():
        shutil.rmtree(old, ignore_errors=True)
        folder.rename(old)
    try:
        new.rename(folder)
    except OSError:
        if old.exists():
            old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)
