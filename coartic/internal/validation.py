"""Data of files that users write, and sentences for what is wrong with them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from coartic.internal.limits import brief_value, plain_values
from coartic.internal.text import counted, did_you_mean, plain

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

T = TypeVar("T")


_SHOWN = 20  # problems of one file
_PLAINER = {
    r"^(Input|String|Tuple|List|Dictionary|Value error,) ": "",
    r"^should have at least (\d+ \w+) after validation, not \d+": r"needs at least \1",
    r"^should have at most (\d+ \w+) after validation, not \d+": r"may have at most \1",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
    "valid integer": "whole number",
    "valid number": "number",
    "valid string": "text",
    "a valid boolean": "true or false",
    "valid (list|tuple)": "list, in square brackets",
    r"(valid )?dictionary( or (an )?instance of \w+)?": "table",
}
"""Wordings of pydantic, and what they say to a person."""


def in_sentences(kind: type[T]) -> type[T]:
    """Change a pydantic class, in place, and return the class: wrong arguments raise ValueError
    (:func:`explain_inline`), and a model's arguments without names TypeError."""
    init: Any = kind.__init__

    @wraps(init)
    def call(self: Any, *args: Any, **given: Any) -> None:
        if args and isinstance(self, BaseModel):
            name = next(iter(type(self).model_fields))
            raise TypeError(f"{type(self).__name__} takes arguments by name, such as {name}=...")
        try:
            init(self, *plain_values(args), **plain_values(given))
        except ValidationError as error:
            fields = [*type(self).__pydantic_fields__]
            raise ValueError(f"{type(self).__name__}: {explain_inline(error, fields)}") from None

    kind.__init__ = call  # type: ignore[method-assign]
    return kind


def equal_contents(a: Any, b: Any) -> Any:
    """Return whether two objects of one class are equal in all fields that count, arrays by shape
    and entries, in which NaN and masked entries are equal: the ``__eq__`` of classes with arrays.
    NotImplemented for objects of two classes."""
    import numpy as np

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            numbers = np.ma.filled(np.ma.asarray(value).astype(np.float64), np.nan)
            return value.shape, [None if x != x else x for x in numbers.ravel().tolist()]
        return value

    if type(a) is not type(b):
        return NotImplemented
    named = (
        [*type(a).model_fields]
        if isinstance(a, BaseModel)
        else [field.name for field in fields(a) if field.compare]
    )
    return all(plain(getattr(a, name)) == plain(getattr(b, name)) for name in named)


@in_sentences
class FileData(BaseModel):
    """Content of a file, whose fields cannot be set and whose unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    __eq__ = equal_contents


def explain_file(source: str, error: ValidationError, keys: Iterable[str] = ()) -> str:
    """Return lines ``source: sentence`` on the first 20 problems in ``error`` of file ``source``
    (:func:`_explain_first`), and, if there are more, a last line with the number of further
    problems. ``keys`` are keys that the file or its tables may have."""
    sentences, more = _explain_first(error.errors(include_url=False), list(keys))
    lines = [f"{plain(source)}: {sentence}" for sentence in sentences]
    if more:
        lines.append(f"{plain(source)}: has {counted(more, 'more problem')}")
    return "\n".join(lines)


def explain_inline(
    error: ValidationError, keys: Sequence[str], given: Mapping[int | str, Any] | None = None
) -> str:
    """Return sentences on the first 20 problems of an object's or a call's arguments
    (:func:`_explain_first`), joined by semicolons; an argument that fits none of several types has
    one sentence. ``keys`` are the names of the arguments, in order, or empty; ``given`` are the
    arguments of a call, by place from 0 or by name."""
    problems: dict[tuple[int | str, ...], ErrorDetails] = {}
    for detail in error.errors(include_url=False):
        place = detail["loc"]
        if given and (kind := detail.get("ctx", {}).get("class_name")):
            detail["msg"] = f"Input should be an instance of {kind}"  # no table, as in a file
        if given and detail["input"] is given.get(place[0]):
            place = place[:1]  # what follows is the name of a kind
        if place in problems:
            problems[place]["msg"] += f" or {detail['msg'].removeprefix('Input should be ')}"
        else:
            problems[place] = {**detail, "loc": place}
    return "; ".join(_explain_first([*problems.values()], keys)[0])


def _explain_first(details: list[ErrorDetails], keys: Sequence[str]) -> tuple[list[str], int]:
    """Return a list of sentences on the first 20 problems, each sentence once, and the number of
    further problems; of lists that are too short only the first counts, and only without other
    problems. ``keys``: names of the keys that a file has, or of arguments in order."""
    # A list is counted too short without its bad entries.
    details = [d for d in details if d["type"] != "too_short"] or details[:1]
    sentences = (plain(_explain_problem(detail, keys)) for detail in details[:_SHOWN])
    return list(dict.fromkeys(sentences)), max(0, len(details) - _SHOWN)


def sentence_error(text: str) -> PydanticCustomError:
    """Return a validation error whose message is ``text`` alone, without the key."""
    return PydanticCustomError("sentence", "{text}", {"text": text})


def _explain_problem(detail: ErrorDetails, keys: Sequence[str]) -> str:
    """Return a sentence about a problem. ``keys``: the known keys, in the order of arguments; the
    sentence names the known key nearest to an unknown key, if one is near, and calls argument k
    (from 0) without a name ``keys[k]``."""
    key, message = "", detail["msg"]  # where it is: goals[1][0], robot.left_links
    for part in detail["loc"]:
        if not key and isinstance(part, int) and part < len(keys):
            part = keys[part]  # an argument without its name
        name = plain(str(part), 80)
        key += f"[{name}]" if isinstance(part, int) else f".{name}" if key else name
    match detail["type"]:
        case "sentence":
            return message
        case "value_error" if not key:  # of the object itself
            return message.removeprefix("Value error, ")
        case "unexpected_positional_argument":
            if key in keys:
                return f"{key} is given without its name; write {key}=..."
            return f"it takes {counted(len(keys), 'argument')}"
        case "missing" | "missing_argument" | "missing_keyword_only_argument":
            return f"{key} is missing"
        case "extra_forbidden" | "unexpected_keyword_argument":
            name, table = str(detail["loc"][-1]), str(detail["loc"][0])
            if len(detail["loc"]) > 1 and name in keys:
                return f"{key} is an unknown key; {name!r} belongs above the line [{table}]"
            return f"{key} is an unknown key{did_you_mean(name, keys)}"
        case "string_pattern_mismatch" if key == "name":
            message = "begins with a letter or digit and may have '.', '_' and '-' besides"
    if isinstance(detail["input"], float) and math.isnan(detail["input"]):
        message = "should be a finite number"
    for wording, plainer in _PLAINER.items():
        message = re.sub(wording, plainer, message)
    return f"{key} is {brief_value(detail['input'])}; it {message[:1].lower()}{message[1:]}"
