"""The pages of the site whose numbers come from stored results."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from coartic.analysis import fill_page

DOCS = Path(__file__).parent.parent / "docs"
sys.path.append(str(DOCS))  # the program imports what is beside it
_SPEC = importlib.util.spec_from_file_location("make_findings", DOCS / "make_findings.py")
make_findings = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(make_findings)


def test_pages_are_their_templates_filled_from_the_stored_tables():
    pages = make_findings.filled_pages()
    assert {"findings.md", "reference/files.md"} <= {*pages}
    for page, text in pages.items():
        assert text == (DOCS / page).read_text(encoding="utf-8"), page


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
