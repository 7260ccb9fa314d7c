"""The claims judged on a results folder: tests corrected together, one verdict each.

- *Supported*: what the claim says is seen, and the largest p-value of its tests, which must all
  hold (intersection-union test), is below 5 % after Holm's correction.
- *Not supported*: it is not seen, and the opposite of one of its tests is significant (smallest
  p-value of the opposites times their number, below 5 % after Holm's correction).
- *Depends on the goals*: it would be supported at our goals, but at most half of the sets of goals
  that the paper's text admits support it.
- *Undecided*: none of these, or the folder lacks the runs.

A claim that is not about the model, that follows from what chose our goals or constants, or whose
rule is flawed has a verdict as well, but does not count (``uncounted``).

What is counted exactly, or shows no spread over runs, needs no test. Corrections are over fixed
groups of claims: those on the paper's own seven cells, those that take other runs beside them,
those on families of random tasks, our own on one suite, and flawed ones of our own on one. A claim
that a folder cannot
test counts in its group all the same, so that what is decided stays decided whatever else is run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import get_args

from coartic.analysis.claims import rules
from coartic.analysis.claims.data import JUDGES, TESTS, Data, MissingError
from coartic.analysis.claims.ensemble import rarely_supported
from coartic.analysis.claims.register import CLAIMS, MARGINS, Claim, Finding, Group, Verdict
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import Study, cached
from coartic.analysis.topics import horizon, objectives, stops  # noqa: F401 (their claims)
from coartic.analysis.topics.paper import claims as single

RULES: dict[str, Callable[[Data, Claim], Finding]] = {
    rule.__name__: rule
    for rule in (
        *(rules.higher, rules.some_higher, rules.in_every_family, rules.counted, rules.ordered),
        *(single.context, single.sequences_change, single.initial_base_reverses),
        *(single.slower_hands_are_chosen,),
        *(single.corrective_ensures, single.corrective_near_shortest, single.printed_p_values),
    )
}
"""The rules by their names in ``claims.toml``."""


@dataclass(frozen=True)
class Judged:
    """A claim with what was seen of it, and its verdict."""

    claim: Claim
    finding: Finding
    run_ids: tuple[str, ...] = ()
    adjusted_p: float = math.nan
    """:func:`p_of` the claim, adjusted over its group (Holm)."""
    adjusted_opposite_p: float = math.nan

    @property
    def verdict(self) -> Verdict:
        """The verdict by corrected p-values and by the admissible goals."""
        verdict = by_tests(self.finding, self.adjusted_p, self.adjusted_opposite_p)
        if verdict == "supported" and self.claim.fitted and rarely_supported(self.claim.id):
            return "depends on the goals"
        return verdict


def by_tests(finding: Finding, p: float, opposite: float) -> Verdict:
    """The verdict of the tests alone, by their p-values and those of the opposite."""
    untested = any(math.isnan(test.p) and min(test.n) < 2 for test in finding.tests)
    if finding.holds is None or (finding.holds and untested):
        return "undecided"
    if finding.holds:
        # NaN: counted exactly, or no spread in any sample.
        return "undecided" if p >= LEVEL else "supported"
    certain = not finding.tests or any(
        test.value <= 0 and math.isnan(test.p) and min(test.n) > 1 for test in finding.tests
    )
    return "not supported" if certain or opposite < LEVEL else "undecided"


def test_in_words(claim: Claim) -> str:
    """How a claim is judged, with its margins; a rule's own words are its docstring."""
    counts = [rules.COUNTS[how.partition(" EC")[0]] for each in claim.runs.values() for how in each]
    words = claim.test or TESTS.get(claim.id) or "; ".join(dict.fromkeys(counts))
    words = words or str(RULES[claim.rule].__doc__)
    return " ".join(words.split()).format(**MARGINS)


def p_of(claim: Claim, finding: Finding) -> float:
    """Largest p-value of the tests, which must all hold; NaN where nothing is tested."""
    values = [test.p for test in finding.tests if not math.isnan(test.p)]
    return max(values) if values and claim.group else math.nan


def opposite_p(claim: Claim, finding: Finding) -> float:
    """Smallest p-value of the opposites times their number (Bonferroni); NaN without any.

    The other tail of a test by resampling counts the observed sample as well. A rule with exact
    tests gives their opposites itself (``against``).
    """
    if finding.against is not None:
        p = [test.p for test in finding.against]
    else:
        p = [min(1.0, 1 - test.p + 1 / (test.resamples + 1)) for test in finding.tests]
    values = [value for value in p if not math.isnan(value)]
    return min(1.0, min(values) * len(values)) if values and claim.group else math.nan


@cached
def judged(study: Study) -> list[Judged]:
    """The claims on the folder's suite, judged and corrected; without any, those on its tasks."""
    of_suite = [claim for claim in CLAIMS.values() if claim.suite == study.suite]
    drawn = {task.family is not None for task in study.tasks.values()} or {False}
    of_tasks = [c for c in CLAIMS.values() if not c.suite and bool(c.families) in drawn]
    return judge(study, of_suite or of_tasks)


def judge(study: Study, claims: Iterable[Claim]) -> list[Judged]:
    """The claims judged; those with a test are corrected over their groups among ``claims``."""
    seen = [(claim, *apply_rule(claim, Data(study))) for claim in claims]
    adjusted: dict[str, tuple[float, float]] = {}
    for group in get_args(Group):
        members = [(claim, finding) for claim, finding, _ in seen if claim.group == group]
        both = [holm([p(*each) for each in members], len(members)) for p in (p_of, opposite_p)]
        adjusted |= {
            each[0].id: p for each, p in zip(members, zip(*both, strict=True), strict=True)
        }
    return [
        Judged(claim, finding, runs, *adjusted.get(claim.id, (math.nan, math.nan)))
        for claim, finding, runs in seen
    ]


def apply_rule(claim: Claim, data: Data) -> tuple[Finding, tuple[str, ...]]:
    """What a claim's rule finds, and the ids of the runs that it read."""
    try:
        judge = JUDGES.get(claim.id)
        finding = judge(data) if judge else RULES[claim.rule](data, claim)
    except MissingError as missing:
        words = f"Not judged: {missing}."
        return Finding(None, words, failed=tuple(dict.fromkeys(data.failed))), ()
    finding = replace(finding, failed=tuple(dict.fromkeys(data.failed)))
    if claim.exact:
        finding = replace(finding, tests=(), against=None)
    return finding, tuple(dict.fromkeys(data.run_ids))


def counts(entries: Iterable[Judged]) -> Mapping[Verdict, int]:
    """How many of the claims that count have each verdict; 0 for those that none has."""
    found = Counter(entry.verdict for entry in entries if not entry.claim.uncounted)
    return {verdict: found[verdict] for verdict in get_args(Verdict)}
