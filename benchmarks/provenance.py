"""Where and with what a result was made, recorded while it is made."""

from __future__ import annotations

import json
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

import psutil

import coartic
from coartic.motion.compiled import PACKAGE, source_fingerprint
from coartic.runs.record import Environment
from coartic.text import LONGEST_LINE, plain

_LIBRARIES = (
    "casadi",
    "clarabel",
    "cvxpy",
    "daqp",
    "dask",
    "distributed",
    "filelock",
    "joblib",
    "llvmlite",
    "matplotlib",
    "numba",
    "numpy",
    "pandas",
    "psutil",
    "pyarrow",
    "pydantic",
    "rich",
    "scipy",
    "typer",
)


def environment() -> dict[str, Any]:
    """Versions, platform, commit, date and command of this process."""
    from joblib import cpu_count

    return {
        "coartic": coartic.__version__,
        "model_code": source_fingerprint(),
        "commit": _commit(),
        "python": platform.python_version(),
        "packages": _versions(),
        "platform": plain(platform.platform(), LONGEST_LINE),
        "processor": plain(_processor(), LONGEST_LINE),
        "cores": cpu_count(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command(),
        "threads": None,
    }


def surroundings() -> Environment:
    """:func:`environment`, typed."""
    return Environment.model_validate_json(json.dumps(environment()))


def command() -> list[str]:
    """The command line of this process; that of a notebook's kernel says nothing."""
    if "ipykernel" in sys.argv[0]:
        return ["a notebook"]
    return [plain(word) for word in (Path(sys.argv[0]).name, *sys.argv[1:])]


def process_peak_mb() -> float:
    """Most memory that this process has had so far, MiB."""
    try:
        import resource
    except ImportError:  # Windows
        return float(psutil.Process().memory_info().peak_wset) / 2**20
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


@cache
def _versions() -> dict[str, str]:
    return {name: metadata.version(name) for name in _LIBRARIES}


@cache
def _commit() -> dict[str, Any] | None:
    """Commit of the checkout the code runs from and whether it was changed since."""
    root = PACKAGE.parent

    def git(*arguments: str) -> str:
        # A GIT_DIR of the caller's (a hook's, say) must not stand in for our checkout.
        clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
        return subprocess.run(
            ["git", "-C", str(root), *arguments],
            capture_output=True,
            text=True,
            check=True,
            timeout=20,
            env=clean,
        ).stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")).resolve() != root.resolve():
            return None  # installed inside somebody else's repository
        return {
            "id": git("rev-parse", "HEAD"),
            "dirty": bool(git("status", "--porcelain", "--untracked-files=no")),
        }
    except (OSError, subprocess.SubprocessError):
        return None


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor()
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found.group(1) if found else platform.processor()
