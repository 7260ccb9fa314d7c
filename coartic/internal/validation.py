"""Data of files that users write, and sentences for what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from functools import wraps
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from coartic.internal.limits import brief_value, plain_values
from coartic.internal.text import did_you_mean, plain

T = TypeVar("T")


def in_sentences(kind: type[T]) -> type[T]:
    """Make a pydantic class raise ValueError with one sentence (:func:`explain`)."""
    init: Any = kind.__init__

    @wraps(init)
    def call(self: Any, *args: Any, **given: Any) -> None:
        try:
            init(self, *plain_values(args), **plain_values(given))
        except ValidationError as error:
            fields = [*type(self).__pydantic_fields__]
            raise ValueError(f"{type(self).__name__}: {explain(error, fields)}") from None

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


def explain(error: ValidationError, keys: Iterable[str] = (), *, of_call: bool = False) -> str:
    """Return pydantic's message on the first problem of an error, with the key and the value.

    Parameters
    ----------
    error : ValidationError
        Error of a model or a function, with at least one problem.
    keys : iterable of str
        Names of all keys that are known, or of a function's arguments in their order; the nearest
        is suggested for an unknown key.
    of_call : bool
        True for arguments of a function: names within an argument are of types, not keys.
    """
    problem = error.errors(include_url=False)[0]
    message = problem["msg"].removeprefix("Value error, ")
    first, *rest = problem["loc"] or [""]
    key = str(dict[int | str, str](enumerate(keys)).get(first, first))
    for part in rest:  # such as goals[1][0] or robot.left_links
        if isinstance(part, int):
            key += f"[{part}]"
        elif not of_call:
            key += f".{part}"
    match problem["type"]:
        case "missing" | "missing_argument" | "missing_keyword_only_argument":
            message = f"{key} is missing"
        case "extra_forbidden" | "unexpected_keyword_argument":
            message = f"{key} is an unknown key{did_you_mean(str((first, *rest)[-1]), keys)}"
        case kind if key and kind != "sentence":
            message = f"{key} is {brief_value(problem['input'])}: {message}"
    return plain(message)


def sentence_error(text: str) -> PydanticCustomError:
    """Return a validation error whose message is ``text``, without the key."""
    return PydanticCustomError("sentence", "{text}", {"text": text})
