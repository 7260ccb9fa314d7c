"""Published against ours: learned rewards of the paper's cells, whole and by hand sequence."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from coartic.analysis.cells import CellRuns
from coartic.analysis.methods import LEARNER
from coartic.analysis.published import RUNS, TRIALS, PublishedCell, Summary, published_cell
from coartic.analysis.statistics.equivalence import Equivalence, difference
from coartic.analysis.study import Study, cached
from coartic.robot import Array


@dataclass(frozen=True)
class PaperRow:
    """A cell of the paper, or its runs that learned one hand sequence, beside our runs."""

    cell: CellRuns
    hands: str
    """Empty for the whole cell."""
    published: Summary | None
    published_runs: int | None
    """Printed number; of hands 0 only where all others are printed."""
    rewards: Array
    """Learned, of our runs with a solution, shape ``(n,)``."""

    @cached_property
    def difference(self) -> Equivalence | None:
        """Ours less published; None where either is missing."""
        paper = self.published
        if paper is None or not len(self.rewards):
            return None
        return difference(self.rewards, paper.mean, paper.sd, paper.runs)

    @property
    def comparable(self) -> bool:
        """Whether all our runs have as many trials as the paper's."""
        return bool((self.cell.good.trials == TRIALS).all())

    @property
    def verdict(self) -> str | None:
        """Of :class:`Equivalence`, for runs that are comparable."""
        return self.difference.verdict if self.difference and self.comparable else None


def published_of(cell: CellRuns) -> PublishedCell | None:
    """What the paper prints about a cell: about its own learner as it stands."""
    if not cell.method.startswith(LEARNER) or cell.variant:
        return None
    return published_cell(cell.task, cell.method.removeprefix(LEARNER))


@cached
def paper_rows(study: Study) -> list[PaperRow]:
    """Every cell that the paper has too, in the order of the plan."""
    rows = []
    for cell in study.cells.values():
        paper = published_of(cell)
        if paper is not None:
            runs = paper.summary and paper.summary.runs
            rows.append(PaperRow(cell, "", paper.summary, runs, cell.rewards))
    return rows


@cached
def sequence_rows(study: Study) -> list[PaperRow]:
    """The same by hand sequence, where the paper or our runs tell several apart.

    Those that the paper prints come first, then ours by their number of runs.
    """
    rows = []
    for cell in study.cells.values():
        paper, hands = published_of(cell), cell.good.hands
        if paper is None or not (paper.sequences or hands.nunique() > 1):
            continue
        printed = paper.sequences
        complete = sum(summary.printed_runs or 0 for summary in printed.values()) == RUNS
        for name in dict.fromkeys([*printed, *map(str, hands.value_counts().index)]):
            rewards = cell.rewards[(hands == name).to_numpy(bool)]
            summary, runs = None, 0 if complete else None
            if name in printed:
                summary, runs = printed[name], printed[name].printed_runs
            rows.append(PaperRow(cell, name, summary, runs, rewards))
    return rows
