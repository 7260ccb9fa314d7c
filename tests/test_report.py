"""Reports: their numbers are those of the runs, their text is escaped, their rows name runs."""

import html
import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from coartic import CoarticError, __version__, load_task
from coartic.analysis import FIGURES, TABLES, tables
from coartic.analysis.figures import drawings, plot
from coartic.analysis.figures.plot import picture
from coartic.analysis.report import build, sections
from coartic.analysis.report.build import stamp, write_report
from coartic.analysis.report.sections import QUESTIONS, SECTIONS, attempt, finding
from coartic.analysis.study import load
from coartic.analysis.words import id_of
from coartic.internal.files import LISTING
from tests.support.made_up import made_up_optima, runs_of, study_of
from tests.support.processes import ROOT
from tests.support.suites import cells_of, edit, run_and_write


@pytest.fixture(scope="module")
def tables_by_name(traced):
    return {name: table(traced) for name, table in TABLES.items()}


def test_a_csv_file_has_the_rows_and_runs_of_its_table(traced, tables_by_name, report):
    """Of the folder, from which its numbers are."""
    with_rows = {name: table for name, table in tables_by_name.items() if len(table)}
    assert {path.stem for path in (report / "tables").iterdir()} == {*with_rows}
    assert len(with_rows) >= 8
    for name, table in with_rows.items():
        assert table.index.is_unique, name
        assert {*" ".join(table.run_ids).split()} <= {*traced.runs.run_id}, name
        path = report / "tables" / f"{name}.csv"
        written = pd.read_csv(path, index_col="row", dtype=str, keep_default_na=False)
        assert [*written.index] == [*table.index]
        assert written.run_ids.tolist() == table.run_ids.tolist()
    rewards = traced.runs.set_index("run_id").reward.astype(float)
    for row, values in tables_by_name["methods"].iterrows():
        of_row = rewards[values.run_ids.split()]
        assert values.reward == pytest.approx(of_row.mean(), abs=1e-9), row


def test_a_report_is_stamped_with_the_results_of_its_runs(traced, report):
    other = traced.runs.reset_index(drop=True)
    other.loc[0, "result"] = "other"
    stamps = [stamp(runs) for runs in (traced.runs, traced.runs[::-1], other)]
    page = (report / "report.html").read_text("utf-8")
    assert [f'name="coartic-runs" content="{each}"' in page for each in stamps] == [1, 1, 0]


def test_page_and_citation_name_the_versions_that_made_the_runs(coartic, traced, tmp_path):
    """And the page the one that draws it, and the one to cite: of the last command."""
    folder = shutil.copytree(traced.folder, tmp_path / "results")
    for statement in (
        "INSERT INTO environments SELECT 'old', json_set(content, '$.coartic', '5.0.0'), '', ''"
        " FROM environments LIMIT 1",
        "UPDATE results SET environment = 'old', date = '2020-01-01' WHERE run > 0",
        "UPDATE environments SET content = json_set(content, '$.coartic', '6.1.0')"
        " WHERE id != 'old'",
        "UPDATE suite SET content = json_set(content, '$.coartic', '6.1.0')",
    ):
        edit(folder, statement)
    assert coartic("report", folder)[0] == 0
    page = html.unescape((folder / "report" / "report.html").read_text("utf-8"))
    text = " ".join(re.sub("<[^>]+>", "", page).split())
    assert "made with coartic 5.0.0 and 6.1.0 (" in text
    assert f" and drawn with {__version__}." in text
    assert "cite the software (version 6.1.0)" in text
    note = coartic("cite", folder)[1].partition("Version ")[2].partition("\n")[0]
    assert re.match("6.1.0(, commit [^;]*)?; runs made with 5.0.0, too", note)


def test_each_figure_is_in_a_section():
    shown = {id_of(draw) for section in (QUESTIONS, *SECTIONS) for draw in section.figures}
    assert not {*FIGURES} - shown, "add these figures to a Section of analysis/report/sections.py"


def test_a_value_without_a_column_and_a_column_without_a_value_are_errors(traced, monkeypatch):
    monkeypatch.setattr(tables.language, "TABLES", {})

    def list_mine(study):
        yield "a row", {"method": "mine", "gpa": 1.0, "run_ids": ""}

    for columns, wrong in (("method|m\ngap|g", "'gap', 'gpa'"), ("method|m", "'gpa'")):
        with pytest.raises(ValueError, match=rf"table mine \(.*, line \d+\): .*{wrong}"):
            tables.table("Mine", columns)(list_mine)(traced)
    right = tables.table("Mine", "method | m\ngpa | grade (%) | 1 | tex")(list_mine)
    frame = right(traced)
    assert "grade (%)" in tables.html_of(right, traced, frame)
    assert "100.0" in tables.latex_of(right, traced, frame)
    assert tables.csv_of(frame).splitlines() == ["row,method,gpa,run_ids", "a row,mine,1.0,"]


def test_a_dagger_in_a_latex_table_is_explained_below_it(traced):
    frame = TABLES["methods"](traced)[:1]
    explained = "The paper does not publish the goals of this task"
    for task, count in (("two-armed task 1 †", 1), ("ascending", 0)):
        text = tables.latex_of(TABLES["methods"], traced, frame.assign(task=task))
        assert text.count(explained) == count


HOSTILE = '<script>alert("&")</script> \\input{x} 5 % of $x_1^2$ #~'


def test_text_from_files_is_escaped(traced):
    frame = TABLES["methods"](traced)[:1].assign(method=HOSTILE, task=HOSTILE)
    page = tables.html_of(TABLES["methods"], traced, frame)
    assert "<script" not in page
    assert HOSTILE in html.unescape(re.sub("<[^>]+>", "", page))
    latex = tables.latex_of(TABLES["methods"], traced, frame, [HOSTILE])
    assert "\\input{x}" not in latex
    assert "5 \\% of \\$x\\_1\\textasciicircum{}2\\$ \\#\\textasciitilde{}" in latex
    assert r"\textbackslash{}input\textbraceleft{}x\textbraceright{}" in latex


TITLES = {
    "ascending": r"50 % of ^a~b\c & #1_x {} {z} $5 to $6 <i>",
    "two-armed-2": "far } (%) [x] { $x^$ {n} {tasks} {reference}",
}
"""Titles of tasks with the signs that Python, HTML, TeX and Matplotlib use."""


def test_titles_are_shown_as_they_are_in_headings_and_figures(monkeypatch):
    tasks = [
        load_task(name).model_copy(update={"title": title, "provenance": {}})
        for name, title in TITLES.items()
    ]
    own, known = "mine {fast} {n}", "hill-climbing"
    rewards = {own: [-310, -311, -312, -313, -314], known: [-320, -321, -322, -323, -324]}
    rows = [
        row for task in TITLES for name, of in rewards.items() for row in runs_of(task, name, of)
    ]
    study = study_of(rows, tasks, optima=made_up_optima(*TITLES))
    table = TABLES["ranking"]
    page = tables.html_of(table, study, table(study))
    heads = {html.unescape(head) for head in re.findall("<th[^>]*>([^<]*)</th>", page)}
    assert heads >= {f"{title} (%)" for title in TITLES.values()}
    assert page.count(f">{100 * 20 / 292:.1f}</td>") == 1  # the mean of five runs
    text = tables.latex_of(table, study, table(study))
    commands = {"textasciicircum": "^", "textasciitilde": "~", "textbackslash": "\\"}
    commands |= {"textbraceleft": "{", "textbraceright": "}"}
    for command, sign in commands.items():
        text = text.replace(f"\\{command}{{}}", sign)
    text = re.sub(r"\\([&%$#_])", r"\1", text)  # as TeX prints it
    for title in TITLES.values():
        assert f"& {title} (%)" in text
    pictured = FIGURES["tasks"](study)
    svg = html.unescape(picture(pictured.figure, ".svg").decode())
    assert all(title in svg for title in TITLES.values())
    monkeypatch.setattr(plot, "FIGURES", {})
    said = " Goal 1 of {far} and {z}."

    def draw_mine(_):
        return pictured.figure, pd.DataFrame({"runs": [5, 20]}), "", said

    captioned = plot.figure("Mine", "n = {n}, to the {reference}.")(draw_mine)(study)
    assert captioned.caption == f"n = 5 to 20, to the optimum.{said}"


def test_no_text_is_a_formula_of_a_spreadsheet():
    texts = ["=HYPERLINK(1)", "+1", "-x", "@SUM(1)", "a=b"]
    frame = pd.DataFrame({"method": texts, "reward": -1.5}, pd.Index(texts, name="row"))
    lines = [f"'{text},'{text},-1.5" for text in texts[:-1]]
    assert tables.csv_of(frame).splitlines()[1:] == [*lines, "a=b,a=b,-1.5"]


def test_a_report_is_not_written_through_a_link(traced, tmp_path):
    study = replace(traced, folder=tmp_path / "results")
    study.folder.mkdir()
    (tmp_path / "mine").mkdir()
    (study.folder / "report").symlink_to(tmp_path / "mine")
    with pytest.raises(CoarticError, match="by a symbolic link"):
        write_report(study, study.folder / "report")
    assert not list((tmp_path / "mine").iterdir())


def test_a_report_removes_only_files_that_it_can_write(traced, tmp_path, monkeypatch):
    """Of an earlier report with figures, whose list somebody has extended by files of a user."""
    folder = tmp_path / "report"
    drawn = {f"figures/{name}": b"drawn" for name in ("ranking.svg", "runtimes-motor-noise-0.pdf")}
    monkeypatch.setattr(build, "_files_of_figures", lambda *_: drawn)
    assert build.write_report(traced, folder)[1] == {}
    earlier = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*")}
    earlier.remove(LISTING)
    users = {"mine.txt", "tables/mine.csv", "figures/mine.svg", "figures/ranking.txt"}
    for name in users:
        (folder / name).write_text("mine")
    with (folder / LISTING).open("a") as listing:
        listing.write("".join(f"{name}\n" for name in users))
    build.write_report(traced, folder, for_paper=False)
    left = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*")} - {LISTING}
    pages = {name for name in earlier if name.endswith((".html", ".csv"))}
    assert left == pages | users


def test_a_page_stands_alone(report):
    text = (report / "report.html").read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!#|data:,|https://doi\.org|tables/|figures/)', text)
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    references = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)
    assert {a or b for a, b in references} <= set(ids)
    figures = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    assert len(figures) > 3
    assert all(ElementTree.fromstring(drawn).get("aria-label") for drawn in figures)
    assert not any("#000000" in drawn for drawn in figures)
    assert len(text) < 1_500_000


def numbers_in(text):
    return re.findall(r"−?\d+(?:\.\d+)?", text.replace("\u202f", ""))


def test_every_number_of_a_sentence_is_in_the_table_under_it(report):
    page = (report / "report.html").read_text("utf-8")
    seen = 0
    for section in re.findall(r"<section.*?</section>", page, re.DOTALL):
        lines = re.findall(r'<p class="finding">(.*?)</p>', section)
        (name,) = re.findall(r'<h2 id="(.*?)"', section)
        lines += re.findall(rf'<li><a href="#{name}">.*?</a>: (.+?)</li>', page)
        assert [line for line in lines if page.count(line) > 1] == []
        table = section.partition("<table")[2].partition("</table>")[0]
        cells = {*numbers_in(re.sub("<[^>]+>", " ", html.unescape(table)))}
        words = html.unescape(" ".join(lines)).replace("95 %", "")
        seen += len(numbers_in(words))
        assert {*numbers_in(words)} <= cells, words
    assert seen > 10


@pytest.mark.usefixtures("ranked")
def test_a_study_of_one_parameter_is_answered_first(coartic, tmp_path, monkeypatch):
    """The suite of the page on own suites: all settings in order, question, answer and figure."""
    monkeypatch.setattr(sections, "visible_sections", lambda study: SECTIONS[:1])
    page = (ROOT / "docs" / "howto" / "task.md").read_text("utf-8")
    (text,) = re.findall(r"```toml\n# noise.toml\n(.*?)```", page, re.DOTALL)
    suite, out = tmp_path / "noise.toml", tmp_path / "noise"
    text = text.replace("runs = 10", "runs = 3").replace("5000", "100")
    suite.write_text(text.replace(', "descending"', ""))
    _, printed, _ = coartic("run", suite, "--out", out)
    seen = load(out)
    means = seen.runs.groupby("noise_sd").gap.mean()
    best, other, *_ = means.sort_values().index
    rows = re.findall(r"^learner EC1 \(noise_sd ([\d.]+)[^)]*\) ", printed, re.MULTILINE)
    assert [*map(float, rows)] == means.sort_values().index.tolist()
    answer = " ".join(finding(seen, SECTIONS[0])).replace("\xa0", " ")
    assert f"is noise_sd {best}:" in answer.partition(f"noise_sd {other} (")[0]
    assert f"{100 * means[best]:.1f} %" in answer
    plot = FIGURES["ranking"](seen)
    drawn = dict(zip(plot.data.value.astype(float), plot.data.gap, strict=True))
    assert drawn == pytest.approx(means.to_dict())
    assert plot.figure.axes[0].get_xscale() == "linear"  # from 0.02 to 0.1
    write_report(seen, tmp_path / "report", for_paper=False)
    written = (tmp_path / "report" / "report.html").read_text("utf-8")
    assert "<h1>Noise</h1>\n<p>How much exploration noise?</p>" in written


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_tables_compile(traced, tables_by_name, tmp_path):
    notes = ["The optimum of Two-armed 1 † is not proven ‡.", "σ ε − ∞ ± É 10\u202f000 a_b 5 %"]
    with_rows = {name: frame for name, frame in tables_by_name.items() if len(frame)}
    assert {"ranking", "signatures", "runtimes", "tasks"} <= {*with_rows}
    texts = [
        tables.latex_of(TABLES[name], traced, frame, notes)
        for name, frame in with_rows.items()
        if any(column.in_latex for column in TABLES[name].columns)
    ]
    (tmp_path / "all.tex").write_text(
        "\\documentclass{article}\\usepackage[T1]{fontenc}\\usepackage{booktabs,longtable}\n"
        "\\begin{document}\n" + "\n\n".join(texts) + "\n\\end{document}\n"
    )
    command = ["pdflatex", "-draftmode", "-interaction=nonstopmode", "-halt-on-error", "all"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:]


def test_a_part_that_fails_costs_no_other(coartic, traced, tmp_path, monkeypatch):
    """A report of one run for print: the figure of a shared goal fails, all else is written, and
    another folder does not write over it."""
    alone = cells_of("comparison", tasks=["ascending"], methods=["corrective-alone/given"])
    run_and_write(tmp_path / "runs", cells=alone, runs=1)
    monkeypatch.setattr(drawings, "shared_goal", lambda study: [][study.plan[0].seed])
    monkeypatch.setattr(build, "picture", lambda drawn, _: b"%.1f inches" % drawn.get_figwidth())
    monkeypatch.setattr(sections, "attempt", attempt)  # which other tests do without
    report = tmp_path / "report"
    options = "--out", report, "--for-paper", "--width", 3.4
    code, said, error = coartic("report", tmp_path / "runs", *options)
    assert code == 1
    assert "report.html" in said
    assert "Error: Coarticulation could not be made" in error
    assert f"IndexError: list index out of range ({__file__.rpartition('/')[2]}, line" in error
    text = (report / "report.html").read_text("utf-8")
    section = re.search(r'<section aria-labelledby="coarticulation">.*?</section>', text, re.S)
    assert "could not be made: IndexError: list index out of range" in section[0]
    assert {path.stem for path in report.glob("tables/*.csv")} >= {"ranking", "tasks"}
    assert (report / "tables" / "ranking.tex").exists()
    for ending in (".svg", ".pdf"):
        assert (report / "figures" / f"tasks{ending}").read_bytes() == b"3.4 inches"
    with pytest.raises(CoarticError, match="report holds the report of other results"):
        write_report(traced, report)


def own_file(folder, text=None):
    """The file of the page on reports, or another text."""
    if text is None:
        page = (ROOT / "docs" / "howto" / "report.md").read_text("utf-8")
        section = page.partition("## Your own tables and figures")[2]
        text = re.search(r"```python\n(.*?)```", section, re.DOTALL)[1]
    (folder / "own.py").write_text(text, "utf-8")
    return folder / "own.py"


def test_a_file_adds_tables_and_figures(traced, tmp_path, coartic):
    """In a section of their own, and in all files; and no later report has them."""
    before = [*TABLES], [*FIGURES]
    options = "--with", own_file(tmp_path), "--for-paper", "--width", 3.4
    code, _, error = coartic("report", traced.folder, "--out", tmp_path / "with", *options)
    assert code == 0, error
    page = (tmp_path / "with" / "report.html").read_text("utf-8")
    assert "Own tables and figures" in page
    assert "changes of hand" in page
    rows = pd.read_csv(tmp_path / "with" / "tables" / "changes.csv", index_col=0)
    runs = traced.runs[traced.runs.status == "ok"]
    for task, hands in runs.groupby("task").hands:
        changed = [sum(a != b for a, b in pairwise(each)) for each in hands]
        assert rows.changes[task] == pytest.approx(np.mean(changed))
    for name in ("tables/changes.tex", "figures/rewards.svg", "figures/rewards.pdf"):
        assert (tmp_path / "with" / name).is_file()
    assert ([*TABLES], [*FIGURES]) == before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "does not exist"),
        ("x = 1\n", "own.py makes no table and no figure: use @table or @figure"),
        ("x = 1\n1 / 0\n", "own.py, line 2: ZeroDivisionError: division by zero"),
        ("def (\n", "own.py, line 1: SyntaxError: invalid syntax"),
        ("import sys\nsys.exit(3)\n", "own.py, line 2: SystemExit: 3"),
        ("import json\njson.loads('{')\n", "own.py, line 2: JSONDecodeError"),
        ("from coartic.analysis import table\n@table('x', 'a')\ndef list_ranking(study): ...\n",
         "own.py, line 2: id 'ranking' exists already; rename function list_ranking"),
        ("from coartic.analysis import table\n@table('x', 'a')\ndef mine(study): ...\n",
         "own.py, line 2: function mine must be named list_NAME or draw_NAME"),
    ],
)  # fmt: skip
def test_a_file_that_adds_nothing_is_refused_before_anything_is_written(
    traced, tmp_path, coartic, text, words, monkeypatch
):
    """Also a file that is named by a path from the current folder, as most are."""
    monkeypatch.chdir(tmp_path)
    file = "no.py" if text is None else own_file(tmp_path, text).name
    code, _, error = coartic("report", traced.folder, "--out", tmp_path / "r", "--with", file)
    assert (code, words in error) == (2, True), error
    assert not (tmp_path / "r").exists()


def test_an_own_table_that_fails_costs_no_other(traced, tmp_path, coartic, monkeypatch):
    monkeypatch.setattr(sections, "attempt", attempt)
    text = """from coartic.analysis import table
@table("Wrong", "a | a")
def list_wrong(study):
    yield "row", {"b": 1, "run_ids": ""}
"""
    file = own_file(tmp_path, text)
    code, _, error = coartic("report", traced.folder, "--out", tmp_path / "r", "--with", file)
    assert code == 1
    assert "Own tables and figures could not be made: " in error
    assert "table wrong (own.py, line 2): the rows and the columns must have the same" in error
    assert "only one of them has ['a', 'b']" in error
    assert (tmp_path / "r" / "tables" / "ranking.csv").is_file()


def test_an_error_in_a_library_names_the_line_of_the_users_file(
    traced, tmp_path, coartic, monkeypatch
):
    monkeypatch.setattr(sections, "attempt", attempt)
    text = """from coartic.analysis import table
@table("Wrong", "a | a")
def list_wrong(study):
    yield "row", {"a": study.runs["nothing"].sum(), "run_ids": ""}
"""
    file = own_file(tmp_path, text)
    code, _, error = coartic("report", traced.folder, "--out", tmp_path / "r", "--with", file)
    assert (code, "KeyError: 'nothing' (own.py, line 4)" in error) == (1, True), error


def test_a_folder_takes_reports_with_and_without_own_tables(traced, tmp_path, coartic):
    for own in (["--with", own_file(tmp_path)], [], ["--with", own_file(tmp_path)]):
        code, _, error = coartic("report", traced.folder, "--out", tmp_path / "r", *own)
        assert code == 0, error
        assert ("Mean hands" in (tmp_path / "r" / "report.html").read_text("utf-8")) == bool(own)
