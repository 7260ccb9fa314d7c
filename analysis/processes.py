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
from coartic.threads import one_thread_each


@contextmanager
def processes(jobs: int, pieces: int) -> Iterator[Callable[..., Any]]:
    """``map`` in ``jobs`` processes, -1 for one a core; in this one where one is enough."""
    workers = min(threads_for(jobs), pieces)
    if workers <= 1:
        yield map
        return
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    with (
        one_thread_each(),
        ProcessPoolExecutor(workers, mp_context=context, initializer=begin_worker) as pool,
    ):
        yield pool.map


def begin_worker() -> None:
    """A worker ends with the process that it works for, however that ends."""

    def end_with_parent() -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None
        parent.join()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent
    Thread(target=end_with_parent, daemon=True).start()
