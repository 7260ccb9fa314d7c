"""The bibliography: whole, well-formed, and what the methods say of themselves."""

import inspect
import re
import sqlite3
import unicodedata
from contextlib import closing
from pathlib import Path

import pytest

from coartic import CoarticError, load_task
from coartic.analysis.citations import PAPER, MethodSource, behind_analysis, bibliography, software
from coartic.analysis.methods import KNOWN_METHODS, KnownMethod
from coartic.analysis.references import parse, references
from coartic.analysis.signatures.register import REGISTER
from coartic.benchmarks.registry import built_in, registry
from coartic.benchmarks.suites import Cell
from coartic.runs.store import FILE
from tests.support.commands import call
from tests.support.suites import BROKEN, run_and_write

ROOT = Path(__file__).parent.parent
BIB = references()
ANALYSIS = behind_analysis()
BUILT_IN = [entry.method for entry in built_in().values()]
GOOD = """@article{a2000,
  author = {A, B.},
  title = {C},
  journal = {D},
  year = {2000},
}
"""


def plain(text):
    """Without accents, TeX's or Unicode's."""
    text = re.sub(r"\{\\.(\w)\}", r"\1", text)
    return "".join(c for c in unicodedata.normalize("NFD", text) if not unicodedata.combining(c))


def surnames(key):
    return {name.partition(",")[0] for name in plain(BIB[key].fields["author"]).split(" and ")}


@pytest.mark.parametrize("method", BUILT_IN, ids=lambda method: method.name)
def test_keys_and_citation_of_a_method_are_of_the_same_works(method):
    keys, text = KNOWN_METHODS[method.name].works, plain(method.citation)
    if not keys:
        assert text.startswith("This package")
    named = set(re.findall(r"(?:[A-Z]\.-?)+(?: [A-Z]\.)* ([A-Z][\w-]+)", text))
    assert named <= set().union(*(surnames(key) for key in keys))
    years = set(re.findall(r"\((\d{4})\)", text))
    assert years == {BIB[key].fields["year"] for key in keys}
    for key in keys:
        fields = BIB[key].fields
        # A multi-author work may be named in short; its first author is always named.
        assert plain(fields["author"]).partition(",")[0] in text
        title = plain(fields["title"]).replace("{", "").replace("}", "").lower().split(":")[0]
        assert title in text.lower() or key in ("kanoun2011", PAPER)


def test_every_method_has_a_row_and_every_row_a_method():
    assert list(KNOWN_METHODS) == [method.name for method in BUILT_IN]


def test_every_entry_is_used():
    behind_methods = {key for row in KNOWN_METHODS.values() for key in (*row.works, *row.solvers)}
    assert {PAPER, *ANALYSIS} | behind_methods == set(BIB)


@pytest.mark.parametrize("method", BUILT_IN, ids=lambda method: method.name)
def test_solvers_are_cited_where_the_code_uses_them(method):
    text = Path(inspect.getsourcefile(method)).read_text(encoding="utf-8")
    due = set()
    if "from coartic.baselines.trajectory_problem import" in text:
        due = {"wachter2006", "andersson2019"}
    if "from coartic.baselines.cascade import" in text:
        due = {"arnstrom2022"}
        assert method.Parameters().solver == "daqp"
    assert set(KNOWN_METHODS[method.name].solvers) == due


def test_fields_look_like_what_they_are():
    for key, entry in BIB.items():
        assert re.fullmatch(r"(1[89]|20)\d\d", entry.fields["year"])
        assert entry.fields["year"] == key[-4:]
        assert (
            re.sub(r"\W", "", plain(entry.fields["author"]).partition(",")[0]).lower() == key[:-4]
        )
        assert re.fullmatch(r"\d+(--\d+)?", entry.fields.get("pages", "1"))
        if "--" in entry.fields.get("pages", ""):
            start, end = map(int, entry.fields["pages"].split("--"))
            assert start < end
        for name in entry.fields["author"].split(" and "):
            assert re.fullmatch(r"[A-Z][\w{}\\'\"-]*, [A-Z]\.([- ]*[A-Z]\.)*", name), name


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GOOD.replace("},\n}", "}\n}"), "'@article{a2000,'"),
        (GOOD.replace("  year = {2000},\n", ""), "a2000 lacks year"),
        (GOOD.replace("{C}", "{C{D}"), "braces of title do not match"),
        (GOOD.replace("{C}", "{C}D{E}"), "braces of title do not match"),
        (GOOD.replace("@article", "@poem"), "a known kind, not @poem"),
        (GOOD + "\n" + GOOD, "there twice"),
        (GOOD.replace("  year", "  title = {E},\n  year"), "there twice"),
        (GOOD + "\nand so on\n", "'and so on'"),
        (GOOD.replace("title = {C}", "title = C"), "'@article{a2000,'"),
    ],
)
def test_what_is_no_bibliography_is_refused(text, words):
    assert list(parse(GOOD, "own.bib")) == ["a2000"]
    with pytest.raises(CoarticError) as caught:
        parse(text, "own.bib")
    assert str(caught.value).startswith("own.bib: ")
    assert words in str(caught.value)


def test_keys_of_no_entry_are_refused_where_they_are_read():
    signature = next(iter(REGISTER.values())).model_dump() | {"sources": ["shah2031"]}
    row = {"short": "x", "works": ["shah2031"]}
    for model, content in ((type(REGISTER["context distance"]), signature), (KnownMethod, row)):
        with pytest.raises(ValueError, match="no entry 'shah2031'; did you mean 'shah2013'?"):
            model.model_validate(content)


def test_the_software_is_cited_by_the_facts_of_citation_cff():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    facts = dict(re.findall(r'^(title|version|date-released): "?([^"\n]+)"?$', text, re.MULTILINE))
    entry = software()
    assert entry.fields["title"] == facts["title"]
    assert entry.fields["note"] == f"Version {facts['version']}"
    assert entry.fields["year"] == facts["date-released"][:4]
    assert entry.fields["author"].strip("{}") in text
    paper = references()[PAPER].fields
    assert f'title: "{paper["title"]}"' in text
    assert paper["journal"] in text
    assert f"year: {paper['year']}" in text


def test_the_software_of_a_folder_has_its_version_and_commit():
    commit = {"id": "0123456789abcdef", "dirty": False}
    note = "Version 0.0.9, commit 0123456789abcdef"
    environment = {"coartic": "0.0.9", "commit": commit}
    assert software(environment).fields["note"] == note
    dirty = {**environment, "commit": {**commit, "dirty": True}}
    assert software(dirty).fields["note"] == f"{note} with changes"
    assert software({**environment, "commit": None}).fields["note"] == "Version 0.0.9"
    assert f"  note = {{{note}}}," in bibliography([], environment=environment)


def test_each_work_once_with_the_methods_that_rest_on_it():
    text = bibliography([MethodSource(m.name, m.title, m.citation, True) for m in BUILT_IN])
    entries = parse(re.sub("^%.*\n", "", text, flags=re.MULTILINE), "output")
    assert set(entries) == {"coartic", *BIB} - set(ANALYSIS)
    assert list(entries)[:2] == ["coartic", PAPER]
    assert "% cma-es/bandit, cma-es/every\n@misc{hansen2016," in text
    assert (
        "% trajectory-optimisation/path-length, trajectory-optimisation/squared-changes, "
        "trajectory-optimisation/acceleration, trajectory-optimisation/jerk, "
        "optimum/dynamic-programming, optimum/multistart, optimum/branch-and-bound\n"
        "@article{wachter2006,"
    ) in text
    more = bibliography([], analysis=True)
    assert set(re.findall(r"@\w+\{([^,]+),", more)) == {"coartic", PAPER, *ANALYSIS}


def test_methods_of_others_cite_themselves():
    own = MethodSource(
        "cma-es/bold", "Bold & fast", "A. B. C_d (2020), me@here, 5 %\n of {x}.", False
    )
    silent = MethodSource("lab/silent", "Silent", "", False)
    ours = MethodSource("dual-process/EC9", "Of another version", "Ours (2030).", True)
    text = bibliography([own, silent, ours])
    assert "hansen2016" not in text  # an id like ours makes nobody one of ours
    assert (
        r"  note = {A. B. C\_d (2020), me@here, 5 \% of "
        r"\textbraceleft{}x\textbraceright{}.}," in text
    )
    assert r"  title = {Bold \& fast}," in text
    assert "@misc{method-cma-es-bold,\n" in text
    comments = [line for line in text.splitlines() if line.startswith("%")]
    assert not any("@" in comment for comment in comments)  # BibTeX would read on there
    assert any("me(at)here" in comment for comment in comments)
    assert "% lab/silent: it declares no citation; ask its authors what to cite" in comments
    assert "silent," not in text
    lacking = "dual-process/EC9, built in, without a row in methods.toml, cites: Ours (2030)."
    assert f"% {lacking}" in comments


def test_command(tmp_path, monkeypatch, capsys):
    known = registry([BROKEN])
    cells = [
        Cell(load_task("ascending"), known[name])
        for name in ("corrective-alone/given", "test/good")
    ]
    run_and_write(tmp_path / "results", cells, runs=1)
    commit = '{"id": "0123456789abcdef", "dirty": false}'
    with closing(sqlite3.connect(tmp_path / "results" / FILE, isolation_level=None)) as plain_sql:
        change = "UPDATE environments SET content = json_set(content, '$.commit', json(?))"
        plain_sql.execute(change, (commit,))
    code, text, _ = call(monkeypatch, capsys, "cite", tmp_path / "results")
    assert code == 0
    assert ", commit 0123456789abcdef}," in text
    found = re.findall(r"@\w+\{([^,]+),", text)
    assert found == ["coartic", PAPER, "whitney1969", "method-test-good"]
    assert "% the paper, corrective-alone/given\n" in text
    assert "% test/good, a method of others, cites: None (2026).\n" in text
    _, every, _ = call(monkeypatch, capsys, "cite", "--analysis")
    assert set(re.findall(r"@\w+\{([^,]+),", every)) == {"coartic", *BIB}
    for arguments, words in (
        ((tmp_path / "nowhere",), "does not exist"),
        ((tmp_path,), "is not a results folder"),
    ):
        code, out, error = call(monkeypatch, capsys, "cite", *arguments)
        assert (code, out) == (2, "")
        assert words in error
