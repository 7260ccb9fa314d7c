"""What a signature is, and one value of it: a row of a table, with the place it belongs to."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from coartic.analysis.statistics.estimates import Estimate
from coartic.analysis.words import read_beside
from coartic.inputs import FileData

COLUMNS = {
    "signature": "", "where": "", "value": math.nan, "low": math.nan, "high": math.nan,
    "p": math.nan, "n": 0, "unit": "", "why_not": "",
}  # fmt: skip
"""Columns of a value, with what they hold where there is none: ``low`` and ``high`` of the interval
at 95 %, ``p`` without correction, ``n`` runs that went into it; ``why_not`` says why there is no
value, interval or test."""
PLACE: dict[str, Any] = {
    "goal": None, "hand": "", "against": "", "moving": None, "joint": "", "longest": None,
}  # fmt: skip
"""Where in a solution, and between which tasks, a value belongs: number of the goal (from 1); hand;
task that is the other context; number of the goal that moves between tasks; joint; ticks that a
lead can have at most. What does not apply is None, or empty."""
Row = dict[str, Any]
"""A value by :data:`COLUMNS` and :data:`PLACE`."""
Rows = Iterator[Row]


class Signature(FileData):
    """One signature, as a row of ``register.toml``, which says what the fields are."""

    name: str
    two_hands: bool = False
    missing: str = ""
    unit: str
    range: str = "share of runs"
    by_goal: bool = False
    share: bool = False
    meaning: str
    sources: tuple[str, ...] = ()

    @property
    def extent(self) -> str:
        """Unit and range, and whether there is one of each goal."""
        return self.range + ", by goal" * self.by_goal


_FILE = read_beside(__file__, "register")
WITHIN, CONTEXTS, FAMILIES = (
    tuple(Signature(name=name, **row) for name, row in _FILE[kind].items())
    for kind in ("within", "contexts", "families")
)
"""Signatures of one method's runs on one task, of one goal in two contexts, and of tasks that
differ in one goal."""
REGISTER = {signature.name: signature for signature in (*WITHIN, *CONTEXTS, *FAMILIES)}
"""All signatures by name."""


def where(place: Row) -> str:
    """A place in words: ``goal 1, right hand, against descending, of at most 141``."""
    goal, hand, against, moving, joint, longest = {**PLACE, **place}.values()
    parts = [] if goal is None else [f"goal {goal}"]
    if moving is not None:
        kind = "anticipatory" if goal is None or goal < moving else "carry-over"
        parts.append(f"{kind} of goal {moving}")
    parts += [f"{hand} hand"] if hand else []
    parts += [f"against {against}"] if against else []
    parts += [joint] if joint else []
    parts += [] if longest is None else [f"of at most {longest}"]
    return ", ".join(parts)


def row(signature: str, place: Row, **values: Any) -> Row:
    """A value of a signature at a place, in its unit; ``values`` by :data:`COLUMNS`."""
    names = {"signature": signature, "where": where(place), "unit": REGISTER[signature].unit}
    return {**COLUMNS, **names, **values, **PLACE, **place}


def estimated(signature: str, place: Row, of: Estimate, n: int, **values: Any) -> Row:
    """A row for a value with its interval or test, over ``n`` runs."""
    why = "one run: no interval" if n == 1 else ""
    numbers = {"value": of.value, "low": of.low, "high": of.high, "p": of.p}
    return row(signature, place, **{"why_not": why, "n": n, **numbers, **values})


def without(
    signatures: Iterable[Signature], why: str, place: Row | None = None, n: int = 0
) -> Rows:
    """Rows of signatures none of which applies, and why."""
    for signature in signatures:
        yield row(signature.name, place or {}, n=n, why_not=why, unit="")
