"""All claims, in the order of the page."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import pandas as pd

from analysis.claims import (  # noqa: F401  (their judges enter themselves)
    beyond,
    coarticulation,
    conditions,
    general,
    one_armed,
    two_armed,
)
from analysis.claims.judges import costs, presence, resemblance  # noqa: F401
from analysis.claims.register import Claim, Judged, judge_claims
from analysis.claims.statements import JUDGED, STATEMENTS

if TYPE_CHECKING:
    from analysis.study import Study

CLAIMS: tuple[Claim, ...] = tuple(JUDGED[name] for name in STATEMENTS)
_COLUMNS = (
    *("id", "section", "statement", "verdict", "fitted", "evidence", "test"),
    *("p", "adjusted_p", "contrary_p", "adjusted_contrary_p"),
    *("place", "quote", "figure", "runs", "sources"),
)


def judge(study: Study, claims: Iterable[Claim] = CLAIMS) -> list[Judged]:
    """Every claim with its verdict; see :func:`analysis.claims.register.judge_claims`."""
    return judge_claims(study, claims)


def register_table(judged: Iterable[Judged]) -> pd.DataFrame:
    """One row per claim.

    Columns: ``id``, ``section``, ``statement``, ``verdict``, ``fitted``, ``evidence``, ``test``,
    ``p`` (largest of the claim's tests), ``adjusted_p`` (Holm), ``contrary_p`` (smallest of the
    contrary's tests, times their number), ``adjusted_contrary_p``, ``place``, ``quote``,
    ``figure`` (of the paper), ``runs`` (ids, space-separated), ``sources`` (what else it rests
    on).
    """
    rows = [
        {
            **vars(entry.claim),
            **vars(entry),
            "runs": " ".join(entry.run_ids),
            "sources": ", ".join(entry.sources),
        }
        for entry in judged
    ]
    return pd.DataFrame(rows, columns=_COLUMNS)
