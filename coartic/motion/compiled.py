"""What kernels share: types, and small kernels."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.motion.kernels import entry as entry
from coartic.motion.kernels import from_compiler
from coartic.motion.kernels import inlined as inlined
from coartic.motion.kernels import inner as inner
from coartic.motion.kernels import lanewise as lanewise
from coartic.motion.trigonometry import cosine, sine
from coartic.robot import chain, lever


def record_type(fields: Mapping[str, Any]) -> np.dtype[np.void]:
    """Type of a record as kernels read it: what it holds lies together, at places they know."""
    return np.dtype(list(fields.items()), align=True)


_DRAWS = ("state", "next_uint64", "next_double")  # of a bit generator, as NumPy hands it to C


def addresses(generators: Iterable[np.random.Generator]) -> NDArray[np.uintp]:
    """NumPy generators as kernels take them, a row each; they must outlive the call."""

    def draws_of(generator: np.random.Generator) -> list[int | None]:
        c = generator.bit_generator.ctypes
        return [ctypes.cast(getattr(c, name), ctypes.c_void_p).value for name in _DRAWS]

    return np.array([draws_of(generator) for generator in generators], dtype=np.uintp)


@from_compiler
def generator_at(addresses: Any, run: int) -> Any:
    """The generator in a row of :func:`addresses`."""


@inlined
def fill_row(row: Any, values: Any) -> None:
    """row[:] = values, or as many of them as both have, without the slices' checks, which cost
    seconds to compile."""
    for j in range(min(len(row), len(values))):
        row[j] = values[j]


chain_by = inner(chain)
joint_lever = inner(lever)


@inner
def joint_chain(q: Any, arm: Any, xs: Any, ys: Any) -> None:
    """:func:`coartic.robot.chain` with the kernels' cosine and sine."""
    chain_by(q, arm, xs, ys, cosine, sine)
