"""Validate data of files and arguments by pydantic, with error messages of one sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import fields
from functools import wraps
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from coartic.internal.limits import brief_value, plain_values
from coartic.internal.text import did_you_mean, plain

T = TypeVar("T")
_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")


def describe_validation_errors(kind: type[T]) -> type[T]:
    """Decorate a class of pydantic so that its constructor raises ValueError for invalid data.

    The message of the ValueError is the name of the class and the sentence of :func:`explain`.
    Without the decorator, pydantic raises ValidationError, with a message of many lines. The
    decorated constructor also accepts NumPy scalars where Python numbers are required. The method
    ``model_validate`` is not changed.
    """
    init: Any = kind.__init__

    @wraps(init)
    def call(self: Any, *args: Any, **named: Any) -> None:
        try:
            init(self, *plain_values(args), **plain_values(named))
        except ValidationError as error:
            fields = [*type(self).__pydantic_fields__]
            raise ValueError(f"{type(self).__name__}: {explain(error, fields)}") from None

    kind.__init__ = call  # type: ignore[method-assign]
    return kind


def equal_contents(a: Any, b: Any) -> Any:
    """Compare two objects field by field; classes with arrays use this function as ``__eq__``.

    Two arrays are equal if their shapes and entries are equal. In arrays, NaN is treated as equal
    to NaN and to a masked entry. Fields of a dataclass with ``compare=False`` are ignored. The
    result is NotImplemented if the objects have different classes.
    """
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


@describe_validation_errors
class FileData(BaseModel):
    """Base class for the content of files: immutable, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    __eq__ = equal_contents


def explain(error: ValidationError, keys: Iterable[str] = (), *, of_call: bool = False) -> str:
    """Return a sentence that describes one problem of a validation error.

    The sentence describes the first unknown key or, if there is none, the first problem. It names
    the key and, if the value is wrong, the value. An error of :func:`described_error` is described
    by its text alone.

    Parameters
    ----------
    error : ValidationError
        Error of a class of pydantic or of a checked function.
    keys : iterable of str
        Known keys or, for a function, the names of its parameters in their order. For an unknown
        key, the sentence suggests the most similar known key.
    of_call : bool
        True if the error was raised by the call of a checked function. If a problem is inside an
        argument, pydantic then reports names of types instead of keys, which are left out.

    Returns
    -------
    str
        The sentence, as one printable line.
    """
    problems = error.errors(include_url=False)
    # A misspelt key explains a missing one.
    unknown = (each for each in problems if each["type"] in _UNKNOWN_KEY)
    problem = next(unknown, problems[0])
    message = problem["msg"].removeprefix("Value error, ")
    root, *parts = problem["loc"] or [""]
    key = str(dict[int | str, str](enumerate(keys)).get(root, root))
    for part in parts:  # such as goals[1][0] or robot.left_links
        if isinstance(part, int):
            key += f"[{part}]"
        elif not of_call:
            key += f".{part}"
    match problem["type"]:
        case "missing" | "missing_argument" | "missing_keyword_only_argument":
            message = f"{key} is missing"
        case kind if kind in _UNKNOWN_KEY:
            name = str((root, *parts)[-1])
            known = "; it belongs in another table" if name in {*keys} else did_you_mean(name, keys)
            message = f"{key} is an unknown key{known}"
        case kind if key and kind != "sentence":
            wanted = re.sub(r"^([A-Z][a-z]+ )?should ", "; it should ", message)
            found = f"{key} is {brief_value(problem['input'])}"
            message = f"{found}: {message}" if wanted == message else f"{found}{wanted}"
    return plain(message)


def described_error(text: str) -> PydanticCustomError:
    """Return a validation error whose message is only ``text``.

    The message does not name the field that is wrong, or its value.
    """
    return PydanticCustomError("sentence", "{text}", {"text": text})
