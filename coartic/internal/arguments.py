"""Check the arguments of functions where data of users enter."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache, wraps
from typing import Annotated, ParamSpec, TypeVar

from numpy.typing import ArrayLike
from pydantic import ConfigDict, PlainValidator, ValidationError, validate_call

from coartic.errors import CoarticError
from coartic.internal.limits import plain_values, real_numbers
from coartic.internal.validation import explain

Asked = ParamSpec("Asked")
Computed = TypeVar("Computed")
Numbers = Annotated[ArrayLike, PlainValidator(real_numbers)]
"""Real numbers of any shape, as an array or lists; a checked function gets an array of float64."""
_STRICT = ConfigDict(strict=True, arbitrary_types_allowed=True)


class ArgumentError(CoarticError, ValueError, TypeError):
    """An argument that a function does not take."""


def checked_arguments(function: Callable[Asked, Computed]) -> Callable[Asked, Computed]:
    """Return a wrapper of the function that raises ArgumentError, before the call, for an argument
    that its type hint excludes, that is missing or that the function does not have. NumPy's scalars
    count as Python's; strings, True and False are not numbers."""
    names = [*inspect.signature(function).parameters]

    @cache  # hints are read at the first call: most commands make none
    def checked() -> Callable[..., Computed]:
        return validate_call(config=_STRICT)(function)

    @wraps(function)
    def call(*args: Asked.args, **named: Asked.kwargs) -> Computed:
        places, given = plain_values([*args]), plain_values(named)
        try:
            return checked()(*places, **given)
        except ValidationError as error:
            sentence = explain(error, names, of_call=True)
            raise ArgumentError(f"{function.__name__}: {sentence}") from None

    return call
