"""The register as a page: ``python -m coartic.analysis.claims.page > docs/register.md``.

Rules, margins, claims with their power at the paper's number of runs, and the whole paper sentence
by sentence; no verdicts, which are those of a folder.
"""

from __future__ import annotations

import itertools
import sys
import textwrap
from collections.abc import Iterator
from typing import Any

from coartic.analysis.claims.catalogue import CLAIMS, family_sizes
from coartic.analysis.claims.power import SIMULATIONS, TRIED, powers, runs_needed
from coartic.analysis.claims.register import CHOSEN, FITTED, RULES, Claim
from coartic.analysis.claims.statements import REASONS
from coartic.analysis.published import RUNS
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.statistics.power import POWER, smallest_difference
from coartic.analysis.words import stated

SENTENCES: list[dict[str, Any]] = stated(__file__, "sentences")["sentence"]
"""Testable sentences of the paper: ``place``, ``quote``, and ``claims``, ``held`` or ``open``."""


def page() -> str:
    """The page in Markdown."""
    return "\n".join(map(_wrapped, _lines())) + "\n"


def _wrapped(line: str) -> str:
    """A line of text in several; headings and rows of tables stay as they are."""
    if line.startswith(("#", "|")):
        return line
    indent = "  " * line.startswith(("- ", "  "))
    return textwrap.fill(
        line, 100, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
    )


def _lines() -> Iterator[str]:
    sizes = family_sizes()
    yield "# The register of claims"
    yield ""
    yield (
        "What Shah, Barto & Fagg (2013) say of their model, and how each sentence is judged, "
        "before any run is looked at. Made by `python -m coartic.analysis.claims.page` of "
        "`analysis/claims/claims.toml` and `sentences.toml`; verdicts are those of a folder "
        "(`claims.md` of `coartic analyse`, the report)."
    )
    yield from ("", "## Verdicts", "", RULES, "", FITTED, "", CHOSEN, "")
    yield (
        f"Families: {sizes['paper']} claims with a test on the paper's own cells, "
        f"{sizes['beside']} that take other runs beside them (suites `comparison`, `ablations`), "
        f"{sizes['families']} on families of random tasks (suite `families`)."
    )
    yield from ("", "## Margins", "", "Each is set once.", "")
    for name, said in REASONS.items():
        yield f"- *{name}* {said['value']:g}: {said['reason']}"
    yield from _power(sizes["paper"])
    for section, claims in itertools.groupby(CLAIMS, lambda claim: claim.section):
        yield from ("", f"## {section}", "")
        for claim in claims:
            yield from _claim(claim)
    yield from ("", "## The paper, sentence by sentence", "")
    yield from ("| place | sentence | judged by, or why not |", "| --- | --- | --- |")
    for said in SENTENCES:
        becomes = ", ".join(said.get("claims", ())) or (
            f"Held by {said['held']}" if "held" in said else said["open"]
        )
        yield f"| {said['place']} | “{said['quote']}” | {becomes} |"


def _power(tested: int) -> Iterator[str]:
    """What tests see of so many claims with a test on the paper's own cells."""
    yield from ("", "## Power", "")
    yield (
        f"With {RUNS} runs a cell, as the paper has, the chance that a claim comes out "
        "*supported* if the paper's numbers are exactly right (at least so much, as claims "
        "without printed numbers are taken to fail), and *not supported* if the contrary holds: "
        "numbers as far on the other side of the claim's bound as the printed ones are on theirs. "
        "From "
        f"{SIMULATIONS} simulated experiments, and for counts of the contrary exactly "
        "(`analysis/claims/power.py`); normal rewards with the printed SDs. *Runs*: how many a "
        f"cell needs for {POWER:.0%} each. "
        "Suite `ablations` has 100 runs of the cells whose shares are judged."
    )
    yield ""
    yield from ("| claim | supported | not supported | runs |", "| --- | --- | --- | --- |")
    needed = runs_needed(CLAIMS)
    for name, chances in powers(CLAIMS, {}).items():
        both = " | ".join(f"{chance:.0%}" for chance in chances)
        yield f"| {name} | {both} | {needed[name] or f'more than {TRIED[-1]}'} |"
    level = LEVEL / tested
    one, two = (smallest_difference(1.0, sd, RUNS, level) for sd in (0.0, 1.0))
    yield ""
    yield (
        "Of the other claims with a test the paper prints no numbers. With a correction for all "
        f"of the family a test of the mean of {RUNS} runs finds, with {POWER:.0%}, a mean that is "
        f"{one:.1f} SD beyond its bound, a test of two means a difference of {two:.1f} SD."
    )
    yield ""
    yield (
        "Claims on families of random tasks are judged over instances, and their power depends on "
        "how much instances differ: a folder states the true effect that is seen with "
        f"{POWER:.0%}."
    )


def _claim(claim: Claim) -> Iterator[str]:
    yield f"- **{claim.id}**{' †' * claim.fitted}. {claim.statement}"
    beside = " Takes runs beside the paper's cells." * claim.beside
    yield f"  *{claim.rule.capitalize()}*: {claim.test}.{beside}"
    if claim.place:
        where = ", ".join(filter(None, (claim.place, claim.figure)))
        yield f"  {where}: “{claim.quote}”."


if __name__ == "__main__":
    sys.stdout.write(page())
