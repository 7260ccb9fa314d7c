"""The report of a results folder: which sections, tables and figures it has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from analysis.claims.page import FITTED
from analysis.claims.register import Judged
from analysis.figures import Figures, Plot, all_figures
from analysis.figures.plot import FILES, rendered, svg_text
from analysis.markup import escaped, words
from analysis.report import tables
from analysis.report.document import (
    Block,
    Bullets,
    Column,
    DataTable,
    Document,
    FigureBlock,
    PlayerBlock,
    Prose,
    Row,
    Section,
)
from analysis.report.legends import with_legends
from analysis.report.limitations import limitations
from analysis.report.numbers import PREFIX, Number, headline_numbers, macro_names, numbers_tex
from analysis.report.player import player_json
from analysis.report.summary import tasks_table, unlike_printed, verdicts, without_variants
from analysis.report.trace import FILE, trace_json
from analysis.report.write import check_report_folder, write_report
from analysis.results.folder import Results
from analysis.table import Table
from coartic import CoarticError

if TYPE_CHECKING:
    from analysis.study import Study

MOST_TASKS = 8
"""More would make a report that nobody reads."""
CLAIMS = "claims-register"
"""Id of the section of the claims."""
_FIGURES = {
    "Figure 4": "tasks",
    "Figure 5": "configurations-one-armed",
    "Figure 6": "configurations-two-armed-1",
    "Figure 7": "configurations-two-armed-2",
    "Figure 8": "learned-reward",
}
"""Ours by the paper's."""
_FORMATS = {".pdf": "PDF", ".svg": "SVG", ".png": "PNG", ".csv": "CSV (the data behind it)"}


@dataclass(frozen=True)
class Report:
    """A document with the figures and the numbers that belong to it."""

    document: Document
    plots: tuple[Plot, ...]
    numbers: tuple[Number, ...]
    formats: tuple[str, ...] = FILES
    """Endings of the figures' files."""


def build(
    study: Study, methods: Sequence[str] | None = None, formats: Sequence[str] = FILES
) -> Report:
    """Everything a report holds. A section that the runs do not allow is left out.

    ``methods``: labels that the figures show instead of their own choice; ``formats``: endings of
    the figures' files, ``.svg`` among them. Raises CoarticError for a method that the folder does
    not have, and for other formats.
    """
    if ".svg" not in formats or not set(formats) <= _FORMATS.keys():
        raise CoarticError(
            f"figures as {', '.join(formats)}: choose of {', '.join(_FORMATS)}, .svg among them, "
            "which report.md shows"
        )
    figures = all_figures(study, MOST_TASKS, methods)
    numbers = tuple(headline_numbers(study))
    by_id = {plot.id: plot for plot in figures.plots}
    judged, pairs, scores = study.judged, study.pairs, study.scores
    used: set[str] = set()

    def shown(*starts: str) -> list[Block]:
        """Figures whose ids begin so, each once."""
        found = [name for start in starts for name in by_id if name.startswith(start)]
        fresh = [name for name in dict.fromkeys(found) if name not in used]
        used.update(fresh)
        return [_figure(by_id[name]) for name in fresh]

    sections = [
        _summary(study, judged, scores),
        _section("tasks-drawn", "Tasks", shown("tasks")),
        _section("paper", "Published and ours", [
            *shown("published", "learned-reward"),
            *_tables(tables.published_table(study), tables.exhaustive_table(study)),
            *shown("recruitment"),
        ]),
        _claims(study, judged, set(by_id)),
        _section("movements", "Movements", [
            PlayerBlock(
                "player", "Movements, tick by tick",
                "Of each method the run nearest its median reward, beside the initial solution. "
                "Open squares: left arm; closed circles: right arm; thick: the arm at work; "
                "filled goals are hit.",
                player_json(study),
            ),
            *shown("configurations"),
        ]),
        _section("learning", "Learning", shown("learning-curves")),
        _methods(study, pairs, scores, shown("profiles")),
        _cost(study, shown("frontier")),
        _signatures(study, shown("context"), shown("signatures")),
        _section("more-figures", "More figures", shown("")),
        _section("limitations", "Limitations", [Bullets(limitations(study))]),
        _about(study, figures, numbers, formats),
    ]  # fmt: skip
    document = Document(
        _title(study.results),
        tuple(section for section in sections if section.blocks or section.sections),
        _lead(study.results),
        {key: tuple(map(str, cell.runs.run_id)) for key, cell in study.cells.items()},
    )
    return Report(document, figures.plots, numbers, tuple(formats))


def write(report: Report, study: Study, folder: Path) -> None:
    """Write a report into ``folder`` (page, Markdown, tables, figures, numbers, traces).

    Raises CoarticError where it cannot be written, or something is in the way.
    """
    check_report_folder(folder, study.results.folder)
    about = [f"Headline values of {_title(study.results)}.", words(_lead(study.results))]
    about += macro_names(study).renamed()
    extra = {
        "numbers.tex": numbers_tex(report.numbers, about),
        FILE: trace_json(study.results, report.document, report.numbers),
    }
    render = partial(rendered, endings=report.formats)
    write_report(report.document, report.plots, folder, extra, render=render)


def _title(results: Results) -> str:
    return f"coartic: suite {results.manifest.specification.suite}"


def _lead(results: Results) -> str:
    specification, environment = results.manifest.specification, results.manifest.environment
    commit = environment.commit
    where = f"coartic {environment.coartic}"
    if commit:
        where += f", commit {commit.id[:12]}{' with changes' if commit.dirty else ''}"
    trials = specification.trials
    return escaped(
        f"{len(results.runs)} runs, up to {specification.runs} a cell"
        + (f", of {trials} trials where a method learns" if trials else "")
        + f"; seed {specification.seed}. Made with {where} on {environment.date[:10]}."
    )


def _summary(study: Study, judged: Sequence[Judged], scores: pd.DataFrame) -> Section:
    results = study.results
    failed = int((results.runs.status != "ok").sum())
    facts = (
        f"{len(results.tasks)} tasks, {len({c.label for c in results.cells})} methods with their "
        f"variants, {len(results.cells)} cells; "
        + (
            f"{failed} of {len(results.runs)} runs have no solution."
            if failed
            else "every run has a solution."
        )
    )
    blocks: list[Block] = [Prose((facts,)), *_tables(tasks_table(study))]
    unlike = unlike_printed(study)
    counted = verdicts(judged, CLAIMS)
    if unlike:
        note = f"Not as printed: {escaped('; '.join(unlike))} ([table](#published-and-ours))."
        counted = Bullets((*counted.items, note))
    blocks.append(counted)
    overall = tables.overall_table(study, study.overall, scores)
    if overall is not None:
        blocks += _tables(*without_variants(overall))
    return _section("summary", "Summary", blocks)


def _methods(
    study: Study, pairs: pd.DataFrame, scores: pd.DataFrame, profiles: list[Block]
) -> Section:
    below = []
    for task, slug in tables.table_ids(study).items():
        blocks = _tables(tables.methods_table(study, task))
        if not _many(study):
            blocks += _tables(
                _folded(tables.pairwise_table(study, pairs, task)),
                _folded(tables.cost_table(study, pairs, task)),
            )
        if blocks:
            below.append(_section(f"on-{slug}-methods", task, blocks))
    reading = Bullets(tables.reading_of_methods(study))
    return _section("methods", "Methods side by side", [*profiles, reading], below)


def _cost(study: Study, frontier: list[Block]) -> Section:
    if _many(study):
        return _section("cost", "Reward and what it costs", frontier)
    targets, areas, pareto = study.targets, study.areas, study.pareto
    below = []
    for task, slug in tables.table_ids(study).items():
        blocks = _tables(
            tables.targets_table(study, targets, task),
            _folded(tables.areas_table(study, areas, task)),
            _folded(tables.pareto_table(study, pareto, task)),
        )
        if blocks:
            below.append(_section(f"on-{slug}-cost", task, blocks))
    return _section("cost", "Reward and what it costs", frontier, below)


def _signatures(study: Study, context: list[Block], matrices: list[Block]) -> Section:
    below = []
    for task, slug in tables.table_ids(study).items():
        found = tables.signatures_tables(study, task, short=_many(study))
        if found:
            below.append(_section(f"on-{slug}-signatures", task, _tables(*found)))
    between = _tables(tables.contexts_table(study), *tables.slopes_tables(study))
    blocks = [*context, *between, *matrices]
    return _section("coarticulation", "Signatures of coarticulation", blocks, below)


def _claims(study: Study, judged: Sequence[Judged], figures: set[str]) -> Section:
    table = tables.claims_table(study, judged)
    blocks: list[Block] = []
    if table is not None:
        rows = tuple(replace(row, link=f"#claim-{row.key}") for row in table.rows)
        blocks.append(replace(table, rows=rows, notes=(*table.notes, FITTED)))
    below = []
    for entry in judged:
        claim = entry.claim
        where = ", ".join(filter(None, (claim.place, claim.figure))) or "not in the paper"
        ours = _FIGURES.get(claim.figure)
        see = f" Ours: [figure {ours}](#{ours})." if ours in figures else ""
        quote = f": “{escaped(claim.quote)}”" if claim.quote else ""
        mark = " †" if claim.fitted else ""
        lines = [
            f"{escaped(claim.statement)} *{entry.verdict}{mark}*.",
            f"Seen: {escaped(entry.evidence)}.",
            f"Test: {claim.test}. Place: {where}{quote}.{see}",
        ]
        content: list[Block] = [Prose(tuple(lines))]
        if entry.table is not None:
            content.append(_evidence(study, entry.table, claim.id))
        title = f"{claim.id}: {entry.verdict}{mark}"
        below.append(Section(f"claim-{claim.id}", title, tuple(content), folded=True))
    each = Section("claims-evidence", "Evidence, claim by claim", (), tuple(below), folded=True)
    return _section(CLAIMS, "Claims", blocks, [each])


def _evidence(study: Study, table: Table, claim: str) -> DataTable:
    """A claim's numbers; rows named like a method rest on its cells."""
    rows = []
    for place, texts in enumerate(table.rows, 1):
        cells = tuple(key for key in study.cells if key[1] == texts[0])
        rows.append(Row(f"{place}: {texts[0]}", tuple(texts), cells))
    columns = tuple(Column(f"column_{k}", head) for k, head in enumerate(table.columns, 1))
    return DataTable(
        f"evidence-{claim}", escaped(f"{table.title} ({claim})."), columns, tuple(rows)
    )


def _about(
    study: Study, figures: Figures, numbers: Iterable[Number], formats: Sequence[str]
) -> Section:
    count = sum(1 for number in numbers for _ in number.companions())
    *others, last = (name for ending, name in _FORMATS.items() if ending in formats)
    drawn = f"{', '.join(others)} and {last}" if others else last
    example = next((n.macro for n in numbers if n.cells), f"{PREFIX}...")
    items = [
        "Every row of a table leads to its runs: by the last column of `report.html`, and by "
        "`tables/runs.csv`. Every table is in `tables/` as "
        f"CSV and LaTeX, every figure in `figures/` as {drawn}.",
        f"`numbers.tex` has {count} macros, such as `\\{example}`.",
        f"`coartic trace {example}` and `coartic trace TABLE ROW COLUMN` name the runs, the "
        "commit, the specification and the command behind a number; `coartic reproduce RUN` "
        "performs a run again; `coartic cite` prints what to cite.",
        *map(escaped, macro_names(study).renamed()),
        *(
            f"No figure {escaped(name)}: {escaped(why.removeprefix(f'{study.results.folder}: '))}."
            for name, why in figures.skipped.items()
        ),
        *([_few(study)] if _many(study) else []),
    ]
    return _section("about", "Tracing and citing", [Bullets(tuple(items))])


def _many(study: Study) -> bool:
    return len(study.results.tasks) > MOST_TASKS


def _few(study: Study) -> str:
    return (
        f"With more than {MOST_TASKS} tasks (here {len(study.results.tasks)}) the report has no "
        "tables of pairs, targets, areas, Pareto sets and signatures at further goals by task, and "
        "no figures of signatures; `coartic analyse` writes all of them as CSV."
    )


def _section(
    name: str, title: str, blocks: Sequence[Block], below: Sequence[Section] = ()
) -> Section:
    return Section(name, title, tuple(blocks), tuple(below))


def _tables(*found: DataTable | None) -> list[Block]:
    return [with_legends(table) for table in found if table is not None]


def _folded(table: DataTable | None) -> DataTable | None:
    return None if table is None else replace(table, folded=True)


def _figure(plot: Plot) -> FigureBlock:
    return FigureBlock(plot.id, plot.title, escaped(plot.caption), plot.alt, svg_text(plot))
