"""The bibliography: well-formed, and what the methods say of themselves."""

import re
import unicodedata

import pytest

from coartic import load_task
from coartic.analysis.citations import STATISTICS, THE_PAPER, references
from coartic.analysis.methods import KNOWN_METHODS
from coartic.benchmarks.registry import built_in, registry
from tests.support.suites import BROKEN, ROOT, cell_on, edit, run_and_write


def fields_of(entry):
    """Fields of an entry in BibTeX, one a line."""
    lines = entry.split("\n")[1:-1]
    return dict(re.fullmatch(r"  ([a-z]+) = \{(.+)\},", line).groups() for line in lines)


BIB = {key: fields_of(entry) for key, entry in references().items()}
BUILT_IN = list(built_in().values())


def plain(text):
    """Without accents, TeX's or Unicode's."""
    text = re.sub(r"\{\\.(\w)\}", r"\1", text)
    return "".join(c for c in unicodedata.normalize("NFD", text) if not unicodedata.combining(c))


def keys_in(text):
    return re.findall(r"^@\w+\{([^,]+),", text, re.MULTILINE)


@pytest.mark.parametrize("method", BUILT_IN, ids=lambda method: method.name)
def test_keys_and_citation_of_a_method_are_of_the_same_works(method):
    """First authors and years."""
    keys, text = KNOWN_METHODS[method.name].works, plain(method.citation)
    assert keys or text.startswith("This package")
    assert set(re.findall(r"\((\d{4})\)", text)) == {BIB[key]["year"] for key in keys}
    for key in keys:
        assert plain(BIB[key]["author"]).partition(",")[0] in text


def test_every_method_has_a_row_and_every_entry_is_used():
    assert list(KNOWN_METHODS) == [method.name for method in BUILT_IN]
    behind_methods = {key for row in KNOWN_METHODS.values() for key in (*row.works, *row.solvers)}
    text = (ROOT / "analysis" / "references.bib").read_text(encoding="utf-8")
    assert {THE_PAPER, *STATISTICS} | behind_methods == set(BIB) == set(keys_in(text))


@pytest.mark.usefixtures("in_this_process")
def test_command(tmp_path, coartic):
    methods = registry([BROKEN])
    names = "corrective-alone/given", "test/good"
    cells = [cell_on(load_task("ascending"), methods[name]) for name in names]
    run_and_write(tmp_path / "results", cells, runs=1)
    commit = '{"id": "0123456789abcdef", "dirty": true}'
    change = "UPDATE suite SET content = json_set(content, '$.commit', json(?))"
    edit(tmp_path / "results", change, commit)
    change = "UPDATE environments SET content = json_set(content, '$.imports', json(?))"
    edit(tmp_path / "results", change, '{"solver": "1.2", "other": "3"}')
    text = coartic("cite", tmp_path / "results")[1]
    assert ", commit 0123456789abcdef with changes}," in text
    assert keys_in(text) == ["coartic", THE_PAPER, "whitney1969", "method-test-good"]
    assert "% test/good ran with other 3, solver 1.2: cite these, too\n" in text
