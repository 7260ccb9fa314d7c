"""What ``coartic analyse`` writes into a results folder."""

from __future__ import annotations

from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.claims import claims_document
from coartic.analysis.report.pages.comparisons import comparisons_document
from coartic.analysis.report.pages.frontier import frontier_document
from coartic.analysis.report.pages.signatures import signatures_document
from coartic.analysis.report.tables.files import ANALYSES
from coartic.analysis.study import Study


def analyse(study: Study) -> dict[str, bytes]:
    """All pages and tables by file name."""
    pages = {
        "claims.md": claims_document,
        "comparisons.md": comparisons_document,
        "frontier.md": frontier_document,
        "signatures.md": signatures_document,
    }
    texts = {name: markdown(page(study), tables="") for name, page in pages.items()}
    texts |= {file.name: file.text(study) for file in ANALYSES}
    return {name: text.encode() for name, text in texts.items()}
