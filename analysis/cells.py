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


def typical_run(cell: CellRuns) -> int:
    """Index among the solved runs of the one whose reward is nearest to their median."""
    return int(np.abs(cell.rewards - np.median(cell.rewards)).argmin())
