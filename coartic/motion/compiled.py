"""How the compiled kernels are built and cached.

Numba keys its on-disk cache by the file of the cached function alone, so a change
in a function it calls from another file would go unnoticed. Here the cache folder
is named after a hash of the package's sources: changed sources, fresh code.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import IO, Any, TypeVar

import numba
import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.core.caching import FunctionCache
from numba.extending import intrinsic
from numpy.typing import NDArray

from coartic.motion.trigonometry import cosine, sine
from coartic.robot import chain, lever

PACKAGE = Path(__file__).parent.parent
_KEPT_S = 30 * 24 * 3600.0
_LONGEST_COMPILATION_S, _RETRY_S = 120.0, 0.05
F = TypeVar("F", bound=Callable[..., Any])


def model_files() -> list[Path]:
    """The files of this package that results come from."""
    single = (PACKAGE / name for name in ("robot.py", "model.py", "method.py", "tasks/task.py"))
    rooms = ((PACKAGE / room).glob("*.py") for room in ("motion", "learner"))
    return sorted([*single, *(path for room in rooms for path in room)])


@cache
def model_source() -> bytes:
    """The sources that results come from, as they were when the package was imported."""
    return b"\0".join(path.name.encode() + b"\0" + path.read_bytes() for path in model_files())


def source_fingerprint() -> str:
    """Hash of :func:`model_source`: the version of the model's code."""
    return hashlib.sha256(model_source()).hexdigest()[:16]


def cache_folder() -> Path | None:
    """A writable folder for compiled code, or None where there is none."""
    roots = [PACKAGE / "__pycache__"]
    if Path(numba.config.CACHE_DIR).is_absolute():  # or it would change with where one stands
        roots.insert(0, Path(numba.config.CACHE_DIR) / "coartic")
    given = os.environ.get("XDG_CACHE_HOME", "")
    if Path(given).is_absolute():
        roots.append(Path(given) / "coartic")
    else:
        with contextlib.suppress(RuntimeError):  # a user without a home
            roots.append(Path.home() / ".cache" / "coartic")
    for root in roots:
        folder = root / f"kernel-{source_fingerprint()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            remove_old(root, folder)
            return folder
    return None


def remove_old(root: Path, current: Path) -> None:
    """Remove machine code of older sources that nobody has begun with for a month."""
    with contextlib.suppress(OSError):
        os.utime(current)
    for folder in root.glob(f"kernel-{'[0-9a-f]' * 16}"):
        with contextlib.suppress(OSError):
            if folder.stat().st_mtime < time.time() - _KEPT_S:
                shutil.rmtree(folder, ignore_errors=True)


# Kernels allocate nothing and work on arrays that their caller holds, so that they need not
# count references to them (NRT, Numba's run time): counting takes a quarter of the time.
_OPTIONS: dict[str, Any] = {"nogil": True, "_nrt": False, "no_cfunc_wrapper": True}
# What Python never calls needs no way to do so, which would take as long to compile.
_INNER = _OPTIONS | {"no_cpython_wrapper": True}


def inner(function: F) -> F:
    """Compile a function that only other compiled functions call."""
    compiled: F = for_any_number(njit(**_INNER)(function))
    return compiled


def inlined(function: F) -> F:
    """As :func:`inner`, but a part of its callers, whose error model it has: passing whole tables
    would cost, and loops over a shape are unrolled where it is known."""
    compiled: F = njit(**_INNER, inline="always")(function)
    return compiled


def lanewise(function: F) -> F:
    """As :func:`inner`, for a loop over lanes: a division by 0 gives what IEEE says."""
    compiled: F = for_any_number(njit(**_INNER, error_model="numpy")(function))
    return compiled


def for_any_number(dispatcher: Any) -> Any:
    """The function, not compiled again for literal integers such as ``count = 0``."""
    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda given, names: template(
        tuple(map(types.unliteral, given)), names
    )
    return dispatcher


class MachineCode(FunctionCache):
    """Machine code on disk.

    Of processes that lack the same code one compiles it and the others wait for it. A file that
    cannot be read, such as one that a full disk has cut short, is dropped, and what cannot be kept
    is compiled again in the next process.
    """

    lock: IO[str] | None = None
    """Held while this process compiles."""

    def load_overload(self, *wanted: Any) -> Any:
        """The code of a signature; None where there is none, and this process is to compile it."""
        self.unlock()
        code = self.load(*wanted)
        if code is None and self.wait_for_lock():
            code = self.load(*wanted)  # somebody may have compiled it meanwhile
            if code is not None:
                self.unlock()
        return code

    def load(self, *wanted: Any) -> Any:
        """The code of a signature, or None."""
        try:
            return super().load_overload(*wanted)
        except Exception:  # an unpickler may say anything
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, *compiled: Any) -> None:
        """Keep what was compiled, where that can be."""
        with contextlib.suppress(Exception):
            super().save_overload(*compiled)
        self.unlock()

    def wait_for_lock(self) -> bool:
        """Lock this function's code; False where the system has no locks, or nobody lets go."""
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            file = open(f"{self.cache_path}/{self._py_func.__name__}.lock", "w")  # noqa: SIM115
            for _ in range(round(_LONGEST_COMPILATION_S / _RETRY_S)):
                with contextlib.suppress(BlockingIOError):
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    self.lock = file
                    return True
                time.sleep(_RETRY_S)
            file.close()
        return False

    def unlock(self) -> None:
        """Let other processes compile this function."""
        if self.lock is not None:
            self.lock.close()
            self.lock = None


def entry(function: F) -> F:
    """Compile a function that Python calls, and keep its machine code on disk."""
    compiled: Any = njit(**_OPTIONS)(function)
    folder = cache_folder()
    if folder is not None:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            compiled._cache = MachineCode(function)
        finally:
            numba.config.CACHE_DIR = before
    kernel: F = compiled
    return kernel


def mangling_args(record: types.Record) -> tuple[str, tuple[int, ...]]:
    """A name of a record by what is in it."""
    return "Record", (int(hashlib.sha256(record.name.encode()).hexdigest()[:15], 16),)


# Machine code on disk calls functions by names that say their types. Numba names a record by its
# number in the process that compiles, so a process that loads code of two such processes may call
# one's function with the other's record. What is in the record is a name that holds everywhere.
types.Record.mangling_args = property(mangling_args)


def record_type(fields: Mapping[str, Any]) -> np.dtype[np.void]:
    """Type of a record as kernels read it: what it holds lies together, at places they know."""
    return np.dtype(list(fields.items()), align=True)


_DRAWS = ("state", "next_uint64", "next_double")  # of a bit generator, as NumPy hands it to C
_BITS = types.NumPyRandomBitGeneratorType("bit_generator")
_GENERATOR = types.NumPyRandomGeneratorType("generator")


def addresses(generators: Iterable[np.random.Generator]) -> NDArray[np.uintp]:
    """NumPy generators as kernels take them, a row each; they must outlive the call."""

    def draws_of(generator: np.random.Generator) -> list[int | None]:
        c = generator.bit_generator.ctypes
        return [ctypes.cast(getattr(c, name), ctypes.c_void_p).value for name in _DRAWS]

    return np.array([draws_of(generator) for generator in generators], dtype=np.uintp)


@intrinsic
def _generator(_: Any, state: Any, next_uint64: Any, next_double: Any) -> Any:
    def build(context: Any, builder: Any, __: Any, arguments: Any) -> Any:
        bits = cgutils.create_struct_proxy(_BITS)(context, builder)
        bits.state, bits.fnptr_next_uint64, bits.fnptr_next_double = arguments
        generator = cgutils.create_struct_proxy(_GENERATOR)(context, builder)
        generator.bit_generator = bits._getvalue()
        return generator._getvalue()

    return _GENERATOR(state, next_uint64, next_double), build


@inner
def generator_at(addresses: Any, run: int) -> Any:
    """The generator in a row of :func:`addresses`."""
    return _generator(addresses[run, 0], addresses[run, 1], addresses[run, 2])


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
