"""What ``coartic analyse`` writes into a results folder."""

from __future__ import annotations

from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.claims import claims_document
from coartic.analysis.report.pages.comparisons import comparisons_document
from coartic.analysis.report.pages.frontier import frontier_document
from coartic.analysis.report.pages.signatures import signatures_document
from coartic.analysis.study import Study


def analyse(study: Study) -> dict[str, bytes]:
    """All pages and tables by file name."""
    pages = {
        "claims.md": claims_document,
        "comparisons.md": comparisons_document,
        "frontier.md": frontier_document,
        "signatures.md": signatures_document,
    }
    tables = {
        "claims.csv": study.claims,
        "comparisons.csv": study.pairs,
        "across_tasks.csv": study.overall,
        "profiles.csv": study.profiles,
        "signatures.csv": study.signatures.drop(columns="label"),
        "anytime.csv": study.anytime,
        "targets.csv": study.targets,
        "areas.csv": study.areas,
        "pareto.csv": study.pareto,
    }
    texts = {name: markdown(page(study), tables="") for name, page in pages.items()}
    texts |= {name: table.to_csv(index=False) for name, table in tables.items()}
    return {name: text.encode() for name, text in texts.items()}
