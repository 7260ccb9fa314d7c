"""Which methods show which signatures of coarticulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from analysis.claims.coarticulation import prepared_by_waiting
from analysis.claims.data import ASCENDING, DESCENDING, ONE, Data, MissingError, rewards_of
from analysis.claims.evidence import measured
from analysis.claims.one_armed import context_distance, sacrifice
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.methods import LEARNER
from analysis.report.document import CellKey, Column, Row, Value
from analysis.statistics.estimates import LEVEL

_PLAN, _POSTURES = "trajectory-optimisation/", "posture-based/"
_FREE = " hands=every, other_arm=free"
REPRESENTATIVES = (
    ("learner", f"{LEARNER}EC1", f"{LEARNER}EC4"),
    ("CMA-ES", "cma-es/bandit", "cma-es/bandit"),
    ("shortest path", f"{_PLAN}path-length", f"{_PLAN}path-length"),
    ("least squared changes", f"{_PLAN}squared-changes", f"{_PLAN}squared-changes"),
    ("least jerk", f"{_PLAN}jerk", f"{_PLAN}jerk"),
    ("two-goal planning", f"{_POSTURES}two-goals", f"{_POSTURES}two-goals{_FREE}"),
    ("one-goal planning", f"{_POSTURES}one-goal", f"{_POSTURES}one-goal{_FREE}"),
    ("nullspace control", "nullspace-qp/next-goal", "nullspace-qp/next-goal"),
    ("corrective alone", "corrective-alone/given", "corrective-alone/every"),
)
"""Name, label on the one-armed tasks, label on the two-armed ones."""
STEP_APART = 0.1
"""Ten steps of movement: postures (length unit, rad) or shares of a way this far apart count."""
TURN_APART = 0.05
"""Turning angles this far apart count, rad."""
PRESENCE = (
    "presence: *context*, mean postures at goal 1 of the ascending and the descending task "
    "lie more than 0.1 apart (ten steps), with p < 5 % where there are several runs; "
    "*sacrifice*, most runs sacrifice the first subtask of the ascending task (Wilson's interval "
    "lies above one half, where there are several), shown are the mean ticks of the first "
    "movement and of all against the corrective process with the same hands; "
    "*motor-equivalent*, context is present and its motor-equivalent part (per root of dimension) "
    "exceeds the other; *preshaping*, on two-armed task 1 the waiting arm brings its hand nearer "
    "to its next goal, since its own last hit, by more than 0.1 of the initial distance, mean "
    "over goals and runs; *lead*, the contexts are "
    "distinguishable before goal 1 is hit; *turning*, the turning angles of the ascending task "
    "sum to at least 0.05 rad less than the initial solution's. A dash: cannot be said of the "
    "runs in this folder, and not judged where that is so of every method"
)


_INITIAL = "corrective-alone/given"
"""Whose solution of the one-armed tasks is the initial one."""

Seen = tuple[bool, tuple[float, ...]] | None
"""Whether a method shows a signature, and the numbers that say so; None: cannot be said."""


def _context(data: Data, label: str) -> Seen:
    apart = context_distance(data, label)
    if apart is None:
        return None
    try:
        p = data.signature(ASCENDING, label, "context dependence", 1).p
    except MissingError:
        p = math.nan
    return apart > STEP_APART and not p >= LEVEL, (apart,)


def _sacrifice(data: Data, label: str) -> Seen:
    runs = data.signature(ASCENDING, label, "first subtask sacrificed")
    ticks = sacrifice(data, label)
    assert ticks is not None
    low = runs.value if math.isnan(runs.low) else runs.low
    return low > 0.5, ticks


def _equivalence(data: Data, label: str) -> Seen:
    context = _context(data, label)
    if context is None:
        return None
    same, other = (
        data.signature(ASCENDING, label, name, 1).value
        for name in ("motor-equivalent part", "non-motor-equivalent part")
    )
    return context[0] and same > other, (same, other)


def _preshaping(data: Data, label: str) -> Seen:
    own = prepared_by_waiting(data.cell(ONE, label))
    nearer = float(own.mean()) if len(own) else math.nan
    return None if math.isnan(nearer) else (nearer > STEP_APART, (nearer,))


def _lead(data: Data, label: str) -> Seen:
    data.runs(ASCENDING, label)
    several = len(data.runs(DESCENDING, label)) > 1
    try:
        lead = data.signature(ASCENDING, label, "lead time", 1).value
    except MissingError:
        known = several and context_distance(data, label) is not None
        return (False, (math.nan,)) if known else None
    return lead > 0, (lead,)


def _turning(data: Data, label: str) -> Seen:
    own, initial = (
        sum(data.signature(ASCENDING, name, "turning angle", goal).value for goal in (1, 2))
        for name in (label, _INITIAL)
    )
    return own <= initial - TURN_APART, (own,)


def _reward(data: Data, label: str) -> float:
    return float(rewards_of(data.runs(ASCENDING, label)).mean())


def _number(name: str, header: str, unit: str = "", digits: int = 2) -> Column:
    return Column(name, header, "number", unit, digits, rests_on=("runs",), printed=False)


class _Sign(NamedTuple):
    """A signature whose presence is asked for."""

    name: str
    show: Callable[[Data, str], Seen]
    numbers: tuple[Column, ...]
    two_armed: bool = False

    @property
    def columns(self) -> tuple[Column, ...]:
        """Whether it is there, and its numbers."""
        return (Column(self.name.replace("-", "_"), self.name, rests_on=("runs",)), *self.numbers)


_SIGNS = (
    _Sign("context", _context, (_number("context_distance", "postures apart"),)),
    _Sign(
        "sacrifice",
        _sacrifice,
        (
            _number("first_change", "first movement", "ticks", 1),
            _number("total_change", "all movements", "ticks", 1),
        ),
    ),
    _Sign(
        "motor-equivalent",
        _equivalence,
        (
            _number("equivalent_part", "motor-equivalent part", digits=3),
            _number("other_part", "other part", digits=3),
        ),
    ),
    _Sign("preshaping", _preshaping, (_number("nearer", "waiting hand nearer"),), two_armed=True),
    _Sign("lead", _lead, (_number("lead_time", "lead time", "ticks", 0),)),
    _Sign("turning", _turning, (_number("turning_angles", "turning angles", "rad"),)),
)


@decides("shared-signatures", PRESENCE)
def _shared_signatures(data: Data) -> Finding:
    """Every representative that the folder has, with every signature."""
    data.runs(ASCENDING, f"{LEARNER}EC1")
    data.runs(DESCENDING, f"{LEARNER}EC1")
    rows = []
    shown: dict[str, list[str]] = {}
    for name, one, two in REPRESENTATIVES:
        seen = [data.recorded(sign.show, two if sign.two_armed else one) for sign in _SIGNS]
        if not any(found for found, _ in seen):
            continue
        reward, cells = data.recorded(_reward, one)
        values: list[Value] = [name, reward]
        by_column: dict[str, tuple[CellKey, ...]] = {}
        for sign, (found, own) in zip(_SIGNS, seen, strict=True):
            if found is None:
                values += [None] * len(sign.columns)
            else:
                present, numbers = found
                values += ["yes" if present else "no", *numbers]
                shown.setdefault(sign.name, []).extend([name] * present)
            by_column |= {column.name: own for column in sign.columns if own != cells}
        rows.append(Row(name, tuple(values), cells, by_column))
    columns = (
        Column("method", "method"),
        Column("reward", "reward, ascending", "number", digits=1, rests_on=("runs",)),
        *(column for sign in _SIGNS for column in sign.columns),
    )
    evidence = "; ".join(
        f"{sign.name}: "
        + (", ".join(shown[sign.name]) or "none" if sign.name in shown else "not judged")
        for sign in _SIGNS
    )
    return measured("shared-signatures", evidence, "Signatures", columns, rows)
