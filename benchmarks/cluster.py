"""Perform runs on a Dask cluster, with the extra ``coartic[cluster]``."""

from __future__ import annotations

import logging
import multiprocessing
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any

from coartic.benchmarks.pool import Local
from coartic.benchmarks.provenance import current_environment
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.worker import fail
from coartic.errors import CoarticError
from coartic.internal.text import error_line
from coartic.runs.plan import Job
from coartic.runs.record import Outcome

WORKERS_S = 600.0  # longest wait for a worker
_PAUSE_S = 0.05  # pause between looks for finished jobs
_RETURN_S = 2.0  # time in which a restarted worker connects again
_LOGGERS = "distributed", "distributed.client", "tornado.application", "asyncio"
_GOES_ON = "Finished runs are kept; repeat the command to resume."


class Dask:
    """Executor that performs jobs on the workers of a Dask scheduler, which should have this
    version of coartic.

    Parameters
    ----------
    address : str
        Address that the scheduler prints, such as ``tcp://127.0.0.1:8786``.
    say : callable
        Function that is called with a sentence before a long wait for workers.

    Examples
    --------
    >>> run_suite("quick", "results/quick", executor=Dask("127.0.0.1:8786"))  # doctest: +SKIP
    """

    def __init__(self, address: str, *, say: Callable[[str], None] = print) -> None:
        self.address, self.say = address, say
        self.workers = 1  # their number can change: jobs are as large as methods allow

    def perform(self, jobs: Sequence[Job]) -> Generator[tuple[Job, list[Outcome]], None, None]:
        """Yield each job with the outcomes of its runs, as jobs finish. If a worker dies, another
        worker performs its jobs; the outcomes of a job on which worker after worker dies are
        ``crashed``.

        When iterated, raises CoarticError if the scheduler is missing or lost or has no worker for
        10 minutes, if a job, tried three times, meets only workers that have another version or
        code of its method or cannot perform it, and if this machine lacks the extra ``cluster``.
        """
        client = self._client()
        from distributed import CancelledError, KilledWorker, as_completed

        place = dict[Any, int]()  # jobs of a method in a row keep a worker's process
        jobs = sorted(jobs, key=lambda job: place.setdefault(job.cell.method.key, len(place)))
        try:
            futures = client.map(_remote, jobs, pure=False, retries=2)
            job_of = {future.key: job for future, job in zip(futures, jobs, strict=True)}
            finished = as_completed(futures, loop=client.loop)
            while not finished.is_empty():
                self._wait_for_workers(client)
                time.sleep(0.0 if finished.has_ready() else _PAUSE_S)
                for future in finished.next_batch(block=False):
                    job = job_of[future.key]
                    try:
                        outcomes = future.result()
                    except KilledWorker:
                        outcomes = fail(job, "crashed", "every worker that tried this run died")
                    yield job, outcomes
        except CoarticError:
            raise
        except (Exception, CancelledError) as error:
            text = f"lost Dask scheduler {self.address}, or its workers cannot work"
            raise CoarticError(f"{text} ({error_line(error)}). {_GOES_ON}") from None
        finally:
            client.close(timeout=3)

    def _client(self) -> Any:
        try:
            from distributed import Client
            from distributed.comm.addressing import resolve_address

            for name in _LOGGERS:  # to which Dask gives levels when it is imported
                logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported here
            resolve_address(self.address)  # without a port, a client would wait for a minute
            return Client(self.address, set_as_default=False)
        except ImportError:
            raise CoarticError("a Dask cluster needs: pip install 'coartic[cluster]'") from None
        except Exception as error:  # Dask raises errors of many kinds
            text = (
                f"no Dask scheduler at {self.address} ({error_line(error)}). Give the address that "
            )
            raise CoarticError(f"{text}it prints, such as tcp://127.0.0.1:8786.") from None

    def _wait_for_workers(self, client: Any) -> None:
        for _ in range(2):
            if client.nthreads():
                return
            time.sleep(_RETURN_S)
        self.say(f"no Dask worker is connected to {self.address}: waiting for one")
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            text = f"Dask scheduler {self.address} had no workers for {WORKERS_S:g} s"
            raise CoarticError(f"{text}; start some. {_GOES_ON}") from None


def _remote(job: Job) -> list[Outcome]:
    """Perform a job on the machine of a Dask worker, in another process, and return the outcomes of
    its runs with the environment of this machine. Raises CoarticError if the method has another
    version or code on this machine, and if no process can work."""
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    method, used = job.cell.method, current_environment()
    if method.is_ours:
        here = built_in()[method.name].code
        if here != method.code:
            text = f"method {method.name!r} is {here} on a Dask worker and {method.code} where "
            raise CoarticError(f"{text}the suite was started; install the same version everywhere")
    else:
        used = used | {"imports": {name: version(name) for name in method.packages}}
    ((_, outcomes),) = Local(1).perform([job])
    return [replace(outcome, environment=used) for outcome in outcomes]
