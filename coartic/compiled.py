"""How the compiled kernels are built and cached.

Numba keys its on-disk cache by the file of the cached function alone, so a change
in a function it calls from another file would go unnoticed. Here the cache folder
is named after a hash of the package's sources: changed sources, fresh code.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit

from coartic.robot import chain, lever
from coartic.trigonometry import cosine, sine

PACKAGE = Path(__file__).parent
F = TypeVar("F", bound=Callable[..., Any])


def source_fingerprint() -> str:
    """Hash of every Python source of the package: the version of the model's code."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    """A writable folder for compiled code, or None where there is none."""
    user = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "coartic"
    roots = [Path(numba.config.CACHE_DIR)] if numba.config.CACHE_DIR else []
    for root in [*roots, PACKAGE / "__pycache__", user]:
        folder = root / f"kernel-{source_fingerprint()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def inner(function: F) -> F:
    """Compile a function that only other compiled functions call."""
    compiled: F = njit(nogil=True)(function)
    return compiled


def entry(function: F) -> F:
    """Compile a function that Python calls, and keep its machine code on disk."""
    folder = _cache_folder()
    if folder is None:
        return inner(function)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        compiled: F = njit(nogil=True, cache=True)(function)
    finally:
        numba.config.CACHE_DIR = before
    return compiled


_chain = inner(chain)
joint_lever = inner(lever)


@inner
def joint_chain(q: Any, arm: Any, xs: Any, ys: Any) -> None:
    """:func:`coartic.robot.chain` with the kernels' cosine and sine."""
    _chain(q, arm, xs, ys, cosine, sine)
