"""Write a report: the page ``report.html``, and files with its tables and figures."""

from __future__ import annotations

import html
import os
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from coartic import CoarticError, __version__
from coartic.analysis.figures.drawings import draw_ranking, draw_shared_goal, draw_tasks
from coartic.analysis.figures.plot import FIGURES, Plot, for_page, panels_for_page, picture
from coartic.analysis.figures.style import ONE
from coartic.analysis.report import sections
from coartic.analysis.report.player import player
from coartic.analysis.report.sections import (
    IN_NOISE,
    QUESTIONS,
    SECTIONS,
    Section,
    words_after,
)
from coartic.analysis.standings import neighbours, reference
from coartic.analysis.study import Study, ending_of, when_of
from coartic.analysis.tables import (
    SOLUTIONS_ONLY,
    TABLES,
    Table,
    caption_of,
    csv_of_worlds,
    html_of,
    is_setting,
    latex_of,
    list_contrasts,
    list_not_ranked,
    list_ranking,
    matrix_of,
)
from coartic.analysis.words import id_of, listed, marked, number
from coartic.internal.files import check_inside, describe_os_errors, make_folder, publish
from coartic.play.page import part_of_page
from coartic.runs.plan import hash_of, world_title
from coartic.runs.shipped import open_results
from coartic.runs.store import lock
from coartic.tasks.task import shipped_tasks

HERE = Path(__file__).parent
LONG = 10
"""Largest number of rows of a table that the page does not fold (:attr:`.Section.unfolded`)."""


def write_report(
    study: Study,
    folder: Path,
    *,
    for_paper: bool = True,
    width: float | None = None,
    own: Section | None = None,
    watch: Callable[[str], object] = str,
) -> tuple[list[str], dict[str, str]]:
    """Write a report into a folder, and replace an earlier report of the same results.

    The page ``report.html`` and a CSV file for each table with rows are always written. If the
    study has several worlds,

    - the page shows the sections of the first world, and a section for each other world;
    - a CSV file has the rows of all worlds, with a column ``world``;
    - a LaTeX file has a table for each world, because headings and best known rewards differ;
    - the name of a figure's file ends in the suffix of its world (:func:`.ending_of`).

    Parameters
    ----------
    study : Study
        Results of the folder, with all worlds.
    folder : pathlib.Path
        Folder of the report. It is made if it does not exist.
    for_paper : bool
        True to also write tables as LaTeX, and figures as SVG and PDF.
    width : float, optional
        Width of the SVG and PDF figures, in inches. By default each figure has its usual width: one
        or two columns of a journal.
    own : Section, optional
        Section with tables and figures of the user (:func:`.own_section`).
    watch : callable
        Function for showing the progress. It is called with the title of each section before the
        section is made, and with ``TITLE, for print`` before the figures of the section are made
        for files.

    Returns
    -------
    list of str
        Paths of the written files, relative to ``folder``.
    dict of str to str
        Maps the name of each part of the report that could not be made to its error.

    Raises
    ------
    CoarticError
        - ``folder`` cannot be written, or another process is writing a report into it.
        - ``folder`` contains the results themselves.
        - ``folder`` already has a report of other results (if ``folder`` is inside the results
          folder, this is not checked), or of the same after another number of trials.
        - ``folder`` contains a file that has the name of a file of the report, but was not written
          by coartic.
        - The results cannot be read, or a stored run cannot be executed again
          (:meth:`.Study.executed`).
    """
    if Path(os.path.realpath(study.folder)).is_relative_to(os.path.realpath(folder)):
        raise CoarticError(
            f"{folder} contains the results themselves; the report must have a folder of its own"
        )
    make_folder(folder, ["report.html"])
    with lock(folder, command="coartic report"):
        home, report = os.path.relpath(study.folder, folder), folder / "report.html"
        with describe_os_errors(report):
            head = report.read_text("utf-8").partition("<title>")[0] if report.exists() else ""
        if study.folder.absolute() in folder.absolute().parents:
            check_inside(study.folder, folder)
        elif head and f'-results" content="{home}"' not in html.unescape(head):
            raise CoarticError(f"{folder} holds the report of other results; choose another folder")
        after = re.search(r'-after" content="(\d+)"', head)
        if head and (after and after[1]) != (study.after and str(study.after)):
            held = f"after {after[1]} trials" if after else "of whole runs"
            raise CoarticError(f"{folder} holds the report {held}; choose another folder")
        failures: dict[str, str] = {}
        sections_of_all = [*SECTIONS, *([own] if own else [])]
        names = {table.id: section.title for section in sections_of_all for table in section.tables}
        tables = TABLES | ({table.id: table for table in own.tables} if own else {})
        if study.after:
            tables = {name: table for name, table in tables.items() if name not in SOLUTIONS_ONLY}
        shown, first = list[dict[str, Any]](), list[Plot]()
        frames = defaultdict[str, dict[str, pd.DataFrame]](dict)
        texts, files = defaultdict[str, list[str]](list), {"report.html": b""}
        if len(study.contrasts):
            shown += _sections_shown(study, [QUESTIONS], [], failures, watch)
            frames[list_contrasts.id][""] = list_contrasts(study)
            if for_paper:
                title = QUESTIONS.title
                tex = sections.attempt(failures, title, _latex_of, study, list_contrasts)
                texts[list_contrasts.id].append(tex or "")
                made = sections.attempt(failures, title, _files_of_figures, study, QUESTIONS, width)
                files |= made or {}
        for world, of_world in study.worlds.items():  # all of a world, so that caches are small
            of_page = [sections.section_of_world(of_world)]
            if is_first := not any(section["id"] != QUESTIONS.id for section in shown):
                of_page = [*sections.visible_sections(of_world), *([own] if own else [])]
                first = sections.attempt(failures, "Pictures", _first_figures, of_world) or []
            shown += _sections_shown(of_world, of_page, first * is_first, failures, watch)
            for name, table in tables.items():
                if table.of_folder:
                    continue
                title = names.get(name, name)
                frame = sections.attempt(failures, title, table, of_world)
                if frame is not None and len(frame):
                    frames[name][world] = frame
                    if for_paper and (
                        tex := sections.attempt(failures, title, _latex_of, of_world, table)
                    ):
                        texts[name].append(tex)
            for section in of_page if for_paper else ():
                watch(f"{section.title}, for print")
                of_figures = sections.attempt(
                    failures, section.title, _files_of_figures, of_world, section, width
                )
                files |= of_figures or {}
        for name, of_worlds in frames.items():
            files[f"tables/{name}.csv"] = csv_of_worlds(of_worlds).encode()
        files |= {f"tables/{name}.tex": "\n".join(of).encode() for name, of in texts.items() if of}
        files["report.html"] = _page(study, home, shown, first, failures).encode()
        publish(folder, files, _names_of_files())
        return list(files), failures


def _names_of_files() -> str:
    """Return a regular expression of the paths of all files that a report can have."""
    tables, figures = "|".join(TABLES), "|".join(FIGURES)
    of_figures = rf"figures/({figures})(-[a-z0-9-]+)?\.(svg|pdf)"
    return rf"report\.html|tables/({tables})\.(csv|tex)|{of_figures}"


def _latex_of(study: Study, table: Table) -> str:
    """Return a table of a study of one world as LaTeX.

    The result is the empty string if LaTeX has no column of the table.
    """
    if not any(column.in_latex for column in table.columns):
        return ""
    notes = [] if table.of_folder else sections.notes_of(study, table(study).columns)
    return latex_of(table, study, _rows_shown(study, table), notes)


def _files_of_figures(study: Study, section: Section, width: float | None) -> dict[str, bytes]:
    """Return a dict that maps paths of a section's picture files to their contents.

    ``width`` is the width of the figures in inches; None stands for the usual width of each figure.
    """
    files = {}
    drawn = (draw(study, width=width) for draw in section.figures)
    for plot in filter(None, drawn):
        for ending in (".svg", ".pdf"):
            files[f"figures/{plot.id}{ending}"] = picture(plot.figure, ending)
            plot.figure.set_layout_engine("none")  # so that both files have the same layout
    return files


def _rows_shown(study: Study, table: Table) -> pd.DataFrame:
    """Return the rows of a table that page and LaTeX show.

    Rows about settings and ablations of other methods in the table (:func:`.is_setting`) are left
    out, unless ``table.with_settings`` is True.
    """
    frame = table(study)
    return frame if table.with_settings else frame[~is_setting(study, frame)]


def _parts_of(study: Study, section: Section, first: Sequence[Plot]) -> dict[str, Any]:
    """Return a dict of the values of a section that the page's template needs.

    ``first`` contains the figures at the top of the page, which the section does not repeat. The
    keys of the dict are

    - ``finding``: the finding as a list of lines (:func:`.finding`);
    - ``first_lines``: the number of these lines that are at the top of the page instead of in the
      section: all lines for the ranking of a study that varies parameters, otherwise one;
    - ``figures``: a tuple for each figure: the plot, its SVG, and the SVGs of its panels for phones
      (:func:`.panels_for_page`);
    - ``shown``: a dict for each table that has rows, with its ``id``, the name of its ``file``
      without suffix, its ``caption``, its number of ``rows``, its ``html``, the sentence ``below``
      it (:func:`.neighbours`), whether it is ``folded`` on the page (:attr:`.Section.unfolded`),
      and whether it ``is_printed``. All tables are printed, except the table of methods that are
      not ranked.
    """
    drawn = {plot.id for plot in first}
    draws = [draw for draw in section.figures if id_of(draw) + ending_of(study) not in drawn]
    figures = [plot for draw in draws if (plot := draw(study)) is not None]
    has_figure = bool(figures) or len(draws) < len(section.figures)
    tables = []
    for table in section.tables:
        if len(frame := _rows_shown(study, table)):
            is_long = table not in section.unfolded or len(frame) > LONG
            folded = is_long and (has_figure or not section.figures)
            folded = (folded or table is list_not_ranked) and table is not list_ranking
            words: dict[str, Any] = {"id": table.id + ending_of(study), "file": table.id}
            words |= {"is_printed": table is not list_not_ranked}
            words |= {"caption": caption_of(table, study), "rows": len(frame)}
            words |= {"below": neighbours(study) if table is list_ranking else ""}
            tables.append({**words, "html": html_of(table, study, frame), "folded": folded})
    finding = sections.finding(study, section)
    is_answer = section is QUESTIONS or (
        list_ranking in section.tables and sections.varies_parameters(study)
    )
    return {
        "finding": finding,
        "first_lines": len(finding) if is_answer else 1,
        "figures": [(plot, for_page(plot), panels_for_page(plot)) for plot in figures],
        "shown": tables,
    }


def stamp(runs: pd.DataFrame) -> str:
    """Return a hash (64 hex digits) of the ids and results of runs.

    The hash does not depend on the order of the runs.
    """
    return hash_of(sorted(zip(runs.run_id, runs.result, strict=True)))


def _first_figures(study: Study) -> list[Plot]:
    """Return the figures at the top of the page, one journal column wide.

    The first figure is the ranking. If the study does not vary parameters, there is a second
    figure:

    - the figure of the postures at a goal that two tasks share (:func:`.draw_shared_goal`), if all
      individual tasks are tasks of the paper, there is such a goal, and the study is of whole runs;
    - otherwise the figure of the tasks.

    A figure for which the study has no runs or tasks is left out.
    """
    draws = [draw_tasks]
    if study.individual_tasks.keys() <= shipped_tasks().keys() and not study.after:
        draws.insert(0, draw_shared_goal)
    others = (draw(study, width=ONE) for draw in draws if study.varied.empty)
    return [plot for plot in (draw_ranking(study, width=ONE), next(filter(None, others), None))
            if plot]  # fmt: skip


def _heading_of(study: Study) -> str:
    """Return a heading for the page.

    The heading is the title of a user's suite. Otherwise it names the tasks if there are at most
    three, and the suite if there are more.
    """
    when = when_of(study)
    if study.question[0]:
        return f"{study.question[0]}{when}"
    tasks = [marked(task) for task in study.tasks.values()]
    subject = listed(tasks) if len(tasks) <= 3 else f"suite {study.suite}"
    return f"Coarticulation of a simulated robot: {subject}{when}"


def _sections_shown(
    study: Study,
    of_page: Sequence[Section],
    first: Sequence[Plot],
    failures: dict[str, str],
    watch: Callable[[str], object],
) -> list[dict[str, Any]]:
    """Return a dict for each section of a world, for the page's template.

    A section is left out if it has no figure, no table and no error. ``first`` contains the figures
    at the top of the page, which no section repeats. If a section cannot be made, its title and the
    error are added to ``failures``. ``watch`` is called with the title of each section before the
    section is made.
    """
    shown = []
    for section in of_page:
        watch(section.title)
        parts = sections.attempt(failures, section.title, _parts_of, study, section, first)
        parts = parts or {"finding": [], "first_lines": 1, "figures": [], "shown": []}
        failure = failures.get(section.title, "")
        if failure or parts["figures"] or parts["shown"]:
            note = section.note
            if "{reference}" in note:
                note = note.replace("{reference}", reference(study, study.optima))
            shown.append({**vars(section), **parts, "failure": failure, "note": note})
    return shown


def _page(
    study: Study,
    home: str,
    shown: Sequence[Mapping[str, Any]],
    first: Sequence[Plot],
    failures: dict[str, str],
) -> str:
    """Return the page as HTML, which needs neither other files nor a network.

    Parameters
    ----------
    study : Study
        Results of the folder, with all worlds.
    home : str
        Path of the results folder, relative to the folder of the page.
    shown : sequence of mapping
        The sections (:func:`_sections_shown`).
    first : sequence of Plot
        The figures at the top of the page.
    failures : dict of str to str
        Maps the name of each part that could not be made to its error. If the interactive figure
        cannot be made, its error is added.
    """
    main = next(iter(study.worlds.values()))
    environment = Environment(
        loader=FileSystemLoader(HERE),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: sections.shown(value) if type(value) is str else value,
    )
    environment.filters |= {"number": number, "listed": listed}
    ids = [section["id"] for section in shown]
    stage = next((name for name in ("coarticulation", "ranking", "tasks") if name in ids), "")
    try:
        links = metadata("coartic").get_all("Project-URL") or []
    except PackageNotFoundError:
        links = []
    made_with = study.made_with
    with open_results(study.folder) as store:
        versions = store.versions()
    return environment.get_template("page.html.jinja").render(
        title=_heading_of(study),
        after=study.after,
        words_after=words_after(study),
        question=study.question[1],
        styles=(HERE / "page.css").read_text("utf-8") + part_of_page("play.css"),
        player=sections.attempt(failures, "Film", player, main) or "",
        script=(HERE / "page.js").read_text("utf-8"),
        sections=shown,
        matrix=matrix_of(study) if len(study.contrasts) else None,
        first=[(plot, for_page(plot)) for plot in first],
        stage=stage,
        suite=study.suite,
        home=home,
        stamp=stamp(study.stored),
        folder=study.folder_in_commands,
        versions=versions or [made_with["coartic"]],
        cited=made_with["coartic"],
        version=__version__,
        commit=made_with["commit"]["id"][:12] if made_with["commit"] else "",
        date=made_with["date"][:10],
        not_ranked=[line for of in study.worlds.values() for line in sections.failed_methods(of)],
        limits=sections.limits(main) | sections.failures_in(study.runs),
        worlds=[*map(world_title, study.worlds)] if [*study.worlds] != [""] else [],
        in_noise=IN_NOISE if any(of.is_noisy for of in study.worlds.values()) else "",
        conditions={*study.methods.condition},
        failures=failures,
        links=dict(link.split(", ", 1) for link in links),
    )
