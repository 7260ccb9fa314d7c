"""Reports of all sorts of folders, by the command line; and their names."""

import json
import re
import shutil

import pytest

import coartic.analysis.report.build
import coartic.analysis.report.headlines
from coartic import CoarticError, builtin_tasks
from coartic.analysis.figures import register
from coartic.analysis.report.build import build, write
from coartic.analysis.report.headlines import headline_numbers
from coartic.analysis.report.numbers import Names, macro_names, words
from coartic.analysis.report.trace import find_report, trace
from coartic.analysis.study import Study
from coartic.analysis.words import slugs
from coartic.benchmarks.suites import Cell, load_suite, select_cells
from coartic.cli.arguments import labels_in
from tests.support.commands import call
from tests.support.packs import records_of
from tests.support.reports import compiled, report_of
from tests.support.strategies import tiny_task
from tests.support.suites import KNOWN, Failing, run_and_write, with_environment


@pytest.fixture
def few_figures(undrawn, monkeypatch):
    """Reports with the first figure alone: drawing all of them takes most of the time."""
    monkeypatch.setattr(register, "REGISTER", register.REGISTER[:1])


def test_letters_alone():
    for name, expected in (
        ("two-armed-1", "TwoArmedOne"),
        ("dual-process/EC1 noise_sd=0.02", "ECOneNoiseSdZeroPointZeroTwo"),
        ("ascending.goal2_0_-1.5", "AscendingGoalTwoZeroMinusOnePointFive"),
        ("A_b", "AB"),
        ("7", "Seven"),
    ):
        assert words(name) == expected


def test_slugs():
    names = ["shelf-2", "shelf.2", "Shelf_2", "shelf-2-2", "a_-1", "a_1", "X"]
    found = slugs(names)
    assert list(found) == names
    assert len(set(found.values())) == len(names)
    assert all(re.fullmatch("[a-z0-9]+(-[a-z0-9]+)*", slug) for slug in found.values())
    assert (found["a_-1"], found["a_1"]) == ("a-minus1", "a-1")


class Plan:
    """What :func:`macro_names` reads of a study."""

    def __init__(self, cells):
        self.results = self
        self.tasks = dict.fromkeys(task for task, _ in cells)
        self.cells = dict.fromkeys(cells)


def test_names_of_the_largest_suite_need_no_help():
    cells = select_cells(load_suite("comparison"), KNOWN)
    names = macro_names(Plan([(cell.task.name, cell.label) for cell in cells]))
    assert len(names.labels) > 50
    assert set(names.tasks) == set(builtin_tasks())
    assert names.renamed() == []
    joined = [names.tasks[c.task.name] + names.labels[c.label] for c in cells]
    assert len(set(joined)) == len(cells)
    assert all(name.isalpha() and name.isascii() for name in joined)


def test_names_that_are_the_same_in_letters():
    names = macro_names(Plan([("shelf-2", "a/b"), ("shelf.2", "a-b"), ("Shelf_2", "a/b")]))
    assert names.tasks == {"shelf-2": "ShelfTwo", "shelf.2": "ShelfTwoAlt",
                           "Shelf_2": "ShelfTwoAltAlt"}  # fmt: skip
    assert names.labels == {"a/b": "AB", "a-b": "ABAlt"}
    assert "shelf.2 is ShelfTwoAlt in macros, as another name is ShelfTwo." in names.renamed()


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """Tasks of somebody's own, with names that are the same in letters; one run a cell."""
    found = [
        Cell(tiny_task(name=name), KNOWN[method])
        for name in ("shelf-2", "shelf.2", "A_b", "on-A_b", "tasks", "optimum")
        for method in ("dual-process/EC4", "corrective-alone/given")
    ]
    folder = tmp_path_factory.mktemp("odd") / "results"
    run_and_write(folder, found, runs=1, trials=30)
    return with_environment(folder)


@pytest.fixture(scope="module")
def of_odd(odd):
    """What is computed of it, each once."""
    return Study(odd)


def test_odd_names_one_run_and_no_optimum(of_odd, tmp_path, few_figures):
    of = of_odd
    folder = report_of(of, tmp_path / "report")
    page = (folder / "report.md").read_text(encoding="utf-8")
    assert "None is known of shelf-2, shelf.2, A\\_b" in page.replace("A_b", "A\\_b")
    tex = (folder / "numbers.tex").read_text(encoding="utf-8")
    assert "% shelf.2 is ShelfTwoAlt in macros" in tex
    assert "shelf.2 is ShelfTwoAlt in macros" in page
    for name, task in (("ShelfTwo", "shelf-2"), ("ShelfTwoAlt", "shelf.2"), ("AB", "A_b")):
        found = trace(folder, f"coartic{name}ECFourReward")
        assert [(source.task, len(source.run_ids)) for source in found.sources] == [(task, 1)]
        assert found.sources[0].command == ""  # the task's file is not here
    assert not re.search("Gap|Low|SD", tex.partition("providecommand")[2])
    # Numbers may be printed as the paper that takes them has it.
    own = tex.replace("\\providecommand", "\\newcommand{\\coarticnum}[1]{\\num{#1}}%", 1)
    assert own != tex
    (folder / "numbers.tex").write_text(own, encoding="utf-8")
    compiled(folder, r"\coarticShelfTwoECFourReward")


def test_macros_that_run_together_are_told_apart(odd, of_odd, monkeypatch):
    """As task a with method b-c and task a-b with method c would: all ABC."""
    of = of_odd
    labels = macro_names(of).labels
    same = Names(dict.fromkeys(odd.tasks, "X"), labels)
    monkeypatch.setattr(coartic.analysis.report.headlines, "macro_names", lambda of: same)
    numbers = headline_numbers(of)
    names = [number.macro + suffix for number in numbers for suffix, _ in number.companions()]
    assert len(names) == len(set(names))
    rewards = [n for n in numbers if re.fullmatch("coarticXECFourReward(Alt)*", n.macro)]
    assert [n.macro.count("Alt") for n in rewards] == list(range(6))
    assert [n.cells[0][0] for n in rewards] == list(odd.tasks)


def test_failed_runs(tmp_path, few_figures):
    known = select_cells(load_suite("paper"), KNOWN, tasks=["ascending"])
    for rows in (1, 3):  # some, then all
        folder = tmp_path / f"{rows} failed"
        run_and_write(folder, known, runs=3, trials=30, executor=Failing(*range(rows)))
        of = Study(with_environment(folder))
        made = build(of)
        write(made, of, tmp_path / "report")
        page = (tmp_path / "report" / "report.md").read_text(encoding="utf-8")
        assert f"{rows} of 3 runs have no solution" in page
        crashed = "1 run is" if rows == 1 else f"{rows} runs are"
        assert f"{crashed} crashed (exit code 9)" in page
        named = {number.macro: number for number in made.numbers}
        if rows == 1:
            assert named["coarticAscendingECOneReward"].n == 2
        else:
            assert "coarticAscendingECOneReward" not in named


def test_the_commands(monkeypatch, capsys, tmp_path, odd, few_figures):
    folder = tmp_path / "res ults"
    shutil.copytree(odd.folder, folder)
    code, out, _ = call(monkeypatch, capsys, "report", folder)
    assert code == 0
    assert str(folder / "report" / "report.html") in out
    macro = "coarticShelfTwoECFourReward"
    for place in (tmp_path, folder, folder / "report"):
        code, out, _ = call(monkeypatch, capsys, "trace", macro, "--in", place)
        assert code == 0
        assert out.startswith(f"{macro} = -")
        assert f"results: {folder}" in out
        assert f"--in '{folder}'" in out
    run = out.split()[-1]
    assert run in records_of(folder)
    row = ("methods-a-b", "dual-process/EC4", "reward")
    code, out, _ = call(monkeypatch, capsys, "trace", *row, "--in", folder)
    assert code == 0
    assert "A_b x dual-process/EC4: 1 run, made" in out
    for arguments, words_ in (
        ([macro + "s"], f"did you mean '{macro}'"),
        (["methods-a-c", "x", "y"], "did you mean 'methods-a-b"),
        ([row[0], "dual-process/EC5", "reward"], "did you mean 'dual-process/EC4"),
        ([row[0], row[1], "rewards"], "did you mean 'reward"),
        ([row[0]], "name a row and a column"),
    ):
        code, out, error = call(monkeypatch, capsys, "trace", *arguments, "--in", folder)
        assert (code, out) == (2, "")
        assert words_ in error
        assert "Traceback" not in error


def refused(monkeypatch, capsys, *arguments):
    code, out, error = call(monkeypatch, capsys, *arguments)
    assert (code, out) == (2, "")
    assert error.startswith("error: ")
    assert "Traceback" not in error
    return error


def test_labels_with_commas_are_quoted():
    text = ' a/b , "a/b x=1, y=2",a/c,a/b'
    assert labels_in(text, "--methods") == ["a/b", "a/b x=1, y=2", "a/c"]


def test_what_cannot_be_reported(monkeypatch, capsys, tmp_path, odd, few_figures):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("x")
    assert "not a results folder" in refused(monkeypatch, capsys, "report", tmp_path / "empty")
    for name in ("file", "nowhere"):
        assert str(tmp_path / name) in refused(monkeypatch, capsys, "report", tmp_path / name)
    assert "no report in" in refused(monkeypatch, capsys, "trace", "a", "--in", tmp_path / "empty")
    near = refused(monkeypatch, capsys, "report", odd.folder, "--methods", "dual-process/EC44")
    assert "did you mean 'dual-process/EC4'" in near
    assert "empty name" in refused(monkeypatch, capsys, "report", odd.folder, "--methods", "a,,b")
    assert "svg must be among them" in refused(
        monkeypatch, capsys, "report", odd.folder, "--formats", "png"
    )
    # Somebody's folder, whose page has the name of ours.
    thesis = tmp_path / "thesis"
    thesis.mkdir()
    (thesis / "report.html").write_text("years of work")
    (thesis / "thesis.tex").write_text("more years of work")
    before = everything(tmp_path)
    error = refused(monkeypatch, capsys, "report", odd.folder, "--out", thesis)
    assert (
        "holds report.html, thesis.tex, not listed there as written by `coartic report`" in error
    )
    assert everything(tmp_path) == before
    before = everything(odd.folder.parent)
    for place, words_ in (
        (odd.folder, "holds the results themselves"),
        (odd.folder.parent, "holds the results themselves"),
        (odd.folder / "records", "is among the records"),
        (odd.folder / "records" / "report", "is among the records"),
    ):
        assert words_ in refused(monkeypatch, capsys, "report", odd.folder, "--out", place)
    assert everything(odd.folder.parent) == before
    # A file where a folder should be: what a disk that is read only answers, for root too.
    error = refused(monkeypatch, capsys, "report", odd.folder, "--out", tmp_path / "file" / "r")
    assert "cannot write" in error


def everything(folder):
    return {path: path.is_dir() or path.read_bytes() for path in folder.rglob("*")}


def test_a_report_is_made_again_where_nobody_changed_it(
    monkeypatch, capsys, tmp_path, tmp_path_factory, few_figures
):
    home, results = tmp_path / "report", tmp_path_factory.mktemp("small")
    run_and_write(results, [Cell(tiny_task(), KNOWN["dual-process/EC4"])], runs=1, trials=5)
    command = ("report", results, "--out", home, "--formats", "svg")
    assert call(monkeypatch, capsys, *command)[0] == 0
    before = everything(tmp_path)
    assert "as SVG." in (home / "report.md").read_text(encoding="utf-8")
    assert call(monkeypatch, capsys, *command)[0] == 0
    assert everything(tmp_path) == before
    with (home / "report.md").open("a", encoding="utf-8") as page:
        page.write("A thought of mine.")
    before = everything(tmp_path)
    error = refused(monkeypatch, capsys, *command)
    assert "holds report.md, changed since `coartic report` wrote it; move it away" in error
    assert everything(tmp_path) == before
    (home / "report.md").rename(tmp_path / "mine.md")
    assert call(monkeypatch, capsys, *command)[0] == 0


@pytest.mark.parametrize("name", ["runs", "solutions", "learning", "sequences", "manifest"])
def test_damaged_folders(name, monkeypatch, capsys, tmp_path, odd, undrawn):
    folder = tmp_path / "results"
    shutil.copytree(odd.folder, folder)
    path = folder / (f"{name}.json" if name == "manifest" else f"{name}.parquet")
    path.write_bytes(path.read_bytes()[:40])
    assert path.stem in refused(monkeypatch, capsys, "report", folder)
    path.unlink()
    assert path.stem in refused(monkeypatch, capsys, "report", folder)
    assert not (folder / "report").exists()


def test_many_tasks_make_a_short_report(monkeypatch, of_odd, undrawn):
    monkeypatch.setattr(coartic.analysis.report.build, "MOST_TASKS", 5)
    own = [row for row in register.REGISTER if row.name == "signatures"]
    monkeypatch.setattr(register, "REGISTER", own)
    document = build(of_odd).document
    kinds = {table.id.partition("-")[0] for table in document.tables()}
    assert kinds >= {"methods", "tasks"}
    assert not kinds & {"pairs", "costs", "targets", "areas", "pareto", "claims"}
    assert not list(document.figures())
    assert "With more than 5 tasks (here 6)" in json.dumps(
        [block.items for block in document.sections[-1].blocks]
    )


def test_tables_of_a_study_are_those_of_its_report(of_odd, few_figures):
    study = of_odd
    document, tables = build(study).document, study.tables
    assert list(tables) == [table.id for table in document.tables()]
    for table in document.tables():
        assert tables[table.id].key.astype(str).tolist() == [row.key for row in table.rows]
    methods = tables["methods-a-b"].set_index("method").reward
    row = study.method_rows["A_b", "dual-process/EC4"]
    assert methods["dual-process/EC4"] == row.reward
    with pytest.raises(KeyError, match="no table 'method-a-b'; did you mean 'methods-a-b'"):
        tables["method-a-b"]
    with pytest.raises(KeyError, match="no table 0; `list"):
        tables[0]


def test_which_report_is_meant(tmp_path):
    with pytest.raises(CoarticError, match="no report"):
        find_report(tmp_path)
    for name in ("a", "b"):
        (tmp_path / name / "report").mkdir(parents=True)
        (tmp_path / name / "report" / "trace.json").write_text("{}")
    with pytest.raises(CoarticError, match="2 reports below"):
        find_report(tmp_path)
    assert find_report(tmp_path / "a") == tmp_path / "a" / "report"
