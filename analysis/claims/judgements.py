"""The paper's claims judged on a results folder: tests corrected together, one verdict each.

- *Supported*: what the claim says is seen, and the largest p-value of its tests, which must all
  hold (intersection-union test), is below 5 % after Holm's correction; tests over random tasks
  also without the task that speaks most for the claim.
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

import re
from collections.abc import Iterable
from dataclasses import replace

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
    """The claims on the folder's tasks, the paper's or random ones, as :func:`judge_claims`."""
    drawn = {task.family is not None for task in study.tasks.values()}
    paper = CLAIMS_OF_THE_PAPER if drawn != {True} else []
    return judge_claims(study, [*paper, *(CLAIMS_ON_FAMILIES if True in drawn else [])])


def judge_claims(study: Study, claims: Iterable[Claim]) -> pd.DataFrame:
    """The claims judged, each corrected over those of its group among ``claims``.

    A row a claim, as :func:`~coartic.analysis.judge` has it, and ``run_ids``, of the runs that were
    read, and ``failed``, the cells that it lacks as some of their runs failed.
    """
    groups: dict[str, dict[str, tuple[str, str, Finding]]] = {}
    rows = []
    ids = "|".join(re.escape(name) for name in sorted(study.tasks, key=len, reverse=True))
    task_name = re.compile(rf"(?<![\w.-])({ids})(?![\w-]|\.\w)")
    for claim in claims:
        read = Reader(study)
        try:
            finding = claim.judge(read)
        except MissingError as missing:
            finding, read.run_ids = Finding(None, str(missing)), []
        # People's names of tasks in place of their ids.
        evidence = task_name.sub(lambda match: study.tasks[match[1]].label, finding.evidence)
        finding = replace(finding, evidence=evidence)
        groups.setdefault(claim.group, {})[claim.id] = claim.text, claim.test, finding
        run_ids = " ".join(dict.fromkeys(read.run_ids))
        rows.append((claim.id, run_ids, tuple(dict.fromkeys(read.failed)), claim.depends))
    columns = ["claim", "run_ids", "failed", "depends"]
    read_of = pd.DataFrame(rows, columns=columns).set_index("claim")
    judged = read_of.join(pd.concat(map(judge, groups.values())))
    goals = judged.pop("depends") & (judged.verdict == "supported")
    return judged.assign(verdict=judged.verdict.mask(goals, "depends on the goals"))
