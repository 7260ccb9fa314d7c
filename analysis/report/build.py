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
from coartic.analysis.report import facts
from coartic.analysis.report.numbers import numbers_tex
from coartic.analysis.report.player import player_json
from coartic.analysis.report.render import csv_table, html_table, latex_table, tone_of
from coartic.analysis.report.sections import Filled, drawn, filled
from coartic.analysis.report.text import answers, environment
from coartic.analysis.study import Study
from coartic.analysis.tables import TABLES
from coartic.analysis.words import number
from coartic.files import check_folder, publish

PAPER_LINK = "https://doi.org/10.1080/00222895.2013.828344"
SEARCHED = 12
"""Rows of a table above which it has a field to search them."""
_POINTS = 72.0  # an inch
_MAGNIFIED = 1.3
_WIDE = 320.0  # pt: a phone scrolls what is wider


def report_files(study: Study, *, for_paper: bool = True) -> dict[str, bytes]:
    """The report's files by their paths within its folder.

    ``for_paper``: also LaTeX tables, figures as PDF, and figures that the page does not show.
    """
    sections = list(filled(study))
    plots = {part.plot.id: part.plot for part in sections if part.plot is not None}
    files = {"report.html": page(study, sections).encode(), "summary.md": summary(study).encode()}
    for name, table in TABLES.items():
        frame = table(study)
        if len(frame):
            files[f"tables/{name}.csv"] = csv_table(frame).encode()
            if for_paper:
                caption = _caption(name, sections)
                files[f"tables/{name}.tex"] = latex_table(frame, name, caption).encode()
    files["numbers.tex"] = numbers_tex(study).encode()
    if for_paper:
        plots |= _other_figures(study, plots)
    endings = (".svg", ".pdf") if for_paper else (".svg",)
    for plot in plots.values():
        for ending in endings:
            files[f"figures/{plot.id}{ending}"] = picture(plot, ending)
    return files


def write_report(
    study: Study,
    folder: Path,
    *,
    for_paper: bool = True,
    begin: Callable[[], object] = lambda: None,
) -> list[str]:
    """Write a report into ``folder``, in the place of an earlier one; the paths of its files.

    ``begin`` is called when all is made and nothing written. Raises CoarticError where the folder
    holds the results themselves or anything that no report wrote.
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


def page(study: Study, sections: list[Filled]) -> str:
    """The page of HTML, which needs no other file and no network."""
    here = Path(__file__).parent
    player = player_json(study)
    scripts = ["page.js", *(["player.js"] if player else [])]
    template = environment(escape=True).get_template("page.html.jinja")
    script = "\n".join(f"{{\n{(here / name).read_text(encoding='utf-8')}}}" for name in scripts)
    return template.render(
        title=_title(study),
        description=" ".join(answer["text"] for answer in answers(study)),
        styles=(here / "page.css").read_text(encoding="utf-8"),
        script=script,
        player=player.replace("<", "\\u003c"),
        answers=answers(study),
        sections=[_for_page(part) for part in sections],
        claims=_claims(study),
        verdicts=get_args(Verdict),
        made=facts.made(study),
        limits=facts.limits(study),
        paper_link=PAPER_LINK,
        links=_links(),
    )


def summary(study: Study) -> str:
    """The first screen as Markdown, with pictures, for where code hosts show it."""
    template = environment(escape=False).get_template("summary.md.jinja")
    figures = [name for name in ("postures", "ranking", "price") if drawn(study, name)]
    return template.render(
        title=_title(study), answers=answers(study), made=facts.made(study), figures=figures
    )


def _title(study: Study) -> str:
    return f"Coarticulation of a simulated robot: suite {study.suite}"


def _for_page(part: Filled) -> dict[str, Any]:
    """A section as the template wants it."""
    section = part.section
    return {
        "id": part.id,
        "short": section.short,
        "title": section.title,
        "finding": part.finding,
        "note": section.note,
        "figure": None if part.plot is None else _figure(part.plot),
        "table": _table(part) if part.id != "claims" else None,
    }


def _table(part: Filled) -> dict[str, Any] | None:
    if part.table is None:
        return None
    section = part.section
    return {
        "id": section.table,
        "caption": section.caption,
        "html": html_table(part.table, section.table, section.caption),
        "searched": len(part.table) > SEARCHED,
        "example": f"'{part.table.index[0]}'",
    }


def _figure(plot: Plot) -> dict[str, Any]:
    points = plot.figure.get_figwidth() * _POINTS
    return {
        "id": plot.id,
        "title": plot.title,
        "caption": plot.caption,
        "svg": svg_for_page(plot),
        "wide": points > _WIDE,
        "width": f"{_MAGNIFIED * points / 12:.0f}",
    }


def _claims(study: Study) -> list[dict[str, str]]:
    """Claims as the template wants them, supported ones first, those used for choosing last."""
    order = get_args(Verdict)
    entries = sorted(judged(study), key=lambda entry: order.index(entry.verdict))
    table = tables.claims(study)
    return [
        {
            "id": entry.claim.id,
            "statement": str(table.statement[entry.claim.id]),
            "verdict": entry.verdict,
            "tone": tone_of(entry.verdict),
            "evidence": entry.finding.evidence,
            "test": str(table.test[entry.claim.id]),
            "quote": entry.claim.quote,
            "place": ", ".join(filter(None, (entry.claim.place, entry.claim.figure))),
            "ensemble": held_in_words(entry.claim.id) if entry.claim.fitted else "–",
            "p": "< 0.001" if entry.adjusted_p < 0.001 else number(entry.adjusted_p, 3),
        }
        for entry in entries
    ]


def _caption(table: str, sections: list[Filled]) -> str:
    captions = {part.section.table: part.section.caption for part in sections}
    return captions.get(table) or table.replace("-", " ").capitalize()


def _other_figures(study: Study, shown: dict[str, Plot]) -> dict[str, Plot]:
    """Figures that no section shows, for a paper."""
    found = {}
    for name in FIGURES:
        plot = None if name in shown else drawn(study, name)
        if plot is not None:
            found[name] = plot
    return found


def _links() -> dict[str, str]:
    """Where project and documentation are, as far as the package says it."""
    try:
        urls = metadata("coartic").get_all("Project-URL") or []
    except PackageNotFoundError:
        return {}
    return dict(text.split(", ", 1) for text in urls)
