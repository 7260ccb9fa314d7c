"""Check the arguments of public functions against their type hints."""

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
"""Type hint for an argument that is an array of real numbers of any shape, or a list of numbers.
The decorator :func:`checked_arguments` converts the argument to an array of float64."""
_STRICT = ConfigDict(strict=True, arbitrary_types_allowed=True)


class ArgumentError(CoarticError, ValueError, TypeError):
    """An argument is missing or unknown, or has a wrong type or value."""


def checked_arguments(function: Callable[Asked, Computed]) -> Callable[Asked, Computed]:
    """Decorate a function so that its arguments are checked against its type hints.

    The decorated function raises ArgumentError if an argument does not match its type hint, is
    missing or is unknown. NumPy scalars are accepted where Python numbers are. Strings, True and
    False are not accepted as numbers.

    Examples
    --------
    >>> @checked_arguments
    ... def double(number: float) -> float:
    ...     return 2 * number
    >>> double(1.5)
    3.0
    >>> double("1.5")
    Traceback (most recent call last):
    ...
    coartic.internal.arguments.ArgumentError: double: number is '1.5'; it should be a valid number
    """
    names = [*inspect.signature(function).parameters]

    @cache  # hints are read at the first call, because most commands do not call the function
    def checked() -> Callable[..., Computed]:
        return validate_call(config=_STRICT)(function)

    @wraps(function)
    def call(*args: Asked.args, **named: Asked.kwargs) -> Computed:
        plain_args, plain_kwargs = plain_values([*args]), plain_values(named)
        try:
            return checked()(*plain_args, **plain_kwargs)
        except ValidationError as error:
            sentence = explain(error, names, of_call=True)
            raise ArgumentError(f"{function.__name__}: {sentence}") from None

    return call
