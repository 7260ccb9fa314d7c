"""Types of what is stored: strict, bounded, immutable."""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
)

from coartic.inputs import MOST_BYTES
from coartic.method import Meter
from coartic.text import LONGEST_REASON, Line, printable

LARGEST_DETAILS = 64 * 1024
"""Characters of a method's details, or of its parameters, as JSON."""
LARGEST_COUNT = 2**53
Count = Annotated[int, Field(ge=0, le=LARGEST_COUNT)]
Reward = Annotated[int, Field(ge=-(2**31) + 1, le=0)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Amount = Annotated[float, Field(ge=0)]
Reason = Annotated[str, Field(max_length=LONGEST_REASON), printable]


def _json(most: int) -> AfterValidator:
    """JSON of at most ``most`` characters, in which every number is one."""

    def check(content: dict[str, Any]) -> dict[str, Any]:
        size = len(json.dumps(content, allow_nan=False))
        if size > most:
            raise ValueError(f"{size} characters as JSON; at most {most} are kept")
        return content

    return AfterValidator(check)


def _is_whole(meter: Any) -> Any:
    missing = isinstance(meter, dict) and vars(Meter()).keys() - meter.keys()
    if missing:
        raise ValueError(f"lacks {', '.join(sorted(missing))}")
    return meter


def _counts(meter: Meter) -> Meter:
    for name, value in vars(meter).items():
        if not 0 <= value <= LARGEST_COUNT:
            raise ValueError(f"{name} is {value}; it must be 0 to {LARGEST_COUNT}")
    return meter


Values = Annotated[dict[Line, JsonValue], _json(LARGEST_DETAILS)]
"""Details or parameters of a method."""
TaskContent = Annotated[dict[str, JsonValue], _json(MOST_BYTES)]
Spent = Annotated[Meter, BeforeValidator(_is_whole), AfterValidator(_counts)]


class Plain(BaseModel):
    """Base of what is stored: typed strictly, immutable, nothing else allowed."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Itself:
    """An object as a key that equals itself alone, and keeps it."""

    __slots__ = ("object",)

    def __init__(self, of: Any) -> None:
        self.object = of

    def __hash__(self) -> int:
        return id(self.object)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Itself) and other.object is self.object


def canonical(content: Any) -> bytes:
    """The one text of plain data: JSON, its keys sorted."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def content_hash(content: Any) -> str:
    """SHA-256 of plain data in canonical form."""
    return hashlib.sha256(canonical(content)).hexdigest()
