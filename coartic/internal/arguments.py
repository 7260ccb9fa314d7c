"""Check the arguments of public functions against their hints."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import cache, wraps
from numbers import Integral, Real
from types import UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from coartic.errors import CoarticError
from coartic.internal.limits import brief_value, check_limits, real_array
from coartic.internal.text import unknown

Asked = ParamSpec("Asked")
Computed = TypeVar("Computed")
_ARRAYS = {*get_args(getattr(ArrayLike, "__value__", ArrayLike))}
_KINDS: dict[Any, Any] = {bool: bool | np.bool_, int: Integral, float: Real, str: str}
_NEEDED = {"bool": "True or False", "int": "a whole number", "float": "a number", "str": "a text"}


class ArgumentError(CoarticError, ValueError, TypeError):
    """An argument that a function does not take."""


def checked_arguments(function: Callable[Asked, Computed]) -> Callable[Asked, Computed]:
    """Return a wrapper of the function that raises ArgumentError, before the call, for an argument
    that its type hint excludes."""
    check = checker_of(function)

    @wraps(function)
    def call(*args: Asked.args, **named: Asked.kwargs) -> Computed:
        check(*args, **named)
        return function(*args, **named)

    return call


def checker_of(function: Callable[..., Any]) -> Callable[..., None]:
    """Return a function that takes the arguments of ``function`` and raises ArgumentError for an
    argument that its type hint excludes, else returns None.

    Arrays may be lists of numbers, but have no masked entries. ``Annotated[int, 1, 9]`` takes whole
    numbers from 1 to 9. Hints with names that only the type checker imports exclude nothing.
    """
    signature = inspect.signature(function)

    @cache
    def hint_of(name: str) -> Any:
        try:
            return eval(signature.parameters[name].annotation, inspect.unwrap(function).__globals__)
        except (NameError, TypeError):  # TypeError: self has none
            return Any

    def check(*args: Any, **named: Any) -> None:
        try:
            given = signature.bind(*args, **named).arguments
            for name, value in given.items():
                parameter, hint = signature.parameters[name], hint_of(name)
                for each in value if parameter.kind is parameter.VAR_POSITIONAL else [value]:
                    if type(each) is not hint and not fits(name, each, hint):
                        needed = _NEEDED.get(parameter.annotation, parameter.annotation)
                        raise ValueError(f"{name} is {brief_value(each)}; needed is {needed}")
        except TypeError as error:
            raise ArgumentError(f"{function.__name__}: {error}") from None
        except ValueError as error:
            raise ArgumentError(str(error)) from None

    return check


def fits(name: str, value: Any, hint: Any) -> bool:
    """Return whether a value fits a type hint; True for a hint of a form that is not known here.

    Raises ValueError, which calls the value ``name``, for a number out of the limits of
    ``Annotated``, an unknown text of a ``Literal``, and an array that is not of real numbers.
    """
    kind, parts = get_origin(hint) or hint, get_args(hint)
    if hasattr(kind, "__value__"):  # an alias, as NumPy's types are from Python 3.12 on
        return fits(name, value, kind.__value__)
    if kind in (Union, UnionType) and value is None:
        return type(None) in parts
    if kind is np.ndarray or _ARRAYS.issubset(parts):
        return bool(real_array(name, value).ndim > 0 or kind is not np.ndarray)
    if kind in (Union, UnionType):
        return any(fits(name, value, each) for each in parts)
    if kind is Annotated:
        check_limits(name, value, *hint.__metadata__)
        return True
    if kind is Literal:
        if isinstance(value, str) and value not in parts:
            raise ValueError(unknown(name, value, parts))
        return isinstance(value, str)
    if kind in _KINDS:
        return isinstance(value, _KINDS[kind]) and (kind is bool or not isinstance(value, bool))
    if not isinstance(kind, type) or kind is Any:
        return True
    if kind is tuple and isinstance(value, tuple) and ... not in parts:
        return len(value) == len(parts) and all(map(fits, [name] * len(parts), value, parts))
    if issubclass(kind, Mapping) and isinstance(value, Mapping) and parts:
        return all(fits(name, each, parts[1]) for each in value.values())
    if issubclass(kind, Mapping) or not issubclass(kind, Iterable) or not parts:
        return isinstance(value, kind)
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    counted = isinstance(value, list | tuple | np.ndarray)  # others may end only when they are used
    return not counted or all(fits(name, each, parts[0]) for each in value)
