"""Which methods show which signatures of coarticulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from analysis.claims.coarticulation import prepared_by_waiting
from analysis.claims.data import ASCENDING, DESCENDING, ONE, Data, MissingError, rewards_of
from analysis.claims.evidence import measured
from analysis.claims.one_armed import context_distance, sacrifice
from analysis.claims.register import Finding
from analysis.comparisons.methods import LEARNER
from analysis.report.document import CellKey, Column, Row, Value
from analysis.statistics.estimates import LEVEL
from analysis.words import NONE

REPRESENTATIVES = (
    ("learner", f"{LEARNER}EC1", f"{LEARNER}EC4"),
    ("CMA-ES", "cma-es/bandit", "cma-es/bandit"),
    (
        "shortest path",
        "trajectory-optimisation/path-length",
        "trajectory-optimisation/path-length",
    ),
    (
        "least squared changes",
        "trajectory-optimisation/squared-changes",
        "trajectory-optimisation/squared-changes",
    ),
    ("least jerk", "trajectory-optimisation/jerk", "trajectory-optimisation/jerk"),
    (
        "two-goal planning",
        "posture-based/two-goals",
        "posture-based/two-goals hands=every, other_arm=free",
    ),
    (
        "one-goal planning",
        "posture-based/one-goal",
        "posture-based/one-goal hands=every, other_arm=free",
    ),
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


class _Shown(NamedTuple):
    """Whether a method shows a signature, and the numbers that say so."""

    present: bool
    numbers: tuple[float, ...]
    words: str

    @property
    def text(self) -> str:
        """``yes, 0.43``."""
        return f"{_ANSWERS[self.present]}{', ' * bool(self.words)}{self.words}"


_ANSWERS = {True: "yes", False: "no"}


def _context(data: Data, label: str) -> _Shown | None:
    apart = context_distance(data, label)
    if apart is None:
        return None
    try:
        p = data.signature(ASCENDING, label, "context dependence", 1).p
    except MissingError:
        p = math.nan
    return _Shown(apart > STEP_APART and not p >= LEVEL, (apart,), f"{apart:.2f}")


def _sacrifice(data: Data, label: str) -> _Shown | None:
    try:
        runs = data.signature(ASCENDING, label, "first subtask sacrificed")
    except MissingError:
        return None
    ticks = sacrifice(data, label)
    assert ticks is not None
    low = runs.value if math.isnan(runs.low) else runs.low
    return _Shown(bool(low > 0.5), ticks, f"{ticks[0]:+.1f}, {ticks[1]:+.1f}")


def _equivalence(data: Data, label: str) -> _Shown | None:
    context = _context(data, label)
    if context is None:
        return None
    same, other = (
        data.signature(ASCENDING, label, name, 1).value
        for name in ("motor-equivalent part", "non-motor-equivalent part")
    )
    present = context.present and same > other
    return _Shown(present, (same, other), f"{same:.3f} and {other:.3f}")


def _preshaping(data: Data, label: str) -> _Shown | None:
    try:
        own = prepared_by_waiting(data.cell(ONE, label))
    except MissingError:
        return None
    if not len(own):
        return None
    nearer = float(own.mean())
    return _Shown(nearer > STEP_APART, (nearer,), f"{nearer:+.2f}")


def _lead(data: Data, label: str) -> _Shown | None:
    try:
        data.runs(ASCENDING, label)
        several = len(data.runs(DESCENDING, label)) > 1
        lead = data.signature(ASCENDING, label, "lead time", 1).value
    except MissingError:
        seen = context_distance(data, label) is not None and several
        return _Shown(False, (math.nan,), "") if seen else None
    return _Shown(lead > 0, (lead,), f"{lead:.0f} ticks")


def _turning(data: Data, label: str) -> _Shown | None:
    try:
        own, initial = (
            sum(data.signature(ASCENDING, name, "turning angle", goal).value for goal in (1, 2))
            for name in (label, _INITIAL)
        )
    except MissingError:
        return None
    return _Shown(own <= initial - TURN_APART, (own,), f"{own:.2f} rad")


class _Sign(NamedTuple):
    """A signature whose presence is asked for."""

    name: str
    show: Callable[[Data, str], _Shown | None]
    numbers: tuple[Column, ...]
    said: str = ""
    """What the numbers in brackets are, in words."""
    tasks: tuple[str, ...] = (ASCENDING, DESCENDING)
    """Tasks whose runs it rests on."""
    beside: tuple[CellKey, ...] = ()
    """What else it rests on."""

    def label(self, one: str, two: str) -> str:
        """Of a method's labels on one-armed and on two-armed tasks, that which is looked at."""
        return two if self.tasks == (ONE,) else one

    def cells(self, one: str, two: str) -> tuple[CellKey, ...]:
        """What its values rest on."""
        return (*((task, self.label(one, two)) for task in self.tasks), *self.beside)

    @property
    def head(self) -> str:
        """Its name with what stands behind it in words."""
        return f"{self.name} ({self.said})" if self.said else self.name


def _number(name: str, header: str, unit: str = "", digits: int = 2) -> Column:
    return Column(name, header, "number", unit, digits, rests_on=("runs",), printed=False)


_SIGNS = (
    _Sign("context", _context, (_number("context_distance", "postures apart"),)),
    _Sign(
        "sacrifice",
        _sacrifice,
        (
            _number("first_change", "first movement", "ticks", 1),
            _number("total_change", "all movements", "ticks", 1),
        ),
        "first, all",
        (ASCENDING,),
    ),
    _Sign(
        "motor-equivalent",
        _equivalence,
        (
            _number("equivalent_part", "motor-equivalent part", digits=3),
            _number("other_part", "other part", digits=3),
        ),
    ),
    _Sign(
        "preshaping",
        _preshaping,
        (_number("nearer", "waiting hand nearer"),),
        tasks=(ONE,),
    ),
    _Sign("lead", _lead, (_number("lead_time", "lead time", "ticks", 0),)),
    _Sign(
        "turning",
        _turning,
        (_number("turning_angles", "turning angles", "rad"),),
        tasks=(ASCENDING,),
        beside=((ASCENDING, _INITIAL),),
    ),
)


def _reward(data: Data, label: str) -> float | None:
    try:
        return float(rewards_of(data.runs(ASCENDING, label)).mean())
    except MissingError:
        return None


def shared_signatures(data: Data) -> Finding:
    """Every representative that the folder has, with every signature."""
    data.runs(ASCENDING, f"{LEARNER}EC1")
    data.runs(DESCENDING, f"{LEARNER}EC1")
    rows, words = [], []
    present: dict[str, list[str] | None] = {sign.head: None for sign in _SIGNS}
    for name, one, two in REPRESENTATIVES:
        shown = [sign.show(data, sign.label(one, two)) for sign in _SIGNS]
        if not any(shown):
            continue
        reward = _reward(data, one)
        values: list[Value] = [name, reward]
        texts = [name, NONE if reward is None else f"{reward:.1f}"]
        for sign, found in zip(_SIGNS, shown, strict=True):
            texts.append(found.text if found else NONE)
            values.append(_ANSWERS[found.present] if found else None)
            values += found.numbers if found else [None] * len(sign.numbers)
            if found:
                own = present[sign.head] or []
                present[sign.head] = [*own, name] if found.present else own
        rows.append(_row(data, (name, one, two), values))
        heads = ("method", "reward (ascending)", *(sign.head for sign in _SIGNS))
        words.append(", ".join(map(" ".join, zip(heads, texts, strict=True))))
    evidence = "; ".join(
        f"{name}: {'not judged' if own is None else ', '.join(own) or 'none'}"
        for name, own in present.items()
    )
    return measured("shared-signatures", evidence, "Signatures", _columns(), rows, words)


def _columns() -> tuple[Column, ...]:
    return (
        Column("method", "method"),
        Column("reward", "reward, ascending", "number", digits=1, rests_on=("runs",)),
        *(
            column
            for sign in _SIGNS
            for column in (
                Column(_identifier(sign), sign.name, rests_on=("runs",)),
                *sign.numbers,
            )
        ),
    )


def _row(data: Data, method: tuple[str, str, str], values: list[Value]) -> Row:
    """A method's row, with the cells of the folder that its values rest on."""
    name, one, two = method

    def known(cells: Iterable[CellKey]) -> tuple[CellKey, ...]:
        return tuple(cell for cell in cells if cell in data.study.cells)

    both = known((task, one) for task in (ASCENDING, DESCENDING))
    by_column = {"reward": known([(ASCENDING, one)])}
    for sign in _SIGNS:
        names = (_identifier(sign), *(column.name for column in sign.numbers))
        by_column |= dict.fromkeys(names, known(sign.cells(one, two)))
    apart = {column: cells for column, cells in by_column.items() if cells != both}
    return Row(name, tuple(values), both, apart)


def _identifier(sign: _Sign) -> str:
    return sign.name.replace("-", "_")
