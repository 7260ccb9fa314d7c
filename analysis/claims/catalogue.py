"""All claims, in the order of the page."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

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
    *ONE_ARMED, *TWO_ARMED_1, *TWO_ARMED_2, *CONDITIONS, *COARTICULATION, *GENERAL, *BEYOND
)  # fmt: skip


def judge(study: Study, claims: Iterable[Claim] = CLAIMS) -> list[Judged]:
    """Every claim with its verdict; see :func:`analysis.claims.register.judge_claims`."""
    return judge_claims(study, claims)
