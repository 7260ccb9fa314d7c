"""Cells: the runs of one method with parameters on one task."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from coartic.robot import Array
from coartic.runs.plan import label_of

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its name with its variant."""


@dataclass(frozen=True)
class CellRuns:
    """One method with parameters on one task, and its runs."""

    task: str
    method: str
    variant: str
    runs: pd.DataFrame

    @property
    def label(self) -> str:
        """The method with its variant."""
        return label_of(self.method, self.variant)

    @cached_property
    def good(self) -> pd.DataFrame:
        """The runs that have a solution."""
        solved = self.runs["status"] == "ok"
        return self.runs if solved.all() else self.runs[solved]

    @cached_property
    def rewards(self) -> Array:
        """Of those runs, shape ``(n,)``."""
        return self.good.reward.to_numpy(dtype=np.float64)


COMMON = 0.2
"""Share of a cell's runs from which on a hand sequence is common."""


def common_sequences(cell: CellRuns) -> list[str]:
    """Hand sequences that :data:`COMMON` of the solved runs have, commonest first; at least one.

    Those that are as common stand in the order of the alphabet.
    """
    counts = cell.good.hands.value_counts()
    ordered = sorted(counts.items(), key=lambda item: (-int(item[1]), str(item[0])))
    least = COMMON * int(counts.sum())
    return [str(hands) for hands, count in ordered if count >= least] or [str(ordered[0][0])]


def typical_run(cell: CellRuns, hands: str | None = None) -> int:
    """Index among the solved runs of the one whose reward is nearest to their median.

    ``hands``: of the runs with this hand sequence.
    """
    chosen = np.arange(len(cell.good))
    if hands is not None:
        chosen = np.flatnonzero(cell.good.hands == hands)
    rewards = cell.rewards[chosen]
    return int(chosen[np.abs(rewards - np.median(rewards)).argmin()])
