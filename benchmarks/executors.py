"""Where runs are performed: on this machine, or on a Dask cluster (``benchmarks.cluster``).

An executor takes jobs and yields their answers in any order. It may lose some (a
worker dies, the pool breaks): the harness asks again for what is missing.
"""

from __future__ import annotations

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
