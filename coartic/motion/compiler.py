"""Numba: how kernels are built, and where their machine code is kept.

Nothing imports it but :mod:`coartic.motion.compiled`, when the first kernel is called: it takes a
while.

Numba keys its on-disk cache by the file of the cached function alone, so a change
in a function it calls from another file would go unnoticed. Here the cache folder
is named after a hash of the package's sources: changed sources, fresh code.

LLVM gets its options before Numba first asks it for machine code. Only how fast the
kernels are hangs on it. A program that has compiled something else with Numba before it calls
a kernel keeps the vectors that LLVM prefers.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import shutil
import sys
import time
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO, Any

from llvmlite import binding  # which Numba brings, in the one version that it takes

from coartic.errors import CoarticError
from coartic.motion.sources import FINGERPRINT, PACKAGE


def import_numba() -> Any:
    """Numba's settings; those of a file in the folder where one stands, which may be a stranger's,
    are not read: neither now nor before it compiles."""
    modules: dict[str, Any] = sys.modules
    kept = {name: modules[name] for name in ("yaml",) if name in modules}
    modules["yaml"] = None  # nothing reads such files
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "A Numba config file is found")
            from numba.core import config
    finally:
        del modules["yaml"]
        modules.update(kept)
    config._config_fname = ""
    return config


_config = import_numba()
import numba  # noqa: E402
from numba import njit, types  # noqa: E402
from numba.core.caching import FunctionCache  # noqa: E402
from numba.core.codegen import get_host_cpu_features  # noqa: E402
from numba.core.registry import cpu_target  # noqa: E402
from numba.extending import intrinsic  # noqa: E402

_KEPT_S = 30 * 24 * 3600.0
_LONGEST_COMPILATION_S, _RETRY_S = 120.0, 0.05

# Loops over the links of an arm are unrolled, or the loop over slots around them could not be
# made of vector instructions: LLVM's own bound ends that at four links.
binding.set_option("coartic", "-unroll-threshold=1000")
# No loop peeling: it would take the first slot out of a loop over whole vectors and leave seven.
binding.set_option("coartic", "-unroll-peel-max-count=0")

# Vectors have 512 bits where there are any: on Intel's processors LLVM would prefer 256, with
# which kinematics take 1.5 times as long.
_features = get_host_cpu_features()
if _config.CPU_FEATURES is None and "+avx512f" in _features.split(","):
    _config.CPU_FEATURES = f"{_features},-prefer-256-bit"


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
        folder = root / f"kernel-{FINGERPRINT}"
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


def compile_kernel(function: Callable[..., Any], kind: str) -> Any:
    """Compile a function as the decorator of this name in :mod:`coartic.motion.compiled` says.

    Raises CoarticError where Numba is set to compile nothing.
    """
    if numba.config.DISABLE_JIT:
        raise CoarticError("NUMBA_DISABLE_JIT is set: unset it, as coartic's kernels are compiled")
    match kind:
        case "entry":
            return keep_on_disk(njit(**_OPTIONS)(function), function)
        case "inner":
            return for_any_number(njit(**_INNER, error_model="numpy")(function))
        case "shared":
            return keep_on_disk(compile_kernel(function, "inner"), function)
        case "inlined":
            return njit(**_INNER, inline="always")(function)
        case "scalar":
            return njit(nogil=True)(function)
    made = intrinsic(function)
    cpu_target.typing_context.refresh()  # which then knows it
    made._numba_type_ = cpu_target.typing_context.resolve_value_type(made)
    return made


def for_any_number(dispatcher: Any) -> Any:
    """The function, not compiled again for literal integers such as ``count = 0``."""
    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda given, names: template(
        tuple(map(types.unliteral, given)), names
    )
    return dispatcher


@cache
def say_so() -> None:
    """Say, once a process, that it compiles; a program shows this if it logs what coartic says."""
    logging.getLogger("coartic").info("Compiling (once): this takes up to a minute.")


class MachineCode(FunctionCache):
    """Machine code on disk.

    Of processes that lack the same code one compiles it and the others wait for it. A file that
    cannot be read, such as one that a full disk has cut short, is dropped, and what cannot be kept
    is compiled again in the next process.
    """

    lock: IO[bytes] | None = None
    """Held while this process compiles."""

    def load_overload(self, *wanted: Any) -> Any:
        """The code of a signature; None where there is none, and this process is to compile it."""
        self.unlock()
        code = self.load(*wanted)
        if code is None and self.wait_for_lock():
            code = self.load(*wanted)  # somebody may have compiled it meanwhile
            if code is not None:
                self.unlock()
        if code is None:
            say_so()
        return code

    def load(self, *wanted: Any) -> Any:
        """The code of a signature, or None."""
        try:
            # Not load_overload, which first lists all that Numba could compile.
            return self._load_overload(*wanted)
        except Exception:  # an unpickler may say anything
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, *compiled: Any) -> None:
        """Keep compiled code on disk where possible."""
        with contextlib.suppress(Exception):
            super().save_overload(*compiled)
        self.unlock()

    def wait_for_lock(self) -> bool:
        """Lock this function's code; False where the system has no locks, or nobody lets go."""
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            file = open(f"{self.cache_path}/{self._py_func.__name__}.lock", "wb")  # noqa: SIM115
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


def keep_on_disk(dispatcher: Any, function: Callable[..., Any]) -> Any:
    """The compiled function itself, whose machine code is kept where there is a folder for it."""
    folder = cache_folder()
    if folder is not None:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            dispatcher._cache = MachineCode(function)
        finally:
            numba.config.CACHE_DIR = before
    return dispatcher


def mangling_args(record: types.Record) -> tuple[str, tuple[int, ...]]:
    """A name of a record type by its fields."""
    return "Record", (int(hashlib.sha256(record.name.encode()).hexdigest()[:15], 16),)


# Machine code on disk calls functions by names that say their types. Numba names a record by its
# number in the process that compiles, so a process that loads code of two such processes may call
# one's function with the other's record. What is in the record is a name that holds everywhere.
types.Record.mangling_args = property(mangling_args)
