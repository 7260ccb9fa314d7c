"""The documents: every relative link leads somewhere, and the example report is there."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
LINK = re.compile(r"(?<!\\)\]\((?!https?://)([^)\s]+)\)")
EXAMPLE = ROOT / "benchmarks" / "example"


def anchors(page):
    """Names of a page's headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
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
        assert hasattr(importlib.import_module(f"coartic.analysis.figures.{module}"), function), (
            function
        )


def test_the_example_report():
    size = sum(path.stat().st_size for path in EXAMPLE.rglob("*") if path.is_file())
    assert size < 9_500_000
    assert (EXAMPLE / "report.html").stat().st_size < 6_000_000
    page = (EXAMPLE / "report.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\((figures/[^)]+)\)", page)
    assert len(pictures) >= 15
    assert all((EXAMPLE / picture).is_file() for picture in pictures)
    assert (EXAMPLE / "report.html").is_file()


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 150


def test_the_paper_is_short_and_its_numbers_are_those_of_the_example(monkeypatch):
    """`python docs/paper_numbers.py` renews them."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    numbers = importlib.import_module("paper_numbers")
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    assert len(numbers.NUMBER.findall(page)) > 20
    assert page == numbers.filled(page)
    assert len(re.sub(r"<!--.*?-->", "", page).split()) < 1500


def test_a_number_that_the_example_lacks_is_noticed(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")
    numbers = importlib.import_module("paper_numbers")
    with pytest.raises(KeyError, match="AscendingECNine"):
        numbers.filled("1<!--macro AscendingECNineReward-->")
    assert numbers.filled("1<!--claims printed all-->") != "1<!--claims printed all-->"


def test_links_of_the_site(tmp_path, monkeypatch):
    """What the check of `make docs` finds, and what it leaves alone."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    check = importlib.import_module("check_links")
    (tmp_path / "a.html").write_text(
        '<a href="b.html#there"></a><a href="b.html#gone"></a><img src="c.png">'
        '<a href="https://example.org/x"></a><a href="#"></a>'
    )
    (tmp_path / "b.html").write_text('<p id="there"></p>')
    lost, elsewhere = check.broken(tmp_path)
    assert (lost, elsewhere) == (["a.html: b.html#gone", "a.html: c.png"], 1)


def test_one_version():
    import tomllib

    import coartic

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    cited = re.findall(r"^ *version: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert {project["version"], *cited} == {coartic.__version__}
