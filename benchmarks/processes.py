"""Processes for methods: they round alike on all processors, and import what is installed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from multiprocessing import resource_tracker
from types import ModuleType
from typing import Any

from coartic.internal.interruption import blocked_signals
from coartic.internal.threads import environment, worker_variables

# Processes are forked from a server that has imported their modules, if the path of its socket is
# short: the system takes 103 characters, and Python adds some.
_BASE: Any = multiprocessing.get_context(
    "forkserver" if len(tempfile.gettempdir()) <= 70 else "spawn"
)
_PRELOADED = "coartic.benchmarks.pool", "coartic.benchmarks.preload"
_starting = threading.Lock()


class WorkerProcess(_BASE.Process):  # type: ignore[misc]
    """A process that starts with the environment variables of a worker.

    NumPy reads them when it is imported. The process imports neither the main program again nor
    modules from the working folder, whoever wrote them.
    """

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        path = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        with _starting, environment(worker_variables() | path), blocked_signals():
            multiprocessing.set_forkserver_preload(list(_PRELOADED))
            main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
            try:
                return _BASE.Process._Popen(process)
            finally:
                sys.modules["__main__"] = main


class _WorkerContext(type(_BASE)):  # type: ignore[misc]
    """Context of workers. The first lock starts a process of Python that keeps track of locks; it
    imports nothing from the working folder either."""

    Process = WorkerProcess

    def Lock(self) -> Any:  # noqa: N802
        _start_tracker()
        return super().Lock()

    def RLock(self) -> Any:  # noqa: N802
        _start_tracker()
        return super().RLock()


def _start_tracker() -> None:
    with _starting, environment({"PYTHONSAFEPATH": "1"}):
        resource_tracker.ensure_running()


CONTEXT: Any = _WorkerContext()
"""Context of ``multiprocessing`` whose processes are :class:`WorkerProcess`."""


def signal_name(number: int) -> str:
    """Return the name of a signal, such as ``SIGKILL``, or, for a signal without a name here, its
    number, as in ``signal 40``."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
