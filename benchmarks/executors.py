"""Where runs are performed: on this machine, or on a Dask cluster
(``coartic.benchmarks.cluster``).

An executor takes jobs and yields their answers in any order. It may lose some (a
worker dies, the pool breaks): the harness asks again for what is missing.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Iterator, Sequence
from typing import Any, Protocol, runtime_checkable

from coartic.benchmarks.sandbox import Keeper, keeper

Job = dict[str, Any]
Answer = dict[str, Any]
_LOOK_S = 0.5  # between looks at the keyboard
_AHEAD = 4  # jobs a worker that may be begun before an answer is taken: answers fill the memory


@runtime_checkable
class Executor(Protocol):
    """Performs jobs (:meth:`coartic.benchmarks.sandbox.Keeper.perform`). It may lose some, and
    answers none twice."""

    def perform(self, jobs: Sequence[Job]) -> Iterator[Answer]:
        """Answers as they come, in any order."""
        ...


class Local:
    """Sandboxes on this machine, each driven by a thread; one thread each for BLAS.

    ``jobs``: how many, -1 for one a core.
    """

    def __init__(self, jobs: int = -1) -> None:
        self.jobs = jobs

    @property
    def workers(self) -> int:
        """Workers at once, where there are jobs enough."""
        from joblib import effective_n_jobs

        return int(effective_n_jobs(self.jobs))

    def perform(self, jobs: Sequence[Job]) -> Iterator[Answer]:
        """Answers as they come. Raises SandboxError where no worker can be started."""
        waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
        for job in jobs:
            waiting.put(job)
        answers: queue.SimpleQueue[Answer | BaseException] = queue.SimpleQueue()
        keepers: list[Keeper] = []
        workers = min(self.workers, len(jobs))
        room, ended = threading.Semaphore(_AHEAD * workers), threading.Event()

        def work() -> None:
            try:
                with keeper() as own:
                    keepers.append(own)
                    while room.acquire() and not ended.is_set():
                        answers.put(own.perform(waiting.get_nowait()))
            except queue.Empty:
                pass
            except BaseException as error:
                answers.put(error)

        threads = [threading.Thread(target=work, daemon=True) for _ in range(workers)]
        for thread in threads:
            thread.start()
        answered = 0
        try:
            while answered < len(jobs):
                with contextlib.suppress(queue.Empty):
                    answer = answers.get(timeout=_LOOK_S)
                    if isinstance(answer, BaseException):
                        raise answer
                    answered += 1
                    room.release()
                    yield answer
        finally:
            ended.set()
            for _ in threads:
                room.release()
            if answered < len(jobs):
                for own in keepers:
                    own.dismiss()
