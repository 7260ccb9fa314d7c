"""All claims, in the order of the page."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import pandas as pd

from coartic.analysis.claims import (  # noqa: F401  (their judges enter themselves)
    beyond,
    coarticulation,
    costs,
    families,
    general,
    one_armed,
    presence,
    rules,
    two_armed,
)
from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.power import Chances, powers, seen_over_instances
from coartic.analysis.claims.register import Claim, Correction, Judged
from coartic.analysis.claims.statements import JUDGED, STATEMENTS
from coartic.analysis.statistics.hypotheses import holm

if TYPE_CHECKING:
    from coartic.analysis.study import Study

if STATEMENTS.keys() - JUDGED.keys():
    without = ", ".join(STATEMENTS.keys() - JUDGED.keys())
    raise ValueError(f"claims of claims.toml without a judge that is imported here: {without}")
CLAIMS: tuple[Claim, ...] = tuple(JUDGED[name] for name in STATEMENTS)
_UNKNOWN = Chances(math.nan, math.nan)
_COLUMNS = (
    *("id", "section", "statement", "verdict", "fitted", "evidence", "rule", "test", "beside"),
    "correction",
    *("p", "adjusted_p", "contrary_p", "adjusted_contrary_p", "power", "contrary_power"),
    *("reconstructions", "place", "quote", "figure", "runs", "sources"),
)


def asked(study: Study) -> tuple[Claim, ...]:
    """Claims about such tasks as a folder has: instances of families, or others."""
    drawn = {task.family is not None for task in study.tasks.values()}
    return tuple(claim for claim in CLAIMS if bool(claim.families) in (drawn or {False}))


def judge(study: Study, claims: Iterable[Claim] | None = None) -> list[Judged]:
    """Every claim with its verdict, p-values corrected over its family of ``claims`` (Holm).

    By default those that are :func:`asked`. A family are the tested claims on the paper's cells,
    those that take other runs as well, or those on random tasks, whether the folder can judge them
    or not.
    """
    claims = asked(study) if claims is None else tuple(claims)
    sizes = family_sizes(claims)
    runs = {key: len(cell.good) for key, cell in study.cells.items() if len(cell.good)}
    chances = powers(claims, runs)
    found = [_seen(claim, Data(study)) for claim in claims]
    adjusted: dict[tuple[int, str], float] = {}
    for correction, size in sizes.items():
        own = [e for e in found if e.claim.tested and e.claim.correction == correction]
        for name in ("p", "contrary_p"):
            of_claims = holm([getattr(entry, name) for entry in own], size)
            adjusted |= {(id(entry), name): p for entry, p in zip(own, of_claims, strict=True)}
    return [
        replace(
            entry,
            adjusted_p=adjusted.get((id(entry), "p"), math.nan),
            adjusted_contrary_p=adjusted.get((id(entry), "contrary_p"), math.nan),
            power=chances.get(entry.claim.id, _UNKNOWN).supported,
            contrary_power=chances.get(entry.claim.id, _UNKNOWN).refuted,
            visible=seen_over_instances(entry.samples, sizes["families"])
            if entry.samples
            else math.nan,
        )
        for entry in found
    ]


def family_sizes(claims: Iterable[Claim] = CLAIMS) -> dict[Correction, int]:
    """Tested claims by what they are corrected with."""
    return Counter(claim.correction for claim in claims if claim.tested)


def _seen(claim: Claim, data: Data) -> Judged:
    try:
        finding = claim.judge(data)
    except MissingError as missing:
        return Judged(None, f"not judged: {missing}", claim=claim)
    run_ids = tuple(dict.fromkeys(data.run_ids))
    return Judged(**vars(finding), claim=claim, run_ids=run_ids, others=data.others)


def register_table(judged: Iterable[Judged]) -> pd.DataFrame:
    """One row per claim, its columns attributes of :class:`Claim` and :class:`Judged`.

    ``runs``: ids, space-separated.
    """
    rows = [
        {
            **vars(entry.claim),
            **vars(entry),
            "reconstructions": entry.claim.reconstructions,
            "verdict": entry.verdict,
            "correction": entry.claim.correction if entry.claim.tested else "",
            **{"p": entry.p, "contrary_p": entry.contrary_p},
            "runs": " ".join(entry.run_ids),
            "sources": ", ".join(entry.sources),
        }
        for entry in judged
    ]
    return pd.DataFrame(rows, columns=_COLUMNS)
