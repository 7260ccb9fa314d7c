"""The pages of the site whose numbers come from stored results."""

import re

import numpy as np
import pandas as pd
import pytest

from coartic.tasks.optima import BEST_KNOWN
from common.writing import fill_page
from tests.support.processes import ROOT, program

DOCS = ROOT / "docs"
make_findings = program(DOCS / "make_findings.py")


def test_pages_are_their_templates_filled_from_the_stored_tables():
    pages = make_findings.filled_pages()
    assert "findings.md" in pages
    for page, text in pages.items():
        assert text == (DOCS / page).read_text(encoding="utf-8"), page


def test_figures_are_drawn_from_the_stored_tables_and_each_is_on_the_page():
    page = (DOCS / "findings.md").read_text(encoding="utf-8")
    for path, drawing in make_findings.figures().items():
        todo = f"{path}: make it anew by PYTHONPATH=studies python docs/make_findings.py"
        assert drawing == (DOCS / path).read_bytes(), todo
        assert path in page


def test_what_pages_ask_for_is_stored_from_the_reports_that_are_named(tmp_path, monkeypatch):
    """And nothing else; suites without a report keep what they have."""
    stored, results = tmp_path / "stored", tmp_path / "results"
    monkeypatch.setattr(make_findings, "STORED", stored)
    monkeypatch.setattr(make_findings, "NEW", {})
    for place in (stored / "old", stored / "planted", results / "planted" / "report" / "tables"):
        place.mkdir(parents=True)
        (place / "gaps.csv").write_text("row,gap,run_ids\na,0.12345678,x y\n")
    (results / "planted" / "report" / "figures").mkdir()
    (results / "planted" / "report" / "figures" / "gaps.svg").write_text("new")
    (stored / "planted" / "unused.csv").write_text("")
    make_findings.forget_stored(results)
    assert make_findings.table("planted", "gaps").to_dict() == {"gap": {"a": 0.123457}}
    assert "run_ids" in make_findings.table("old", "gaps")
    make_findings.store_figures(["![Gaps](stored/planted/gaps.svg) ![Old](stored/old/gaps.svg)"])
    assert {path.name for path in (stored / "planted").iterdir()} == {"gaps.csv", "gaps.svg"}


def test_stored_gaps_of_families_are_to_the_best_known_rewards_that_ship():
    """Else pages are behind a reward that was renewed."""
    stored = pd.read_csv(DOCS / "stored" / "families" / "by-task.csv")
    best = stored.task.map(pd.read_csv(BEST_KNOWN, index_col="instance").reward)
    np.testing.assert_allclose(stored.gap, (stored.reward - best) / best, rtol=1e-4, atol=1e-5)


def test_a_sentence_that_no_longer_holds_is_refused(tmp_path):
    template = tmp_path / "page.md.jinja"
    template.write_text('{{ expect(gap < 1, "CMA-ES is nearer") }}It is nearer.')
    assert fill_page(template, gap=0.5) == "It is nearer."
    with pytest.raises(ValueError, match="CMA-ES is nearer"):
        fill_page(template, gap=2)


def test_links_of_pages_name_files_that_are_there():
    pages = [*DOCS.parent.glob("*.md"), *DOCS.parent.glob("studies/**/*.md"), *DOCS.rglob("*.md")]
    lost = []
    for page in pages:
        # Code spans and blocks have brackets of their own.
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.S)
        for link in re.findall(r"\]\(([^)#\s]+)", text):
            if "://" not in link and not (page.parent / link).exists():
                lost.append(f"{page.name}: {link}")
    assert not lost
