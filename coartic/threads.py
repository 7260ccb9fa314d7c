"""How many threads or processes there are, and what all worker processes have in common."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator

from coartic.inputs import check_limits

MOST_JOBS = 10_000
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
    ),
    "1",
)
"""Environment of a worker. One run, one core: BLAS threads would get in each other's way."""


def threads_for(jobs: int) -> int:
    """Number of threads or processes; ``jobs`` is -1 for one a core.

    Raises ValueError for 0, which is none, and for what is no number of them.
    """
    if jobs != -1 or isinstance(jobs, float):
        check_limits("jobs", jobs, 1, MOST_JOBS)
        return jobs
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Workers that begin meanwhile have one thread for BLAS each."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end this process, whatever it does, when the parent has
    ended. The server that it was forked from lives as long as any worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_parent, daemon=True).start()


def end_with_parent() -> None:
    """Wait for the end of the process that this one works for."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
