"""Work that is shared among processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

from coartic.learner.learning import threads_for
from coartic.threads import begin_worker, one_thread_each


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
