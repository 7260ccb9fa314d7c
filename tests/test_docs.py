"""The documents: every relative link leads somewhere, and the example report is there."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINK = re.compile(r"(?<!\\)\]\((?!https?://)([^)\s]+)\)")
EXAMPLE = ROOT / "benchmarks" / "example"


def anchors(page):
    """Names of a page's headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in LINK.findall(text):
        path, _, anchor = link.partition("#")
        target = (page.parent / path) if path else page
        assert target.exists(), link
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), link


def test_figures_are_made_by_the_functions_that_are_named():
    page = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8")
    named = re.findall(r"\| `(\w+)\.(\w+)` \|", page)
    assert len(named) == 12
    for module, function in named:
        assert hasattr(importlib.import_module(f"analysis.figures.{module}"), function), function


def test_the_example_report():
    size = sum(path.stat().st_size for path in EXAMPLE.rglob("*") if path.is_file())
    assert size < 6_500_000
    page = (EXAMPLE / "report.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\((figures/[^)]+)\)", page)
    assert len(pictures) >= 15
    assert all((EXAMPLE / picture).is_file() for picture in pictures)
    assert (EXAMPLE / "report.html").is_file()
