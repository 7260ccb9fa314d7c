"""Numbers of threads and processes, and the set-up of worker processes."""

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

MAX_JOBS = 10_000
_POOLS = "OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMBA_NUM", "VECLIB_MAXIMUM"
_environment_lock = threading.RLock()
ONE_THREAD = dict.fromkeys([f"{name}_THREADS" for name in _POOLS], "1")
"""Dict that maps environment variables to values that limit numerical libraries to one thread in
each worker. More threads of several workers would compete for the cores."""


@cache
def worker_variables() -> dict[str, str]:
    """Return a dict of the environment variables of worker processes, in which methods run.

    The variables limit numerical libraries to one thread. On x86-64 they also select OpenBLAS's
    kernels for Nehalem and NumPy's loops without AVX-512, so that floating-point results are the
    same on all processors with AVX2 (from Haswell and Zen on). Each call returns the same dict: do
    not change it.
    """
    if platform.machine() not in ("x86_64", "AMD64"):
        return ONE_THREAD
    major, minor = map(int, metadata.version("numpy").split(".")[:2])
    names = "X86_V4,AVX512_ICL,AVX512_SPR"
    if (major, minor) < (2, 4):
        names = "AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL,AVX512_ICL"
    return ONE_THREAD | {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": names}


def threads_for(jobs: int) -> int:
    """Return the number of threads or processes that a parameter ``jobs`` asks for.

    An integer from 1 to 10,000 asks for this number, and -1 for the number of cores that the
    process may use. Raises ValueError for any other value.
    """
    if not (isinstance(jobs, Integral) and jobs == -1):
        from coartic.internal.limits import check_limits  # imports NumPy

        check_limits("jobs", jobs, 1, MAX_JOBS)
        return jobs
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_parts(work: Callable[[slice], object], count: int, least: int) -> None:
    """Call a function with slices of a range of indices, in parallel threads.

    The slices cover ``range(count)``. The number of slices is at most the value of the environment
    variable ``OMP_NUM_THREADS``. If that is not a number, it is at most the number of cores that
    the process may use. The function returns when all calls have ended. If a call raises an error,
    the error is raised.

    Parameters
    ----------
    work : callable
        Function that is called with each slice.
    count : int
        Number of indices.
    least : int
        Smallest number of indices in a slice, unless there is only one slice.
    """
    if count < 2 * least:
        work(slice(0, count))
        return
    allowed = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    limit = int(allowed) if allowed.isdigit() else threads_for(-1)
    threads = max(1, min(count // least, limit))
    edges = [count * part // threads for part in range(threads + 1)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, itertools.starmap(slice, itertools.pairwise(edges))))


@contextlib.contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for the processes that are started in a ``with`` block.

    At the end of the block, the earlier values of the variables are restored. If several threads
    use this context manager, their blocks are executed one after the other.
    """
    with _environment_lock:
        old_values = {name: os.environ[name] for name in variables if name in os.environ}
        os.environ.update(variables)
        try:
            yield
        finally:
            for name in variables:
                del os.environ[name]
            os.environ.update(old_values)


def begin_worker(folder: Path | None = None, streams: int = 3) -> None:
    """Make this process a worker: the leader of a new process group.

    If the process gets SIGTERM, ends normally, or loses its parent, the process and all processes
    of the group are killed.

    Parameters
    ----------
    folder : Path, optional
        Folder that is removed when the parent ends.
    streams : int
        Number of standard streams that are connected to the null device: 1 for standard input, 2
        for standard input and output, 3 for standard input, output and error.
    """
    null_device = os.open(os.devnull, os.O_RDWR)
    for stream in range(streams):
        os.dup2(null_device, stream)
    os.setpgid(0, 0)
    signal.signal(signal.SIGTERM, lambda *_: end_group(os.getpid()))
    _let_forks_end()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)  # see blocked_signals
    end_with_parent(folder, lambda: end_group(os.getpid()))
    # A worker that ends in another way, such as when its parent closes the pipe, also kills its
    # group.
    Finalize(None, end_group, (os.getpid(),), exitpriority=0)


def _let_forks_end() -> None:
    """Let SIGTERM end the processes that this process forks.

    For example, a method can make a pool of processes. A forked process inherits the signal handler
    of the worker, and then sets the default handler. SIGTERM is blocked until then, so that the
    inherited handler never handles a signal in the forked process.
    """

    def mask(how: int) -> None:
        signal.pthread_sigmask(how, {signal.SIGTERM})

    def begin_fork() -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        mask(signal.SIG_UNBLOCK)

    os.register_at_fork(
        before=lambda: mask(signal.SIG_BLOCK),
        after_in_child=begin_fork,
        after_in_parent=lambda: mask(signal.SIG_UNBLOCK),
    )


def end_with_parent(
    folder: Path | None = None, end: Callable[[], object] = lambda: os._exit(1)
) -> None:
    """Start a thread that ends this process when its parent has ended.

    The parent is the process that has started this one by ``multiprocessing``.

    Parameters
    ----------
    folder : Path, optional
        Folder that the thread removes before it ends the process.
    end : callable
        Function without arguments that ends the process, by default with exit code 1.
    """

    def wait() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            parent.join()
            if folder is not None:
                shutil.rmtree(folder, ignore_errors=True)
            end()

    threading.Thread(target=wait, daemon=True).start()


def end_group(pid: int) -> None:
    """Kill the process with id ``pid``, and all processes of the group that it leads.

    Nothing is raised if they do not exist.
    """
    for kill in (os.killpg, os.kill):
        with contextlib.suppress(OSError):
            kill(pid, signal.SIGKILL)
