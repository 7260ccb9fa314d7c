"""Describe how a result was made: versions, machine, commit and command."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import platform
import re
import subprocess
import sys
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import coartic
from coartic.benchmarks.pool import process_pool
from coartic.benchmarks.processes import CONTEXT
from coartic.internal.text import MAX_LINE_LENGTH, plain
from coartic.internal.threads import threads_for, worker_variables
from coartic.motion.kernels.compile import PACKAGE, hash_of_files, python_files

_LIBRARIES = ("casadi", "daqp", "llvmlite", "numba", "numpy", "pandas", "pydantic", "scipy")
"""Libraries that results may depend on."""
MODEL_FILES = [
    *(PACKAGE / name for name in ("robot.py", "model.py", "tasks/task.py")),
    *python_files("motion", "learner", "method"),
]
"""Files of the model: a change of one of these files may change results."""
_MODEL_CODE = hash_of_files(MODEL_FILES)


@cache
def current_environment() -> dict[str, Any]:
    """Return the versions, settings and hardware on which results of this process can depend.

    Each call returns the same dict: do not change it.

    Returns
    -------
    dict
        - ``coartic``, ``python``: versions of coartic and of Python;
        - ``packages``: dict that maps libraries (numpy, scipy, ...) to their versions;
        - ``model_code``: hash of the files of the model (:data:`MODEL_FILES`);
        - ``commit``: dict with the id of the commit of the checkout (``id``), and whether tracked
          files were changed since (``dirty``); None for an installed package, or if Git fails;
        - ``platform``, ``processor``: names of the operating system and of the processor;
        - ``cores``: number of cores that this process may use;
        - ``arithmetic``: fingerprint of how libraries round (:func:`arithmetic`);
        - ``threads``: dict that maps the environment variables of workers to their values.
    """
    processor = platform.processor()
    with contextlib.suppress(OSError):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        if named := re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE):
            processor = named[1]
    return {
        "coartic": coartic.__version__,
        "model_code": _MODEL_CODE,
        "commit": _commit_of_checkout(),
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in _LIBRARIES},
        "platform": plain(platform.platform(), MAX_LINE_LENGTH),
        "processor": plain(processor, MAX_LINE_LENGTH),
        "arithmetic": arithmetic(),
        "cores": threads_for(-1),
        "threads": dict(worker_variables()),
    }


def now() -> str:
    """Return the date and time in UTC, to the second, in ISO 8601 format."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def made_with() -> dict[str, Any]:
    """Return the environment of this process, with the command and the present date.

    Returns
    -------
    dict
        A new dict with the entries of :func:`current_environment` and two further entries:

        - ``command``: list of the program and its arguments; ``["a notebook"]`` in a notebook;
        - ``date``: date and time in UTC (:func:`now`).
    """
    words = [Path(sys.argv[0]).name, *sys.argv[1:]]
    command = ["a notebook"] if "ipykernel" in sys.argv[0] else [*map(plain, words)]
    return current_environment() | {"command": command, "date": now()}


def _commit_of_checkout() -> dict[str, Any] | None:
    """Return the commit of the checkout that the code runs from.

    Returns
    -------
    dict or None
        ``id`` is the hash of the commit; ``dirty`` is True if tracked files were changed since the
        commit. None is returned if the code is not in a checkout of its own, or if Git fails.
    """
    # A GIT_DIR of the caller, such as a hook, must not replace this checkout.
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(PACKAGE.parent), *arguments]
        output = subprocess.check_output(command, stderr=subprocess.DEVNULL, timeout=20, env=clean)
        return os.fsdecode(output).strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")).resolve() != PACKAGE.parent.resolve():
            return None  # installed inside another repository
        changed = git("status", "--porcelain", "--untracked-files=no")
        return {"id": git("rev-parse", "HEAD"), "dirty": bool(changed)}
    except (OSError, subprocess.SubprocessError):
        return None


def arithmetic() -> str:
    """Return a fingerprint of how workers round, in the form ``NumPy HASH, libm HASH``.

    A new process with the environment variables of a worker computes some numbers by NumPy, and
    some by the C library (libm). Each of the two hashes is computed from the bits of the numbers of
    one library. If the hash of a library is the same on two machines, the library rounds these
    numbers alike on both.
    """
    with process_pool(1, CONTEXT) as pool:
        return pool.submit(_arithmetic).result()


def _arithmetic() -> str:
    """Compute the fingerprint of :func:`arithmetic` in this process, and return it."""
    matrix = np.random.default_rng(0).standard_normal((16, 16))
    by_numpy = *np.linalg.eigh(matrix @ matrix.T), np.log(np.abs(matrix)), np.abs(matrix) ** 0.3
    numbers = np.abs(matrix).ravel().tolist()
    functions = math.exp, math.log, lambda x: math.pow(x, 0.3)
    by_libm = [[*map(function, numbers)] for function in functions]
    hashes = [
        hashlib.sha256(b"".join(np.asarray(part).tobytes() for part in parts)).hexdigest()[:8]
        for parts in (by_numpy, by_libm)
    ]
    return "NumPy {}, libm {}".format(*hashes)
