"""All claims, in the order of the page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import pandas as pd

from analysis.claims import (  # noqa: F401  (their judges enter themselves)
    beyond,
    coarticulation,
    costs,
    general,
    one_armed,
    presence,
    two_armed,
)
from analysis.claims.data import Data, MissingError
from analysis.claims.register import Claim, Judged
from analysis.claims.statements import JUDGED, STATEMENTS
from analysis.statistics.hypotheses import holm

if TYPE_CHECKING:
    from analysis.study import Study

if STATEMENTS.keys() - JUDGED.keys():
    without = ", ".join(STATEMENTS.keys() - JUDGED.keys())
    raise ValueError(f"claims of claims.toml without a judge that is imported here: {without}")
CLAIMS: tuple[Claim, ...] = tuple(JUDGED[name] for name in STATEMENTS)
_COLUMNS = (
    *("id", "section", "statement", "verdict", "fitted", "evidence", "test"),
    *("p", "adjusted_p", "contrary_p", "adjusted_contrary_p"),
    *("place", "quote", "figure", "runs", "sources"),
)


def judge(study: Study, claims: Iterable[Claim] = CLAIMS) -> list[Judged]:
    """Every claim with its verdict, p-values corrected over all of them (Holm)."""
    found = [_seen(claim, Data(study)) for claim in claims]
    adjusted = holm([entry.p for entry in found]), holm([entry.contrary_p for entry in found])
    return [
        replace(entry, adjusted_p=p, adjusted_contrary_p=contrary)
        for entry, p, contrary in zip(found, *adjusted, strict=True)
    ]


def _seen(claim: Claim, data: Data) -> Judged:
    try:
        finding = claim.judge(data)
    except MissingError as missing:
        return Judged(None, f"not judged: {missing}", claim=claim)
    run_ids, sources = (tuple(dict.fromkeys(read)) for read in (data.run_ids, data.others))
    return Judged(**vars(finding), claim=claim, run_ids=run_ids, sources=sources)


def register_table(judged: Iterable[Judged]) -> pd.DataFrame:
    """One row per claim, its columns attributes of :class:`Claim` and :class:`Judged`.

    ``runs``: ids, space-separated.
    """
    rows = [
        {
            **vars(entry.claim),
            **vars(entry),
            "verdict": entry.verdict,
            **{"p": entry.p, "contrary_p": entry.contrary_p},
            "runs": " ".join(entry.run_ids),
            "sources": ", ".join(entry.sources),
        }
        for entry in judged
    ]
    return pd.DataFrame(rows, columns=_COLUMNS)
