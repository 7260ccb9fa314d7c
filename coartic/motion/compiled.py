"""Kernels: functions that are compiled when the first of them is called.

Until then they cost nothing: a command that lists names needs no compiler. Here are the decorators
that make kernels, and what kernels share.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from coartic.motion import sources  # noqa: F401 (notes the version of what is imported now)
from coartic.robot import chain, lever

F = TypeVar("F", bound=Callable[..., Any])


class Kernel:
    """A function that is compiled as its kind says, see :mod:`coartic.motion.compiler`."""

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        self.function, self.kind = function, kind
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:
        """The compiled function, as Numba calls it."""
        from coartic.motion.compiler import compile_kernel

        return compile_kernel(self.function, self.kind)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function, and return its result."""
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        """For Numba, which takes a kernel that another one calls for its dispatcher."""
        if name in ("_numba_type_", "py_func", "targetoptions"):
            return getattr(self.dispatcher, name)
        raise AttributeError(f"a kernel has no attribute {name!r}")


def entry(function: F) -> F:
    """A kernel that Python calls; its machine code is kept on disk."""
    return cast(F, Kernel(function, "entry"))


def inner(function: F) -> F:
    """A kernel that only other kernels call; a division by 0 gives infinity or NaN."""
    return cast(F, Kernel(function, "inner"))


def shared(function: F) -> F:
    """As :func:`inner`, but several entries call it: its machine code is kept on disk, too."""
    return cast(F, Kernel(function, "shared"))


def inlined(function: F) -> F:
    """As :func:`inner`, but a part of its callers, whose error model it has: passing whole tables
    would cost, and loops over a shape are unrolled where it is known."""
    return cast(F, Kernel(function, "inlined"))


def scalar(function: F) -> F:
    """A kernel of numbers, which compiled functions of others may call, too."""
    return cast(F, Kernel(function, "scalar"))


def intrinsic(function: Callable[..., Any]) -> Any:
    """A function that gives the type of a call in a kernel and builds its machine code."""
    return Kernel(function, "intrinsic")


def record_type(fields: Mapping[str, Any]) -> np.dtype[np.void]:
    """Type of a record for kernels, with these fields; they lie together in memory."""
    return np.dtype(list(fields.items()), align=True)


_DRAWS = ("state", "next_uint64", "next_double")  # of a bit generator, as NumPy hands it to C


def addresses(generators: Iterable[np.random.Generator]) -> NDArray[np.uintp]:
    """NumPy generators as kernels take them, a row each; they must outlive the call."""

    def draws_of(generator: np.random.Generator) -> list[int | None]:
        c = generator.bit_generator.ctypes
        return [ctypes.cast(getattr(c, name), ctypes.c_void_p).value for name in _DRAWS]

    return np.array([draws_of(generator) for generator in generators], dtype=np.uintp)


@intrinsic
def generator_of(_: Any, state: Any, next_uint64: Any, next_double: Any) -> Any:
    """The generator that draws by the functions at these addresses."""
    from numba.core import cgutils, types

    kind = types.NumPyRandomGeneratorType("generator")
    kind_of_bits = types.NumPyRandomBitGeneratorType("bit_generator")

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        bits = cgutils.create_struct_proxy(kind_of_bits)(context, builder)
        bits.state, bits.fnptr_next_uint64, bits.fnptr_next_double = arguments
        generator = cgutils.create_struct_proxy(kind)(context, builder)
        generator.bit_generator = bits._getvalue()
        return generator._getvalue()

    return kind(state, next_uint64, next_double), build


@inner
def generator_at(addresses: Any, run: int) -> Any:
    """The generator in a row of :func:`addresses`."""
    return generator_of(addresses[run, 0], addresses[run, 1], addresses[run, 2])


@inlined
def fill_row(row: Any, values: Any) -> None:
    """row[:] = values, or as many of them as both have, without the slices' checks, which cost
    seconds to compile."""
    for j in range(min(len(row), len(values))):
        row[j] = values[j]


chain_by = inner(chain)
joint_lever = inner(lever)
