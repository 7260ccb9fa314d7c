"""Verdicts on the paper's claims for a results folder, with tests corrected together.

- *Supported*: the runs show the claim, and the largest p-value of its tests, which must all hold
  (intersection-union test), is below 5 % after Holm's correction; tests over random tasks also
  without the task that favours the claim most.
- *Not supported*: the runs do not show the claim, and the opposite of one of its tests is
  significant (smallest p-value of the opposites times their number, below 5 % after Holm's
  correction).
- *Depends on the goals*: our goals support the claim, but at most half of the sets of goals
  consistent with the paper's text do.
- *Undecided*: none of these, or the folder lacks the runs.

Exact counts, and values without spread over runs, need no test. Corrections are over fixed groups
of claims: claims on the paper's seven cells, claims that compare these with other runs, and claims
on families of random tasks. A claim that a folder cannot test counts in its group all the same, so
that verdicts do not change with the other runs of a folder.
"""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from coartic.analysis.claims.claim import Claim
from coartic.analysis.claims.families import CLAIMS_ON_FAMILIES
from coartic.analysis.claims.judging import Finding, judge
from coartic.analysis.claims.paper import CLAIMS_OF_THE_PAPER
from coartic.analysis.claims.reader import MissingError, Reader
from coartic.analysis.study import Study, cached

CLAIMS = {claim.id: claim for claim in (*CLAIMS_OF_THE_PAPER, *CLAIMS_ON_FAMILIES)}
"""Every claim by its id."""


@cached
def judgements(study: Study) -> pd.DataFrame:
    """Judge the claims on the folder's tasks, by :func:`judge_claims`."""
    drawn = {task.family is not None for task in study.tasks.values()}
    paper = CLAIMS_OF_THE_PAPER if drawn != {True} else []
    return judge_claims(study, [*paper, *(CLAIMS_ON_FAMILIES if True in drawn else [])])


def judge_claims(study: Study, claims: Iterable[Claim]) -> pd.DataFrame:
    """Judge claims, each corrected over the claims of its group among ``claims``.

    Returns a row for each claim, as :func:`~coartic.analysis.judge` does, with more columns:
    ``run_ids`` of the runs that the claim read; ``failed``, the cells that the claim could not use
    because some of their runs failed; ``lacks_runs``, True if the claim was not tested.
    """
    groups: dict[str, dict[str, tuple[str, str, Finding]]] = {}
    rows = []
    for claim in claims:
        read = Reader(study)
        try:
            finding = claim.judge(read)
        except MissingError as missing:
            finding, read.run_ids = Finding(None, str(missing)), []
        groups.setdefault(claim.group, {})[claim.id] = claim.text, claim.test, finding
        run_ids = " ".join(dict.fromkeys(read.run_ids))
        failed, lacks_runs = tuple(dict.fromkeys(read.failed)), finding.holds is None
        rows.append((claim.id, run_ids, failed, lacks_runs, claim.depends))
    columns = ["claim", "run_ids", "failed", "lacks_runs", "depends"]
    read_of = pd.DataFrame(rows, columns=columns).set_index("claim")
    judged = read_of.join(pd.concat(map(judge, groups.values())))
    goals = judged.pop("depends") & (judged.verdict == "supported")
    return judged.assign(verdict=judged.verdict.mask(goals, "depends on the goals"))
