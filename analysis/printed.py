"""What the paper prints, entry by entry (``published.toml``).

An entry says one thing of a task, or of the model; its class is the kind of thing. What it is
said of is a task, a condition (none: the corrective process alone) and a hand sequence (none:
all runs). Its role says what it may be used for: a ``constraint`` may select what the paper does
not print, a ``test`` never does.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from coartic.errors import CoarticError
from coartic.text import did_you_mean

Condition = Literal["EC1", "EC2", "EC3", "EC4"]
Role = Literal["setting", "constraint", "test"]
Hands = Annotated[str, Field(pattern="^[LR]+$")]
Side = Literal["left", "right", "above", "below"]
Goal = Annotated[int, Field(ge=1)]
"""As the paper numbers them, from 1."""
_GENERAL = "general"


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Solved(_Frozen):
    """Solutions of a task: all runs under a condition, or those with a hand sequence.

    Without a condition: what the corrective process alone does with the hands.
    """

    condition: Condition | None = None
    hands: Hands | None = None


class _Entry(Solved):
    """What every entry says beside its content."""

    id: str
    task: str | None
    """None: the model, or every task."""
    role: Role
    quote: str
    """Words of the paper."""
    place: str
    """Section or figure of the paper."""
    claims: tuple[str, ...] = ()
    """Claims of the register that judge it."""


class _Number(_Entry):
    value: Decimal
    """With the decimals that are printed."""
    rounding: float
    """The value's half-width as printed: half a unit of its last decimal, more where derived."""
    difference_of: tuple[str, ...] = ()
    """Ids of the entries from which the value is computed, first less second."""

    @property
    def derived(self) -> bool:
        """Whether the value is computed from others rather than printed."""
        return bool(self.difference_of)

    @property
    def formula(self) -> str:
        """How a derived value is computed; empty for a printed one."""
        return " - ".join(self.difference_of)

    @property
    def digits(self) -> int:
        """Decimals that are printed."""
        return max(0, -int(self.value.as_tuple().exponent))

    @property
    def number(self) -> float:
        """The value; an integer where no decimals are printed."""
        return float(self.value) if self.digits else int(self.value)


class Constant(_Number):
    """A constant of the model or of the experiments; length unit, rad."""

    kind: Literal["constant"]


class Reward(_Number):
    """Mean total reward of the runs; of the corrective process, its one reward."""

    kind: Literal["reward"]


class Sd(_Number):
    """Standard deviation of total reward over the runs."""

    kind: Literal["sd"]


class Count(_Number):
    """Runs of the condition that learned the hand sequence."""

    kind: Literal["count"]


class Gain(_Number):
    """Mean reward less that of ``than``."""

    kind: Literal["gain"]
    than: Solved


class Order(_Entry):
    """The mean reward is above (less negative than) that of ``than``."""

    kind: Literal["order"]
    than: Solved
    p_below: Decimal | None = None
    """Printed bound of the one-tailed bootstrap test's p-value, where one is."""
    goal: Goal | None = None
    """Compared is the movement to this goal alone."""
    sample: bool = False
    """Said of a sample run, not of all."""


class Best(_Entry):
    """The hands are the best of all sequences under the corrective process alone."""

    kind: Literal["best of all sequences"]
    hands: Hands


class InitialHands(_Entry):
    """The initial solution uses these hands."""

    kind: Literal["initial hands"]
    hands: Hands


class Sequences(_Entry):
    """Hand sequences that the runs of a condition learn."""

    kind: Literal["hand sequences"]
    condition: Condition
    found: tuple[Hands, ...] = ()
    """Every one that is named; the paper names no other."""
    mixed: bool = False
    """There are several, and they are not named."""


class Base(_Entry):
    """Where the base moves horizontally."""

    kind: Literal["base"]
    left: tuple[Goal, ...] = ()
    """Goals to whose hits it moves left, from where it was at the hit before."""
    right: tuple[Goal, ...] = ()
    net: Literal["left", "right"]
    """From the start to the last hit."""
    sample: bool = False
    """Said of a sample run, not of all."""


class Layout(_Entry):
    """How the goals lie."""

    kind: Literal["layout"]
    goals: tuple[Goal, ...]
    """Those on one line."""
    same: Literal["x", "y"]
    """Their common coordinate."""
    going: Literal["up", "down"] | None = None
    """Direction of their order along the line, where it is said."""
    apart: Goal | None = None
    """The goal that is off the line,"""
    side: Side | None = None
    """and on which side."""


class Goals(_Entry):
    """Positions of all goals, in the order of hits, length unit."""

    kind: Literal["goals"]
    points: tuple[tuple[float, float], ...]


class Posture(_Entry):
    """The starting configuration. In a *steeple* the arms are up and the hands at one point."""

    kind: Literal["posture"]
    base: tuple[float, float]
    arms: Literal["extended to the right", "steeple"]


class Lock(_Entry):
    """Coordinates in which the base cannot move."""

    kind: Literal["lock"]
    locked_base: tuple[Literal["x", "y"], ...]


class Context(_Entry):
    """The learned configuration at a goal is another one than in another task."""

    kind: Literal["context"]
    goal: Goal
    other_task: str
    sample: bool = False
    """Said of a sample run, not of all."""


class Statement(_Entry):
    """What is said in words only."""

    kind: Literal["statement"]
    text: str


Entry = (
    Constant | Reward | Sd | Count | Gain | Order | Best | InitialHands | Sequences | Base
    | Layout | Goals | Posture | Lock | Context | Statement
)  # fmt: skip


def constant(name: str) -> float:
    """A general constant that the paper prints; KeyError for another."""
    entry = ENTRIES[f"{_GENERAL}.{name}"]
    if not isinstance(entry, Constant):
        raise KeyError(name)
    return entry.number


def constraints(task: str) -> tuple[Entry, ...]:
    """What is printed of a task and may select; CoarticError for a task the paper lacks."""
    return _of(task, "constraint")


def tests(task: str) -> tuple[Entry, ...]:
    """Printed results of learning on a task. Raises CoarticError for a task the paper lacks."""
    return _of(task, "test")


def _of(task: str, role: Role) -> tuple[Entry, ...]:
    tasks = list(dict.fromkeys(e.task for e in ENTRIES.values() if e.task is not None))
    if task not in tasks:
        known = f"its tasks are {', '.join(tasks)}{did_you_mean(task, tasks)}"
        raise CoarticError(f"the paper has no task {task!r}; {known}")
    return tuple(e for e in ENTRIES.values() if e.task == task and e.role == role)


def parse_entries(text: str) -> dict[str, Entry]:
    """Entries by id from the text of a table such as ``published.toml``, in its order.

    Raises pydantic's ValidationError for an entry that is not of its kind, ValueError for a
    difference of what is not there or not a number.
    """
    tables = tomllib.loads(text, parse_float=Decimal)
    rows = {f"{task}.{name}": row for task, own in tables.items() for name, row in own.items()}
    return TypeAdapter(dict[str, Annotated[Entry, Field(discriminator="kind")]]).validate_python(
        {key: dict(_complete(key, row, rows)) for key, row in rows.items()}
    )


def _complete(
    key: str, row: Mapping[str, Any], rows: Mapping[str, Mapping[str, Any]]
) -> Iterator[tuple[str, Any]]:
    """A row's fields with what follows from its place and from other rows."""
    task = key.partition(".")[0]
    yield from row.items()
    yield from {"id": key, "task": None if task == _GENERAL else task}.items()
    if "difference_of" in row:
        parts = [name if name in rows else f"{task}.{name}" for name in row["difference_of"]]
        missing = [part for part in parts if "value" not in rows.get(part, {})]
        if missing or len(parts) != 2:
            raise ValueError(f"{key}: difference_of names two printed numbers, not {parts}")
        first, second = (rows[part] for part in parts)
        yield from {"difference_of": parts, "value": first["value"] - second["value"]}.items()
        yield "rounding", 0.0 if row.get("kind") == "count" else _half(first) + _half(second)
    elif "value" in row:
        yield "rounding", _half(row)


def _half(row: Mapping[str, Any]) -> float:
    """Half a unit of the last decimal of a row's value; counts are exact."""
    exponent = Decimal(row["value"]).as_tuple().exponent
    exact = row.get("kind") in ("count", "constant")
    return 0.0 if exact else 0.5 * 10.0 ** min(0, int(exponent))


ENTRIES: Mapping[str, Entry] = parse_entries(
    Path(__file__).with_name("published.toml").read_text("utf-8")
)
"""Every entry by id, in the paper's order of tasks."""
