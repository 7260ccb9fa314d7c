"""Work that is shared among processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from threading import Thread
from typing import Any

from coartic.learner.learning import threads_for


@contextmanager
def processes(jobs: int, pieces: int) -> Iterator[Callable[..., Any]]:
    """``map`` in ``jobs`` processes, -1 for one a core; in this one where one is enough."""
    workers = min(threads_for(jobs), pieces)
    if workers <= 1:
        yield map
        return
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin) as pool:
        yield pool.map


def _begin() -> None:
    """A worker ends with the process that it works for, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent
    Thread(target=_follow, daemon=True).start()


def _follow() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
