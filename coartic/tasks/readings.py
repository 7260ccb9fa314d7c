"""What the paper leaves open, and what is chosen here (``readings.toml``).

A reading is one open question with the choices that the text allows, the default among them.
Each is applied to one field, of the motion model or of the exploration condition. A constant of the
motion model is set in the same way, to any number: ``model.gain=0.1``.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field, TypeAdapter

from coartic.errors import CoarticError
from coartic.inputs import FileData, brief, brief_value, read_toml
from coartic.model import PAPER, MotionModel, check_model
from coartic.text import did_you_mean, unknown

REFUTED = {
    "arrival-tolerance=0.1",
    "correction-tolerance=0.099",
    "arrival-tick=0",
    "shoulder-height=0.0",
    "shoulder-height=-0.1",
    "learned-reward=replay",
    "update=not-less",
}
"""Readings of version 1.0.0 that left the code: the printed results refute them
(``analysis/reconstruction/readings.csv``)."""


class Choice(FileData):
    """One way to read the text."""

    value: bool | int | float | str
    """Value of the parameter."""
    says: str
    """What it means, in a line."""
    printed: bool = False
    """Whether the text says so if it is taken at its word."""

    @property
    def written(self) -> str:
        """The value as it is written after a reading's id: ``true``, ``left``."""
        return str(self.value).lower() if isinstance(self.value, bool) else str(self.value)


class Reading(FileData):
    """An open question about the paper's text."""

    id: str
    question: str
    quote: str
    """What the text says nearest to it."""
    place: str
    """Section or figure of the quote."""
    parameter: Annotated[str, Field(pattern=r"^(model|condition)\.[a-z_]+$")]
    """Where it is applied: part and field."""
    default: Choice
    alternatives: tuple[Choice, ...]
    why: str
    """Why the default."""

    @property
    def part(self) -> str:
        """``model`` or ``condition``."""
        return self.parameter.partition(".")[0]

    @property
    def field(self) -> str:
        """Name of the field."""
        return self.parameter.partition(".")[2]

    @property
    def choices(self) -> tuple[Choice, ...]:
        """All choices, the default first."""
        return self.default, *self.alternatives


class ChosenReading(NamedTuple):
    """A reading with one of its choices."""

    reading: Reading
    choice: Choice

    def __str__(self) -> str:
        """As :func:`load_reading` takes it."""
        return f"{self.reading.id}={self.choice.written}"


@cache
def readings() -> tuple[Reading, ...]:
    """Every open question, in the order of the table."""
    rows: dict[str, dict[str, Any]] = read_toml(Path(__file__).with_name("readings.toml"))
    entries = [{"id": name, **row} for name, row in rows.items()]
    return TypeAdapter(tuple[Reading, ...]).validate_python(entries)


@cache
def constants() -> tuple[Reading, ...]:
    """The numbers of the motion model, to be set by ``model.gain=0.1`` and the like."""
    numbers = [name for name, value in PAPER._asdict().items() if not isinstance(value, bool)]
    return tuple(
        Reading(
            id=f"model.{name}",
            question=f"Constant {name} of the motion model",
            quote="",
            place="",
            parameter=f"model.{name}",
            default=Choice(value=getattr(PAPER, name), says="as in the paper's model"),
            alternatives=(),
            why="",
        )
        for name in numbers
    )


def set_constant(constant: Reading, value: str) -> ChosenReading:
    """A constant with a value. Raises CoarticError for one that no movement can be made with."""
    kind = type(constant.default.value)
    number: Any
    try:
        number = kind(value)
        check_model(PAPER._replace(**{constant.field: number}))
    except ValueError as error:
        reason = str(error) if str(error).startswith("model.") else "it must be a number"
        if kind is int and reason == "it must be a number":
            reason = "it must be a whole number"
        raise CoarticError(f"reading {constant.id}={brief(value)}: {reason}") from None
    is_default = number == constant.default.value
    return ChosenReading(
        constant, constant.default if is_default else Choice(value=number, says="")
    )


def load_reading(text: str) -> ChosenReading:
    """A reading and its choice from ``id=value``, such as ``ties=right`` or ``model.gain=0.1``.

    Raises CoarticError for what is not written so, an unknown reading, and a value that is not
    among its choices or that no movement can be made with.
    """
    name, sign, value = (part.strip() for part in str(text).partition("="))
    by_id = {reading.id: reading for reading in (*readings(), *constants())}
    if not sign:
        raise CoarticError(
            f"reading {brief_value(text)}: write it as NAME=VALUE, such as ties=right"
        )
    if f"{name}={value}" in REFUTED:
        raise CoarticError(
            f"reading {name}={value} is refuted by the printed results and is no longer here. "
            "Version 1.0.0 of coartic has it."
        )
    if name not in by_id:
        raise CoarticError(unknown("reading", brief(name), by_id))
    reading = by_id[name]
    if reading in constants():
        return set_constant(reading, value)
    for choice in reading.choices:
        if choice.written == value:
            return ChosenReading(reading, choice)
    values = [choice.written for choice in reading.choices]
    raise CoarticError(
        f"reading {name}: {brief_value(value)} is not one of its choices "
        f"({', '.join(values)}){did_you_mean(value, values)}"
    )


def load_readings(texts: Iterable[str]) -> tuple[ChosenReading, ...]:
    """Several readings, in the order of the table, without those that are the default.

    Raises CoarticError as :func:`load_reading`, for two choices of one reading, and for what
    is no list.
    """
    if isinstance(texts, str) or not isinstance(texts, Iterable):
        raise CoarticError(f"readings must be a list of texts, not {brief_value(texts)}")
    chosen: dict[str, ChosenReading] = {}
    for text in texts:
        new = load_reading(text)
        old = chosen.setdefault(new.reading.id, new)
        if old.choice != new.choice:
            raise CoarticError(f"reading {new.reading.id}: {old} and {new} cannot both hold")
    every = (*readings(), *constants())
    ordered = (chosen[reading.id] for reading in every if reading.id in chosen)
    return tuple(new for new in ordered if new.choice != new.reading.default)


def fields_under(chosen: Iterable[ChosenReading], part: str) -> dict[str, Any]:
    """Fields of the model or of a condition that these readings set."""
    return {reading.field: choice.value for reading, choice in chosen if reading.part == part}


def model_under(chosen: Iterable[ChosenReading]) -> MotionModel:
    """The model as these readings have it."""
    return PAPER._replace(**fields_under(chosen, "model"))


def condition_under(chosen: Iterable[ChosenReading]) -> dict[str, Any]:
    """Fields of an exploration condition, and parameters of the learner, that they change."""
    return fields_under(chosen, "condition")
