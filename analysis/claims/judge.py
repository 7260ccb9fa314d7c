"""The claims judged on a results folder: tests corrected together, one verdict each.

- *Supported*: what the claim says is seen, and the largest p-value of its tests, which must all
  hold (intersection-union test), is below 5 % after Holm's correction.
- *Not supported*: it is not seen, and the opposite of one of its tests is significant (smallest
  p-value of the opposites times their number, below 5 % after Holm's correction).
- *Depends on the goals*: it would be supported at our goals, but at most half of the sets of goals
  that the paper's text admits support it.
- *Undecided*: none of these, or the folder lacks the runs.

What is counted exactly, or shows no spread over runs, needs no test. Corrections are over fixed
groups of claims: those on the paper's own seven cells, those that take other runs beside them,
and those on families of random tasks. A claim that a folder cannot test
counts in its group all the same, so that what is decided stays decided whatever else is run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import get_args

# These register the claims that they judge.
import coartic.analysis.topics.families.claims
import coartic.analysis.topics.paper.claims
import coartic.analysis.topics.paper.coarticulation  # noqa: F401
from coartic.analysis.claims.data import JUDGES, TESTS, Data, MissingError
from coartic.analysis.claims.register import CLAIMS, MARGINS, Claim, Finding, Group, Verdict
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import CellKey, Study, cached


@dataclass(frozen=True)
class Judgement:
    """A claim with what was seen of it, and its verdict."""

    claim: Claim
    finding: Finding
    run_ids: tuple[str, ...]
    """Runs that were read, each once."""
    failed: tuple[CellKey, ...]
    """Cells that the claim lacks, as some of their runs failed: task, and label of the method."""
    adjusted_p: float = math.nan
    """p-value of the finding, adjusted over the claim's group (Holm)."""
    adjusted_opposite_p: float = math.nan

    @property
    def verdict(self) -> Verdict:
        """The verdict by corrected p-values and by the admissible goals."""
        verdict = self.finding.verdict(self.adjusted_p, self.adjusted_opposite_p)
        depends = verdict == "supported" and self.claim.depends
        return "depends on the goals" if depends else verdict


def words_of_test(claim: Claim) -> str:
    """How a claim is judged, with its margins."""
    return " ".join(TESTS[claim.id].split()).format(**MARGINS)


@cached
def judgements(study: Study) -> list[Judgement]:
    """The claims on the folder's tasks, the paper's or random ones, judged and corrected."""
    drawn = {task.family is not None for task in study.tasks.values()} or {False}
    return judge_claims(study, [claim for claim in CLAIMS.values() if claim.families in drawn])


def judge_claims(study: Study, claims: Iterable[Claim]) -> list[Judgement]:
    """The claims judged; those with a test are corrected over their groups among ``claims``."""
    seen = [judge_alone(claim, Data(study)) for claim in claims]
    corrected: dict[str, Judgement] = {}
    for group in get_args(Group):
        members = [entry for entry in seen if entry.claim.group == group]
        p = holm([entry.finding.p for entry in members], len(members))
        opposite_p = holm([entry.finding.opposite_p for entry in members], len(members))
        for entry, *adjusted in zip(members, p, opposite_p, strict=True):
            corrected[entry.claim.id] = replace(
                entry, adjusted_p=adjusted[0], adjusted_opposite_p=adjusted[1]
            )
    return [corrected.get(entry.claim.id, entry) for entry in seen]


def judge_alone(claim: Claim, data: Data) -> Judgement:
    """What is seen of one claim, before its tests are corrected."""
    try:
        finding = JUDGES[claim.id](data)
    except MissingError as missing:
        finding, data.run_ids = Finding(None, f"Not judged: {missing}."), []
    run_ids, failed = dict.fromkeys(data.run_ids), dict.fromkeys(data.failed)
    return Judgement(claim, finding, tuple(run_ids), tuple(failed))


def counts(entries: Iterable[Judgement]) -> Mapping[Verdict, int]:
    """How many claims have each verdict; 0 for those that none has."""
    found = Counter(entry.verdict for entry in entries)
    return {verdict: found[verdict] for verdict in get_args(Verdict)}
