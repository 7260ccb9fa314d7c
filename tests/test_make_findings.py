"""The pages of the site whose numbers come from stored results."""

import re
import tomllib

import numpy as np
import pandas as pd
import pytest
from pydantic import TypeAdapter, ValidationError

from coartic.benchmarks.suites import Suite
from coartic.tasks.families import Family
from coartic.tasks.optima import BEST_KNOWN
from coartic.tasks.task import Task
from common.writing import fill_page
from tests.support.processes import ROOT, program

DOCS = ROOT / "docs"
make_findings = program(DOCS / "make_findings.py")


def test_pages_are_their_templates_filled_from_the_stored_tables():
    pages = make_findings.filled_pages()
    assert "findings.md" in pages
    for page, text in pages.items():
        assert text == (DOCS / page).read_text(encoding="utf-8"), page


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


def read_example(text):
    """The content of a TOML example, and the comment behind each key and table."""
    notes, table = {}, ()
    for line in text.splitlines():
        code, _, note = line.partition("#")
        if head := re.match(r"\[+([\w.]+)\]", code):
            table = tuple(head[1].split("."))
            notes[table] = note
            notes.setdefault(table[:1], note)
        elif key := re.match(r"(\w+) = ", code):
            notes[*table, key[1]] = note
    return tomllib.loads(text), notes


def check_keys(kind, content, notes, place=(), **beside):
    """Every key of a model is there, and said to be required if a file needs it; its value is what
    holds without it, where the comment does not say otherwise. ``beside``: no key of the file."""
    read = TypeAdapter(kind).validate_python
    assert content.keys() | beside.keys() == kind.__pydantic_fields__.keys()
    shown = read({**beside, **content})
    for key, value in content.items():
        inner, part = (*place, key), getattr(shown, key)
        note = notes.get(inner, "")
        try:
            without = read({**beside, **{k: v for k, v in content.items() if k != key}})
        except ValidationError:
            assert "required" in note, inner
        else:
            assert "required" not in note, inner
            assert (getattr(without, key) == part) == ("left out" not in note), inner
        if key == "provenance":
            inner, part, value = (*inner, "goals"), part["goals"], value["goals"]
        if isinstance(value, list) and value:
            part, value = part[0], value[0]
        if hasattr(part, "__pydantic_fields__"):
            check_keys(type(part), value, notes, inner)


def test_the_page_of_files_has_every_key_with_what_holds_without_it():
    page = (DOCS / "reference" / "files.md").read_text(encoding="utf-8")
    task, family, suite = re.findall("```toml\n(.*?)```", page, re.DOTALL)
    check_keys(Task, *read_example(task))
    check_keys(Family, *read_example(family), name="mine/v1")
    check_keys(Suite, *read_example(suite), name="mine")


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
