"""Which methods show which signatures of coarticulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from coartic.analysis.claims.coarticulation import prepared_by_waiting
from coartic.analysis.claims.data import ASCENDING, DESCENDING, ONE, Data, MissingError
from coartic.analysis.claims.evidence import measured
from coartic.analysis.claims.one_armed import context_distance, sacrifice
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import MARGINS, decides
from coartic.analysis.methods import EC1, EC4, INITIAL
from coartic.analysis.report.document import CellKey, Row, Value
from coartic.analysis.statistics.estimates import LEVEL

_PLAN, _POSTURES = "trajectory-optimisation/", "posture-based/"
_FREE = " hands=every, other_arm=free"
REPRESENTATIVES = (
    ("learner", EC1, EC4),
    ("CMA-ES", "cma-es/bandit", "cma-es/bandit"),
    ("shortest path", f"{_PLAN}path-length", f"{_PLAN}path-length"),
    ("least squared changes", f"{_PLAN}squared-changes", f"{_PLAN}squared-changes"),
    ("least jerk", f"{_PLAN}jerk", f"{_PLAN}jerk"),
    ("two-goal planning", f"{_POSTURES}two-goals", f"{_POSTURES}two-goals{_FREE}"),
    ("one-goal planning", f"{_POSTURES}one-goal", f"{_POSTURES}one-goal{_FREE}"),
    ("nullspace control", "nullspace-qp/next-goal", "nullspace-qp/next-goal"),
    ("corrective alone", INITIAL, "corrective-alone/every"),
)
"""Name, label on the one-armed tasks, label on the two-armed ones."""
STEP_APART, TURN_APART = MARGINS["steps"], MARGINS["turn"]

Seen = tuple[bool, tuple[float, ...]]
"""Whether a method shows a signature, and the numbers that say so."""


def _context(data: Data, label: str) -> Seen:
    apart, p = context_distance(data, label), math.nan
    with suppress(MissingError):
        p = data.signature(ASCENDING, label, "context dependence", 1).p
    return apart > STEP_APART and not p >= LEVEL, (apart,)


def _sacrifice(data: Data, label: str) -> Seen:
    runs = data.signature(ASCENDING, label, "first subtask sacrificed")
    low = runs.value if math.isnan(runs.low) else runs.low
    return low > 0.5, sacrifice(data, label)


def _equivalence(data: Data, label: str) -> Seen:
    present, _ = _context(data, label)
    same, other = (
        data.signature(ASCENDING, label, name, 1).value
        for name in ("motor-equivalent part", "non-motor-equivalent part")
    )
    return present and same > other, (same, other)


def _preshaping(data: Data, label: str) -> Seen:
    own = prepared_by_waiting(data.cell(ONE, label))
    if not len(own):
        raise MissingError(f"no run of {label} on {ONE} uses both hands")
    nearer = float(own.mean())
    return nearer > STEP_APART, (nearer,)


def _lead(data: Data, label: str) -> Seen:
    data.runs(ASCENDING, label)
    several = len(data.runs(DESCENDING, label)) > 1
    try:
        lead = data.signature(ASCENDING, label, "lead time", 1).value
    except MissingError:
        if not several:
            raise
        context_distance(data, label)  # without one there is nothing to be led
        return False, (math.nan,)
    return lead > 0, (lead,)


def _turning(data: Data, label: str) -> Seen:
    own, initial = (
        sum(data.signature(ASCENDING, name, "turning angle", goal).value for goal in (1, 2))
        for name in (label, INITIAL)
    )
    return own <= initial - TURN_APART, (own,)


class _Sign(NamedTuple):
    """A signature whose presence is asked for; its column has its name."""

    name: str
    show: Callable[[Data, str], Seen]
    numbers: tuple[str, ...]
    """Columns of its numbers."""
    two_armed: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """Whether it is there, and its numbers."""
        return (self.name.replace("-", "_"), *self.numbers)


_SIGNS = (
    _Sign("context", _context, ("context_distance",)),
    _Sign("sacrifice", _sacrifice, ("first_change", "total_change")),
    _Sign("motor-equivalent", _equivalence, ("equivalent_part", "other_part")),
    _Sign("preshaping", _preshaping, ("nearer",), two_armed=True),
    _Sign("lead", _lead, ("lead_time",)),
    _Sign("turning", _turning, ("turning_angles",)),
)


@decides("shared-signatures")
def _shared_signatures(data: Data) -> Finding:
    """Every representative that the folder has, with every signature."""
    data.runs(ASCENDING, EC1)
    data.runs(DESCENDING, EC1)
    rows = []
    shown: dict[str, list[str]] = {}
    for name, one, two in REPRESENTATIVES:
        seen = [data.recorded(sign.show, two if sign.two_armed else one) for sign in _SIGNS]
        if not any(found for found, _ in seen):
            continue
        reward, cells = data.recorded(lambda own, label: own.row(ASCENDING, label).reward, one)
        values: list[Value] = [name, reward]
        by_column: dict[str, tuple[CellKey, ...]] = {}
        for sign, (found, own) in zip(_SIGNS, seen, strict=True):
            if found is None:
                values += [None] * len(sign.columns)
            else:
                present, numbers = found
                values += ["yes" if present else "no", *numbers]
                shown.setdefault(sign.name, []).extend([name] * present)
            by_column |= {column: own for column in sign.columns if own != cells}
        rows.append(Row(name, tuple(values), cells, by_column))
    evidence = "; ".join(
        f"{sign.name}: "
        + (", ".join(shown[sign.name]) or "none" if sign.name in shown else "not judged")
        for sign in _SIGNS
    )
    return measured("shared-signatures", evidence, rows)
