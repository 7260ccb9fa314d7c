"""In how many reconstructions of the two-armed tasks each claim holds.

``ensemble.csv`` has a row for each claim and task whose goals were replaced by those of every
member of its ensemble (docs/reconstruction.md): counts of verdicts, by p-values without
correction. Members are no random sample, so these counts are no probabilities.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import load_task


@cache
def held_by(claim: str) -> tuple[Any, ...]:
    """Counts of verdicts on a claim, a row a task; none unless it rests on two-armed tasks.

    ``task`` whose goals are the members'; how often ``supported``, ``refuted``, of ``members``.
    """
    table = pd.read_csv(Path(__file__).with_suffix(".csv"))
    return tuple(table[table.claim == claim].itertuples())


def held_in_words(rows: Iterable[Any]) -> str:
    """``231 of 242 (Two-armed 1, refuted in 3)``, or that there is no count.

    There is none where all members were admitted by the claim, and where it takes other runs than
    the paper's conditions.
    """
    parts = []
    for held in rows:
        refuted = f", refuted in {held.refuted}" if held.refuted else ""
        parts.append(f"{held.supported} of {held.members} ({load_task(held.task).label}{refuted})")
    return "; ".join(parts) or "not counted"


def rarely_supported(rows: Iterable[Any]) -> bool:
    """Whether at most half of the admissible goals of some task support a claim."""
    return any(2 * held.supported <= held.members for held in rows)
