"""The bibliography: well-formed, and what the methods say of themselves."""

import re

import pytest

from coartic import load_task
from coartic.analysis.citations import STATISTICS, THE_PAPER, THEORIES, references
from coartic.analysis.methods import KNOWN_METHODS
from coartic.analysis.study import load
from coartic.benchmarks.registry import registry
from coartic.method import Facts
from tests.support.suites import BROKEN, ROOT, cell_on, edit, run_and_write


def fields_of(entry):
    """Fields of an entry in BibTeX, one a line."""
    lines = entry.split("\n")[1:-1]
    return dict(re.fullmatch(r"  ([a-z]+) = \{(.+)\},", line).groups() for line in lines)


BIB = {key: fields_of(entry) for key, entry in references().items()}


def keys_in(text):
    return re.findall(r"^@\w+\{([^,]+),", text, re.MULTILINE)


def test_every_method_has_works_and_every_entry_is_used():
    """And the file has no entry with another layout, which would be overlooked."""
    cited = {THE_PAPER, *STATISTICS, *THEORIES}
    for name, method in KNOWN_METHODS.items():
        assert method.facts.works, f"{name}: add facts = Facts(works=(KEY, ...)) to its class"
        cited |= {*method.facts.works, *method.facts.solvers}
    assert not cited - {*BIB}, "add entries with these keys to analysis/references.bib"
    assert not {*BIB} - cited, (
        "remove these entries from analysis/references.bib: nothing cites them"
    )
    text = (ROOT / "analysis" / "references.bib").read_text(encoding="utf-8")
    assert [*BIB] == keys_in(text), "write these entries of analysis/references.bib like the others"


OWN = """
class Own(Good):
    name = "test/own"
    title = "A title that is too long for figures of one column"
    facts = Facts(works=("hansen2016", "nobody2020"), algorithm="CMA-ES", short="own, short")


class Heir(Own):
    name = "test/heir"
    title = "Another title"
"""


@pytest.mark.process
@pytest.mark.usefixtures("in_this_process")
def test_a_method_of_a_file_has_a_short_name_an_algorithm_and_its_works(tmp_path, coartic):
    """Its folder carries them; a subclass does not inherit them."""
    head = "from coartic.method import Facts\n"
    (tmp_path / "own.py").write_text(head + BROKEN.read_text("utf-8") + OWN, encoding="utf-8")
    methods = registry([tmp_path / "own.py"])
    names = "cma-es/bandit", "test/own", "test/heir"
    cells = [cell_on(load_task("ascending"), methods[name]) for name in names]
    run_and_write(tmp_path / "results", cells, runs=1, trials=40)
    rows = load(tmp_path / "results").methods
    assert rows.short_title.to_dict() == {
        "cma-es/bandit": "CMA-ES", "test/own": "own, short", "test/heir": "test/heir",
    }  # fmt: skip
    assert [*rows.algorithm] == ["CMA-ES", "CMA-ES", "test/heir"]
    text = coartic("cite", tmp_path / "results")[1]
    assert "% cma-es/bandit, test/own\n@article{hansen2016" in text.replace("@misc", "@article")
    assert "% test/own names nobody2020, which coartic's bibliography does not have" in text


def test_a_wrong_fact_is_refused():
    with pytest.raises(ValueError, match="Facts: .*short.* 22 characters"):
        Facts(short="a name that is much too long")
    with pytest.raises(ValueError, match="Facts: .*works"):
        Facts(works="hansen2016")


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
