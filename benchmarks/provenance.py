"""The surroundings in which a result is made: versions, machine, commit, command."""

from __future__ import annotations

import contextlib
import hashlib
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
from coartic.internal.text import LONGEST_LINE, plain
from coartic.internal.threads import ONE_THREAD, threads_for
from coartic.motion.compile import FINGERPRINT, PACKAGE

_LIBRARIES = (
    "casadi",
    "clarabel",
    "cvxpy",
    "daqp",
    "llvmlite",
    "numba",
    "numpy",
    "pandas",
    "pydantic",
    "scipy",
)
"""Libraries on which results may depend."""


@cache
def current_environment() -> dict[str, Any]:
    """Versions, platform and commit of this process."""
    processor = platform.processor()
    with contextlib.suppress(OSError):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        if named := re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE):
            processor = named[1]
    return {
        "coartic": coartic.__version__,
        "model_code": FINGERPRINT,
        "commit": commit_of_checkout(),
        "python": platform.python_version(),
        "packages": {name: metadata.version(name) for name in _LIBRARIES},
        "platform": plain(platform.platform(), LONGEST_LINE),
        "processor": plain(f"{processor} (arithmetic {arithmetic()})", LONGEST_LINE),
        "cores": threads_for(-1),
        "threads": ONE_THREAD,
    }


def now() -> str:
    """Date and time, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def command() -> list[str]:
    """The command line of this process; that of a notebook's kernel says nothing."""
    if "ipykernel" in sys.argv[0]:
        return ["a notebook"]
    return [plain(word) for word in (Path(sys.argv[0]).name, *sys.argv[1:])]


def process_peak_mb() -> float | None:
    """Most memory that this process has had so far, MiB; None where the system does not say."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def commit_of_checkout() -> dict[str, Any] | None:
    """Commit of the checkout the code runs from and whether it was changed since."""
    # A GIT_DIR of the caller's (a hook's, say) must not stand in for our checkout.
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(PACKAGE.parent), *arguments]
        said = subprocess.check_output(command, stderr=subprocess.DEVNULL, timeout=20, env=clean)
        return os.fsdecode(said).strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")).resolve() != PACKAGE.parent.resolve():
            return None  # installed inside somebody else's repository
        changed = git("status", "--porcelain", "--untracked-files=no")
        return {"id": git("rev-parse", "HEAD"), "dirty": bool(changed)}
    except (OSError, subprocess.SubprocessError):
        return None


def arithmetic() -> str:
    """Hash of the bits of eigenvectors and logarithms: where it is the same, NumPy and its linear
    algebra round alike. They choose their instructions by the processor, whose name says little of
    it on virtual machines."""
    matrix = np.random.default_rng(0).standard_normal((16, 16))
    computed = *np.linalg.eigh(matrix @ matrix.T), np.log(np.abs(matrix))
    return hashlib.sha256(b"".join(each.tobytes() for each in computed)).hexdigest()[:8]
