"""What Shah, Barto & Fagg (2013) print (``published.toml``), and its numbers by task and condition.

An entry says one thing of a task, or of the model. What it is said of is a task, a condition
(none: the corrective process alone) and a hand sequence (none: all runs).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, TypeAdapter

from coartic.analysis.words import number
from coartic.inputs import FileData

HandSequence = Annotated[str, Field(pattern="^[LR]+$")]


class Solved(FileData):
    """Solutions of a task: all runs under a condition, or those with a hand sequence.

    Without a condition: what the corrective process alone does with the hands.
    """

    condition: Literal["EC1", "EC2", "EC3", "EC4"] | None = None
    hands: HandSequence | None = None


class Printed(Solved):
    """An entry. Which fields it has beside the first ones depends on its kind.

    A ``constant`` (length unit, rad), a ``reward``, an ``sd`` and a ``count`` are numbers. A
    reward of the corrective process is one reward, else it is a mean; a ``gain`` is a mean reward
    less that of ``than``, and an ``order`` says that it is above (less negative than) that.
    """

    id: str
    task: str | None
    """None: the model, or every task."""
    role: Literal["setting", "constraint", "test"]
    """A ``constraint`` may select what the paper does not print, a ``test`` never does."""
    quote: str
    """Words of the paper."""
    place: str
    """Section or figure of the paper."""
    claims: tuple[str, ...] = ()
    """Claims of the register that judge it."""
    sample: bool = False
    """Said of a sample run, not of all."""
    kind: Literal[
        "constant", "reward", "sd", "count", "gain", "order", "best of all sequences",
        "initial hands", "hand sequences", "base", "layout", "goals", "posture", "lock", "context",
        "statement",
    ]  # fmt: skip
    value: Decimal | None = None
    """Of a number: it with its printed decimals."""
    rounding: float = 0.0
    """The value's half-width as printed: half a unit of its last decimal, more where derived."""
    difference_of: tuple[str, ...] = ()
    """Entries from which the value is computed, first less second; none: it is printed."""
    than: Solved | None = None
    p_below: Decimal | None = None
    """Order: printed bound of the one-tailed bootstrap test's p-value, where one is."""
    goal: int | None = None
    """Order: compared is the movement to this goal alone. Context: the learned configuration at
    this goal is another one than in ``other_task``."""
    other_task: str | None = None
    sequences: tuple[HandSequence, ...] = ()
    """Hand sequences: every one that is named; the paper names no other."""
    mixed: bool = False
    """Hand sequences: there are several, and they are not named."""
    left: tuple[int, ...] = ()
    """Base: goals (from 1) to whose hits it moves left, from where it was at the hit before."""
    right: tuple[int, ...] = ()
    net: Literal["left", "right"] | None = None
    """Base: where it moves from the start to the last hit."""
    goals: tuple[int, ...] = ()
    """Layout: goals on one line,"""
    same: Literal["x", "y"] | None = None
    """their common coordinate,"""
    going: Literal["up", "down"] | None = None
    """the direction of their order, where it is said,"""
    apart: int | None = None
    """the goal that is off the line,"""
    side: Literal["left", "right", "above", "below"] | None = None
    """and on which side."""
    points: tuple[tuple[float, float], ...] = ()
    """Goals: positions of all, length unit."""
    base: tuple[float, float] | None = None
    """Posture at the start: position of the base, length unit."""
    arms: Literal["extended to the right", "steeple"] | None = None
    """Posture at the start. In a steeple the arms are up and the hands at one point."""
    locked_base: tuple[Literal["x", "y"], ...] = ()
    """Lock: coordinates in which the base cannot move."""
    text: str = ""
    """Statement: what is said in words only."""

    @property
    def digits(self) -> int:
        """Decimals that are printed."""
        return max(0, -int((self.value or Decimal()).as_tuple().exponent))

    @property
    def number(self) -> float:
        """The value; an integer where no decimals are printed."""
        value = self.value or Decimal()
        return float(value) if self.digits else int(value)

    @property
    def in_words(self) -> str:
        """The value, which says whether it was derived."""
        return printed_words(self.number, bool(self.difference_of))


def printed_words(value: float, derived: bool) -> str:
    """A printed number, which says whether it was derived from others."""
    return f"{number(value)}{' (derived)' * derived}"


def parse_entries(text: str) -> dict[str, Printed]:
    """Entries by id from the text of a table such as ``published.toml``, in its order."""
    rows: dict[str, dict[str, Any]] = {}
    for task, entries in tomllib.loads(text, parse_float=Decimal).items():
        for name, row in entries.items():
            about = {"id": f"{task}.{name}", "task": None if task == "general" else task}
            rows[f"{task}.{name}"] = row | about
            if "value" in row:
                exact = row["kind"] in ("count", "constant")
                exponent = int(Decimal(row["value"]).as_tuple().exponent)
                rows[f"{task}.{name}"]["rounding"] = (
                    0.0 if exact else 0.5 * 10.0 ** min(0, exponent)
                )
    for row in rows.values():
        if "difference_of" in row:
            parts = [n if n in rows else f"{row['task']}.{n}" for n in row["difference_of"]]
            first, second = (rows[part] for part in parts)
            row["value"] = first["value"] - second["value"]
            row["rounding"] = (
                0.0 if row["kind"] == "count" else first["rounding"] + second["rounding"]
            )
    return TypeAdapter(dict[str, Printed]).validate_python(rows)


ENTRIES: Mapping[str, Printed] = parse_entries(
    Path(__file__).with_name("published.toml").read_text("utf-8")
)
"""Every entry by id, in the paper's order of tasks."""


def constant(name: str) -> float:
    """A general constant that the paper prints; KeyError for another."""
    return ENTRIES[f"general.{name}"].number


RUNS = int(constant("runs"))
"""Runs of every experiment."""


class Summary(NamedTuple):
    """A printed mean reward with what is printed about its spread."""

    mean: float
    sd: float | None
    runs: int
    """Number of runs that is printed, or the paper's general 20."""
    printed_runs: int | None = None
    """Runs with the hand sequence, where their number stands beside the mean."""
    derived: bool = False
    """Computed from other printed numbers rather than printed itself."""
    derived_runs: bool = False
    """Whether the number of runs is computed from another."""

    @property
    def in_words(self) -> str:
        """The mean, which says whether it was derived."""
        return printed_words(self.mean, self.derived)


class PublishedCell(NamedTuple):
    """What the paper prints about one task under one condition."""

    summary: Summary | None
    """Mean and spread over all runs."""
    sequences: dict[str, Summary]
    """Runs by hand sequence, where the paper tells them apart."""


def published_initial(task: str) -> Printed | None:
    """Reward of the initial solution of a task; None where the paper prints nothing of it."""
    return _corrective(task, "initial hands")


def published_exhaustive(task: str) -> Printed | None:
    """The best over all hand sequences."""
    return _corrective(task, "best of all sequences")


def _corrective(task: str, kind: str) -> Printed | None:
    for entry in ENTRIES.values():
        if (entry.kind, entry.task) == (kind, task):
            return _number("reward", task, None, entry.hands)
    return None


def published_cell(task: str, condition: str) -> PublishedCell | None:
    """What is printed about a cell; None for a cell that the paper does not have."""
    entries = [e for e in ENTRIES.values() if (e.task, e.condition) == (task, condition)]
    if not entries:
        return None
    summaries: dict[str | None, Summary] = {}
    for entry in entries:
        if entry.kind == "reward":
            sd = _number("sd", task, condition, entry.hands)
            count = _number("count", task, condition, entry.hands)
            runs = None if count is None else int(count.number)
            summaries[entry.hands] = Summary(
                entry.number,
                None if sd is None else float(sd.number),
                RUNS if runs is None else runs,
                RUNS if entry.hands is None else runs,
                derived_runs=count is not None and bool(count.difference_of),
            )
    sequences = {hands: summary for hands, summary in summaries.items() if hands}
    return PublishedCell(summaries.get(None) or pooled([*sequences.values()]), sequences)


def pooled(parts: list[Summary]) -> Summary | None:
    """Mean and SD over all runs of several groups, from each group's own."""
    if len(parts) < 2:
        return parts[0] if parts else None
    runs = sum(part.runs for part in parts)
    mean = sum(part.runs * part.mean for part in parts) / runs
    if any(part.sd is None for part in parts):
        return Summary(mean, None, runs, derived=True)
    squares = sum(
        (part.runs - 1) * (part.sd or 0.0) ** 2 + part.runs * (part.mean - mean) ** 2
        for part in parts
    )
    return Summary(mean, math.sqrt(squares / (runs - 1)), runs, derived=True)


def _number(kind: str, task: str, condition: str | None, hands: str | None) -> Printed | None:
    for entry in ENTRIES.values():
        about = entry.kind, entry.task, entry.condition, entry.hands
        if about == (kind, task, condition, hands):
            return entry
    return None
