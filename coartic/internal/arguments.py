"""Check the arguments of functions where data of users enter."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache, wraps
from typing import Annotated, Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ConfigDict, PlainValidator, ValidationError, validate_call

from coartic.errors import CoarticError
from coartic.internal.limits import is_span, real_numbers
from coartic.internal.validation import explain_call

Asked = ParamSpec("Asked")
Computed = TypeVar("Computed")
Numbers = Annotated[ArrayLike, PlainValidator(real_numbers)]
"""Real numbers of any shape, as an array or lists; a checked function gets an array of float64."""
_STRICT = ConfigDict(strict=True, arbitrary_types_allowed=True)


class ArgumentError(CoarticError, ValueError, TypeError):
    """An argument that a function does not take."""


def checked_arguments(function: Callable[Asked, Computed]) -> Callable[Asked, Computed]:
    """Return a wrapper of the function that raises ArgumentError, before the call, for an argument
    that its type hint excludes. Scalars of NumPy count as numbers of Python; text, True and False
    are no numbers."""
    names = [*inspect.signature(function).parameters]

    @cache  # hints are read at the first call: most commands make none
    def checked() -> Callable[..., Computed]:
        return validate_call(config=_STRICT)(function)

    @wraps(function)
    def call(*args: Asked.args, **named: Asked.kwargs) -> Computed:
        places = [*map(plain_scalar, args)]
        given: dict[Any, Any] = {name: plain_scalar(value) for name, value in named.items()}
        try:
            return checked()(*places, **given)
        except ValidationError as error:
            sentences = explain_call(error, names, given | dict(enumerate(places)))
            raise ArgumentError(f"{function.__name__}: {sentences}") from None

    return call


def plain_scalar(value: Any) -> Any:
    """Return a NumPy scalar as a Python scalar, a span of time (``timedelta64``), which passes for
    a number if it has no unit, as a text, and any other value itself."""
    if is_span(value):
        return str(value)
    return value.item() if isinstance(value, np.generic) else value
