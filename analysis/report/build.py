"""The report of a results folder: which sections, tables and figures it has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from coartic import CoarticError
from coartic.analysis.figures import Figures
from coartic.analysis.figures.plot import FILES
from coartic.analysis.figures.register import Section as FigureSection
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.markup import escaped, words
from coartic.analysis.report.answers import (
    answers,
    cells_found,
    claims_found,
    context_found,
    hands_found,
    limits_found,
    of_the_paper,
    pace_found,
    price,
    winners,
)
from coartic.analysis.report.charts import charts
from coartic.analysis.report.document import (
    Block,
    Bullets,
    DataTable,
    Document,
    FigureBlock,
    PlayerBlock,
    Prose,
    Section,
)
from coartic.analysis.report.formats.csv import raw_columns
from coartic.analysis.report.headlines import headline_numbers
from coartic.analysis.report.limitations import limitations
from coartic.analysis.report.numbers import PREFIX, Number, macro_names, numbers_tex
from coartic.analysis.report.pages.claims import claim_section, claims_table
from coartic.analysis.report.pages.comparisons import cost_table, pairwise_table, reading_of_pairs
from coartic.analysis.report.pages.families import families_section
from coartic.analysis.report.pages.frontier import cost_tables, optima_known, reading_of_cost
from coartic.analysis.report.pictures import Pictures
from coartic.analysis.report.player import player_json
from coartic.analysis.report.summary import (
    tasks_table,
    verdicts,
    version_text,
    without_variants,
)
from coartic.analysis.report.tables.common import table_ids
from coartic.analysis.report.tables.contexts import contexts_table, slopes_tables
from coartic.analysis.report.tables.main import main_methods, main_verdicts
from coartic.analysis.report.tables.methods import methods_table, overall_table, reading_of_methods
from coartic.analysis.report.tables.paper import beside_paper
from coartic.analysis.report.tables.signatures import signatures_tables
from coartic.analysis.report.trace_file import FILE, trace_json
from coartic.analysis.report.write import check_report_folder, write_report
from coartic.analysis.results.folder import Results
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.study import Study
from coartic.analysis.words import stated
from coartic.task import address_of
from coartic.text import counted

MOST_TASKS = 8
"""More would make a report that nobody reads."""
_MANY_PARTS = 4
"""Things that a sentence of a limitation lists: from so many on they are a list."""
CLAIMS = "claims-register"
"""Id of the section of the claims."""
_FORMATS = {".pdf": "PDF", ".svg": "SVG", ".png": "PNG", ".csv": "CSV (the data behind it)"}


@dataclass(frozen=True)
class Report:
    """A document with the figures and the numbers that belong to it."""

    document: Document
    pictures: Pictures
    numbers: tuple[Number, ...]


def build(
    study: Study,
    methods: Sequence[str] | None = None,
    formats: Sequence[str] = FILES,
    *,
    processes: int = 1,
) -> Report:
    """Everything a report holds. A section that the runs do not allow is left out.

    ``methods``: labels that the figures show instead of their own choice; ``formats``: endings of
    the figures' files, ``.svg`` among them; ``processes`` make the pictures. Raises CoarticError
    for a method that the folder does not have, and for other formats.
    """
    if ".svg" not in formats or not set(formats) <= _FORMATS.keys():
        raise CoarticError(
            f"figures as {', '.join(formats)}: choose of {', '.join(_FORMATS)}, .svg among them, "
            "which report.md shows"
        )
    figures = Figures(study, methods, MOST_TASKS)
    pictures = Pictures(figures, formats, processes)
    numbers = tuple(headline_numbers(study))
    sections = [*_sections(study, pictures), _about(study, figures, numbers, formats)]
    document = Document(
        _title(study.results), tuple(sections), _lead(study.results), study.run_ids
    )
    return Report(document, pictures, numbers)


def report_tables(study: Study) -> dict[str, pd.DataFrame]:
    """The report's tables by id, with the columns of their CSV files."""
    document = Document("", tuple(_sections(study, None)), runs=study.run_ids)
    return {table.id: pd.DataFrame(raw_columns(table)) for table in document.tables()}


def _sections(study: Study, pictures: Pictures | None) -> Iterator[Section]:
    """The sections that have something to show; without figures and films where None."""

    def drawn(section: FigureSection) -> list[FigureBlock]:
        if pictures is None:
            return []
        plots = pictures.sections[section]
        chart_of = charts(study, {plot.id: plot.data for plot in plots})
        return [
            FigureBlock(
                *(plot.id, plot.title, escaped(plot.caption), plot.alt, pictures[plot.id].svg),
                chart=chart_of.get(plot.id, ""),
                narrow=pictures[plot.id].narrow,
            )
            for plot in plots
        ]

    limits = limitations(study)
    words_said = stated(__file__, "glossary").items()
    glossary = tuple(f"**{word}**: {meaning}" for word, meaning in words_said)
    first = {picture.id: picture for picture in drawn("answers")}
    played = bool(one_by_one(study))  # of many instances alone there is too much to be played
    player = _player(study) if pictures is not None and played else None
    sections = (
        answers(study, first, player),
        families_section(study, drawn("families")),
        _section(
            "tasks-drawn", "Tasks", drawn("tasks-drawn"), [tasks_table(study)], _facts(study)
        ),
        _section("paper", "Paper", drawn("paper"), beside_paper(study), cells_found(study)),
        *(
            [_claims(study, {} if pictures is None else pictures.like_the_paper)]
            if of_the_paper(study) or any(map(address_of, study.tasks))
            else []
        ),
        _section("movements", "Movements", drawn("movements"), (), hands_found(study)),
        _section("learning", "Learning", drawn("learning"), (), pace_found(study)),
        _methods(study, drawn("methods")),
        _cost(study, drawn("cost")),
        _signatures(study, drawn("coarticulation")),
        Section("limitations", "Limitations", (), _limits(limits), finding=limits_found(limits)),
        Section("glossary", "Glossary", (Bullets(glossary),), folded=True),
    )
    return (section for section in sections if section.blocks or section.sections)


def write(
    report: Report,
    study: Study,
    folder: Path,
    *,
    printed: bool = False,
    begin: Callable[[], object] = lambda: None,
) -> None:
    """Write a report into ``folder`` (page, Markdown, tables, figures, numbers, traces).

    ``printed``: also the page as a PDF.

    ``begin`` is called when all is made and nothing written.
    Raises CoarticError where it cannot be written, or something is in the way.
    """
    check_report_folder(folder, study.results.folder)
    about = [f"Headline values of {_title(study.results)}.", words(_lead(study.results))]
    about += macro_names(study).renamed()
    extra = {
        "numbers.tex": numbers_tex(report.numbers, about),
        FILE: trace_json(study, report.document, report.numbers),
    }
    figures = report.pictures.files()
    write_report(report.document, figures, folder, extra, printed=printed, begin=begin)


def _title(results: Results) -> str:
    return f"coartic: suite {results.manifest.specification.suite}"


def _lead(results: Results) -> str:
    specification, environment = results.manifest.specification, results.manifest.environment
    trials = f", of {specification.trials} trials where a method learns"
    return escaped(
        f"{counted(len(results.runs), 'run')}, up to {specification.runs} a cell"
        f"{trials if specification.trials else ''}; seed {specification.seed}. Made with "
        f"{version_text(environment)} on {environment.date[:10]}."
    )


def _facts(study: Study) -> str:
    results = study.results
    failed = int((results.runs.status != "ok").sum())
    runs, labels = counted(len(results.runs), "run"), {label for _, label in results.cells}
    return (
        f"{counted(len(results.tasks), 'task')}, {counted(len(labels), 'method')} with their "
        f"variants, {counted(len(results.cells), 'cell')}; "
        + (f"{failed} of {runs} have no solution." if failed else "every run has a solution.")
    )


def _player(study: Study) -> PlayerBlock:
    return PlayerBlock(
        "player",
        "Movements, tick by tick",
        "Of each method the run nearest its median reward, beside the initial solution. "
        "Open squares: left arm; closed circles: right arm; thick: the arm at work; "
        "filled goals are hit.",
        player_json(study),
    )


def _limits(items: Sequence[str]) -> tuple[Section, ...]:
    """Each limitation below its first words; what lists many things as a list."""
    found = []
    for number, item in enumerate(items, 1):
        title, _, text = item.strip("*").partition(".* ")
        text = text or item
        said, colon, listed = text.partition(": ")
        parts = listed.split("; ")
        blocks: list[Block] = [Prose((text,))]
        if colon and len(parts) >= _MANY_PARTS:
            blocks = [Prose((f"{said}:",)), Bullets(tuple(parts))]
        found.append(Section(f"limit-{number}", words(title), tuple(blocks), folded=True))
    return tuple(found)


def _by_task(
    study: Study,
    name: str,
    what: str,
    blocks_of: Callable[[str], Sequence[Block]],
    read: tuple[str, tuple[str, ...]],
) -> Iterator[Section]:
    """How it is ``read``, then a folded section a task where there is something to show of it."""
    yield Section(f"{name}-read", read[0], (Bullets(read[1]),), folded=True)
    alone = one_by_one(study)
    for task, slug in table_ids(study).items():
        if task not in alone:
            continue  # the section of families has them together
        blocks = blocks_of(task)
        if blocks:
            title = f"{study.tasks[task].label}: {what}"
            yield Section(f"on-{slug}-{name}", title, tuple(blocks), folded=True)


def _methods(study: Study, figures: Sequence[Block]) -> Section:
    pairs = not _many(study)

    def of(task: str) -> list[Block]:
        tables = [methods_table(study, task)]
        if pairs:
            tables += [pairwise_table(study, task), cost_table(study, task)]
        return _tables(*tables)

    reading = reading_of_methods(study)
    if study.pair_rows and pairs:
        reading += reading_of_pairs(study)
    overall = overall_table(study)
    read = "How the tables of methods are read", reading
    below = _by_task(study, "methods", "every method", of, read)
    tables = (main_methods(study), *(without_variants(overall) if overall else ()))
    return _section("methods", "Methods", figures, tables, winners(study), below)


def _cost(study: Study, figures: Sequence[Block]) -> Section:
    title = "Cost"
    if _many(study):
        return _section("cost", title, figures)

    def of(task: str) -> list[Block]:
        found = list(cost_tables(study, task))
        return [optima_known(study, task), *_tables(*found)] if found else []

    read = "How the tables of cost are read", reading_of_cost()
    below = _by_task(study, "cost", "reward and cost", of, read)
    return _section("cost", title, figures, (), price(study), below)


def _signatures(study: Study, figures: Sequence[Block]) -> Section:
    short = _many(study)

    def of(task: str) -> list[Block]:
        return _tables(*signatures_tables(study, task, short=short))

    between = (contexts_table(study), *slopes_tables(study))
    meanings = tuple(f"**{escaped(s.name)}**: {s.meaning}" for s in REGISTER.values())
    read = "What each signature says", meanings
    below = _by_task(study, "signatures", "signatures", of, read)
    title = "Signatures"
    return _section("coarticulation", title, figures, between, context_found(study), below)


def _claims(study: Study, figures: Mapping[str, str]) -> Section:
    found = tuple(claim_section(entry, figures) for entry in study.judged)
    each = Section("claims-evidence", "Evidence, claim by claim", (), found, folded=True)
    blocks = verdicts(study.judged), *_tables(main_verdicts(study), claims_table(study))
    return Section(CLAIMS, "Claims", blocks, (each,), finding=claims_found(study))


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
    ]
    if _many(study):
        items.append(
            f"With more than {MOST_TASKS} tasks (here {len(study.tasks)}) the report has "
            "no tables of pairs, targets, areas, Pareto sets and further signatures by task, and "
            "no figures of signatures; `coartic analyse` writes all of them as CSV."
        )
    return Section("about", "Citing", (Bullets(tuple(items)),))


def _many(study: Study) -> bool:
    return len(study.tasks) > MOST_TASKS


def _section(
    name: str,
    title: str,
    figures: Sequence[Block],
    tables: Iterable[DataTable | None] = (),
    finding: str = "",
    below: Iterable[Section] = (),
) -> Section:
    """What was found, one figure, then folded: further figures, tables and what is below."""
    blocks, more = (*figures[:1], *_tables(*tables)), tuple(figures[1:])
    if more:
        titles = "; ".join(figure.title for figure in more if isinstance(figure, FigureBlock))
        below = [Section(f"{name}-figures", f"More figures: {titles}", more, folded=True), *below]
    return Section(name, title, blocks, tuple(below), finding=finding)


def _tables(*found: DataTable | None) -> list[Block]:
    return [replace(table, folded=True) for table in filter(None, found)]
