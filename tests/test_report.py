"""The report: what its renderers make of a document, checked by other readers."""

import ast
import csv
import io
import itertools
import json
import math
import re
import shutil
import subprocess
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from pydantic import ValidationError
from rich.console import Console

from coartic.analysis.markup import Span, inline
from coartic.analysis.report.document import (
    Bullets,
    Column,
    DataTable,
    Document,
    Estimate,
    FigureBlock,
    PlayerBlock,
    Prose,
    Row,
    Section,
    Strip,
    Verdict,
)
from coartic.analysis.report.formats.csv import runs_csv, table_csv
from coartic.analysis.report.formats.html import MOST_ROWS, WIDTHS, html
from coartic.analysis.report.formats.latex import MOST_ROWS as MOST_LATEX
from coartic.analysis.report.formats.latex import PACKAGES, is_long, latex_table, latex_text
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.formats.terminal import terminal_table
from coartic.analysis.report.summary import without_variants
from coartic.analysis.report.tables.layout import LAYOUTS, TableLayout, with_legends
from coartic.analysis.report.text import number_text, parts, texts
from coartic.analysis.report.write import write_report
from coartic.analysis.words import typographic
from coartic.files import LISTING
from tests.support.reports import Page, needs_latex

LEARNER, OPTIMUM = ("shelf", "dual-process/EC4 noise_sd=0.1"), ("shelf", "optimum/multistart")
NASTY = 'a_b & <i>50 %</i> #1 {x} ~ ^ $ \\ "q" -- − – — ± † ΔV ε ≤ [z] *s* `c` | 10⁻³ é 漢'
SVG = (
    '<?xml version="1.0"?>\n<svg xmlns="http://www.w3.org/2000/svg" width="9pt" '
    'viewBox="0 0 90 45"><metadata>http://example.org</metadata><defs><path id="p" d="M0 0L9 9"/>'
    '</defs><use href="#p" fill="url(#p)"/></svg>'
)
TABLE = DataTable(
    "methods-shelf",
    "Methods on *shelf*: 100 % of `all_methods`",
    (
        Column("method", "method"),
        Column("reward", "reward", "number", "ticks", digits=1),
        Column("gap", "ΔV", "share", digits=1),
        Column("count", "runs & more", "number"),
        Column("p", "p", "p", digits=3),
        Column("remark", "remark"),
    ),
    (
        Row(
            "learner",
            ("dual-process/EC4", Estimate(-483.25, 5.0, -490.06, -477.0), 0.0385, 20, 1e-6, NASTY),
            (LEARNER,),
            {"gap": (LEARNER, OPTIMUM)},
        ),
        Row("optimum", ("[optimum]", Estimate(-465.0), 0.0, 1234567, None, None), (OPTIMUM,)),
        Row("none", ("*none*", None, math.nan, 2.5e-7, 0.25, ""), ()),
    ),
    ("A note with 5 % & *stress*.",),
)


def document():
    figures = [FigureBlock(f"line-{k}", "A line", "It rises.", NASTY, SVG) for k in (1, 2)]
    player = PlayerBlock("player", "Movements", "Played.", '{"label":"</script><b>"}')
    return Document(
        NASTY,
        (
            Section("summary", "Summary", (Prose((NASTY,)), Bullets(("*one*", "`two`")))),
            Section(
                "all", "All & more", (*figures, player), (Section("below", "Below", (TABLE,)),)
            ),
        ),
        lead="A lead.",
        runs={LEARNER: ("aa-1", "aa-2"), OPTIMUM: ("bb-1",)},
    )


def test_documents_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="a: ids are used once"):
        Document("t", (Section("a", "A"), Section("b", "B", sections=(Section("a", "C"),))))
    with pytest.raises(ValueError, match="no run ids"):
        Document("t", (Section("a", "A", (TABLE,)),), runs={LEARNER: ("aa-1",)})
    with pytest.raises(ValueError, match="5 values for 6 columns"):
        replace(TABLE, rows=(replace(TABLE.rows[0], values=TABLE.rows[0].values[:5]),))
    with pytest.raises(ValueError, match="same key"):
        replace(TABLE, rows=(TABLE.rows[0], TABLE.rows[0]))
    with pytest.raises(ValueError, match="kind text, its value is 3"):
        DataTable("t", "", (Column("a", "a"),), (Row("r", (3,)),))
    with pytest.raises(ValueError, match="int64; numbers are Python's"):
        DataTable("t", "", (Column("a", "a", "number"),), (Row("r", (np.int64(3),)),))
    for name in ("With Space", "runs", "", "a/b", "../up"):
        with pytest.raises(ValueError, match="id "):
            Document("t", (Section(name, "A"),))
    with pytest.raises(ValueError, match="both ends"):
        Estimate(1.0, low=0.0)


@pytest.mark.parametrize(
    ("text", "spans"),
    [
        ("plain", [Span("text", "plain")]),
        ("a *b c* d", [Span("text", "a "), Span("emphasis", "b c"), Span("text", " d")]),
        ("`x*y*z`", [Span("code", "x*y*z")]),
        ("**a b**c *d*", [Span("strong", "a b"), Span("text", "c "), Span("emphasis", "d")]),
        (r"**a\*\[b** *\`*", [Span("strong", "a*[b"), Span("text", " "), Span("emphasis", "`")]),
        ("[w](javascript:x) [w](../x)", [Span("text", "[w](javascript:x) [w](../x)")]),
        ("[w](#a)[1]", [Span("link", "w", "#a"), Span("text", "[1]")]),
        (r"\*a\* \[b](c)", [Span("text", "*a* [b](c)")]),
        ("2 * 3 * 4", [Span("text", "2 * 3 * 4")]),
        ("", []),
    ],
)
def test_inline_markup(text, spans):
    assert inline(text) == spans


@pytest.mark.parametrize(
    ("value", "kind", "digits", "ascii_text", "shown"),
    [
        (-483.25, "number", 1, "-483.2", "−483.2"),
        (-0.04, "number", 1, "0.0", "0.0"),
        (1234567, "number", None, "1234567", "1\u202f234\u202f567"),
        (9999.6, "number", None, "10000", "10\u202f000"),
        (0.99951, "number", None, "1.00", "1.00"),
        (0.0123, "number", None, "0.0123", "0.0123"),
        (-2.5e-7, "number", None, "-2.5e-7", "−2.5 × 10⁻⁷"),
        (0.0, "number", None, "0", "0"),
        (0.0385, "share", 1, "3.9", "3.9"),
        (0.0004, "p", 3, "<0.001", "<0.001"),
        (0.0006, "p", 3, "0.001", "0.001"),
        (0.0, "p", 3, "<0.001", "<0.001"),
        (-math.inf, "number", 1, "-inf", "−∞"),
    ],
)
def test_numbers(value, kind, digits, ascii_text, shown):
    found = number_text(value, Column("a", "a", kind, digits=digits))
    assert found == ascii_text
    assert typographic(found) == shown


def test_numbers_of_others_keep_their_digits():
    column = Column("a", "a", "number", digits=1)
    printed, derived = Estimate(-314, 1.88, digits=(0, 2)), Estimate(-560.05, 47.06)
    table = DataTable("t", "t", (column,), (Row("1", (printed,)), Row("2", (derived,))))
    assert [texts(table, row) for row in table.rows] == [["−314 ± 1.88"], ["−560.0 ± 47.1"]]
    censored = Estimate(math.inf, low=4430, high=math.inf, beyond=10_000)
    late = replace(table, columns=(replace(column, digits=0),), rows=(Row("1", (censored,)),))
    assert texts(late, late.rows[0]) == [">10\u202f000 [4430, >10\u202f000]"]
    assert r"{$>$\num{10000}} & {[\num{4430}, $>$\num{10000}]}" in latex_table(late)


def test_html_is_one_accessible_page():
    page = Page(html(document()))
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    for tag, attributes in page.elements:
        address = attributes.get("href") or attributes.get("src") or "#content"
        assert address.startswith("#") or address == "data:,", f"{tag} asks for {address}"
        if address.startswith("#"):
            assert address[1:] in ids
        for name in ("aria-labelledby", "for"):
            assert attributes.get(name, "content") in ids
    assert page.all("html") == [{"lang": "en"}]
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    assert all("scope" in attributes for attributes in page.all("th"))
    assert [svg["aria-label"] for svg in page.all("svg")] == [NASTY, NASTY]
    assert all(svg["role"] == "img" for svg in page.all("svg"))
    assert {"header", "nav", "main", "caption"} <= {tag for tag, _ in page.elements}
    words = "".join(text for _, text in page.texts)
    assert "http" not in re.sub(r"http://www\.w3\.org/2000/svg", "", words)
    assert words.count("<i>50 %</i>") >= 3  # title, prose and table: as text
    assert not page.all("i")


def test_html_numbers_lead_to_their_runs():
    text = html(document())
    page = Page(text)
    links = [a["href"] for a in page.all("a") if a["href"].startswith("#runs-")]
    # The gap's own cells first, then the rows' lists.
    assert links == ["#runs-1", "#runs-1", "#runs-2"]
    for number, runs in ((1, ("aa-1", "aa-2")), (2, ("bb-1",))):
        listed = re.search(rf'<details id="runs-{number}">.*?</details>', text, re.S)
        assert re.search("<code>(.*?)</code>", listed[0])[1].split() == list(runs)


def test_a_cell_holds_a_value_with_its_small_print():
    text = html(document())
    rows = re.findall(r"<tr>.*?</tr>", text)
    assert rows[0].count("<th") == len(TABLE.columns) + 1  # one a column, and the runs
    assert "reward (ticks)<small>± SD [95 % interval]</small>" in rows[0]
    assert "<td>−483.2<span> ± 5.0</span><small>[−490.1, −477.0]</small></td>" in rows[1]
    assert "<td>−465.0<span></span></td>" in rows[2]


def test_longer_tables_have_a_field_to_search_and_all_their_rows():
    rows = tuple(replace(TABLE.rows[0], key=f"row {k}") for k in range(MOST_ROWS + 1))
    for shown, long in ((rows[:-1], 0), (rows, 1)):
        table = replace(TABLE, rows=shown)
        page = Document("t", (Section("a", "A", (table,)),), runs=document().runs)
        text = html(page)
        assert text.count(" data-rows=") == long
        assert text.count('<th scope="row"') == len(shown)  # all of them are there
        assert "overflow" not in re.search(r"<table.*?</table>", text, re.S)[0]


def test_rows_of_one_kind_stay_together():
    kinds = ("b", "a", "b")
    rows = tuple(
        replace(TABLE.rows[0], key=f"row {k}", group=kind) for k, kind in enumerate(kinds)
    )
    page = Document("t", (Section("a", "A", (replace(TABLE, rows=rows),)),), runs=document().runs)
    bodies = re.findall(r"<tbody>.*?</tbody>", html(page), re.S)
    assert [re.search(r'scope="rowgroup"[^>]*>(.)<', body)[1] for body in bodies] == ["b", "a"]
    assert [body.count('scope="row"') for body in bodies] == [2, 1]


def test_narrow_pages_show_rows_as_cards_with_every_head():
    text = html(document())
    for place, column in enumerate(TABLE.columns[1:], 2):
        head = re.search(rf'#methods-shelf td:nth-child\({place}\){{--head:"(.*?)"}}', text)[1]
        said = re.sub(r"\\([0-9a-f]{6})", lambda m: chr(int(m[1], 16)), head)
        assert said.startswith(column.header)
    widths = [int(width) for width in re.findall(r'<table[^>]* class="w(\d+)"', text)]
    assert widths
    assert set(widths) <= set(WIDTHS)
    for width in WIDTHS[:-1]:
        assert f"(max-width: {width}rem)" in text


def test_findings_strips_and_charts():
    verdicts = (
        Verdict("One <b>", "supported", "good", "#s"),
        Verdict("Two", "cannot tell", "open", "#s"),
    )
    strips = [
        Strip("named", "Named", verdicts),
        Strip("squares", "Squares", verdicts, counted=True),
    ]
    chart = json.dumps({"mark": "</script>", "config": {}})
    figure = FigureBlock("line", "A line", "It rises.", "x", SVG, chart=chart)
    section = Section("s", "S", (*strips, figure), finding="**Found** it.")
    shown = Document("t", (section,))
    text = html(shown)
    page = Page(text)
    assert "<strong>Found</strong> it." in text
    assert "One &lt;b&gt;<small>supported</small>" in text
    assert "1 supported" in text
    assert "1 cannot tell" in text
    assert [a["aria-label"] for a in page.all("a") if "aria-label" in a] == [
        "One <b> Supported.",
        "Two Cannot tell.",
    ]
    data = re.search(r'<script type="application/json">(.*?)</script>', text)[1]
    assert json.loads(data) == json.loads(chart)
    # Readable without scripts: the drawing is there and shown, the chart's place is not.
    assert 'class="still' in text
    place = next(div for div in page.all("div") if div.get("class") == "chart")
    assert "hidden" in place
    assert "vegaEmbed" in text
    assert "vegaLite" not in html(document())  # which has no chart to draw
    told = markdown(shown)
    assert "**Found** it." in told
    assert "One \\<b>: supported; Two: cannot tell" in told
    assert "1 supported, 1 cannot tell" in told


def test_folds_hold_their_content_and_links_lead_there():
    table = replace(TABLE, folded=True, rows=(replace(TABLE.rows[0], link="#below"),))
    inner = Section("below", "Below", (Prose(("Hidden words.",)),), folded=True)
    text = html(Document("t", (Section("a", "A", (table,), (inner,)),), runs=document().runs))
    page = Page(text)
    main = text[text.index("<main") :]
    folds = re.findall(r'<details(?: class="table")?><summary>.*?</details>', main, re.S)
    assert len(folds) == 3  # the lists of runs as well
    assert 'aria-labelledby="methods-shelf-caption">' in folds[0]
    assert re.search(r'<th scope="row"[^>]*><a href="#below">', folds[0])
    assert folds[1].startswith('<details><summary><h3 id="below">Below</h3></summary>')
    assert "Hidden words." in folds[1]
    assert not page.all("caption")  # the summary names it
    assert all("open" not in fold for fold in page.all("details")[1:])


def test_wide_figures_stay_readable():
    wide = SVG.replace("0 0 90 45", "0 0 500 45")
    for svg, least in ((SVG, None), (wide, "700px")):
        text = html(Document("t", (Section("a", "A", (FigureBlock("f", "F", "", "x", svg),)),)))
        found = re.search(r"<svg[^>]*min-width: (\w+)", text)
        assert (found and found[1]) == least
        assert ('tabindex="0"' in text) == (least is not None)


def test_a_figure_is_drawn_for_a_narrow_page_as_well():
    """Two drawings, of which one is shown; their ids are apart and none is scrolled."""
    wide, narrow = (SVG.replace("0 0 90 45", f"0 0 {width} 45") for width in (500, 240))
    narrow = narrow.replace('id="', 'id="f-narrow-').replace("#", "#f-narrow-")
    figure = FigureBlock("f", "F", "", "x", wide, narrow=narrow)
    text = html(Document("t", (Section("a", "A", (figure,)),)))
    page = Page(text)
    kinds = [of["class"] for of in page.all("div") if "still" in of.get("class", "")]
    assert [kind.split()[-1] for kind in kinds] == ["on-desk", "on-phone"]
    ids = [of["id"] for _, of in page.elements if "id" in of]
    assert len(ids) == len(set(ids))
    assert 'tabindex="0"' not in text
    assert "min-width" not in text.partition("</style>")[2]


def test_marks_are_explained_once():
    columns = (Column("method", "method †"), Column("told", "told"), Column("d", "Cliff's δ"))
    table = DataTable("t", "T", columns, (Row("r", ("a", "GF", None)),), ("Own note.",))
    notes = with_legends(table).notes
    assert notes[0] == "Own note."
    assert "*F* forward kinematics" in notes[1]
    assert [note[0] for note in notes[2:]] == ["†", "C"]
    assert with_legends(replace(table, notes=notes[2:])).notes[:2] == notes[2:]
    plain = replace(TABLE, rows=())
    assert with_legends(plain) == plain


def test_variants_are_set_apart():
    names = ("dual-process/EC1", "dual-process/EC1-biased", "cma-es/every", "jerk timing=fixed")
    rows = tuple(Row(name, (name,)) for name in names)
    table = DataTable("all", "All.", (Column("method", "method"),), rows)
    kept, folded = without_variants(table)
    assert [row.key for row in kept.rows] == [names[0], names[2]]
    assert folded is not None
    assert [row.key for row in folded.rows] == [names[1], names[3]]
    assert (kept.folded, folded.folded, folded.id) == (False, True, "all-variants")
    assert without_variants(kept) == (kept, None)


def node(script):
    if not shutil.which("node"):
        pytest.skip("node is not installed")
    code = (files("coartic.analysis.report") / "sort.js").read_text(encoding="utf-8")
    done = subprocess.run(
        ["node", "-e", code + script], capture_output=True, check=True, timeout=60
    )
    return json.loads(done.stdout)


def test_sorting_reads_the_numbers_that_the_page_writes():
    values = [-483.25, 1234567, 2.5e-7, -math.inf, 0.0385, 12, 3.0e-12, -0.5]
    column = Column("a", "a", "number")
    texts = [typographic(number_text(value, column)) for value in values]
    read = node(f"console.log(JSON.stringify({json.dumps(texts)}.map(value).map(String)))")
    assert [float(x.replace("Infinity", "inf")) for x in read] == pytest.approx(values, rel=0.01)


@pytest.mark.parametrize(
    ("keys", "words", "up", "down"),
    [
        (
            ["2", "–", "−10", "<0.001", ">1\u202f000\u202f000"],
            False,
            [2, 3, 0, 4, 1],
            [4, 0, 3, 2, 1],
        ),
        (["b", "a", "", "EC10", "EC2"], True, [1, 0, 4, 3, 2], [3, 4, 0, 1, 2]),
        (["1", "1", "0"], False, [2, 0, 1], [0, 1, 2]),  # equals stay in their order
    ],
)
def test_sorting(keys, words, up, down):
    call = "order({}, {}, {})"
    both = [call.format(json.dumps(keys), *map(json.dumps, (words, way))) for way in (False, True)]
    assert node(f"console.log(JSON.stringify([{', '.join(both)}]))") == [up, down]


def test_svgs_of_one_page_keep_their_own_ids():
    text = html(document())
    for name in ("line-1", "line-2"):
        assert f'<path id="{name}--p"' in text
        assert f'href="#{name}--p" fill="url(#{name}--p)"' in text
    with pytest.raises(ValueError, match="no <svg> element"):
        html(Document("t", (Section("a", "A", (FigureBlock("f", "", "", "", "<png>"),)),)))


def test_no_data_ends_the_player_early():
    text = html(document())
    data = re.search(r'id="player-data">(.*?)</script>', text)[1]
    assert data == '{"label":"\\u003c/script>\\u003cb>"}'


def test_markdown():
    text = markdown(document())
    rows = [line for line in text.splitlines() if line.startswith("|")]
    bars = [len(re.findall(r"(?<!\\)\|", row)) for row in rows]
    assert bars == [len(parts(TABLE)) + 1] * 5
    assert rows[1].count("---:") == 6  # reward, SD, interval, share, runs, p
    assert "−483.2 | 5.0 | [−490.1, −477.0] | 3.9" in rows[2]
    assert "](figures/line-1.svg)" in text
    assert [line for line in text.splitlines() if line.startswith("#")][1:] == [
        "## Summary",
        "## All & more",
        "### Below",
    ]


def printed(table, width):
    console = Console(width=width, file=io.StringIO(), emoji=False)
    console.print(terminal_table(table, width, "see a page"))
    return console.file.getvalue()


def test_a_terminal_has_the_columns_that_fit():
    wide = printed(TABLE, 240)
    assert "dual-process/EC4" in wide
    assert "−483.2 ± 5.0 [−490.1, −477.0]" in wide
    assert "1\u202f234\u202f567" in wide
    assert "[optimum]" in wide
    assert "*none*" in wide
    assert NASTY[:20] in wide
    assert "No room" not in wide
    for width in (100, 60):
        lines = printed(TABLE, width).splitlines()
        assert max(map(len, lines)) <= width
        assert any("dual-process/EC4" in line for line in lines)  # never broken
    said = " ".join(" ".join(lines).split())
    assert "No room here for ΔV; runs & more; p; remark (see a page)." in said
    leading = tuple(replace(c, leading=c.name == "p") for c in TABLE.columns)
    assert "<0.001" in printed(replace(TABLE, columns=leading), 80)


def test_csv_reads_back_as_the_raw_values():
    rows = list(csv.DictReader(io.StringIO(table_csv(TABLE))))
    assert (
        list(rows[0])
        == (
            "key method reward reward_sd reward_low reward_high gap count p remark cells gap_cells"
        ).split()
    )
    assert [float(rows[0][name]) for name in ("reward", "reward_sd", "reward_low", "gap")] == [
        -483.25, 5.0, -490.06, 0.0385,
    ]  # fmt: skip
    assert rows[0]["remark"] == NASTY
    assert rows[0]["cells"] == " ".join(LEARNER)
    assert rows[0]["gap_cells"] == f"{' '.join(LEARNER)} | {' '.join(OPTIMUM)}"
    assert rows[1]["count"] == "1234567"
    assert rows[1]["reward_sd"] == rows[2]["reward"] == rows[2]["gap"] == ""
    assert list(csv.reader(io.StringIO(runs_csv(document())))) == [
        ["task", "label", "run_id"],
        [*LEARNER, "aa-1"],
        [*LEARNER, "aa-2"],
        [*OPTIMUM, "bb-1"],
    ]


def test_latex_escapes():
    assert latex_text("a_b & 5 % #1 {x} $") == r"a\_b \& 5~\% \#1 \{x\} \$"
    assert latex_text("−1 ± 2 ΔV †") == r"$-$1 $\pm$ 2 $\Delta$V \textdagger{}"
    assert latex_text("--- [*") == "-{}-{}- {[}{*}"
    assert latex_text("λΛ漢") == r"$\lambda$$\Lambda$[U+6F22]"


def test_every_character_of_ours_has_an_escape():
    home = files("coartic.analysis")
    texts = [path.read_text(encoding="utf-8") for path in home.rglob("*.toml")]
    for path in home.rglob("*.py"):
        if path.name != "latex.py":
            tree = ast.parse(path.read_text(encoding="utf-8"))
            constants = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant))
            texts += [text for text in constants if isinstance(text, str)]
    characters = set("".join(texts)) - set("\n")
    assert len(characters) > 100
    assert {c for c in characters if latex_text(c).startswith("[U+")} == set()


def test_latex_columns_are_as_wide_as_their_numbers():
    text = latex_table(next(t for t in document().tables() if t.id == "methods-shelf"))
    assert (
        r"\begin{tabularx}{\linewidth}{@{}lS[table-format=-3.1]S[table-format=1.1]r"
        r"S[table-format=1.1]S[table-format=7.0]S[table-format=1.3]"
        r">{\raggedright\arraybackslash}X@{}}"
    ) in text
    assert r"-483.2 & 5.0 & {[\num{-490.1}, \num{-477.0}]} & 3.9 & 20" in text


LONG = DataTable(
    "long",
    "A table of several pages.",
    (
        Column("method", "method"),
        Column("difference", "difference to what was there before", "number", "ticks", digits=1),
        Column("told", "told"),
        Column("p", "p of the two-tailed test", "p", digits=4),
        Column("hidden", "not for print", printed=False),
    ),
    tuple(
        Row(
            f"{k}",
            (
                f"trajectory-optimisation/squared-changes other_arm=still, hands={'LR' * 4}{k}",
                Estimate(-100.0 - k, 3.25, -120.5, -99.0),
                "one word after another, " * 3,
                0.01,
                "unseen",
            ),
        )
        for k in range(90)
    ),
    ("A note.",),
)


WIDE = DataTable(
    "wide",
    "A table of several pages and many numbers, wider than the text of a book.",
    (
        Column("method", "method"),
        *(Column(f"n{k}", f"after {k}", "number", digits=1) for k in range(3)),
    ),
    tuple(
        Row(f"{k}", ("one-armed/v1/i000", *(Estimate(-1000.5, None, -1020.5, -99.5),) * 3))
        for k in range(60)
    ),
)


def test_tables_longer_than_a_page_are_continued():
    text = latex_table(LONG)
    assert r"\begin{longtable}{@{}>{\raggedright" in text
    assert r"\begin{table}" not in text
    assert text.count("{method}") == 2  # the second is for the pages that follow
    assert text.count("squared changes (other arm still") == 90  # as figures name them
    assert "trajectory-optimisation" not in text
    assert "unseen" not in text
    assert is_long(replace(LONG, rows=LONG.rows[:MOST_LATEX]))  # of two lines each
    short = replace(LONG, rows=LONG.rows[:8])
    assert r"\begin{table}" in latex_table(short)
    assert r"\begin{tabularx}" in latex_table(short)
    few = latex_table(replace(short, columns=LONG.columns[1:2], rows=(Row("a", (1.0,)),)))
    assert r"\begin{tabular}{@{}S[table-format=1.1]@{}}" in few
    assert r"\resizebox{\ifdim\width>\linewidth" in few
    head = next(line for line in text.splitlines() if line.startswith("{method}"))
    assert head.replace(r" \\ ", " ").startswith(
        r"{method} & {\shortstack[c]{difference to what was there before (ticks)}} & {SD} & "
    )


def files_of(figures):
    return {f"{figure.id}.svg": figure.svg.encode() for figure in figures}


def write(folder, shown=None):
    shown = shown or document()
    write_report(shown, files_of(shown.figures()), folder)
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_latex_compiles(tmp_path):
    needs_latex(*PACKAGES)
    several = replace(
        document(), sections=(*document().sections, Section("pages", "Long", (LONG, WIDE)))
    )
    write(tmp_path / "report", several)
    (tmp_path / "report" / "paper.tex").write_text(
        r"\documentclass{article}\usepackage[T1]{fontenc}\usepackage[utf8]{inputenc}"
        r"\usepackage{booktabs,siunitx,graphicx,tabularx,longtable}\begin{document}\input{tables.tex}\end{document}",
        encoding="utf-8",
    )
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    done = subprocess.run(
        command, cwd=tmp_path / "report", capture_output=True, check=False, timeout=120
    )
    log = done.stdout.decode(errors="replace")
    assert done.returncode == 0, log[-2000:]
    assert " pages" in log
    assert not re.search(r"Overfull \\hbox.*in alignment", log)  # nor is it scaled
    assert "Missing character" not in log


def test_the_folder_is_the_same_for_the_same_document(tmp_path):
    first, second = write(tmp_path / "a"), write(tmp_path / "b")
    assert first == second
    assert sorted(first) == [
        LISTING,
        "figures/line-1.svg",
        "figures/line-2.svg",
        "report.html",
        "report.md",
        "tables.tex",
        "tables/methods-shelf.csv",
        "tables/methods-shelf.tex",
        "tables/runs.csv",
    ]
    for link in re.findall(r"\]\(((?:figures|tables|report)[^)#]*)", first["report.md"].decode()):
        assert link in first


def test_a_report_replaces_the_one_before(tmp_path):
    folder = tmp_path / "report"
    write(folder)
    written = write(folder, Document("Later", (Section("a", "A"),)))
    pages = {"report.html", "report.md", "tables.tex", "tables/runs.csv"}
    assert set(written) == {LISTING, *pages}
    assert not (folder / "figures").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_a_report_that_fails_leaves_the_one_before(tmp_path):
    folder = tmp_path / "report"
    before = write(folder)
    with pytest.raises(ValueError, match="figures without a file: line-2"):
        write_report(document(), files_of(document().figures()[:1]), folder)
    after = {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()
    }
    assert after == before
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_a_layout_has_the_columns_that_it_speaks_of():
    layout = LAYOUTS["across-tasks"]
    with pytest.raises(ValueError, match="table across-tasks has no columns gain"):
        layout.row("a", method="a", gain=1.0)
    fields = dict(layout) | {"intervals": {"gain": ""}}
    with pytest.raises(ValidationError, match="intervals of no columns: gain"):
        TableLayout.model_validate(fields)
    with pytest.raises(ValidationError, match="colour"):
        TableLayout.model_validate(
            dict(layout) | {"columns": [{"name": "a", "header": "a", "colour": 1}]}
        )
