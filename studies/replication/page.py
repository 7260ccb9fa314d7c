"""Make the page of a user's own results: claims, rewards and evidence."""

import html
from pathlib import Path

from coartic.analysis import interval, number
from coartic.analysis.words import NO_BREAK, p_value

HERE = Path(__file__).parent
STYLE = HERE.parents[1] / "analysis" / "report" / "page.css"
MARKS = {"not supported": "✗", "undecided": "?", "supported": "✓"}
"""Marks of the verdicts, in the order of the page: failures first."""


def page_of(tables):
    """Return the page of the tables of a folder as HTML."""
    claims, rewards = tables["claims"], tables["rewards"]
    judged = claims[claims.suite.fillna("") != ""]
    judged = judged.sort_values("replicates", key=lambda of: of.map([*MARKS].index), kind="stable")
    missing = [name.replace("-", " ") for name in claims.index if name not in judged.index]
    counts = {verdict: (judged.replicates == verdict).sum() for verdict in MARKS}
    words = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    body = [
        "<h1>Replication: what of the paper comes out again?</h1>",
        f"<p>Of {len(judged)} judged claims: {words}. † Goals are reconstructed.</p>",
    ]
    if missing:
        body.append(
            f"<p>Not judged, for lack of runs: {html.escape(', '.join(missing))}. Suites "
            "<code>ablations</code> and <code>families</code> have them.</p>"
        )
    body += [
        "<h2>Verdicts</h2>",
        "<p>p is of the test of the claim; where it is not supported, of the test of its opposite. "
        "<i>Replicates</i> compares with the corrective process, <i>more than one selection</i> "
        "with random search.</p>",
        _table(
            ["claim", "replicates", "p", "more than one selection", "p", "suite"],
            [
                [claim.statement, _mark(claim.replicates),
                 _p(claim.replicates, claim.p_holm, claim.opposite_p_holm),
                 _mark(claim.more_than_one_selection),
                 _p(claim.more_than_one_selection, claim.p_beyond, claim.opposite_p_beyond),
                 claim.suite]
                for _, claim in judged.iterrows()
            ],
        ),
        "<h2>Rewards by hands</h2>",
        '<img src="rewards.svg" alt="Learned rewards, ours minus published">',
        _table(
            ["task, condition", "hands", "published", "ours", "runs", "difference", "verdict"],
            [
                [f"{row.task}, {row.condition}", row.hands if _is(row.hands) else "all",
                 _with_sd(row.published, row.published_sd), _with_sd(row.ours, row.ours_sd),
                 row.runs, interval(row, "difference"), row.verdict if _is(row.verdict) else "–"]
                for _, row in rewards.iterrows()
            ],
        ),
        "<h2>Solutions</h2>",
        '<img src="solutions.svg" alt="Postures that hit each goal, without and with learning">',
        "<h2>Evidence</h2>",
        *(_evidence(claim) for _, claim in judged.iterrows()),
    ]  # fmt: skip
    page, style = (HERE / "page.html").read_text("utf-8"), STYLE.read_text("utf-8")
    return page.replace("{{ style }}", style).replace("{{ body }}", "\n".join(body))


def _is(value):
    """Return whether a cell has a value."""
    return value == value and value != ""


def _mark(verdict):
    """Return a verdict with its mark."""
    return f"{MARKS[verdict]} {verdict}" if _is(verdict) else "–"


def _p(verdict, p, opposite):
    """Return the p-value that belongs to a verdict."""
    value = opposite if verdict == "not supported" else p
    return p_value(value).partition(NO_BREAK)[2].removeprefix(f"={NO_BREAK}") if _is(value) else "–"


def _with_sd(value, sd):
    """Return a mean with its standard deviation."""
    return f"{number(value, 1)} ± {number(sd, 1)}" if _is(sd) else number(value, 1)


def _table(headings, rows):
    """Return a table as HTML."""
    lines = [
        "<tr>" + "".join(_cell(tag, str(cell)) for cell in row) + "</tr>"
        for tag, row in [("th", headings), *(("td", row) for row in rows)]
    ]
    return '<div class="scroll"><table>' + "".join(lines) + "</table></div>"


def _cell(tag, text):
    """Return a cell as HTML; words stand to the left."""
    is_number = text[:1] in "−<–" or text[:1].isdigit()
    kind = "" if is_number else ' class="text"'
    return f"<{tag}{kind}>{html.escape(text)}</{tag}>"


def _evidence(claim):
    """Return the evidence of a claim as HTML, folded."""
    lines = [_plain(claim.evidence), f"Test: {claim.test}."]
    if _is(claim.more_than_one_selection):
        lines.append(
            f"More than one selection: {_mark(claim.more_than_one_selection)}. "
            f"{_plain(claim.evidence_beyond)} Test: {claim.test_beyond}."
        )
    lines.append(f"The paper, {claim.place}: “{claim.quote}”")
    paragraphs = "".join(f"<p>{html.escape(line)}</p>" for line in lines)
    head = html.escape(f"{claim.statement} {_mark(claim.replicates)}")
    return f"<details><summary>{head}</summary>{paragraphs}</details>"


def _plain(evidence):
    """Return evidence with words in place of endings of ids."""
    words = {"-subtask": " with reward per subtask", "-uncorrected": " without correction"}
    for ending, meaning in words.items():
        evidence = evidence.replace(ending, meaning)
    return evidence
