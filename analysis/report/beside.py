"""Two results folders side by side: what is said of either, and what differs between them."""

from __future__ import annotations

from dataclasses import replace

from coartic.analysis.comparisons.versions import VersionComparison
from coartic.analysis.markup import escaped
from coartic.analysis.report.answers import cells_found, claims_found, price, strips, winners
from coartic.analysis.report.document import Block, Bullets, DataTable, Document, Section, Strip
from coartic.analysis.report.pages.versions import versions_document
from coartic.analysis.study import Study


def beside(document: Document, first: Study, second: Study, found: VersionComparison) -> Document:
    """The report of the first folder, which begins with both beside each other."""
    cards = tuple(_card(side, study) for side, study in zip("ab", (first, second), strict=True))
    differing = tuple(
        replace(section, id=f"beside-{section.id}", blocks=tuple(map(_folded, section.blocks)))
        for section in versions_document(found).sections
        if section.id != "outcome"
    )
    both = (
        Section("beside", "A and B", (), cards, cards=True),
        Section(
            "beside-outcome",
            "A against B",
            (),
            differing,
            finding=escaped(" ".join(found.summary)),
        ),
    )
    return replace(
        document,
        title=f"{document.title}, A, beside B",
        sections=(*both, *document.sections),
    )


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


def _folded(block: Block) -> Block:
    return replace(block, folded=True) if isinstance(block, DataTable) else block
