"""Names, titles and reasons from elsewhere are text in every language that they are written in."""

import csv
import io
import json
import re
import shlex
import subprocess
import unicodedata
import warnings
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from rich.console import Console

import coartic.analysis.results.folder
import coartic.analysis.study
import coartic.benchmarks.registry
import coartic.benchmarks.reproduce
from coartic import CoarticError, load_task
from coartic.analysis.citations import MethodSource, bibliography
from coartic.analysis.comparisons.versions import compare_versions
from coartic.analysis.figures.plot import svg_text
from coartic.analysis.figures.tasks import tasks_plot
from coartic.analysis.markup import code, escaped, markdown, markdown_text, words
from coartic.analysis.report.comparison import comparison_document
from coartic.analysis.report.document import (
    Bullets,
    Column,
    DataTable,
    Document,
    Prose,
    Row,
    Section,
)
from coartic.analysis.report.formats.latex import latex_text
from coartic.analysis.report.formats.markdown import markdown as to_markdown
from coartic.analysis.report.formats.terminal import terminal_table
from coartic.analysis.report.numbers import Number, numbers_tex
from coartic.analysis.report.pages.versions import versions_document
from coartic.analysis.report.trace import trace, trace_text
from coartic.analysis.report.trace_file import command_of
from coartic.analysis.study import Study
from coartic.analysis.words import MINUS, NONE
from coartic.benchmarks.harness import Progress
from coartic.benchmarks.store import Store
from coartic.benchmarks.suites import Cell
from coartic.cli import terminal
from coartic.record import Commit
from coartic.tables import label_of
from coartic.text import json_text, one_line, plain, printed, shell_line
from tests.support.commands import call
from tests.support.made_up import MadeUp, replanned
from tests.support.reports import Page, report_of
from tests.support.strategies import tiny_task
from tests.support.suites import KNOWN, run_and_write, with_environment

HTML = "<img src=x onerror=alert(1)></script><script>alert(1)</script>&lt;b&gt;<!--"
LINKS = (
    "[click](javascript:alert(1)) ![i](http://evil/x.png) http://evil/a www.evil.org <http://x>"
)
MARKS = (
    "`evil` *evil* **evil** _us_ __init__ ~~del~~ $m$ | a|b [1]: http://x [red]rich[/red] :smile:"
)
TEX = r"\input{/etc/passwd} % } { ^^M \write18{x} & # ~ \end{document} << ,, --"
LINES = "\n# heading\n- item\r\n| a | b |\n|---|---|\n    indented\n===\u2028@misc{x,\x0b"
CODES = "\x1b[31mred\x1b]0;title\x07 \x9b2J \u202egnp.exe\u2066 \x00 \x7f \u200b"
SHELL = "$(touch pwned) `id` '\"; rm -rf ~ #"
EVIL = " ".join((HTML, LINKS, MARKS, TEX, LINES, CODES, SHELL))
STARTS = (
    "# h", "- item", "+ item", "* item", "1. item", "12) item", "> quote", "===", "---", "***",
    "[ ] task", "[x] task", "[a]: http://x", "    code", "```", "~~~", "| a |", "<div>", "=1+1",
    "[a][b]", "![a]", "a]", "[a](b", "a <", "a &", "a!", "a\\", "#", "_a_", "a_", "&#60;", "&amp;",
)  # fmt: skip
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"></svg>'
MARKDOWN = MarkdownIt("gfm-like", {"linkify": False, "html": True})


def flat(text):
    """With single spaces, as a page shows it."""
    return " ".join(text.split())


def shown(tokens):
    """The text of inline tokens, all of which must be text."""
    assert {token.type for token in tokens} <= {"text", "softbreak"}, tokens
    return flat("".join(token.content for token in tokens))


def inlines(source):
    return [token.children for token in MARKDOWN.parse(source) if token.type == "inline"]


def spaceless(text):
    return re.sub(r"\s", "", text)


def page(*sections):
    return to_markdown(Document("t", sections), tables="")


def block_page(*blocks):
    """What stands below the heading of a section."""
    return page(Section("x", "t", blocks)).removeprefix("# t\n\n## t\n\n")


def table_page(headers, *rows):
    columns = tuple(Column(f"c{k}", header) for k, header in enumerate(headers))
    table = DataTable("t", "Caption.", columns, tuple(Row(str(k), r) for k, r in enumerate(rows)))
    return block_page(table).removeprefix("Caption.\n\n")


@pytest.mark.parametrize("text", [EVIL, HTML, LINKS, MARKS, TEX, LINES, CODES, SHELL, *STARTS])
def test_text_in_markdown(text):
    due = flat(one_line(text))
    for source in (
        block_page(Prose((escaped(text),))),
        block_page(Bullets((escaped(text), escaped(text)))),
        block_page(Prose((f"*Ours* {escaped(text)} *ours*",))),
        table_page(("a", text), (text, "b"), ("a", text)),
        "## " + page(Section("x", text)).partition("## ")[2],
    ):
        found = [token for token in inlines(source) if token]
        ours = [t for t in found[0] if t.type.startswith("em_")]
        if ours:
            assert len(ours) == 4
            found[0] = [t for t in found[0] if t.type not in ("em_open", "em_close")]
            found[0] = [t for t in found[0] if t.content != "ours"]
            found = [[t for t in found[0] if t.content != "Ours"]]
        assert all(shown(tokens) in (due, "a", "b") for tokens in found)
        assert sum(shown(tokens) == due for tokens in found) >= 1
        kinds = {token.type for token in MARKDOWN.parse(source)}
        assert not kinds & {"html_block", "fence", "code_block", "blockquote_open", "hr"}
        assert ("heading_open" in kinds) == source.startswith("## ")
        assert len(source.strip().split("\n")) == {"|": 4, "-": 2}.get(source[0], 1)
        # Of what GitHub makes links of by itself, nothing is left.
        assert not re.search(r"(?i)[a-z]://|\bwww\.", source)


@settings(max_examples=150)
@given(st.text("\\`*_[]()<>&~|#!+-=.:;^$1 aw/\"'\n\t\x1bé", max_size=24))
def test_any_text_in_markdown(text):
    due = flat(one_line(text))
    cells = inlines(table_page(("a",), (text,)))
    assert shown(cells[1]).replace(MINUS, "-") in (due, due or NONE)
    if due:
        for source in (
            block_page(Prose((escaped(text),))),
            block_page(Bullets((escaped(text),))),
            "## " + page(Section("x", text)).partition("## ")[2],
        ):
            (tokens,) = inlines(source)
            assert shown(tokens) == due


def test_markup_of_our_own_still_works():
    assert markdown("*a* **b** `c|<d>` [e](#f) [g](https://h/i) 2 < 3, [1, 2].") == (
        "*a* **b** `c|<d>` e [g](https://h/i) 2 < 3, [1, 2]."
    )
    for text in (
        "p < 0.05",
        "−1.5 [−2.0, 3.1] ticks",
        "a/b noise_sd=0.1",
        "50 % & more",
        "ΔV_ucm",
    ):
        assert markdown_text(text) == markdown(text) == text
    assert code("a|b <i>") == "`a|b <i>`"
    assert words(code("a`b")) == "a`b"
    assert words(f"*a* {escaped(MARKS)}") == f"a {MARKS}"


def test_text_on_a_line():
    assert plain(" a \n\n b\x1b ") == "a | b\\x1b"
    assert plain("x" * 9, 5) == "xxxx…"
    assert one_line(" a ") == " a "
    assert one_line("1\u202f000 €\ud800") == "1\u202f000 €\\ud800"
    assert printed("a\nb") == "a\\nb"
    for text in (EVIL, EVIL.encode("utf-8").decode("latin-1"), "\ud83d\U000e0001"):
        shown = one_line(text)
        assert all(c.isprintable() or unicodedata.category(c) == "Zs" for c in shown)
        shown.encode()


def test_json_prints_and_stays_json():
    content = {"a": EVIL, EVIL: ["é ε 漢", "\ud800\U000e0001\x7f\x9b", 1.5, None]}
    for indent in (None, 2):
        text = json_text(content, indent=indent)
        assert all(c.isprintable() or c == "\n" for c in text)
        assert json.loads(text) == content
    assert json_text({"a": "é\u202fε"}) == '{"a":"é\u202fε"}'


@pytest.mark.parametrize(
    "arguments",
    [
        (
            "coartic",
            "a b",
            "",
            "it's",
            '"',
            "$(touch x)",
            "`id`",
            "a;b",
            "*",
            "~",
            "\\",
            "-x",
            "é",
        ),
        (EVIL.replace("\0", ""), "a\nb", "\x1b[31m", "\u202e", "'\\\x7f", "\udcff"),
    ],
)
def test_commands_to_paste(arguments):
    line = shell_line(*arguments)
    assert line == one_line(line)
    done = subprocess.run(
        ["bash", "-c", f"printf '%s\\0' {line}"], capture_output=True, check=True
    )
    assert done.stdout.decode("utf-8", "surrogateescape").split("\0")[:-1] == list(arguments)
    assert shell_line(Path("-x"), Path("a b")) == "./-x 'a b'"


COMMANDS = re.compile(r"\\(?:[a-zA-Z]+\*?|[^a-zA-Z])")
PRINTED = {
    *(r"\textbackslash \textasciicircum \textasciitilde \textasciigrave").split(),
    *r"\{ \} \$ \& \% \# \_ \, \textendash \textbackslash".split(),
}


def test_text_in_latex():
    for text in (EVIL, TEX, LINES, "\n\n", "a\r% b", *STARTS):
        found = latex_text(text)
        assert "\n" not in found
        assert "\r" not in found
        assert set(COMMANDS.findall(found)) <= PRINTED
        assert not re.search(r"(?<!\\)[%#&$~^_]|--|<<|>>|,,", found.replace("{}", "\0"))
        assert balanced(found)
    number = Number("coarticX", EVIL, 1.0, 1, EVIL, low=0.0, high=2.0, n=3, how=EVIL, of=EVIL)
    macros_only(numbers_tex([number], [EVIL]), 5)
    for name in ("coartic1", "coartic_x", "coartic}\\input{x}", "coarticé"):
        with pytest.raises(ValueError, match="letters alone"):
            replace(number, macro=name)


def balanced(text):
    """Braces as TeX counts them."""
    depth = 0
    for mark in re.findall(r"(?<!\\)[{}]", text.replace("\\\\", "")):
        depth += 1 if mark == "{" else -1
        if depth < 0:
            return False
    return depth == 0


def macros_only(text, least):
    """Each line is a comment, or defines a macro of letters as numbers and a few words."""
    assert "\r" not in text
    lines = [line for line in text.split("\n") if line and not line.startswith("% ")]
    content = r"(?:\\coarticnum\{-?[\d.]+\}|\$n\$ = \d+|[\[\](), \d]|no spread)+"
    assert lines.pop(0) == r"\providecommand{\coarticnum}[1]{\ensuremath{#1}}"
    assert len(lines) >= least
    for line in lines:
        assert re.fullmatch(rf"\\newcommand\{{\\[a-zA-Z]+\}}\{{{content}\}}", line), line


def entries(text):
    """A bibliography as BibTeX reads it: between entries all but @ is skipped, braces count."""
    found, at = {}, 0
    while (at := text.find("@", at)) >= 0:
        kind, key = re.compile(r"@(\w+)\{([a-z0-9-]+),").match(text, at).groups()
        depth, end = 0, text.index("{", at)
        while depth or end == text.index("{", at):
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        assert key not in found
        found[key] = kind, text[at:end]
        at = end
    return found


def test_text_in_bibtex():
    own = [
        MethodSource(f"{EVIL}{k}", title, citation, own)
        for k, (title, citation, own) in enumerate(
            [(EVIL, EVIL, False), ("{", "}}", False), (EVIL, "", False), ("a", "b\n@x", True)]
        )
    ]
    ours = MethodSource("posture-based/one-goal", "", "", True)
    commit = {"id": EVIL, "dirty": False}
    text = bibliography([*own, ours], environment={"coartic": EVIL, "commit": commit})
    found = entries(text)
    assert [kind for kind, _ in found.values()].count("misc") == 4  # software, three of others
    assert len(set(found)) == len(found)
    assert {"coartic", "shah2013", "rosenbaum2001"} < set(found)
    lines = text.splitlines()
    assert all(re.match(r"(%|@|  [a-z]+ = \{|\}$|$)", line) for line in lines)
    assert all(line == one_line(line) for line in lines)


def named(results):
    """A folder's results with hostile text wherever there is text from elsewhere."""
    tasks = {name: f"{k}{EVIL}" for k, name in enumerate(results.tasks)}
    methods = {"corrective-alone/given": EVIL, "dual-process/EC3": f"dual-process/{EVIL}"}
    variants = {"noise_sd=0.1": f"noise_sd={EVIL}"}
    old = results.manifest.specification
    cells = [
        cell.model_copy(
            update={
                "task": tasks[cell.task],
                "method": methods.get(cell.method, cell.method),
                "variant": variants.get(cell.variant, cell.variant),
            }
        )
        for cell in old.cells
    ]
    declared = {"title": EVIL, "citation": EVIL, "origin": EVIL}
    manifest = replanned(
        results.manifest,
        suite=EVIL,
        cells=tuple(cells),
        tasks={tasks[name]: {**task, "title": EVIL} for name, task in old.tasks.items()},
        methods={
            methods.get(name, name): item.model_copy(update=declared)
            for name, item in old.methods.items()
        },
    )
    environment = manifest.environment.model_copy(
        update={
            **dict.fromkeys(
                ("platform", "processor", "python", "coartic", "date", "model_code"), EVIL
            ),
            "command": ("coartic", "run", EVIL),
            "commit": Commit.model_construct(id=EVIL, dirty=True),
            "packages": {EVIL: EVIL},
        }
    )
    manifest = manifest.model_copy(update={"environment": environment})
    runs = results.runs.assign(
        task=results.runs.task.map(tasks),
        method=results.runs.method.replace(methods),
        variant=results.runs.variant.replace(variants),
        suite=EVIL,
        commit=EVIL,
        packages=EVIL,
    )
    runs["label"] = list(map(label_of, runs.method, runs.variant))
    failed = runs.status != "ok"
    runs.loc[failed, "reason"] = EVIL
    runs.loc[failed, "status"] = f"crashed{EVIL}"
    # One run is of a commit with changes and of other libraries.
    runs.loc[runs.index[0], "commit"] = "b+"
    runs.loc[runs.index[0], "packages"] = "other"
    runs["failed_trials"] = 5
    runs.loc[runs.method != "dual-process/EC1", "solution_corrections"] = 1
    sequences = results.sequences.assign(task=results.sequences.task.map(tasks))
    hostile = replace(results, manifest=manifest, runs=runs, sequences=sequences)
    # Names of tasks are checked when they are read: here they come past that.
    hostile.__dict__["tasks"] = {
        tasks[name]: task.model_copy(
            update={
                "name": tasks[name],
                "title": EVIL,
                "provenance": {
                    key: origin.model_copy(update={"source": EVIL})
                    for key, origin in task.provenance.items()
                },
            }
        )
        for name, task in results.tasks.items()
    }
    return hostile


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreign") / "results"
    learner, alone = KNOWN["dual-process/EC4"], KNOWN["corrective-alone/given"]
    shelf = tiny_task(provenance={"goals": {"status": "inferred", "source": "x"},
                                  "start": {"status": "chosen", "source": "x"}})  # fmt: skip
    cells = [
        *(
            Cell(load_task(name), KNOWN["dual-process/EC1"])
            for name in ("ascending", "descending")
        ),
        Cell(load_task("ascending"), alone),
        *(Cell(shelf, entry) for entry in (learner, KNOWN["dual-process/EC3"], alone)),
        Cell(shelf, learner, (("noise_sd", 0.1),)),
        Cell(shelf, KNOWN["random-search/pure"]),
    ]
    run_and_write(folder, cells, runs=3, trials=20)
    results = with_environment(folder)
    failed = (results.runs.method == "random-search/pure") & (results.runs.run == 1)
    assert failed.any()
    runs = results.runs.copy()
    runs.loc[failed, ["reward", "replay_reward", "hands"]] = pd.NA
    runs.loc[failed, "status"] = "crashed"
    lost = set(runs.run_id[failed])
    for name, read in (("solutions", results.solutions()), ("learning", results.learning())):
        read[~read.run_id.isin(lost)].to_parquet(folder / f"{name}.parquet")
    return named(replace(results, runs=runs))


@pytest.fixture(scope="module")
def study(hostile):
    """What is computed of it, each once."""
    return Study(hostile)


def words_alone(source):
    """Every inline of a page holds text, our own marks and links within the page at most."""
    allowed = {"text", "softbreak", "hardbreak", "code_inline", "em_open", "em_close"}
    allowed |= {"strong_open", "strong_close"}
    kinds = {token.type for token in MARKDOWN.parse(source)}
    assert not kinds & {"html_block", "fence", "code_block", "blockquote_open", "hr"}
    for tokens in inlines(source):
        for token in tokens:
            if token.type == "link_open":
                assert re.match(
                    r"#[a-z]|tables/[a-z0-9.-]+\.csv$|report\.html#", token.attrs["href"]
                )
            elif token.type == "image":
                assert re.fullmatch(r"figures/[a-z0-9.-]+\.svg", token.attrs["src"])
            else:
                assert token.type in allowed | {"link_close"}, token
                assert token.content != "evil"  # alone, in a style
            if token.type == "code_inline":
                assert token.content == one_line(token.content)
    assert "heading\n" not in source
    assert all(c == "\n" or c.isprintable() or unicodedata.category(c) == "Zs" for c in source)
    assert not re.search(r"(?i)[a-z]://|\bwww\.", re.sub("`[^`\n]*`", "", source))


SIGN = "alert(1)</script>"  # of EVIL: it must be seen as what it is


def test_comparison_page(study, hostile):
    rows = {
        key: replace(row, beaten=1, corrections=2, told="G")
        for key, row in study.method_rows.items()
    }
    page = to_markdown(comparison_document(MadeUp(hostile, method_rows=rows)), tables="")
    assert page.count("is better than the optimum") == len(rows)
    words_alone(page)
    text = "".join(token.content for tokens in inlines(page) for token in tokens)
    assert text.count(SIGN) >= 5  # tasks, methods, variant, reason, suite, platform


def printable(text):
    return all(c == "\n" or c.isprintable() or unicodedata.category(c) == "Zs" for c in text)


def test_analyse(study, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(coartic.analysis.study, "load", lambda folder: study)
    code, out, error = call(monkeypatch, capsys, "analyse", tmp_path)
    assert (code, error) == (0, "")
    assert printable(out)
    for name in ("claims.md", "comparisons.md", "frontier.md", "signatures.md"):
        words_alone((tmp_path / name).read_text(encoding="utf-8"))
    for path in tmp_path.glob("*.csv"):
        rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"), newline="")))
        assert len({len(row) for row in rows}) == 1
    labels = pd.read_csv(tmp_path / "anytime.csv").method  # data, as it was found
    assert EVIL.split("\n")[0] in " ".join(labels)


def compared(first, second):
    return to_markdown(versions_document(compare_versions(Study(first), Study(second))), tables="")


def test_compare(hostile, monkeypatch, capsys, tmp_path):
    changed = hostile.runs.assign(reward=hostile.runs.reward - 1)
    environment = hostile.manifest.environment.model_copy(update={"platform": f"{EVIL}!"})
    other = replace(
        hostile,
        folder=Path(f"/nowhere/{EVIL}"),
        runs=changed,
        manifest=hostile.manifest.model_copy(update={"environment": environment}),
    )
    other.__dict__["tasks"] = hostile.tasks
    words_alone(compared(hostile, other))
    other.__dict__["cells"] = dict(list(hostile.cells.items())[:1])
    assert EVIL[:60] in MARKDOWN.render(compared(hostile, other)).replace(
        "&lt;", "<").replace("&gt;", ">")  # fmt: skip
    folders = {"a": hostile}
    monkeypatch.setattr(
        "coartic.analysis.comparisons.versions.load",
        lambda folder: Study(folders.get(folder.name, other)),
    )
    out = tmp_path / "page.md"
    code, text, error = call(monkeypatch, capsys, "compare", "a", "b", "--out", out)
    assert (code, error) == (0, "")
    assert printable(text)
    words_alone(out.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def report(study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreign") / "report"
    return report_of(study, folder)


def test_report_page(report):
    text = (report / "report.html").read_text(encoding="utf-8")
    assert printable(text)
    page = Page(text)
    assert not page.all("img")
    for tag, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")], tag
        address = attributes.get("href") or attributes.get("src") or "#"
        assert address.startswith("#") or address == "data:,"
    assert {script.get("type") for script in page.all("script")} == {"application/json", None}
    (data,) = re.findall(r'<script type="application/json" id="player-data">(.*?)</script>', text)
    assert any(EVIL in task["name"] for task in json.loads(data)["tasks"])
    seen = "".join(words for _, words in page.texts)
    assert seen.count(SIGN) > 20
    assert "evil" not in {words for _, words in page.texts}  # alone, in a style


def test_report_in_markdown(report):
    words_alone((report / "report.md").read_text(encoding="utf-8"))


def test_report_in_latex(report):
    ours = {
        *(r"\begin \end \centering \footnotesize \scriptsize \setlength \tabcolsep \caption "
          r"\label "
          r"\resizebox \ifdim \width \linewidth \else \fi \toprule \midrule \bottomrule \num "
          r"\raggedright \arraybackslash \shortstack \\ \par \smallskip \parbox \emph \texttt "
          r"\textbf \begingroup \endgroup \LTcapwidth \endfirsthead \endhead \endfoot \noindent "
          r"\pm \times \cdot \infty \textdagger \delta \Delta \sigma \textbullet \ldots \leq "
          r"\geq \approx \eta \varepsilon \epsilon \infty").split(),
        *PRINTED,
    }  # fmt: skip
    for path in (report / "tables").glob("*.tex"):
        text = path.read_text(encoding="utf-8")
        found = set(COMMANDS.findall(text))
        assert found <= ours, (path.name, found - ours)
        assert set(re.findall(r"\\begin\{(\w+)\}", text)) <= {
            *("table", "tabular", "tabularx", "longtable"),
        }
        assert balanced(text)
        assert "{evil}" not in text
        assert all(
            line.endswith("{%") for line in text.split("\n") if re.search(r"(?<!\\)%", line)
        )
        assert printable(text)
    macros_only((report / "numbers.tex").read_text(encoding="utf-8"), 20)
    inputs = (report / "tables.tex").read_text(encoding="utf-8")
    assert set(re.findall(r"\\input\{(.*?)\}", inputs)) == {
        f"tables/{path.name}" for path in (report / "tables").glob("*.tex")
    }
    assert all(re.fullmatch(r"[a-z0-9.-]+", path.stem) for path in report.rglob("*.*"))


def test_report_in_csv(report):
    """Data as it is: text is quoted, and not altered for programs that take = for a formula."""
    for path in (report / "tables").glob("*.csv"):
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
        assert len({len(row) for row in rows}) == 1
    with (report / "tables" / "runs.csv").open(encoding="utf-8", newline="") as file:
        labels = {row["label"] for row in csv.DictReader(file)}
    assert EVIL.strip() in labels


def test_trace(report, hostile):
    content = json.loads((report / "trace.json").read_text(encoding="utf-8"))
    name = next(n["macro"] for n in content["numbers"] if n.get("cells"))
    with pytest.raises(CoarticError, match="environment.coartic: should be one line") as caught:
        trace(report, name)  # what a manifest would not be let in with
    assert printable(str(caught.value))
    facts = ("coartic", "model_code", "python", "platform", "processor", "date")
    content["environment"] |= {
        **dict.fromkeys(facts, HTML),
        "command": ["coartic", "run", SHELL],
        "commit": None,
        "packages": {HTML: HTML},
    }
    (report / "trace.json").write_text(json.dumps(content), encoding="utf-8")
    text = trace_text(trace(report, name))
    assert printable(text)
    assert text.count("\n# heading") == 0
    asked = next(line for line in text.split("\n") if line.startswith("asked for by: "))
    line = asked.removeprefix("asked for by: ")
    done = subprocess.run(
        ["bash", "-c", f"printf '%s\\n---\\n' {line.replace('000', '001')}"],
        capture_output=True, check=True,
    )  # fmt: skip
    assert done.stdout.decode().split("\n---\n")[:2] == ["coartic", "run"]
    # The command of one cell, where the task is ours and the names are anybody's.
    plan = hostile.manifest.specification.model_copy(update={"suite": "-x; $(id)"})
    arguments = shlex.split(command_of(plan, "ascending", SHELL))
    assert arguments[:6] == ["coartic", "run", "--tasks", "ascending", "--methods", SHELL]
    assert arguments[-4:] == ["--out", "NEW", "--", "-x; $(id)"]


def test_figures(hostile):
    """Their words are drawn as they are, and none ends an element or an attribute."""
    task = next(iter(hostile.tasks.values()))
    text = svg_text(tasks_plot([task.model_copy(update={"title": f"{HTML} {CODES}\ud800"})]))
    assert printable(text)
    page = Page(text)
    assert {tag for tag, _ in page.elements} <= set(
        "svg g path use text defs clippath rect".split()
    )
    assert not [n for _, a in page.elements for n in a if n.startswith("on")]


def test_terminal(hostile, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(coartic.analysis.results.folder, "load_results", lambda folder: hostile)
    code, out, error = call(monkeypatch, capsys, "cite", tmp_path)
    assert (code, error) == (0, "")
    assert printable(out)
    assert len(entries(out)) == 2 + len(hostile.manifest.specification.methods)

    def fail(*_):
        warnings.warn(EVIL, stacklevel=1)
        raise CoarticError(f"first {EVIL}")

    monkeypatch.setattr(coartic.benchmarks.registry, "registry", fail)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        code, out, error = call(monkeypatch, capsys, "list")
    assert code == 2
    assert printable(out + error)
    assert all(re.match("error: |warning: ", line) for line in error.strip().split("\n"))
    monkeypatch.undo()
    code, out, error = call(monkeypatch, capsys, "report", tmp_path / "\x1b[31mnothing")
    assert code == 2
    assert printable(out + error)


def test_no_name_makes_a_line_of_its_own(capsys):
    terminal.say("run a\nb: identical.", "", "c")
    assert capsys.readouterr().out == "run a | b: identical.\n\nc\n"


@pytest.mark.parametrize("columns", ["9000", "40"])
def test_tables_of_a_terminal(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    rows = [(EVIL, "[red]a[/red] :smile:"), ("[b]", "\x1b]0;x\x07")]
    terminal.show_table(f"[blink]{EVIL}", ("[i]", EVIL), rows)
    out = capsys.readouterr().out
    assert printable(out)
    for text in ("[blink]", "[red]a[/red] :smile:", "[b]", r"\x1b]0;x\x07"):
        assert text in out.replace("\n    ", "")


def test_rendered_tables_of_a_terminal(capsys):
    columns = (Column("a", "[i]"), Column("b", EVIL), Column("c", "c", "number", unit=EVIL))
    rows = (Row("1", (EVIL, "[red]a[/red] :smile:", 1)), Row("2", ("[b]", "\x1b]0;x\x07", None)))
    table = DataTable("t", escaped(f"[blink]{EVIL}"), columns, rows)
    console = terminal.console()
    console.width = 9_000
    console.print(terminal_table(table, console.width))
    out = capsys.readouterr().out
    assert printable(out)
    for text in ("[blink]", "[i]", "[red]a[/red] :smile:", "[b]"):
        assert text in out
    assert r"\x1b]0;x\x07" in out


def test_progress(monkeypatch):
    """Names are no markup of rich, and move no cursor."""
    for live in (False, True):
        display = terminal.Display(f"[red]{EVIL}")
        stream = io.StringIO()
        display._console = Console(
            file=stream, force_terminal=live, width=4000, color_system=None, **terminal._AS_IT_IS
        )
        display._bar.live.console = display._console
        display._bar.live.auto_refresh = False
        progress = Progress(total=3, present=1)
        progress.damaged.append(CoarticError(EVIL))
        progress.damaged[0].reason = EVIL
        with display:
            display.update(progress, None)
            if live:
                task = display._bar.tasks[0]
                assert task.description == "starting workers (the first time compiles)"

                class Spec:
                    task, method = tiny_task(), f"[red]{EVIL}[/red]"

                display.update(progress, Spec())
                display._bar.refresh()
        text = re.sub(r"\x1b\[(\?25[lh]|\d*[AK]|2K)|\r", "", stream.getvalue())
        assert printable(text)
        assert not live or "[red]<img" in text


def test_show(hostile, monkeypatch, capsys, tmp_path):
    found = Store(hostile.folder).read(hostile.runs.run_id.iloc[0])
    words = {"run_id": "0a-1b", "origin": f"{EVIL.strip()}.py", "reason": EVIL}
    record = found.model_copy(update=words)

    class Folder:
        folder = tmp_path / "-\x1b it's $(id)"

        def path(self, run_id):
            return self.folder / run_id

    monkeypatch.setattr(coartic.benchmarks.reproduce, "find_record", lambda *_: (Folder(), record))
    code, out, error = call(monkeypatch, capsys, "show", "0a")
    assert (code, error) == (0, "")
    assert printable(out)
    head, _, command = out.partition("\n\nReproduce it with: ")
    assert json.loads(head)["reason"] == EVIL
    assert command.count("\n") == 1
    done = subprocess.run(
        ["bash", "-c", f"printf '%s\\0' {command}".replace("\\000", "")],
        capture_output=True, check=True,
    )  # fmt: skip
    arguments = done.stdout.decode().split("\0")
    assert arguments[:3] == ["coartic", "reproduce", "0a-1b"]
    assert arguments[4] == str(Folder.folder)
