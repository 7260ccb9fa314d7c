"""The pages of the site whose numbers come from stored results."""

import re

import numpy as np
import pandas as pd
import pytest

from coartic.tasks.optima import BEST_KNOWN
from common.writing import fill_page
from tests.support.made_up import row, study_of
from tests.support.pictures import draw_the_same
from tests.support.processes import ROOT, program

DOCS = ROOT / "docs"
STORED = DOCS / "stored"
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
        assert draw_the_same(drawing, (DOCS / path).read_bytes()), todo
        assert path in page


def test_what_pages_ask_for_is_stored_from_the_results_that_are_given(tmp_path, monkeypatch):
    """And nothing else; suites without new results keep what they have."""
    stored = tmp_path / "stored"
    monkeypatch.setattr(make_findings, "STORED", stored)
    monkeypatch.setattr(make_findings, "NEW", {})
    for suite in ("old", "planted"):
        (stored / suite).mkdir(parents=True)
        (stored / suite / "ranking.csv").write_text("row,gap,run_ids\na,0.12345678,x y\n")
        (stored / suite / "unused.csv").write_text("")
    rows = [row("random-search", -480 - run, run=run) for run in range(3)]
    make_findings.forget_stored({"planted": study_of(rows), "another": study_of(rows)})
    assert make_findings.table("planted", "ranking").index.tolist() == ["random-search"]
    assert "run_ids" not in make_findings.table("planted", "ranking")
    assert "run_ids" in make_findings.table("old", "ranking")
    make_findings.store_figures(["![Gaps](stored/planted/ranking.svg) ![](stored/old/gaps.svg)"])
    made = {path.name for path in (stored / "planted").iterdir()}
    assert made == {"ranking.csv", "ranking.svg"}
    assert {path.name for path in stored.iterdir()} == {"old", "planted"}


def test_stored_gaps_of_families_are_to_the_best_known_rewards_that_ship():
    """Else pages are behind a reward that was renewed."""
    stored = pd.read_csv(DOCS / "stored" / "families" / "by-task.csv")
    best = stored.task.map(pd.read_csv(BEST_KNOWN, index_col="instance").reward)
    np.testing.assert_allclose(stored.gap, (stored.reward - best) / best, rtol=1e-4, atol=1e-5)


def test_where_a_claim_does_not_hold_in_other_worlds_is_said_in_words(monkeypatch):
    """By family, but for claims about one family; tasks of the paper have no verdict."""
    rows = [
        ("ahead", world, family, "holds")
        for world in ("paper", "maximum", "base-4")
        for family in ("one-armed", "two-armed", "aligned")
    ]
    rows += [("ahead", "paper", "ascending", None), ("leans", "paper", "one-armed", "open")]
    judged = pd.DataFrame(rows, columns=["claim", "world", "group", "verdict"])
    judged.loc[4:6, "verdict"] = ["open", "open", "reversed"]
    monkeypatch.setattr(make_findings, "table", lambda *_: judged)
    assert make_findings.in_worlds("ahead") == (
        "it holds in 6 of 9 comparisons: the paper's (one-armed, two-armed, aligned), maximum norm "
        "(one-armed), base weight 4 (two-armed, aligned); reversed in 1: base weight 4 "
        "(one-armed); open in 2: maximum norm (two-armed, aligned)."
    )
    assert make_findings.in_worlds("leans") == (
        "it holds in 0 of 1 worlds; open in 1: the paper's."
    )


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


def test_leans_of_the_readme_are_what_the_tables_say():
    """Of base and joints at the goal that ascending and descending share."""
    text = (ROOT / "README.md").read_text("utf-8")
    ids = {
        "CMA-ES": "cma-es/bandit", "shortest-path plan": "trajectory-optimisation/path-length",
        "the paper's learner": "dual-process/EC1", "random search": "random-search",
        "corrective process": "corrective-alone/given",
    }  # fmt: skip
    leans = make_findings.table("comparison", "contexts").set_index("method").loc[[*ids.values()]]
    rows = re.findall(r"^   \| ([^|]+?) \| (\d+) % \|$", text, re.MULTILINE)
    assert [name.split(",")[0] for name, _ in rows] == [*ids]
    assert [int(lean) for _, lean in rows] == [*(100 * leans.lean_base).round()]
    ends = [round(100 * end) for end in (leans.lean_joints.min(), leans.lean_joints.max())]
    assert f"is between {ends[0]} % and {ends[1]} %" in re.sub(r"\s+", " ", text)


def test_the_first_table_of_the_readme_is_what_the_tables_say():
    """Mean gaps over random tasks, by method, without and with motor noise."""
    text = (ROOT / "README.md").read_text("utf-8")
    rows = re.findall(r"^   \| (.+?) \| (\d+) % \| (\d+) % \|$", text, re.MULTILINE)
    figures = make_findings.finding_figures
    ids = {
        "policy gradient": "policy-gradient", "CMA-ES": "cma-es/bandit",
        "the paper's learner": figures.LEARNER, "random search": figures.RANDOM,
    }  # fmt: skip
    assert [re.split("[,:]", name)[0] for name, *_ in rows] == [*ids]
    for (_, *printed), method in zip(rows, ids.values(), strict=True):
        for percent, world in zip(printed, ("", figures.NOISE), strict=True):
            tasks = make_findings.table("families", "by-task", world)
            gap = figures.over_random_tasks(tasks).loc[method, "gap"]
            assert round(100 * gap) == int(percent)
