"""The process between a suite and a worker: it sees to it that nothing outlives its purpose.

``python -m coartic.benchmarks.guard PARENT`` starts a worker on its own standard streams and
waits. When the worker ends, or the parent does, every process that the worker has started is ended
as well: on Linux those that detached themselves too, because the guard is where the kernel
hands orphans to (``PR_SET_CHILD_SUBREAPER``); elsewhere those that are still linked to it.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterable

import psutil

# A worker's. One run, one core: BLAS and OpenMP threads would only get in each other's way.
THREADS = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
    ),
    "1",
)
_LOOK_S = 0.2  # between looks at the parent
_END_LIMIT_S = 5.0
# What is imported stays: to look through it for garbage would be a fifth of a worker's start.
_WORKER = "import gc; gc.disable(); from coartic.benchmarks.worker import main; main()"


def end_below(process: psutil.Process, *, patience_s: float = _END_LIMIT_S) -> None:
    """End everything that a process has started, at any depth, but not the process itself."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        try:
            below = process.children(recursive=True)
        except psutil.Error:
            return
        alive = [child for child in below if _runs(child)]
        if not alive:
            return
        end(alive)


def end(processes: Iterable[psutil.Process]) -> None:
    """End processes at once."""
    ended = list(processes)
    for process in ended:
        with contextlib.suppress(psutil.Error):
            process.kill()
    psutil.wait_procs(ended, timeout=0.05)


def _runs(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.Error:
        return False


def _receive_orphans() -> None:
    if sys.platform != "linux":
        return
    import ctypes

    set_child_subreaper = 36  # PR_SET_CHILD_SUBREAPER
    ctypes.CDLL(None).prctl(set_child_subreaper, 1, 0, 0, 0)


def main() -> None:
    """Guard one worker; exit with its code, or 128 and the number of the signal it had."""
    _receive_orphans()
    own = psutil.Process()
    try:
        parent = psutil.Process(int(sys.argv[1]))
    except psutil.NoSuchProcess:  # it ended before we looked
        return
    worker = subprocess.Popen([sys.executable, "-P", "-c", _WORKER], start_new_session=True)
    with open(os.devnull, "r+b") as nothing:  # the streams are the worker's: it ends them
        for stream in (0, 1, 2):
            os.dup2(nothing.fileno(), stream)
    code: int | None = None
    while code is None and parent.is_running() and _runs(parent):
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = worker.wait(_LOOK_S)
    end_below(own)
    os._exit(0 if code is None else code if code >= 0 else 128 - code)


if __name__ == "__main__":
    main()
