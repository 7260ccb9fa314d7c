"""A report: one page, its tables and figures, and a summary.

``report.html`` stands alone; ``summary.md`` is its first screen, for code hosts; ``tables/`` has
every table as CSV and LaTeX, and ``figures/`` every figure as SVG and PDF.
"""

from __future__ import annotations

import os
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any, get_args

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from coartic import CoarticError
from coartic.analysis.claims.judging import Verdict
from coartic.analysis.figures.plot import Plot, for_page, picture
from coartic.analysis.report import about
from coartic.analysis.report.player import player
from coartic.analysis.report.render import TONES, html_table, latex_table
from coartic.analysis.sections import FIGURES, SECTIONS, TABLES
from coartic.analysis.study import Study, cached
from coartic.analysis.words import NONE, id_of, listed, number
from coartic.files import check_inside, make_folder, publish
from coartic.play.page import text_of

PAPER_LINK = "https://doi.org/10.1080/00222895.2013.828344"
SEARCHED = 12
"""Rows of a table above which it has a field to search them."""
LONG = 20
"""Rows of a table above which it scrolls in a box of its own."""


def report_files(study: Study, *, for_paper: bool = True) -> dict[str, bytes]:
    """The report's files by their paths within its folder.

    ``for_paper``: also LaTeX tables, figures as PDF, and figures that the page does not show.
    """
    files = {"report.html": page(study).encode(), "summary.md": summary(study).encode()}
    captions = {id_of(section.table): section.caption for section in SECTIONS}
    for name, table in TABLES.items():
        frame = table(study)
        if len(frame):
            files[f"tables/{name}.csv"] = frame.to_csv(lineterminator="\n").encode()
            if for_paper:
                caption = captions.get(name) or name.replace("-", " ").capitalize()
                notes = about.notes_of(study, frame.columns)
                files[f"tables/{name}.tex"] = latex_table(frame, name, caption, notes).encode()
    files["tables/notes.txt"] = about.notes_on_tables(study).encode()
    for name in FIGURES if for_paper else plots(study):
        if plot := plots(study).get(name) or draw_figure(study, name):
            for ending in (".svg", ".pdf") if for_paper else (".svg",):
                files[f"figures/{name}{ending}"] = picture(plot.figure, ending)
    return files


def write_report(
    study: Study,
    folder: Path,
    *,
    for_paper: bool = True,
) -> list[str]:
    """Write a report into ``folder``, in the place of an earlier one; the paths of its files.

    Raises CoarticError where the folder holds the results themselves or anything that no report
    wrote.
    """
    if Path(os.path.realpath(study.folder)).is_relative_to(os.path.realpath(folder)):
        raise CoarticError(
            f"{folder} holds the results themselves, or lies above them. Give the report a folder "
            "of its own."
        )
    if study.folder.absolute() in folder.absolute().parents:
        check_inside(study.folder, folder)
    make_folder(folder, ["report.html"])
    files = report_files(study, for_paper=for_paper)
    publish(folder, files)
    return list(files)


def draw_figure(study: Study, name: str) -> Plot | None:
    """A figure by its id; None where the runs do not allow it."""
    try:
        return FIGURES[name](study)
    except CoarticError:
        return None


@cached
def plots(study: Study) -> dict[str, Plot]:
    """Figures of the page by id, as far as the runs allow them."""
    ids = [id_of(each.figure) for each in about.visible_sections(study) if each.figure]
    return {name: plot for name in ids if (plot := draw_figure(study, name)) is not None}


def sections(study: Study) -> list[dict[str, Any]]:
    """Sections that the runs allow, as the template wants them.

    With their ``finding``; figure or table is None where the runs do not allow it.
    """
    allowed = []
    for section in about.visible_sections(study):
        name, frame = id_of(section.table), section.table(study)
        plot = plots(study).get(id_of(section.figure)) if section.figure else None
        if plot is None and not len(frame):
            continue
        rows = {
            "html": html_table(frame, name, section.caption),
            "searched": len(frame) > SEARCHED,
            "long": len(frame) > LONG,
            "example": f"'{frame.index[0]}'",
        } if len(frame) else None  # fmt: skip
        words = {
            "table": name,
            "finding": about.sentences(study).get(section.id, ""),
            "rows": rows,
            "figure": plot and for_page(plot),
        }
        allowed.append(vars(section) | words)
    return allowed


@cache
def template(name: str) -> Template:
    """A template beside this file; texts that it shows are escaped where it is of HTML."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        autoescape=name.endswith(".html.jinja"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: about.shown(value) if type(value) is str else value,
    )
    environment.filters |= {"number": number, "listed": listed, "inert": inert}
    return environment.get_template(name)


def page(study: Study) -> str:
    """The page of HTML, which needs no other file and no network."""
    here = Path(__file__).parent
    scripts = [(here / name).read_text("utf-8") for name in ("page.js", "address.js")]
    try:
        links = metadata("coartic").get_all("Project-URL") or []
    except PackageNotFoundError:
        links = []
    return template("page.html.jinja").render(
        description=" ".join(text for _, text in about.answers(study)),
        styles=(here / "page.css").read_text("utf-8") + text_of("play.css"),
        player=player(study),
        script="\n".join(f"{{\n{script}}}" for script in scripts),
        answers=about.answers(study),
        sections=sections(study),
        claims=claims_for_page(study),
        verdicts=get_args(Verdict),
        provenance=about.provenance(study),
        limits=about.limits(study),
        paper_link=PAPER_LINK,
        links=dict(link.split(", ", 1) for link in links),
    )


def summary(study: Study) -> str:
    """The first screen as Markdown, with pictures, for where code hosts show it."""
    return template("summary.md.jinja").render(
        answers=about.answers(study),
        provenance=about.provenance(study),
        figures=[name for name in ("postures", "ranking", "runtimes") if name in plots(study)],
    )


def inert(text: str) -> str:
    """Text for Markdown in which names from elsewhere make no tags, links and pictures."""
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", text).replace("](", "]\\(")


def claims_for_page(study: Study) -> list[dict[str, str]]:
    """Claims as the template wants them, by verdict."""
    order = get_args(Verdict)
    rows = TABLES["claims"](study).reset_index(names="id")
    return [
        {
            **{
                key: str(row[key])
                for key in ("id", "statement", "verdict", "evidence", "test", "place", "quote")
            },
            "tone": TONES[row["verdict"]],
            "sets": row["sets"] or NONE,
            "p": "< 0.001" if row["p_holm"] < 0.001 else number(row["p_holm"], 3),
        }
        for row in sorted(rows.to_dict("records"), key=lambda row: order.index(row["verdict"]))
    ]
