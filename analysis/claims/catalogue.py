"""All claims, in the order of the page."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import pandas as pd

from analysis.claims.beyond import BEYOND
from analysis.claims.coarticulation import COARTICULATION
from analysis.claims.conditions import CONDITIONS
from analysis.claims.general import GENERAL
from analysis.claims.one_armed import ONE_ARMED
from analysis.claims.register import Claim, Judged, judge_claims
from analysis.claims.two_armed_1 import TWO_ARMED_1
from analysis.claims.two_armed_2 import TWO_ARMED_2

if TYPE_CHECKING:
    from analysis.study import Study

CLAIMS: tuple[Claim, ...] = (
    *ONE_ARMED,
    *TWO_ARMED_1,
    *TWO_ARMED_2,
    *CONDITIONS,
    *COARTICULATION,
    *GENERAL,
    *BEYOND,
)


def judge(study: Study, claims: Iterable[Claim] = CLAIMS) -> list[Judged]:
    """Every claim with its verdict; see :func:`analysis.claims.register.judge_claims`."""
    return judge_claims(study, claims)


def register_table(judged: Iterable[Judged]) -> pd.DataFrame:
    """One row per claim.

    Columns: ``id``, ``section``, ``statement``, ``verdict``, ``fitted``, ``evidence`` (with its
    table, row by row), ``test``, ``p`` (largest of the claim's tests), ``adjusted_p`` (Holm),
    ``contrary_p`` (smallest of the contrary's tests, times their number),
    ``adjusted_contrary_p``, ``place``, ``quote``, ``figure`` (of the paper), ``runs`` (ids,
    space-separated), ``sources`` (what else it rests on).
    """
    return pd.DataFrame(
        [
            {
                "id": entry.claim.id,
                "section": entry.claim.section,
                "statement": entry.claim.statement,
                "verdict": entry.verdict,
                "fitted": entry.claim.fitted,
                "evidence": ". ".join(filter(None, (entry.evidence, entry.rows))),
                "test": entry.claim.test,
                "p": entry.p,
                "adjusted_p": entry.adjusted_p,
                "contrary_p": entry.contrary_p,
                "adjusted_contrary_p": entry.adjusted_contrary_p,
                "place": entry.claim.place,
                "quote": entry.claim.quote,
                "figure": entry.claim.figure,
                "runs": " ".join(entry.run_ids),
                "sources": ", ".join(entry.sources),
            }
            for entry in judged
        ]
    )
