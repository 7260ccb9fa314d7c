"""Writing a report: the page ``report.html``, and tables and figures as files."""

from __future__ import annotations

import html
import os
from functools import partial
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from shlex import quote
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from coartic import CoarticError
from coartic.analysis.figures.plot import Plot, for_page, picture
from coartic.analysis.report import about
from coartic.analysis.report.player import player
from coartic.analysis.report.render import (
    IN_LATEX,
    classes_of,
    html_table,
    latex_table,
    table_csv,
)
from coartic.analysis.sections import SECTIONS, TABLES, Section
from coartic.analysis.sections.ranking import differences
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Table
from coartic.analysis.words import listed, number
from coartic.internal.files import check_inside, errors_in_words, make_folder, publish
from coartic.play.page import part_of_page
from coartic.runs.plan import hash_of

HERE = Path(__file__).parent
NO_PARTS: dict[str, Any] = {"rows": 0, "settings": 0, "finding": [], "figure": None}
"""Values of :func:`parts_of` for a section that failed."""


def write_report(study: Study, folder: Path, *, for_paper: bool = True) -> list[str]:
    """Write a report into ``folder``, in the place of an earlier report.

    ``for_paper``: write tables as LaTeX, too, and figures as SVG and PDF. Returns the paths of the
    files. Raises CoarticError if the folder holds the results themselves, the report of other
    results, or other files.
    """
    if Path(os.path.realpath(study.folder)).is_relative_to(os.path.realpath(folder)):
        raise CoarticError(
            f"{folder} holds the results themselves, or lies above them. Give the report a folder "
            "of its own."
        )
    make_folder(folder, ["report.html"])
    home, report = os.path.relpath(study.folder, folder), folder / "report.html"
    if study.folder.absolute() in folder.absolute().parents:
        check_inside(study.folder, folder)
    else:
        with errors_in_words(report):
            head = report.read_text("utf-8").partition("<title>")[0] if report.exists() else ""
        if head and f'-results" content="{home}"' not in html.unescape(head):
            raise CoarticError(f"{folder} holds the report of other results: choose another folder")
    files = {"report.html": page(study, home).encode()}
    captions = {section.table.id: (section.short, section.caption) for section in SECTIONS}
    for name, table in TABLES.items():
        where, caption = captions.get(name, (name, ""))
        make = partial(files_of_table, table, caption, for_paper)
        files |= about.attempt(study, where, make) or {}
    for section in about.visible_sections(study) if for_paper else ():
        files |= about.attempt(study, section.short, partial(files_of_figure, section)) or {}
    publish(folder, files)
    return list(files)


def files_of_table(table: Table, caption: str, for_paper: bool, study: Study) -> dict[str, bytes]:
    """Return the files of a table by path: CSV, and LaTeX ``for_paper``; none without rows."""
    frame = table(study)
    if not len(frame):
        return {}
    files = {f"tables/{table.id}.csv": table_csv(frame).encode()}
    if for_paper and table.id in IN_LATEX:
        text = latex_table(table, frame, caption, about.notes_of(study, frame.columns))
        files[f"tables/{table.id}.tex"] = text.encode()
    return files


def files_of_figure(section: Section, study: Study) -> dict[str, bytes]:
    """Return the files of a section's figure by path: SVG and PDF; none without a figure."""
    files = {}
    if (plot := plot_of(study, section)) is not None:
        for ending in (".svg", ".pdf"):
            files[f"figures/{plot.id}{ending}"] = picture(plot.figure, ending)
            plot.figure.set_layout_engine("none")  # the next is laid out alike
    return files


@cached
def plot_of(study: Study, section: Section) -> Plot | None:
    """Return the figure of a section; None if the section or the folder has none."""
    return section.figure(study) if section.figure else None


def sections(study: Study) -> list[dict[str, Any]]:
    """Return the sections with a table or figure, as :func:`parts_of` does, and the sections that
    failed, with their ``failure`` in words."""
    allowed = []
    for section in about.visible_sections(study):
        parts = about.attempt(study, section.short, partial(parts_of, section)) or NO_PARTS
        failure = about.failures(study).get(section.short, "")
        if failure or parts["figure"] or parts["rows"]:
            allowed.append({**vars(section), **parts, "failure": failure})
    return allowed


def parts_of(section: Section, study: Study) -> dict[str, Any]:
    """Return the values of a section for the template: table, figure and finding."""
    table, frame, plot = section.table, section.table(study), plot_of(study, section)
    return {
        "table": table.id,
        "rows": len(frame),
        "settings": sum("setting" in names for names in classes_of(table, frame)),
        "html": html_table(table, frame, section.caption) if len(frame) else "",
        "finding": about.finding(study, section),
        "figure": plot,
        "svg": for_page(plot) if plot else "",
    }


def stamp(runs: pd.DataFrame) -> str:
    """Return the hash of the results of runs, by which a report identifies its runs."""
    return hash_of(sorted(zip(runs.run_id, runs.result, strict=True)))


def page(study: Study, home: str) -> str:
    """Return the page in HTML, which needs no other file and no network.

    ``home`` is the path from the page's folder to the results.
    """
    environment = Environment(
        loader=FileSystemLoader(HERE),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: about.shown(value) if type(value) is str else value,
    )
    environment.filters |= {"number": number, "listed": listed}
    try:
        links = metadata("coartic").get_all("Project-URL") or []
    except PackageNotFoundError:
        links = []
    made_with = study.made_with
    cards = [(section, lines[0]) for section, lines in about.answers(study)]
    return environment.get_template("page.html.jinja").render(
        title=f"Coarticulation of a simulated robot: suite {study.suite}",
        description=" ".join(text for _, text in cards),
        styles=(HERE / "page.css").read_text("utf-8") + part_of_page("play.css"),
        player=about.attempt(study, "Film", player) or "",
        script=(HERE / "page.js").read_text("utf-8"),
        cards=cards,
        differences=about.attempt(study, "Differences of gaps", differences) or {},
        sections=sections(study),
        suite=study.suite,
        home=home,
        stamp=stamp(study.runs),
        folder=quote(str(study.folder)),
        version=made_with["coartic"],
        commit=made_with["commit"]["id"][:12] if made_with["commit"] else "",
        date=made_with["date"][:10],
        limits=about.limits(study),
        failures=about.failures(study),
        links=dict(link.split(", ", 1) for link in links),
    )
