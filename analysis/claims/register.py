"""The claims that are judged: rows of ``claims.toml``, which says what the fields are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from coartic.analysis.methods import KNOWN_METHODS, name_of
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.statistics.estimates import Estimate
from coartic.analysis.words import read_beside
from coartic.inputs import FileData

_FILE = read_beside(__file__, "claims")
HISTORY: dict[str, dict[str, Any]] = _FILE.pop("margins")
"""Every margin with its value, the reason for it, and its history where it was changed."""
MARGINS: dict[str, float] = {name: float(row["value"]) for name, row in HISTORY.items()}

Verdict = Literal["supported", "not supported", "undecided", "depends on the goals"]
Group = Literal["paper", "beside", "families", "ours", "flawed"]
"""Which claims are corrected together: the paper's on its own cells, with runs beside them, on
families of random tasks; claims of our own, those on one suite, and those that are flawed apart."""

_HANDS = "[LR]+"
QUANTITIES = {
    "replay": "reward of a replay without noise after learning",
    "early": "share of movements that are corrected, in the first tenth of the trials",
    "late": "share of movements that are corrected, in the last tenth of the trials",
    "last": "share of movements that are corrected, in the learned solution",
    "resemblance": "share of the distance of the initial solution to the plan for least squared "
    "changes that learning has covered (postures at the goals)",
}
for _name, _sign in SIGNS.items():
    QUANTITIES[_name.replace(" ", "-")] = _sign.words
    QUANTITIES[f"replayed-{_name.replace(' ', '-')}"] = (
        f"in noiseless replays, {_sign.in_short or _sign.words}"
    )
"""What is measured of runs beside their reward, by its name in comparisons."""
_WHAT = "|".join(QUANTITIES)
_METHODS = "|".join(name for name in KNOWN_METHODS if "/" not in name)
_WHO = rf"EC\S*|initial|best|\S+/.+?|{_METHODS}"
_SIDE = rf"(?:(?P<what>{_WHAT}) )?(?P<who>{_WHO})(?: (?P<hands>{_HANDS}))?"


class Side(NamedTuple):
    """One side of a comparison."""

    what: str
    """A name of :data:`QUANTITIES`, or ``reward``; ``number`` for 0."""
    who: str
    """Condition, ``initial`` solution, ``best`` hand sequence of the corrective process alone, or
    label of a method."""
    hands: str = ""
    """Only the runs that learned this sequence, where it is named."""

    def __str__(self) -> str:
        who = name_of(self.who) if is_method(self.who) else self.who
        return " ".join(filter(None, ("replay of" * (self.what == "replay"), who, self.hands)))


def is_method(who: str) -> bool:
    """Whether one side of a comparison is a method by its id or label."""
    return "/" in who or who in KNOWN_METHODS


def read_side(text: str) -> Side:
    """A side as it is written, such as ``replay EC2 RRRR``."""
    match = re.fullmatch(_SIDE, text)
    if match is None:
        return Side("number", text)
    return Side(match["what"] or "reward", match["who"], match["hands"] or "")


def read_comparison(pair: str) -> tuple[Side, Side, float]:
    """Both sides of a comparison such as ``arm EC4 > 0 by ticks``, and its margin."""
    first, second = pair.split(" > ")
    second, _, margin = second.partition(" by ")
    return read_side(first), read_side(second), MARGINS[margin] if margin else 0.0


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
    failed: tuple[tuple[str, str], ...] = ()
    """Cells that it lacks, as some of their runs failed: task, and label of the method."""


class Claim(FileData):
    """One statement, of the paper where it has a place, and how it is decided."""

    id: str
    section: str
    statement: str
    rule: str = ""
    test: str = ""
    exact: bool = False
    fitted: bool = False
    short: str = ""
    """In a few words, for the three claims that carry the paper's point."""
    beside: bool = False
    pairs: Mapping[str, Sequence[str]] = {}
    shown: Mapping[str, Sequence[str]] = {}
    runs: Mapping[str, Sequence[str]] = {}
    cells: Mapping[str, Sequence[str]] = {}
    families: Sequence[str] = ()
    compared: Sequence[str] = ()
    uncounted: str = ""
    """Why its verdict does not count for or against the model; empty where it does."""
    suite: str = ""
    power: str = ""
    place: str = ""
    quote: str = ""
    figure: str = ""

    @property
    def group(self) -> Group | None:
        """Which claims it is corrected with; None for what is counted exactly."""
        if self.exact:
            return None
        if not self.place:
            return "flawed" if self.uncounted else "ours"
        if self.families:
            return "families"
        return "beside" if self.beside else "paper"


CLAIMS: Mapping[str, Claim] = {
    name: Claim(id=name, section=section, **row)
    for section, rows in _FILE.items()
    for name, row in rows.items()
}
"""Every claim by its id, in the order of the register."""
