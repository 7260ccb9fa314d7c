"""What ``coartic analyse`` writes into a results folder."""

from __future__ import annotations

from analysis.comparisons.frontier_page import frontier_page
from analysis.comparisons.pairs_page import comparisons_page
from analysis.report.formats.markdown import markdown
from analysis.report.pages.claims import claims_document
from analysis.signatures.page import signatures_page
from analysis.study import Study


def analyse(study: Study) -> dict[str, bytes]:
    """All pages and tables by file name."""
    pages = {
        "claims.md": markdown(claims_document(study), tables=""),
        "comparisons.md": comparisons_page(study, study.pairs, study.overall, study.scores),
        "frontier.md": frontier_page(study.results, study.targets, study.areas, study.pareto),
        "signatures.md": signatures_page(study),
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
    texts = pages | {name: table.to_csv(index=False) for name, table in tables.items()}
    return {name: text.encode() for name, text in texts.items()}
