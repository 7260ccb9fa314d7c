"""The claims that are judged: rows of ``claims.toml``, which says what the fields are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from coartic.analysis.statistics.estimates import LEVEL, Estimate
from coartic.analysis.words import read_beside
from coartic.inputs import FileData

_REGISTER = read_beside(__file__, "claims")
HISTORY: dict[str, dict[str, Any]] = _REGISTER.pop("margins")
"""Every margin with its value, the reason for it, and its history where it was changed."""
MARGINS: dict[str, float] = {name: float(row["value"]) for name, row in HISTORY.items()}

Verdict = Literal["supported", "not supported", "undecided", "depends on the goals"]
Group = Literal["paper", "beside", "families"]
"""Which claims are corrected together: the paper's on its own cells, with runs beside them, on
families of random tasks."""


@dataclass(frozen=True)
class Finding:
    """What was seen of one claim, before any correction of its tests."""

    holds: bool | None
    """Whether what the claim says is seen; None where that cannot be said."""
    evidence: str
    tests: tuple[Estimate, ...] = ()
    """Tests that it rests on, turned so that a positive estimate is as claimed."""
    against: tuple[Estimate, ...] | None = None
    """Tests of the opposite, any of which refutes it; None: the other tails of ``tests``."""

    @property
    def p(self) -> float:
        """Largest p-value of the tests, which must all hold; NaN where nothing is tested."""
        return max((t.p for t in self.tests if not math.isnan(t.p)), default=math.nan)

    @property
    def opposite_p(self) -> float:
        """Smallest p-value of the opposites times their number (Bonferroni); NaN without any.

        The other tail of a test by resampling counts the observed sample as well. Exact tests
        come with their opposites (``against``).
        """
        if self.against is not None:
            every = [test.p for test in self.against]
        else:
            every = [min(1.0, 1 - test.p + 1 / (test.resamples + 1)) for test in self.tests]
        tested = [p for p in every if not math.isnan(p)]
        return min(1.0, min(tested) * len(tested)) if tested else math.nan

    def verdict(self, p: float, opposite_p: float) -> Verdict:
        """The verdict of the tests alone, by p-values that may be corrected."""
        untested = any(math.isnan(test.p) and min(test.n) < 2 for test in self.tests)
        if self.holds is None or (self.holds and untested):
            return "undecided"
        if self.holds:
            # NaN: counted exactly, or no spread in any sample.
            return "undecided" if p >= LEVEL else "supported"
        certain = not self.tests or any(
            test.value <= 0 and math.isnan(test.p) and min(test.n) > 1 for test in self.tests
        )
        return "not supported" if certain or opposite_p < LEVEL else "undecided"


class Claim(FileData):
    """One statement of the paper."""

    id: str
    section: str
    statement: str
    exact: bool = False
    fitted: bool = False
    sets: str = ""
    depends: bool = False
    beside: bool = False
    families: bool = False
    short: str = ""
    """In a few words, for the three claims that carry the paper's point."""
    place: str
    quote: str
    figure: str = ""

    @property
    def group(self) -> Group | None:
        """Which claims it is corrected with; None for what is counted exactly."""
        if self.exact:
            return None
        if self.families:
            return "families"
        return "beside" if self.beside else "paper"


CLAIMS: Mapping[str, Claim] = {
    name: Claim(id=name, section=section, **row)
    for section, rows in _REGISTER.items()
    for name, row in rows.items()
}
"""Every claim by its id, in the order of the register."""
