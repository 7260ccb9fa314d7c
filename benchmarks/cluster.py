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
ANSWER_S = 60.0  # longest wait for an answer of the scheduler
_PAUSE_S = 0.05  # pause before the next look for finished jobs
_RETURN_S = 2.0  # time that a restarted worker gets to connect again
_LOGGERS = "distributed", "distributed.client", "tornado.application", "asyncio"
_GOES_ON = "Finished runs are stored; repeat the command to resume."


class Dask:
    """Executor that performs jobs on the workers of a Dask scheduler.

    The machines of the workers must have the same versions of the planned methods as this process.

    Parameters
    ----------
    address : str
        Address that the scheduler prints, such as ``tcp://127.0.0.1:8786``.
    say : callable
        Function, such as ``print``, that is called with a sentence when the scheduler has no worker
        and the executor begins to wait for one.

    Examples
    --------
    >>> run_suite("quick", "results/quick", executor=Dask("127.0.0.1:8786"))  # doctest: +SKIP
    """

    def __init__(self, address: str, *, say: Callable[[str], None] = print) -> None:
        self.address, self.say = address, say
        self.workers = 1  # the number of workers can change, so it does not limit the size of jobs

    def perform(self, jobs: Sequence[Job]) -> Generator[tuple[Job, list[Outcome]], None, None]:
        """Yield each job with the outcomes of its runs, as jobs finish.

        If a worker dies, another worker performs its unfinished jobs. If several workers die while
        they perform the same job, the outcomes of this job have status ``crashed``.

        Parameters
        ----------
        jobs : sequence of Job

        Yields
        ------
        Job
            One of ``jobs``.
        list of Outcome
            Outcome of each run of the job, in the order of ``job.numbers``.

        Raises
        ------
        CoarticError
            One of these is the case:

            - the scheduler does not answer for a minute, or the connection to it is lost;
            - the scheduler has no worker for 10 minutes;
            - a job fails in three attempts, because the version or the code of the job's method
              differs on the workers, or because they cannot perform the job;
            - the extra ``cluster`` is not installed on this machine.
        """
        client = self._client()
        from distributed import CancelledError, KilledWorker, as_completed

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
            raise CoarticError(
                f"Dask scheduler {self.address} is lost, or its workers cannot work "
                f"({error_line(error)}). {_GOES_ON}"
            ) from None
        finally:
            client.close(timeout=3)

    def _client(self) -> Any:
        try:
            from distributed import Client
            from distributed.comm.addressing import resolve_address

            for name in _LOGGERS:  # Dask sets their levels when it is imported
                logging.getLogger(name).setLevel(logging.CRITICAL)  # this class reports errors
            resolve_address(self.address)  # raises without a port; a client would wait instead
            return Client(self.address, set_as_default=False)
        except ImportError:
            raise CoarticError(
                "Dask is not installed: pip install 'coartic[cluster]' installs it"
            ) from None
        except Exception as error:  # Dask raises errors of many kinds
            raise CoarticError(
                f"Dask scheduler {self.address} does not answer ({error_line(error)}). Pass the "
                "address that the scheduler prints, such as tcp://127.0.0.1:8786."
            ) from None

    def _wait_for_workers(self, client: Any) -> None:
        for _ in range(2):
            try:  # as client.nthreads(), which waits for ever if the scheduler's machine is lost
                if client.sync(client.scheduler.ncores, callback_timeout=ANSWER_S):
                    return
            except TimeoutError:
                raise CoarticError(
                    f"Dask scheduler {self.address} has not answered for {ANSWER_S:g} s: start it "
                    f"again, with its workers. {_GOES_ON}"
                ) from None
            time.sleep(_RETURN_S)
        self.say(f"Dask scheduler {self.address} has no workers: waiting for one")
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise CoarticError(
                f"Dask scheduler {self.address} had no workers for {WORKERS_S:g} s: start a "
                f"worker. {_GOES_ON}"
            ) from None


def _remote(job: Job) -> list[Outcome]:
    """Perform a job on the machine of a Dask worker, in a separate process.

    Return the outcome of each run, with the environment of the worker's machine. Raises
    CoarticError if the version or the code of the method differs on that machine, or if processes
    cannot start there.
    """
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    method, used = job.cell.method, current_environment()
    if method.is_ours:
        code = built_in()[method.name].code
        if code != method.code:
            raise CoarticError(
                f"method {method.name!r} has version {code} on a Dask worker and {method.code} "
                "where the suite was started: install the same version of coartic everywhere"
            )
    else:
        used = used | {"imports": {name: version(name) for name in method.packages}}
    ((_, outcomes),) = Local(1).perform([job])
    return [replace(outcome, environment=used) for outcome in outcomes]
