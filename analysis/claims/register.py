"""What a claim is, and the rules of its verdict (:data:`RULES`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from analysis.claims.data import Data, MissingError
from analysis.report.document import DataTable
from analysis.statistics.estimates import LEVEL, RESAMPLES, Inference
from analysis.statistics.hypotheses import holm

if TYPE_CHECKING:
    from analysis.study import Study

Verdict = Literal["supported", "not supported", "cannot tell", "measured"]
Section = Literal["One-armed tasks", "Two-armed tasks", "General", "Beyond the paper"]

RULES = (
    "*Supported*: what the claim says is seen, and the largest p-value of the tests it rests on "
    "(they must all hold: an intersection-union test) stays below 5 % after Holm's correction. "
    "*Not supported*: it is not seen, and the contrary of one of its tests is significant (the "
    "smallest p-value of the contrary times their number, below 5 % after Holm's correction). "
    "What is counted exactly, or shows no spread over runs, needs no test and is supported or not "
    "as it is. *Cannot tell*: neither, or the folder lacks the runs. Each of the two corrections "
    "is over all of the paper's claims that the folder can test. Comparisons that the paper does "
    "not make are *measured*, not judged."
)
"""How verdicts are reached, in inline markup."""
FITTED = (
    "† rests on the two-armed tasks. Their goals are a reconstruction, chosen so that printed "
    "rewards and hand sequences come out (docs/model.md): a reproduction, no independent test."
)
"""What the mark of a fitted claim means."""


@dataclass(frozen=True)
class Finding:
    """What was seen of one claim, before any correction of its tests."""

    holds: bool | None
    """Whether what the claim says is seen; None where nothing is judged."""
    evidence: str
    tests: tuple[Inference, ...] = ()
    """Tests that it rests on, turned so that a positive estimate is as claimed."""
    against: tuple[Inference, ...] | None = None
    """Tests of the contrary, any of which refutes it; None: the other tails of ``tests``."""
    table: DataTable | None = None
    """Numbers that are more than a sentence can hold; its id is ``evidence-`` and the claim's."""


Judge = Callable[[Data], Finding]


@dataclass(frozen=True)
class Claim:
    """One statement and how it is decided."""

    id: str
    statement: str
    section: Section
    test: str
    """In inline markup."""
    judge: Judge
    place: str = ""
    """Section of the paper that makes it; empty for comparisons of our own."""
    quote: str = ""
    """A few words of the paper by which the place can be found."""
    figure: str = ""
    """Figure of the paper that shows it, where one does."""
    fitted: bool = False
    """Whether it rests on a task whose goals were chosen for results like it."""


@dataclass(frozen=True, kw_only=True)
class Judged(Finding):
    """A claim with what was seen of it, and its verdict."""

    claim: Claim
    verdict: Verdict
    p: float
    """Largest of its tests; NaN without a test, and where nothing is judged."""
    adjusted_p: float
    """The same, adjusted over the paper's claims (Holm)."""
    contrary_p: float
    """Smallest p-value of the contrary, times the number of tests."""
    adjusted_contrary_p: float
    run_ids: tuple[str, ...]
    sources: tuple[str, ...]
    """What it rests on beside runs."""

    @property
    def methods(self) -> tuple[str, ...]:
        """Its tests, in words."""
        return tuple(dict.fromkeys(map(_in_words, (*self.tests, *(self.against or ())))))

    @property
    def marked(self) -> str:
        """The verdict, with † where the claim is fitted."""
        return self.verdict + (" †" if self.claim.fitted else "")


def judge_claims(study: Study, claims: Iterable[Claim]) -> list[Judged]:
    """Every claim with its verdict, p-values corrected over all of them (Holm)."""
    data = Data(study)
    found: list[tuple[Claim, Finding, tuple[str, ...], tuple[str, ...]]] = []
    for claim in claims:
        data.forget()
        try:
            finding = claim.judge(data)
        except MissingError as missing:
            found.append((claim, Finding(None, f"not judged: {missing}"), (), ()))
        else:
            found.append((claim, finding, data.run_ids, data.others))
    largest = [_largest(finding) if claim.place else math.nan for claim, finding, *_ in found]
    contrary = [_contrary(finding) if claim.place else math.nan for claim, finding, *_ in found]
    return [
        Judged(
            **vars(finding),
            claim=claim,
            verdict=_verdict(claim, finding, adjusted, refuted, seen=bool(run_ids or sources)),
            p=p,
            adjusted_p=adjusted,
            contrary_p=against,
            adjusted_contrary_p=refuted,
            run_ids=run_ids,
            sources=sources,
        )
        for (claim, finding, run_ids, sources), p, adjusted, against, refuted in zip(
            found, largest, holm(largest), contrary, holm(contrary), strict=True
        )
    ]


def _in_words(test: Inference) -> str:
    return f"{test.method} ({test.note})" if math.isnan(test.p) and test.note else test.method


def _largest(finding: Finding) -> float:
    """All tests of a claim must hold: its p-value is the largest."""
    return max((t.p for t in finding.tests if not math.isnan(t.p)), default=math.nan)


def _contrary(finding: Finding) -> float:
    """One contrary suffices: the smallest p-value, times their number (Bonferroni)."""
    against = finding.against
    p = [
        t.p if against is not None else min(1.0, 1 - t.p + 1 / (RESAMPLES + 1))
        for t in (finding.tests if against is None else against)
        if not math.isnan(t.p)
    ]
    return min(1.0, min(p) * len(p)) if p else math.nan


def _verdict(claim: Claim, finding: Finding, p: float, contrary: float, *, seen: bool) -> Verdict:
    if not seen:
        return "cannot tell"
    if not claim.place:
        return "measured"
    if finding.holds is None:
        return "cannot tell"
    if finding.holds:
        # NaN: counted exactly, or no spread in any sample.
        return "cannot tell" if p >= LEVEL else "supported"
    certain = not finding.tests or any(t.estimate < 0 and math.isnan(t.p) for t in finding.tests)
    return "not supported" if certain or contrary < LEVEL else "cannot tell"
