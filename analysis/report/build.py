"""A report: one page that stands alone, ``report.html``, and its tables and figures as files."""

from __future__ import annotations

import html
import os
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from shlex import quote
from typing import Any, get_args

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from coartic import CoarticError
from coartic.analysis.claims.judging import Verdict
from coartic.analysis.figures.plot import Plot, for_page, picture
from coartic.analysis.report import about
from coartic.analysis.report.player import player
from coartic.analysis.report.render import IN_LATEX, MOST_ROWS, TONES, html_table, latex_table
from coartic.analysis.report.trace import stamp
from coartic.analysis.sections import SECTIONS, TABLES
from coartic.analysis.study import Study, cached
from coartic.analysis.topics.ranking import differences
from coartic.analysis.words import id_of, listed, number
from coartic.files import check_inside, make_folder, publish
from coartic.play.page import text_of

HERE = Path(__file__).parent


def write_report(study: Study, folder: Path, *, for_paper: bool = True) -> list[str]:
    """Write a report into ``folder``, in the place of an earlier one; the paths of its files.

    ``for_paper``: tables as LaTeX beside those as CSV, and figures as SVG and PDF.

    Raises CoarticError where the folder holds the results themselves, the report of other results,
    or anything that no report wrote.
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
    elif report.exists() and f'-results" content="{home}"' not in html.unescape(
        report.read_text("utf-8").partition("<title>")[0]
    ):
        raise CoarticError(f"{folder} holds the report of other results: choose another folder")
    files = {"report.html": page(study, home).encode()}
    captions = {id_of(section.table): section.caption for section in SECTIONS}
    for name, table in TABLES.items():
        frame = table(study)
        if len(frame):
            files[f"tables/{name}.csv"] = frame.to_csv(lineterminator="\n").encode()
            if for_paper and name in IN_LATEX and len(frame) <= MOST_ROWS:
                notes = about.notes_of(study, frame.columns)
                text = latex_table(frame, name, captions[name], notes)
                files[f"tables/{name}.tex"] = text.encode()
    if for_paper:
        for name, plot in plots(study).items():
            for ending in (".svg", ".pdf"):
                files[f"figures/{name}{ending}"] = picture(plot.figure, ending)
                plot.figure.set_layout_engine("none")  # the next is laid out alike
    publish(folder, files)
    return list(files)


@cached
def plots(study: Study) -> dict[str, Plot]:
    """Figures of the page by id, as far as the runs allow them."""
    drawn = [each.figure(study) for each in about.visible_sections(study) if each.figure]
    return {plot.id: plot for plot in drawn if plot}


def sections(study: Study) -> list[dict[str, Any]]:
    """Sections that the runs allow, as the template wants them.

    With their ``finding`` and the number of ``rows``; ``figure`` is None where the runs do not
    allow it.
    """
    allowed = []
    for section in about.visible_sections(study):
        name, frame = id_of(section.table), section.table(study)
        plot = plots(study).get(id_of(section.figure)) if section.figure else None
        if plot or len(frame):
            words = {
                "table": name,
                "rows": len(frame),
                "html": html_table(frame, name, section.caption) if len(frame) else "",
                "example": f"'{frame.index[0]}'" if len(frame) else "",
                "finding": about.finding(study, section),
                "figure": plot,
                "svg": for_page(plot) if plot else "",
            }
            allowed.append(vars(section) | words)
    return allowed


def page(study: Study, home: str) -> str:
    """The page of HTML, which needs no other file and no network; ``home`` leads from its folder to
    the results."""
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
    verdicts, claims = list(get_args(Verdict)), TABLES["claims"](study).reset_index(names="id")
    claims = claims.sort_values("verdict", key=lambda each: each.map(verdicts.index), kind="stable")
    made_with = study.made_with
    cards = [(section, lines[0]) for section, lines in about.answers(study)]
    return environment.get_template("page.html.jinja").render(
        title=f"Coarticulation of a simulated robot: suite {study.suite}",
        description=" ".join(text for _, text in cards),
        styles=(HERE / "page.css").read_text("utf-8") + text_of("play.css"),
        player=player(study),
        script=(HERE / "page.js").read_text("utf-8"),
        cards=cards,
        differences=differences(study),
        sections=sections(study),
        claims=claims.to_dict("records"),
        verdicts=verdicts,
        tones=TONES,
        suite=study.suite,
        home=home,
        stamp=stamp(study.runs),
        folder=quote(str(study.folder)),
        version=made_with["coartic"],
        commit=made_with["commit"]["id"][:12] if made_with["commit"] else "",
        date=made_with["date"][:10],
        limits=about.limits(study),
        links=dict(link.split(", ", 1) for link in links),
    )
