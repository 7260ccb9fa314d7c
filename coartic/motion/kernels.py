"""Kernels: functions that are compiled when the first of them is called.

Until then they cost nothing: a command that lists names needs no compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

from coartic.motion import sources  # noqa: F401 (notes the version of what is imported now)

F = TypeVar("F", bound=Callable[..., Any])


class Kernel:
    """A function, compiled as a decorator of :mod:`coartic.motion.compiler` says."""

    def __init__(self, function: Callable[..., Any], decorator: str) -> None:
        self.function, self.decorator = function, decorator
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:
        """What Numba makes of the function."""
        from coartic.motion import compiler

        return getattr(compiler, self.decorator)(self.function)

    def __call__(self, *arguments: Any) -> Any:
        """What the compiled function returns."""
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        """For Numba, which takes a kernel that another one calls for its dispatcher."""
        if name in ("_numba_type_", "py_func", "targetoptions"):
            return getattr(self.dispatcher, name)
        raise AttributeError(f"a kernel has no attribute {name!r}")


def inner(function: F) -> F:
    """A function that only other kernels call."""
    return cast(F, Kernel(function, "inner"))


def inlined(function: F) -> F:
    """As :func:`inner`, but a part of its callers."""
    return cast(F, Kernel(function, "inlined"))


def lanewise(function: F) -> F:
    """As :func:`inner`, for a loop over lanes."""
    return cast(F, Kernel(function, "lanewise"))


def scalar(function: F) -> F:
    """A function of numbers, which compiled functions of others may call, too."""
    return cast(F, Kernel(function, "scalar"))


def entry(function: F) -> F:
    """A function that Python calls; its machine code is kept on disk."""
    return cast(F, Kernel(function, "entry"))


def from_compiler(function: F) -> F:
    """What only Numba can say: the kernel of this name in :mod:`coartic.motion.compiler`."""
    return cast(F, Kernel(function, "from_compiler"))
