"""``signatures.md``: how all methods of a folder move."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analysis.report.document import Block, Document, Prose, Section
from analysis.report.tables.common import marked, table_ids
from analysis.report.tables.contexts import contexts_table, slopes_tables
from analysis.report.tables.signatures import definitions_table, signatures_tables
from analysis.signatures.rows import NO_RUN

if TYPE_CHECKING:
    from analysis.study import Study

LEAD = (
    "Means over runs with Student's 95 % interval, shares of runs with Wilson's, slopes with the "
    "regression's. A number alone is that of a single run, or of a quantity without an interval; "
    "no spread says that these runs do not differ, not that others would not. Methods by mean "
    "reward, best first. How tests and intervals hold: docs/signatures.md; all signatures, by "
    "goal, hand and joint: `signatures.csv`."
)
TESTS = (
    "p-values are two-sided for ΔV z and slopes, of permutation tests for contexts and norms of "
    "slopes, one-sided for the sacrifice (in the mean over runs, the first subtask takes longer "
    "by more than one tick and the whole takes less than by the corrective process with the same "
    "hands). They are adjusted by Holm's method over all tests of their own table, in the table "
    "of contexts over those of the same goal, hand and tasks, of slopes norms apart from joints. "
    "Over several tables nothing is adjusted."
)


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
        made = tuple(table for table in tables if table is not None)
        sections += [Section(name, title, made)] if made else []
    tests: list[Block] = [Prose((TESTS,))]
    if any(task.reconstructed for task in study.tasks.values()):
        tests.append(Prose(("† Reconstructed task (docs/model.md).",)))
    sections.insert(0, Section("signatures-reading", "How to read the tables", tuple(tests)))
    return Document("Signatures of coarticulation", tuple(sections), LEAD, study.run_ids)
