"""Kernels: functions that Numba compiles when they are first called.

Numba is imported at the first call of a kernel, so that a command that only lists names does not
need it. The machine code is stored on disk. Numba compiles a stored function again if the file of
this function has changed. It does not notice changes in the files of other functions that the
function calls. Therefore the name of the folder of the machine code contains a hash of
:data:`KERNEL_FILES`. If one of these files changes, all kernels are compiled again.
"""

from __future__ import annotations

import contextlib
import copy
import ctypes
import fcntl
import hashlib
import logging
import os
import re
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import cache, cached_property, partial, update_wrapper
from multiprocessing import parent_process
from pathlib import Path
from threading import Lock
from types import SimpleNamespace
from typing import IO, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from coartic.errors import CoarticError
from coartic.robot import chain, lever

PACKAGE = Path(__file__).parents[2]
_KEPT_S = 30 * 24 * 3600.0  # time for which unused machine code of other sources is stored
_MAX_COMPILATION_S, _RETRY_S = 120.0, 0.05
_TOLD_S = 60.0  # time after which a message names the process that is waited for
_IMPORTING = Lock()  # an option of LLVM can be set only once
F = TypeVar("F", bound=Callable[..., Any])


def python_files(*folders: str) -> list[Path]:
    """Return the sorted paths of the Python files in folders of ``coartic``.

    Files in subfolders are included.
    """
    return sorted(path for folder in folders for path in (PACKAGE / folder).rglob("*.py"))


def hash_of_files(files: Iterable[Path]) -> str:
    """Return a hash of the names and contents of files: 16 hex digits of SHA-256."""
    texts = (path.name.encode() + b"\0" + path.read_bytes() for path in files)
    return hashlib.sha256(b"\0".join(texts)).hexdigest()[:16]


_DECORATED = re.compile(rb"^@(entry|inner|shared|inlined|scalar|intrinsic)$", re.MULTILINE)
KERNEL_FILES = [
    PACKAGE / "robot.py",
    *(path for path in python_files("motion", "learner") if _DECORATED.search(path.read_bytes())),
]
"""The files in ``motion`` and ``learner`` that define kernels, and ``robot.py``, whose formulas are
compiled as well. A kernel in any other file may call only kernels of these files and of its own
file, because Numba itself notices changes of its own file."""
FINGERPRINT = hash_of_files(KERNEL_FILES)
"""Hash of the files of the kernels when this module was imported."""


class _Kernel:
    """A function that Numba compiles when it is first called (:func:`_compile_kernel`)."""

    def __init__(self, kind: str, function: Callable[..., Any]) -> None:
        self.kind, self.function = kind, function
        update_wrapper(self, function)

    @cached_property
    def dispatcher(self) -> Any:
        """The compiled function: a dispatcher of Numba, or an intrinsic.

        A dispatcher compiles the function, or reads its machine code, when it is first called.
        Raises CoarticError as :func:`_compile_kernel` does.
        """
        return _compile_kernel(self.function, self.kind)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function, and return its result.

        Raises TypeError for a kernel that only other kernels can call.
        """
        if self.kind not in ("entry", "scalar"):
            raise TypeError(f"{self.function.__name__} can only be called by other kernels")
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of :attr:`dispatcher` that Numba needs when another kernel calls it.

        Raises AttributeError for other attributes.
        """
        if name in ("_numba_type_", "py_func", "targetoptions"):
            return getattr(self.dispatcher, name)
        raise AttributeError(f"a kernel has no attribute {name!r}")


def _decorator(kind: str) -> Callable[[F], F]:
    """Return the decorator that makes a function a kernel of ``kind``, such as ``"entry"``."""
    return cast(Callable[[F], F], partial(_Kernel, kind))


entry = _decorator("entry")
"""A kernel that Python calls; its machine code is stored on disk."""
inner = _decorator("inner")
"""A kernel that only other kernels call; a division by 0 gives infinity or NaN."""
shared = _decorator("shared")
"""An inner kernel that several entries call; its machine code is stored on disk as well."""
inlined = _decorator("inlined")
"""An inner kernel that is inlined into its callers. A division by 0 has the result that it has in
the caller. Inlining avoids the cost of passing large records, and lets the compiler unroll loops
over a known shape."""
scalar = _decorator("scalar")
"""A kernel with scalar arguments, which Python and other compiled functions may also call."""
intrinsic: Callable[[Any], Any] = _decorator("intrinsic")
"""A function that returns a pair: the type of a call in a kernel, and a function that builds the
machine code of this call."""


# ---- What kernels share ----


def record_type(fields: Mapping[str, Any]) -> np.dtype[np.void]:
    """Return the NumPy dtype of an aligned record for kernels.

    ``fields`` maps the names of the fields, in order, to their types.
    """
    return np.dtype(list(fields.items()), align=True)


@inlined
def fill_row(row: Any, values: Any) -> None:
    """Copy numbers from the beginning of ``values`` into ``row``, in place.

    If the lengths differ, the number of copied numbers is the smaller length.
    """
    for j in range(min(len(row), len(values))):
        row[j] = values[j]


chain_by = inner(chain)
joint_lever = inner(lever)
_DRAWS = ("state", "next_uint64", "next_double")  # of a bit generator, as NumPy hands it to C


def addresses(generators: Iterable[np.random.Generator]) -> NDArray[np.uintp]:
    """Return the memory addresses through which kernels draw from N > 0 NumPy generators.

    The result has shape ``(N, 3)``, with a row for each generator. The row contains the address of
    the generator's state and the addresses of two of its C functions, for :func:`generator_at`. The
    generators must exist until the kernel returns.
    """
    rows = [
        [ctypes.cast(getattr(c, name), ctypes.c_void_p).value for name in _DRAWS]
        for c in (generator.bit_generator.ctypes for generator in generators)
    ]
    return np.array(rows, dtype=np.uintp)


@intrinsic
def _generator_of(_: Any, state: Any, next_uint64: Any, next_double: Any) -> Any:
    """Build the call that makes a NumPy generator in a kernel.

    The call makes the generator from the addresses of its state and its functions
    (:func:`addresses`). As in every intrinsic of Numba, the arguments of this function are types of
    Numba, and the result is a pair: the signature of the call, and a function that builds its code.
    """
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
    """Return the NumPy generator of run ``run`` (from 0) from its row of :func:`addresses`."""
    return _generator_of(addresses[run, 0], addresses[run, 1], addresses[run, 2])


# ---- Numba ----


def import_numba() -> Any:
    """Import Numba with the settings that kernels need, and return the module."""
    with _IMPORTING:
        return _set_up_numba()


@cache
def _set_up_numba() -> Any:
    """Import Numba, set it up, and return the module.

    The options that are set for LLVM change only the speed of kernels. They have no effect if the
    program has compiled something else with Numba before.
    """
    modules: dict[str, Any] = sys.modules
    yaml_module = {"yaml": modules["yaml"]} if "yaml" in modules else {}
    modules["yaml"] = None  # Numba then reads no settings from a file in the current folder
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "A Numba config file is found")
            from numba.core import config
    finally:
        del modules["yaml"]
        modules.update(yaml_module)
    config._config_fname = ""  # nor when it compiles

    from llvmlite import binding  # installed with Numba, in the version that Numba needs

    # Unroll loops over the links of an arm. Otherwise the loop over slots around them could not
    # become vector instructions; LLVM's default bound stops unrolling at four links.
    binding.set_option("coartic", "-unroll-threshold=1000")
    # No loop peeling: it would take one slot out of a loop over whole vectors and leave seven.
    binding.set_option("coartic", "-unroll-peel-max-count=0")
    import numba.extending
    from numba.core.codegen import get_host_cpu_features

    # Use vectors of 512 bits where the processor has them. On Intel's processors LLVM would prefer
    # 256 bits, with which kinematics take 1.5 times as long.
    features = get_host_cpu_features()
    if config.CPU_FEATURES is None and "+avx512f" in features.split(","):
        config.CPU_FEATURES = f"{features},-prefer-256-bit"

    def mangling_args(record: Any) -> tuple[str, tuple[int, ...]]:
        return "Record", (int(hashlib.sha256(record.name.encode()).hexdigest()[:15], 16),)

    # Machine code on disk calls functions by names that include the types of their arguments.
    # Numba names a record type by its number in the process that compiles. A process that loads
    # code from two such processes could call the function of one with the record of the other, so
    # here a record type is named by its fields.
    numba.types.Record.mangling_args = property(mangling_args)
    from numba.core import inline_closurecall

    # Numba reads a function anew each time it inlines it, and then copies it twice, block by block,
    # which takes a third of the time. The blocks of this project's kernels need no copy.
    def copy_block(block: Any) -> Any:
        return block if block.loc.filename.startswith(str(PACKAGE)) else copy.deepcopy(block)

    inline_closurecall.copy = SimpleNamespace(copy=copy.copy, deepcopy=copy_block)
    return numba


def _compile_kernel(function: Callable[..., Any], kind: str) -> Any:
    """Return the dispatcher or intrinsic that Numba makes of a function.

    ``kind`` is the name of its decorator. Raises CoarticError if environment variables keep Numba
    from compiling.
    """
    try:
        numba = import_numba()
    except ValueError as error:
        raise CoarticError(
            f"Numba cannot start ({error}): unset its environment variables, such as "
            "NUMBA_NUM_THREADS"
        ) from None
    if numba.config.DISABLE_JIT:
        raise CoarticError(
            "NUMBA_DISABLE_JIT is set: unset it, because coartic's kernels have to be compiled"
        )
    # Kernels allocate nothing and work on arrays that their caller holds. They need not count
    # references (NRT, Numba's run time), which would take a quarter of the time.
    options: dict[str, Any] = {"nogil": True, "_nrt": False, "no_cfunc_wrapper": True}
    if kind in ("inner", "shared", "inlined"):
        options["no_cpython_wrapper"] = True  # the wrapper would take as long to compile
    match kind:
        case "entry":
            return _keep_on_disk(numba.njit(**options)(function), function)
        case "inner" | "shared":
            compiled = numba.njit(**options, error_model="numpy")(function)
            # Do not compile again for literal integers such as count = 0.
            template, unliteral = compiled.get_call_template, numba.types.unliteral
            compiled.get_call_template = lambda types, names: template(
                tuple(map(unliteral, types)), names
            )
            return _keep_on_disk(compiled, function) if kind == "shared" else compiled
        case "inlined":
            return numba.njit(**options, inline="always")(function)
        case "scalar":
            return numba.njit(nogil=True)(function)
    builder, context = numba.extending.intrinsic(function), numba.core.registry.cpu_target
    context.typing_context.refresh()  # so that it knows the intrinsic
    builder._numba_type_ = context.typing_context.resolve_value_type(builder)
    return builder


def _keep_on_disk(compiled: Any, function: Callable[..., Any]) -> Any:
    """Make a compiled function read and store its machine code on disk, and return it.

    The function is returned unchanged if no folder can be written.
    """
    folder, config = _cache_folder(), import_numba().config
    if folder is not None:
        previous, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            compiled._cache = _MachineCode(function)
        finally:
            config.CACHE_DIR = previous
    return compiled


def _cache_folder() -> Path | None:
    """Return the folder for machine code of these sources, or None if none is writable.

    The folder is made if it does not exist. Old folders next to it are removed
    (:func:`_remove_old`).
    """
    roots, chosen = [PACKAGE / "__pycache__"], import_numba().config.CACHE_DIR
    if Path(chosen).is_absolute():  # a relative folder would change with the current folder
        roots.insert(0, Path(chosen) / "coartic")
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    if Path(cache_home).is_absolute():
        roots.append(Path(cache_home) / "coartic")
    else:
        with contextlib.suppress(RuntimeError):  # a user without a home
            roots.append(Path.home() / ".cache" / "coartic")
    for root in roots:
        folder = root / f"kernel-{FINGERPRINT}"
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                _remove_old(root, folder)
                return folder
    return None


def _remove_old(root: Path, current: Path) -> None:
    """Remove folders of machine code that no process has begun to use for 30 days.

    The folders are looked for in ``root``. Folder ``current`` is not removed, and its time stamp is
    set to now.
    """
    with contextlib.suppress(OSError):
        os.utime(current)
    for folder in root.glob(f"kernel-{'[0-9a-f]' * 16}"):
        with contextlib.suppress(OSError):
            if folder != current and folder.stat().st_mtime < time.time() - _KEPT_S:
                shutil.rmtree(folder, ignore_errors=True)


@cache
def _command_id() -> int:
    """Return the process id of the command.

    In a worker it is the id of the parent process, and otherwise the id of this process.
    """
    parent = parent_process()
    return (parent.pid if parent else None) or os.getpid()


def _log_once(message: str) -> None:
    """Log a message (logger ``coartic``, level info)."""
    logging.getLogger("coartic").info(message)


class _MachineCode:
    """Cache of a function's machine code on disk, with the interface of Numba's caches.

    If several processes need the same code, one process compiles the code and the other processes
    wait, at most 120 s, provided that files can be locked. Code that cannot be loaded or stored is
    compiled again.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        from numba.core.caching import FunctionCache

        self.files = FunctionCache(function)
        self.cache_path: str = self.files.cache_path
        self.name = function.__name__
        self.lock: IO[bytes] | None = None  # held while this process compiles

    def load_overload(self, *signature: Any) -> Any:
        """Return a signature's machine code, or None if it has to be compiled.

        If another process compiles the same code, this process waits for it
        (:meth:`wait_for_lock`). If code has to be compiled, a message is logged. ``signature`` is
        as Numba passes it.
        """
        self.unlock()
        code = self.load(*signature)
        if code is None and self.wait_for_lock():
            code = self.load(*signature)  # another process may have compiled it meanwhile
            if code is not None:
                self.unlock()
        if code is None:
            _log_once("Compiling (once): this takes up to a minute.")
        return code

    def load(self, *signature: Any) -> Any:
        """Return the machine code of a signature from disk, or None if there is none.

        If loading raises an error, the index of the function's code is emptied.
        ``signature`` is as Numba passes it.
        """
        try:
            # Not load_overload, which first lists everything that Numba could compile.
            return self.files._load_overload(*signature)
        except Exception:  # an unpickler may raise any error
            with contextlib.suppress(OSError):
                self.files.flush()
            return None

    def save_overload(self, *compiled: Any) -> None:
        """Store compiled code, as Numba passes it, on disk if possible, and release the lock."""
        with contextlib.suppress(Exception):
            self.files.save_overload(*compiled)
        self.unlock()

    def wait_for_lock(self) -> bool:
        """Lock this function's code for this process, and return whether that succeeded.

        The id of the process, and that of the main process of its command, are written into the
        lock file, unless the disk is full. Locking fails if the file cannot be locked, or if
        another process holds the lock for more than 120 s. After 60 s a logged message names that
        process, unless it belongs to the same command.
        """
        with contextlib.suppress(OSError):
            file = open(f"{self.cache_path}/{self.name}.lock", "a+b", buffering=0)  # noqa: SIM115
            for tries in range(round(_MAX_COMPILATION_S / _RETRY_S)):
                with contextlib.suppress(BlockingIOError):
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    self.lock = file
                    with contextlib.suppress(OSError):  # a full disk
                        file.truncate(0)
                        file.write(f"{os.getpid()} {_command_id()}".encode())
                    return True
                time.sleep(_RETRY_S)
                if tries == round(_TOLD_S / _RETRY_S):
                    ids = os.pread(file.fileno(), 40, 0).decode(errors="replace").split()
                    state = f"which compiles, or is stopped: it holds {file.name}"
                    if ids[1:] != [str(_command_id())]:
                        _log_once(f"Waiting for process {' '.join(ids[:1])}, {state}")
            file.close()
        return False

    def unlock(self) -> None:
        """Release this process's lock on the function's code, if it holds the lock."""
        if self.lock is not None:
            self.lock.close()
            self.lock = None
