"""Processes that round numbers alike, with and without the main program of their parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from multiprocessing import resource_tracker
from types import ModuleType
from typing import Any

from coartic.errors import CoarticError
from coartic.internal.interruption import blocked_signals
from coartic.internal.threads import environment, worker_variables

# Processes are forked from a server that has imported their modules. The path of the server's
# socket must be short: the system allows 103 characters, and Python adds some to the temporary
# folder. If that folder's path is too long, each process imports its modules itself (spawn).
_BASE: Any = multiprocessing.get_context(
    "forkserver" if len(tempfile.gettempdir()) <= 70 else "spawn"
)
_PRELOADED = "coartic.benchmarks.pool", "coartic.benchmarks.preload"
_starting = threading.Lock()


class WorkerProcess(_BASE.Process):  # type: ignore[misc]
    """Process that starts with the environment variables of a worker.

    NumPy reads these variables when it is imported (:func:`.worker_variables`). The process does
    not import the main program. It searches for modules in the folders of the parent's
    ``sys.path``, and not in the current folder in addition.
    """

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        return _start(process, ModuleType("__main__"))


class ProgramProcess(_BASE.Process):  # type: ignore[misc]
    """Worker process that imports the main program, so that it can call its functions."""

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        return _start(process, sys.modules["__main__"])


def _start(process: Any, main: ModuleType) -> Any:
    """Start a process that uses the module ``main`` as its main program."""
    path = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with _starting, environment(worker_variables() | path), blocked_signals():
        multiprocessing.set_forkserver_preload(list(_PRELOADED))
        here, sys.modules["__main__"] = sys.modules["__main__"], main
        try:
            return _BASE.Process._Popen(process)
        finally:
            sys.modules["__main__"] = here


class _WorkerContext(type(_BASE)):  # type: ignore[misc]
    """Context of ``multiprocessing`` for worker processes.

    Before a lock is made, the context starts Python's resource tracker, a further process, so that
    it does not import modules from the current folder either.
    """

    Process = WorkerProcess

    def Lock(self) -> Any:  # noqa: N802
        return _made(super().Lock)

    def RLock(self) -> Any:  # noqa: N802
        return _made(super().RLock)


def _made(lock: Callable[[], Any]) -> Any:
    """Call ``lock`` to make a lock, and return the lock.

    Raises CoarticError if the system cannot make one, for example because ``/dev/shm`` is full.
    """
    _start_tracker()
    try:
        return lock()
    except OSError as error:
        raise CoarticError(
            f"processes cannot have a lock ({error.strerror}): /dev/shm must have free space, and "
            "you must be allowed to write there"
        ) from None


def _start_tracker() -> None:
    with _starting, environment({"PYTHONSAFEPATH": "1"}):
        resource_tracker.ensure_running()


class _ProgramContext(_WorkerContext):
    Process = ProgramProcess


CONTEXT: Any = _WorkerContext()
"""Context of ``multiprocessing`` whose processes are :class:`WorkerProcess`."""
PROGRAM_CONTEXT: Any = _ProgramContext()
"""Context of ``multiprocessing`` whose processes are :class:`ProgramProcess`."""


def signal_name(number: int) -> str:
    """Return the name of a signal, such as ``SIGKILL`` for 9.

    The name of a signal that Python does not know is its number, such as ``signal 40``.
    """
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
