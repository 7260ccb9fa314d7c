"""Numbers of threads and processes, and the set-up that all worker processes share."""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import platform
import shutil
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import metadata
from multiprocessing.util import Finalize
from numbers import Integral
from pathlib import Path

from coartic.internal.interruption import ENDING

MOST_JOBS = 10_000
_POOLS = "OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMBA_NUM", "VECLIB_MAXIMUM"
ONE_THREAD = dict.fromkeys([f"{name}_THREADS" for name in _POOLS], "1")
"""Environment variables by which a worker has one thread: BLAS threads of workers compete."""


@cache
def worker_variables() -> dict[str, str]:
    """Return environment variables to set for a process in which methods run: one thread, and on
    x86-64 OpenBLAS's kernels for Nehalem and NumPy's loops without AVX-512, so that x86-64
    processors with AVX2 (from Haswell and Zen on) round alike."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return ONE_THREAD
    major, minor = map(int, metadata.version("numpy").split(".")[:2])
    names = "X86_V4,AVX512_ICL,AVX512_SPR"
    if (major, minor) < (2, 4):
        names = "AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL,AVX512_ICL"
    return ONE_THREAD | {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": names}


def threads_for(jobs: int) -> int:
    """Return the number of threads or processes that ``jobs`` means: ``jobs`` itself, a whole
    number from 1 to 10,000, or for -1 the number of cores that the process may use. Raises
    ValueError for anything else."""
    if not (isinstance(jobs, Integral) and jobs == -1):
        from coartic.internal.limits import check_limits  # which needs NumPy

        check_limits("jobs", jobs, 1, MOST_JOBS)
        return jobs
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_parts(work: Callable[[slice], object], count: int, least: int) -> None:
    """Call ``work`` with consecutive slices that together cover the indices 0 to ``count`` - 1, in
    parallel: at least ``least`` indices each, unless one slice has all, and at most as many slices
    as ``OMP_NUM_THREADS`` says (one for 0), or, if it has no number, as the process may use cores.
    Returns when all calls have ended; an error that ``work`` raises passes."""
    if count < 2 * least:
        work(slice(0, count))
        return
    allowed = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    most = int(allowed) if allowed.isdigit() else threads_for(-1)
    threads = max(1, min(count // least, most))
    edges = [count * part // threads for part in range(threads + 1)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, itertools.starmap(slice, itertools.pairwise(edges))))


@contextlib.contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables in the block of this context, for processes that start in it; at
    its end reset them to their former values, or remove variables that were not set."""
    before = {name: os.environ[name] for name in variables if name in os.environ}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            del os.environ[name]
        os.environ.update(before)


def begin_worker(folder: Path | None = None, streams: int = 3) -> None:
    """Make this process a worker: the leader of a new group of processes, with the
    first ``streams`` of input, output and errors connected to the null device. SIGTERM kills the
    process with its group, and so does :func:`end_with_parent`, which removes ``folder`` before."""
    nobody = os.open(os.devnull, os.O_RDWR)
    for stream in range(streams):
        os.dup2(nobody, stream)
    os.setpgid(0, 0)
    signal.signal(signal.SIGTERM, lambda *_: end_group(os.getpid()))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)  # see blocked_signals
    end_with_parent(folder, lambda: end_group(os.getpid()))
    # A worker that ends by itself, as when its parent closes the pipe first, takes its group along.
    Finalize(None, end_group, (os.getpid(),), exitpriority=0)


def end_with_parent(
    folder: Path | None = None, end: Callable[[], object] = lambda: os._exit(1)
) -> None:
    """Start a thread that, when the parent of this process by ``multiprocessing`` has ended,
    removes ``folder``, if given, and calls ``end``."""

    def wait() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            parent.join()
            if folder is not None:
                shutil.rmtree(folder, ignore_errors=True)
            end()

    threading.Thread(target=wait, daemon=True).start()


def end_group(pid: int) -> None:
    """Kill the group of processes that process ``pid`` leads, and process ``pid``; pass over either
    that does not exist or may not be killed."""
    for end in (os.killpg, os.kill):
        with contextlib.suppress(OSError):
            end(pid, signal.SIGKILL)
