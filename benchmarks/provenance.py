"""Describe the surroundings of a result: versions, machine, commit and command."""

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
from coartic.internal.text import LONGEST_LINE, plain
from coartic.internal.threads import threads_for, worker_variables
from coartic.motion.compile import FINGERPRINT, PACKAGE

_LIBRARIES = ("casadi", "daqp", "llvmlite", "numba", "numpy", "pandas", "pydantic", "scipy")
"""Libraries that results may depend on."""


@cache
def current_environment() -> dict[str, Any]:
    """Return what results of this process can depend on, by name: versions (``coartic``,
    ``python``, ``packages``, ``model_code``, ``commit``), ``platform``, ``processor``,
    ``arithmetic``, ``cores`` and ``threads``, the environment variables of workers. It is always
    the same dictionary, not to be changed."""
    processor = platform.processor()
    with contextlib.suppress(OSError):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        if named := re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE):
            processor = named[1]
    return {
        "coartic": coartic.__version__,
        "model_code": FINGERPRINT,
        "commit": _commit_of_checkout(),
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in _LIBRARIES},
        "platform": plain(platform.platform(), LONGEST_LINE),
        "processor": plain(processor, LONGEST_LINE),
        "arithmetic": arithmetic(),
        "cores": threads_for(-1),
        "threads": dict(worker_variables()),
    }


def now() -> str:
    """Return date and time, UTC, to the second, as ISO 8601 text."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def made_with() -> dict[str, Any]:
    """Return :func:`current_environment` with ``command``, this process's program and arguments, a
    list of words (``a notebook`` in a notebook), and the ``date``, UTC."""
    words = [Path(sys.argv[0]).name, *sys.argv[1:]]
    command = ["a notebook"] if "ipykernel" in sys.argv[0] else [*map(plain, words)]
    return current_environment() | {"command": command, "date": now()}


def _commit_of_checkout() -> dict[str, Any] | None:
    """Return the commit of the checkout that the code runs from, as ``id``, and as ``dirty``
    whether it was changed since (files that Git does not track do not count); None for an installed
    package or if Git fails."""
    # A GIT_DIR of the caller, such as a hook, must not replace this checkout.
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(PACKAGE.parent), *arguments]
        said = subprocess.check_output(command, stderr=subprocess.DEVNULL, timeout=20, env=clean)
        return os.fsdecode(said).strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")).resolve() != PACKAGE.parent.resolve():
            return None  # installed inside another repository
        changed = git("status", "--porcelain", "--untracked-files=no")
        return {"id": git("rev-parse", "HEAD"), "dirty": bool(changed)}
    except (OSError, subprocess.SubprocessError):
        return None


def arithmetic() -> str:
    """Return a fingerprint of how workers round, ``NumPy HASH, libm HASH``: hashes of the bits of
    some results, computed in a process with the variables of a worker. Where a hash is the same,
    that library rounds these results alike."""
    with process_pool(1) as pool:
        return pool.submit(_arithmetic).result()


def _arithmetic() -> str:
    """Return the text of :func:`arithmetic` for this process: a hash of numbers computed by NumPy,
    and a hash of numbers computed by the C library."""
    matrix = np.random.default_rng(0).standard_normal((16, 16))
    by_numpy = *np.linalg.eigh(matrix @ matrix.T), np.log(np.abs(matrix)), np.abs(matrix) ** 0.3
    numbers = np.abs(matrix).ravel().tolist()
    by_libm = [[*map(each, numbers)] for each in (math.exp, math.log, lambda x: math.pow(x, 0.3))]
    hashes = [
        hashlib.sha256(b"".join(np.asarray(each).tobytes() for each in computed)).hexdigest()[:8]
        for computed in (by_numpy, by_libm)
    ]
    return "NumPy {}, libm {}".format(*hashes)
