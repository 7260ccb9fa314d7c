"""What ``coartic run`` says of its results: against the paper, and all methods side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from coartic.analysis.markup import code, escaped, words
from coartic.analysis.report.document import Block, Bullets, DataTable, Document, Prose, Section
from coartic.analysis.report.limitations import limitations
from coartic.analysis.report.summary import version_text
from coartic.analysis.report.tables.common import table_ids
from coartic.analysis.report.tables.methods import methods_table, reading_of_methods
from coartic.analysis.report.tables.paper import beside_paper
from coartic.analysis.study import Study
from coartic.text import counted


def comparison_document(study: Study) -> Document:
    """Published and ours, methods by task, and what the folder cannot show."""
    said: set[str] = set()
    paper = Section("paper", "Published and ours", _noted(beside_paper(study), said))
    by_task = (
        Section(f"on-{slug}", task, _noted([methods_table(study, task)], said))
        for task, slug in table_ids(study).items()
    )
    methods = Section(
        "methods",
        "Methods side by side",
        (Bullets(reading_of_methods(study)),),
        tuple(section for section in by_task if section.blocks),
    )
    limits = Section("limitations", "Limitations", (Bullets(limitations(study)),))
    return Document(
        "Comparison",
        tuple(section for section in (paper, methods, limits) if section.blocks),
        _made(study),
        study.run_ids,
    )


def notes_of(document: Document) -> list[str]:
    """Prose, items and tables' notes of a document as plain text, each once."""
    found: list[str] = []
    for block in document.blocks():
        match block:
            case DataTable():
                found += block.notes
            case Bullets():
                found += block.items
            case Prose():
                found += block.paragraphs
    return list(dict.fromkeys(map(words, [*found, document.lead])))


def _made(study: Study) -> str:
    """Of which suite, by which code, where and when."""
    manifest = study.results.manifest
    specification, environment = manifest.specification, manifest.environment
    readings = " and ".join(specification.readings)
    made = (
        f", {counted(specification.runs, 'run')} of {specification.trials} trials, "
        f"seed {specification.seed}{readings and f', read with {readings}'}; "
        f"{version_text(environment)}, "
        f"model code {environment.model_code}; Python {environment.python}, "
        f"{environment.platform}; {environment.date}."
    )
    return f"Suite {code(specification.suite)}{escaped(made)}"


def _noted(tables: Iterable[DataTable | None], said: set[str]) -> tuple[Block, ...]:
    """The tables that there are, each with the notes that were not ``said`` before."""
    found: list[Block] = []
    for table in filter(None, tables):
        fresh = tuple(note for note in table.notes if note not in said)
        found.append(replace(table, notes=fresh))
        said.update(fresh)
    return tuple(found)
