"""A report: one page, its tables and figures, numbers for a paper, and a summary.

``report.html`` stands alone; ``summary.md`` is its first screen, for code hosts; ``tables/`` has
every table as CSV and LaTeX, ``figures/`` every figure as SVG and PDF, and ``numbers.tex`` the
headline numbers as macros.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any, get_args

from coartic import CoarticError
from coartic.analysis import tables
from coartic.analysis.claims.ensemble import held_in_words
from coartic.analysis.claims.judge import judged
from coartic.analysis.claims.register import Verdict
from coartic.analysis.figures import FIGURES, Plot
from coartic.analysis.figures.plot import picture, svg_for_page
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.report import facts
from coartic.analysis.report.numbers import numbers_tex
from coartic.analysis.report.player import player_json
from coartic.analysis.report.render import TONES, csv_table, html_table, latex_table
from coartic.analysis.report.text import answers, environment, sentence
from coartic.analysis.study import Study, cached
from coartic.analysis.words import number, read_beside
from coartic.files import check_folder, publish

PAPER_LINK = "https://doi.org/10.1080/00222895.2013.828344"
SECTIONS: dict[str, dict[str, Any]] = read_beside(__file__, "sections")
"""The sections of the page by id, in its order."""
SEARCHED = 12
"""Rows of a table above which it has a field to search them."""
_MAGNIFIED = 1.3  # figures on the page
_PHONE = 320 / 72  # inches: a phone scrolls what is wider


def report_files(study: Study, *, for_paper: bool = True) -> dict[str, bytes]:
    """The report's files by their paths within its folder.

    ``for_paper``: also LaTeX tables, figures as PDF, and figures that the page does not show.
    """
    files = {"report.html": page(study).encode(), "summary.md": summary(study).encode()}
    captions = {section.get("table"): section.get("caption") for section in SECTIONS.values()}
    for name, table in tables.TABLES.items():
        frame = table(study)
        if len(frame):
            files[f"tables/{name}.csv"] = csv_table(frame).encode()
            if for_paper:
                caption = captions.get(name) or name.replace("-", " ").capitalize()
                files[f"tables/{name}.tex"] = latex_table(frame, name, caption).encode()
    files["numbers.tex"] = numbers_tex(study).encode()
    names = [section["figure"] for section in sections(study).values() if "figure" in section]
    for name in FIGURES if for_paper else names:
        if plot := plots(study).get(name) or drawn(study, name):
            for ending in (".svg", ".pdf") if for_paper else (".svg",):
                files[f"figures/{name}{ending}"] = picture(plot.figure, ending)
    return files


def write_report(
    study: Study,
    folder: Path,
    *,
    for_paper: bool = True,
    begin: Callable[[], object] = lambda: None,
) -> list[str]:
    """Write a report into ``folder``, in the place of an earlier one; the paths of its files.

    ``begin`` is called when everything is computed and nothing written. Raises CoarticError where
    the folder holds the results themselves or anything that no report wrote.
    """
    if Path(os.path.realpath(study.folder)).is_relative_to(os.path.realpath(folder)):
        raise CoarticError(
            f"{folder} holds the results themselves, or lies above them. Give the report a folder "
            "of its own."
        )
    check_folder(folder, ["report.html"])
    files = report_files(study, for_paper=for_paper)
    begin()
    publish(folder, files)
    return list(files)


def drawn(study: Study, name: str) -> Plot | None:
    """A figure by its id; None where the runs do not allow it."""
    try:
        return FIGURES[name](study)
    except CoarticError:
        return None


@cached
def plots(study: Study) -> dict[str, Plot]:
    """Figures of the page by id, as far as the runs allow them."""
    shown = {
        section["figure"]
        for section in SECTIONS.values()
        if "figure" in section and (one_by_one(study) or not section.get("single"))
    }
    every = {name: drawn(study, name) for name in FIGURES if name in shown}
    return {name: plot for name, plot in every.items() if plot is not None}


@cached
def sections(study: Study) -> dict[str, dict[str, Any]]:
    """Sections of ``sections.toml`` that the runs allow, by id.

    With their ``finding``, and without the figure or the table that the runs do not allow.
    """
    allowed = {}
    for name, section in SECTIONS.items():
        left_out = set()
        if section.get("figure") not in plots(study):
            left_out.add("figure")
        if "table" in section and not len(tables.TABLES[section["table"]](study)):
            left_out.add("table")
        parts = {key: value for key, value in section.items() if key not in left_out}
        if {"figure", "table"} & parts.keys() and (one_by_one(study) or not section.get("single")):
            of = getattr(facts, name)(study) if hasattr(facts, name) else None
            allowed[name] = parts | {"finding": "" if of is None else sentence(name, of)}
    return allowed


def page(study: Study) -> str:
    """The page of HTML, which needs no other file and no network."""
    here = Path(__file__).parent
    player = player_json(study)
    scripts = ["page.js", *(["player.js"] if player else [])]
    template = environment(escape=True).get_template("page.html.jinja")
    script = "\n".join(f"{{\n{(here / name).read_text(encoding='utf-8')}}}" for name in scripts)
    try:
        links = metadata("coartic").get_all("Project-URL") or []
    except PackageNotFoundError:
        links = []
    return template.render(
        title=title(study),
        description=" ".join(answer["text"] for answer in answers(study)),
        styles=(here / "page.css").read_text(encoding="utf-8"),
        script=script,
        player=player.replace("<", "\\u003c"),
        answers=answers(study),
        sections=[section_for_page(study, *section) for section in sections(study).items()],
        claims=claims_for_page(study),
        verdicts=get_args(Verdict),
        provenance=facts.provenance(study),
        limits=facts.limits(study),
        paper_link=PAPER_LINK,
        links=dict(link.split(", ", 1) for link in links),
    )


def summary(study: Study) -> str:
    """The first screen as Markdown, with pictures, for where code hosts show it."""
    template = environment(escape=False).get_template("summary.md.jinja")
    figures = [name for name in ("postures", "ranking", "price") if name in plots(study)]
    return template.render(
        title=title(study),
        answers=answers(study),
        provenance=facts.provenance(study),
        figures=figures,
    )


def title(study: Study) -> str:
    """Title of the page and of the summary."""
    return f"Coarticulation of a simulated robot: suite {study.suite}"


def section_for_page(study: Study, name: str, section: dict[str, Any]) -> dict[str, Any]:
    """A section as the template wants it."""
    values = {"note": "", **section, "id": name, "figure": None, "table": None}
    if "figure" in section:
        plot = plots(study)[section["figure"]]
        inches = plot.figure.get_figwidth()
        values["figure"] = {
            "id": plot.id,
            "title": plot.title,
            "caption": plot.caption,
            "svg": svg_for_page(plot),
            "wide": inches > _PHONE,
            "width": f"{_MAGNIFIED * inches * 72 / 12:.0f}",
        }
    if "table" in section:
        frame = tables.TABLES[section["table"]](study)
        values["table"] = {
            "id": section["table"],
            "caption": section["caption"],
            "html": html_table(frame, section["table"], section["caption"]),
            "searched": len(frame) > SEARCHED,
            "example": f"'{frame.index[0]}'",
        }
    return values


def claims_for_page(study: Study) -> list[dict[str, str]]:
    """Claims as the template wants them, supported ones first, those used for choosing last."""
    order = get_args(Verdict)
    table = tables.claims(study)
    return [
        {
            "id": entry.claim.id,
            "statement": str(table.statement[entry.claim.id]),
            "verdict": entry.verdict,
            "tone": TONES[entry.verdict],
            "evidence": entry.finding.evidence,
            "test": str(table.test[entry.claim.id]),
            "quote": entry.claim.quote,
            "place": ", ".join(filter(None, (entry.claim.place, entry.claim.figure))),
            "ensemble": held_in_words(entry.claim.id) or "–" if entry.claim.fitted else "–",
            "p": "< 0.001" if entry.adjusted_p < 0.001 else number(entry.adjusted_p, 3),
        }
        for entry in sorted(judged(study), key=lambda entry: order.index(entry.verdict))
    ]
