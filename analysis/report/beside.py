"""Two results folders side by side: what is said of either, and what differs between them."""

from __future__ import annotations

from dataclasses import replace

from coartic.analysis.comparisons.versions import compare_versions
from coartic.analysis.markup import escaped
from coartic.analysis.report.answers import cells_found, claims_found, price, strips, winners
from coartic.analysis.report.document import Block, Bullets, DataTable, Document, Section, Strip
from coartic.analysis.report.pages.versions import versions_document
from coartic.analysis.study import Study


def beside(document: Document, first: Study, second: Study) -> Document:
    """The report of the first folder, which begins with both beside each other."""
    found = compare_versions(first, second)
    cards = tuple(_card(side, study) for side, study in zip("ab", (first, second), strict=True))
    differing = []
    for section in versions_document(found).sections:
        blocks = tuple(
            replace(block, folded=True) if isinstance(block, DataTable) else block
            for block in section.blocks
        )
        if section.id != "outcome":
            differing.append(replace(section, id=f"beside-{section.id}", blocks=blocks))
    outcome = escaped(" ".join(found.summary))
    both = (
        Section("beside", "A and B", (), cards, cards=True),
        Section("beside-outcome", "A against B", (), tuple(differing), finding=outcome),
    )
    title = f"{document.title}, A, beside B"
    return replace(document, title=title, sections=(*both, *document.sections))


def _card(side: str, study: Study) -> Section:
    """What the four questions come to in one folder."""
    said = (cells_found(study), claims_found(study), winners(study), price(study))
    blocks: list[Block] = [
        replace(strip, id=f"{strip.id}-{side}")
        for strip in strips(study)
        if isinstance(strip, Strip)
    ]
    blocks.append(Bullets(tuple(filter(None, said))))
    title = f"{side.upper()}: {study.results.folder.name}"
    specification = study.results.manifest.specification
    environment = study.results.manifest.environment
    finding = escaped(
        f"Suite {specification.suite}, {len(study.runs)} runs, seed {specification.seed}; "
        f"coartic {environment.coartic}, {environment.date[:10]}."
    )
    return Section(f"beside-{side}", title, tuple(blocks), finding=finding)
