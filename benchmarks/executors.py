"""Where runs are performed: on this machine, or on a Dask cluster.

An executor takes jobs and yields their answers in any order. It may lose some (a
worker dies, the pool breaks): the harness asks again for what is missing.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from benchmarks.sandbox import SandboxError, die_with_parent, supervise
from coartic import CoarticError

Job = dict[str, Any]
Answer = dict[str, Any]


class Executor(Protocol):
    """Performs jobs."""

    def perform(self, jobs: Sequence[Job]) -> Iterator[Answer]:
        """Answers as they come, in any order."""
        ...


class Local:
    """Processes on this machine, by joblib's loky; one thread each for BLAS."""

    def __init__(self, jobs: int = -1) -> None:
        self.jobs = jobs

    def perform(self, jobs: Sequence[Job]) -> Iterator[Answer]:
        """Answers as they come. A broken pool ends the iteration early."""
        from joblib import Parallel, delayed, effective_n_jobs, parallel_config
        from joblib.externals.loky import get_reusable_executor
        from joblib.externals.loky.process_executor import BrokenProcessPool

        workers = min(effective_n_jobs(self.jobs), len(jobs))
        try:
            # The initializer runs before any job: no worker outlives a suite killed early.
            with parallel_config(
                backend="loky",
                n_jobs=workers,
                inner_max_num_threads=1,
                initializer=die_with_parent,
                initargs=(os.getpid(),),
            ):
                yield from Parallel(return_as="generator_unordered", batch_size=1)(
                    delayed(supervise)(job) for job in jobs
                )
        except BrokenProcessPool:
            return
        except SandboxError as error:
            raise CoarticError(str(error)) from None
        except (KeyboardInterrupt, GeneratorExit):
            if workers > 1:
                get_reusable_executor().shutdown(kill_workers=True)
            raise


class Dask:
    """A Dask scheduler, which has the project installed on its workers."""

    def __init__(self, address: str, *, timeout_s: float = 30.0) -> None:
        self.address = address
        self.timeout_s = timeout_s

    def perform(self, jobs: Sequence[Job]) -> Iterator[Answer]:
        """Answers as they come. Runs of a worker that dies are performed by another."""
        from distributed import Client, as_completed
        from distributed.scheduler import KilledWorker

        try:
            client = Client(self.address, timeout=self.timeout_s)  # type: ignore[no-untyped-call]
        except (OSError, TimeoutError, ValueError) as problem:
            raise CoarticError(f"no Dask scheduler at {self.address}: {problem}") from None
        with client, contextlib.ExitStack() as cleanup:
            futures = {
                client.submit(supervise, job, pure=False, retries=2): job["run_id"] for job in jobs
            }
            cleanup.callback(client.cancel, list(futures))
            cleanup.enter_context(_lost_scheduler(self.address))
            for future in as_completed(list(futures)):  # type: ignore[no-untyped-call]
                error = future.exception()
                if isinstance(error, KilledWorker):
                    reason = "every worker that tried this run died"
                    yield {
                        "run_id": futures[future],
                        "failure": "crashed",
                        "reason": reason,
                        "wall_s": 0.0,
                    }
                elif isinstance(error, SandboxError):
                    raise CoarticError(str(error))
                elif error is not None:
                    raise error
                else:
                    yield future.result()


@contextlib.contextmanager
def _lost_scheduler(address: str) -> Iterator[None]:
    """One sentence for all the ways in which a scheduler that goes away shows."""
    from concurrent.futures import CancelledError

    from distributed.comm.core import CommClosedError

    try:
        yield
    except (CancelledError, CommClosedError, OSError) as error:
        raise CoarticError(
            f"lost the Dask scheduler at {address} ({type(error).__name__}); what is done is "
            "kept, and the same command goes on from there"
        ) from None
