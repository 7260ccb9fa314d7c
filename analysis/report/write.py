"""A report's folder: the page, the Markdown, tables and figures."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from coartic import CoarticError
from coartic.analysis.report.document import Document
from coartic.analysis.report.formats.csv import runs_csv, table_csv
from coartic.analysis.report.formats.html import html
from coartic.analysis.report.formats.latex import latex_inputs, latex_table
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pdf import pdf
from coartic.files import REPORT, check_folder, publish


def check_report_folder(folder: Path, results: Path) -> None:
    """Raises CoarticError where no report of ``results`` may be written into ``folder``.

    It is the results folder, above it or among records, or holds what no report wrote.
    """
    if Path(os.path.realpath(results)).is_relative_to(os.path.realpath(folder)):
        raise CoarticError(
            f"{folder} holds the results themselves, or lies above them; a report has a folder "
            "of its own"
        )
    check_folder(folder, owner=REPORT, alone=True)


def write_report(
    document: Document,
    figures: Mapping[str, bytes],
    folder: Path,
    extra: Mapping[str, str] | None = None,
    *,
    printed: bool = False,
    begin: Callable[[], object] = lambda: None,
) -> None:
    """Write a report into ``folder``, in the place of an earlier one, with a PDF if ``printed``.

    ``report.html`` stands alone; ``report.md`` links to ``figures/`` with ``figures``: contents
    by file name, at least ``ID.svg`` of each; ``tables/`` holds CSV and LaTeX, ``tables.tex``
    inputs the latter; ``extra`` are further text files by name; ``begin`` is called when all is
    made and nothing written. The same document gives the same bytes. Raises ValueError where a
    figure of the document is not among the files, CoarticError as
    :func:`coartic.files.publish` for a folder that is a report's alone.
    """
    lost = [f.id for f in document.figures() if f"{f.id}.svg" not in figures]
    if lost:
        raise ValueError(f"figures without a file: {', '.join(lost)}")
    texts = {
        "report.html": html(document),
        "report.md": markdown(document),
        "tables.tex": latex_inputs(document),
        "tables/runs.csv": runs_csv(document),
        **(extra or {}),
    }
    for table in document.tables():
        texts[f"tables/{table.id}.csv"] = table_csv(table)
        texts[f"tables/{table.id}.tex"] = latex_table(table)
    files = {f"figures/{name}": data for name, data in figures.items()}
    files |= {name: text.encode() for name, text in texts.items()}
    if printed:
        files["report.pdf"] = pdf(files["report.html"])
    begin()
    publish(folder, files, owner=REPORT, alone=True)
