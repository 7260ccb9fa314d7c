"""``signatures.md``: how all methods of a folder move."""

from __future__ import annotations

from coartic.analysis.report.document import Block, Document, Prose, Section
from coartic.analysis.report.tables.common import marked, table_ids
from coartic.analysis.report.tables.contexts import contexts_table, slopes_tables
from coartic.analysis.report.tables.layout import LAYOUTS
from coartic.analysis.report.tables.signatures import definitions_table, signatures_tables
from coartic.analysis.signatures.rows import NO_RUN
from coartic.analysis.study import Study


def signatures_document(study: Study) -> Document:
    """Tables by task, between contexts and of locus slopes, and what each signature says."""
    sections = []
    for task, slug in table_ids(study).items():
        found: list[Block] = [*signatures_tables(study, task)]
        blocks = found or [Prose((f"{NO_RUN.capitalize()}.",))]
        sections.append(Section(f"on-{slug}-signatures", marked(study, task), tuple(blocks)))
    for name, title, tables in (
        ("between-contexts", "Between contexts", [contexts_table(study)]),
        ("locus-slopes", "Locus slopes", slopes_tables(study)),
        ("signatures-meaning", "What the signatures say", [definitions_table()]),
    ):
        made = tuple(filter(None, tables))
        sections += [Section(name, title, made)] if made else []
    lead, tested = LAYOUTS["main-signatures"].reading_with()
    tests: list[Block] = [Prose((tested,))]
    if any(task.reconstructed for task in study.tasks.values()):
        tests.append(Prose(("† Reconstructed task (docs/model.md).",)))
    sections.insert(0, Section("signatures-reading", "How to read the tables", tuple(tests)))
    return Document("Signatures of coarticulation", tuple(sections), lead, study.run_ids)
