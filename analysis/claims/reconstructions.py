"""In how many admissible reconstructions of the two-armed tasks each claim holds.

``reconstructions.csv`` has a row a claim and a task whose goals were replaced by those of each
member of its ensemble: counts of verdicts, p-values uncorrected. It is ``shares.csv`` of
``coartic robustness`` over suite ``reconstructions`` (docs/reconstruction.md). Members are no
sample of anything: these counts are no probabilities.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import pandas as pd

DATA = Path(__file__).with_name("reconstructions.csv")


class Held(NamedTuple):
    """Verdicts of a claim over the members of an ensemble."""

    task: str
    """Whose goals are the members'."""
    supported: int
    refuted: int
    """*Not supported*."""
    members: int

    def __str__(self) -> str:
        refuted = f", refuted in {self.refuted}" if self.refuted else ""
        return f"{self.supported} of {self.members} ({self.task}{refuted})"


@cache
def _held() -> dict[str, tuple[Held, ...]]:
    table = pd.read_csv(DATA)
    found: dict[str, tuple[Held, ...]] = {}
    for row in table[table.kind != "readings"].to_dict("records"):
        members = int(row["specifications"])
        held = Held(str(row["kind"]), int(row["supported"]), int(row["not supported"]), members)
        found[row["claim"]] = (*found.get(row["claim"], ()), held)
    return found


def held_by(claim: str) -> tuple[Held, ...]:
    """Of a claim's id, by task; none for a claim that does not rest on two-armed tasks."""
    return _held().get(claim, ())
