"""Runs on a Dask cluster: the extra ``coartic[cluster]``."""

from __future__ import annotations

import logging
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from coartic.benchmarks.pool import Failure, Local
from coartic.benchmarks.provenance import environment
from coartic.benchmarks.registry import brief, current_code
from coartic.benchmarks.worker import Answer, Job
from coartic.errors import CoarticError

if TYPE_CHECKING:
    from distributed import Client, Future

WORKERS_S = 600.0  # that runs wait while no worker is connected
_ASK_EVERY_S = 2.0
_GOES_ON = "Finished runs are kept; repeat the command to resume."


class Dask:
    """An executor: a Dask scheduler, with this version of coartic on its workers; ``say`` is told
    what is waited for. TLS is set up in Dask's own configuration."""

    def __init__(
        self, address: str, *, workers_s: float = WORKERS_S, say: Callable[[str], None] = print
    ) -> None:
        self.address, self.workers_s, self.say = address, workers_s, say
        self.workers = 1  # it may have any number: lots are as large as methods take them

    def perform(self, jobs: Sequence[Job]) -> Iterator[tuple[int, Answer | Failure]]:
        """The number of each job with its answer, as they come; another worker takes over the
        jobs of one that dies. Raises CoarticError where there is no scheduler, it is lost, it has
        no workers for a long time, or they have another version.
        """
        client = self._client()
        try:
            from distributed import as_completed

            futures = client.map(_remote, jobs, pure=False, retries=2)
            numbers = {future.key: number for number, future in enumerate(futures)}
            answers, waited_since = as_completed(futures, loop=client.loop), None
            while not answers.is_empty():
                waited_since = self._check_workers(client, waited_since)
                deadline = time.monotonic() + _ASK_EVERY_S
                while not answers.has_ready() and time.monotonic() < deadline:
                    time.sleep(_ASK_EVERY_S / 100)
                for future in answers.next_batch(block=False):
                    yield numbers[future.key], self._answer(future)
        finally:
            client.close(timeout=3)

    def _answer(self, future: Future[Any]) -> Answer | Failure:
        from distributed import CancelledError, KilledWorker

        try:
            return future.result()  # type: ignore[no-any-return]
        except KilledWorker:
            return Failure("crashed", "every worker that tried this run died", 0.0)
        except CoarticError:
            raise
        except (Exception, CancelledError) as error:
            if future.status != "error":
                raise self._lost(error) from None
            raise CoarticError(f"a Dask worker cannot work: {brief(error)}. {_GOES_ON}") from None

    def _client(self) -> Client:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said here
        try:
            from distributed import Client

            return Client(self.address, set_as_default=False)
        except ImportError:
            raise CoarticError("a Dask cluster needs: pip install 'coartic[cluster]'") from None
        except Exception as error:  # Dask's, of many kinds: who answers may be anybody
            raise CoarticError(
                f"no Dask scheduler at {self.address} ({brief(error)}). Give the address that the "
                "scheduler prints, such as tcp://127.0.0.1:8786."
            ) from None

    def _check_workers(self, client: Client, since: float | None) -> float | None:
        """Since when there are no workers. Raises CoarticError where that is too long."""
        try:
            workers = client.scheduler_info()["workers"]
        except Exception as error:
            raise self._lost(error) from None
        if workers:
            return None
        if since is None:
            self.say(f"no Dask worker is connected to {self.address}: waiting for one")
            return time.monotonic()
        if time.monotonic() - since > self.workers_s:
            raise CoarticError(
                f"no Dask worker was connected to {self.address} for {self.workers_s:g} s; start "
                f"some with: dask worker {self.address}. {_GOES_ON}"
            )
        return since

    def _lost(self, error: BaseException) -> CoarticError:
        return CoarticError(f"lost Dask scheduler {self.address} ({brief(error)}). {_GOES_ON}")


def _remote(job: Job) -> Answer | Failure:
    """Perform a job on a worker's machine, in a process that ends with its time limit."""
    here = current_code(job.where, job.method)
    if here != job.code:
        raise CoarticError(
            f"method {job.method!r} has code {here} on a Dask worker and {job.code} where the "
            "suite was started; install the same version everywhere"
        )
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
    ((_, answer),) = Local(1).perform([job])
    if isinstance(answer, Answer):
        answer.environment = environment()._asdict()
    return answer
