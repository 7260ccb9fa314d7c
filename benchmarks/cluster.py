"""Runs on a Dask cluster, which may have no workers, lose them, or be lost itself.

Dask waits without end and without a word where nobody performs what it was given. Here the
scheduler is asked, whenever no answer has come for a while, whether it is there and has
workers; each of these questions, and the wait for workers, has an end.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
import warnings
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from coartic import CoarticError
from coartic.benchmarks.executors import Answer, Job
from coartic.benchmarks.sandbox import failure, supervise
from coartic.text import plain

if TYPE_CHECKING:
    from distributed import Client, Future

SCHEDULER_S = 30.0
"""How long a scheduler may take to answer, when it is first called and later, s."""
WORKERS_S = 600.0
"""How long a run waits while no worker is connected, s."""
_ASK_EVERY_S = 2.0  # while no answer comes
_SAY_EVERY_S = 30.0
_CLOSE_S = 3.0  # for goodbyes to a scheduler that may be gone

_GOES_ON = "what is done is kept, and the same command goes on from there"
_HINTS = {
    "tls": "with TLS, Dask's configuration names the certificates: docs/cluster.md",
    "ucx": "Dask has no UCX of its own: install distributed-ucxx, or use tcp://host:port",
}
_HINT = "give the address that the scheduler prints, such as tcp://127.0.0.1:8786"


class Dask:
    """An executor: a Dask scheduler, with the project installed there and on its workers.

    ``scheduler_s`` is how long the scheduler may take to answer, ``workers_s`` how long a run
    waits while no worker is connected, ``say`` is told, line by line, what is waited for. TLS
    is set up in Dask's own configuration.
    """

    def __init__(
        self,
        address: str,
        *,
        scheduler_s: float = SCHEDULER_S,
        workers_s: float = WORKERS_S,
        say: Callable[[str], None] = lambda line: None,
    ) -> None:
        self.address = address
        self.shown = plain(address, 200) or "an empty address"
        self.scheduler_s = scheduler_s
        self.workers_s = workers_s
        self.say = say

    def perform(self, jobs: Sequence[Job]) -> Iterator[Answer]:
        """Answers as they come. Runs of a worker that dies are performed by another.

        Raises CoarticError where no scheduler answers at the address, the scheduler is lost,
        no worker is connected for ``workers_s``, or the workers cannot perform runs.
        """
        with _without_logging(), asyncio.Runner() as runner:
            answers = self._answers(jobs)
            try:
                while (answer := runner.run(_next(answers))) is not None:
                    yield answer
            finally:
                runner.run(answers.aclose())

    async def _answers(self, jobs: Sequence[Job]) -> AsyncGenerator[Answer, None]:
        done: asyncio.Queue[Answer | CoarticError] = asyncio.Queue()
        async with self._connected() as client, contextlib.AsyncExitStack() as cleanup:
            watch = _Watch(self, client)
            patience = await watch.ask()
            futures = [client.submit(supervise, job, pure=False, retries=2) for job in jobs]
            cleanup.push_async_callback(_briefly, client.cancel, futures)
            for job, future in zip(jobs, futures, strict=True):
                task = asyncio.create_task(self._collect(job["run_id"], future, done))
                cleanup.callback(task.cancel)
            for _ in jobs:
                while (answer := await _get(done, patience)) is None:
                    patience = await watch.ask()
                if isinstance(answer, CoarticError):
                    raise answer
                watch.end_wait()
                yield answer

    @contextlib.asynccontextmanager
    async def _connected(self) -> AsyncIterator[Client]:
        client: Client | None = None
        self.say(f"calling the Dask scheduler at {self.shown}: {self.scheduler_s:g} s at most")
        try:
            with warnings.catch_warnings(record=True) as heard:
                from distributed import Client  # reads the user's Dask configuration

                async with asyncio.timeout(self.scheduler_s):
                    client = Client(  # type: ignore[no-untyped-call]
                        self.address,
                        asynchronous=True,
                        set_as_default=False,
                        timeout=0.8 * self.scheduler_s,  # its own error says more than ours
                    )
                    await client
        except Exception as problem:  # Dask's, of many kinds: who answers may be anybody
            await self._close(client)
            raise self._unreachable(problem) from None
        for warning in heard:
            self.say(f"warning: {plain(str(warning.message))}")
        try:
            yield client
        finally:
            await self._close(client)

    async def _close(self, client: Client | None) -> None:
        if client is not None:
            await _briefly(client.close)

    async def _collect(
        self, run_id: str, future: Future[Answer], done: asyncio.Queue[Answer | CoarticError]
    ) -> None:
        from distributed import CancelledError
        from distributed.scheduler import KilledWorker

        answer: Answer | CoarticError
        try:
            answer = await future
            if not isinstance(answer, dict) or answer.get("run_id") != run_id:
                raise TypeError("the answer is not that of the run")
        except KilledWorker:
            answer = failure(run_id, "crashed", "every worker that tried this run died", 0.0)
        except CancelledError:  # by Dask itself, when it loses the scheduler
            answer = self.lost(ConnectionError("the connection was closed"))
        except CoarticError as problem:
            answer = problem
        except Exception as problem:
            answer = CoarticError(
                f"the Dask workers of {self.shown} cannot perform runs: {self._why(problem)}; "
                "install the same version of coartic on the scheduler and every worker"
            )
        done.put_nowait(answer)

    def _unreachable(self, problem: Exception) -> CoarticError:
        hint = _HINTS.get(self.address.partition("://")[0], _HINT)
        return CoarticError(f"no Dask scheduler at {self.shown} ({self._why(problem)}); {hint}")

    def lost(self, problem: Exception) -> CoarticError:
        """The error for all the ways in which a scheduler that goes away shows."""
        return CoarticError(
            f"lost the Dask scheduler at {self.shown} ({self._why(problem)}); {_GOES_ON}"
        )

    def _why(self, problem: BaseException) -> str:
        """What went wrong, from the first of a chain of errors."""
        while problem.__cause__ is not None and not isinstance(problem, TimeoutError):
            problem = problem.__cause__
        if isinstance(problem, TimeoutError) and not str(problem):
            return f"no answer within {self.scheduler_s:g} s"
        return plain(f"{type(problem).__name__}: {problem}".removesuffix(": "), 300)


class _Watch:
    """Asks the scheduler whether it is there and has workers."""

    def __init__(self, dask: Dask, client: Client) -> None:
        self._dask, self._client = dask, client
        self._until: float | None = None  # when the wait for workers ends, if one is on
        self._say_at = 0.0

    async def ask(self) -> float:
        """Seconds until the next question. Raises CoarticError where there is no hope."""
        try:
            if (scheduler := self._client.scheduler) is None:
                raise ConnectionError("the connection is closed")
            async with asyncio.timeout(self._dask.scheduler_s):
                identity = await scheduler.identity(n_workers=-1)
        except Exception as problem:
            raise self._dask.lost(problem) from None
        if any(worker["status"] == "running" for worker in identity["workers"].values()):
            self.end_wait()
            return _ASK_EVERY_S
        address, now = self._dask.shown, time.monotonic()
        if self._until is None:
            self._until, self._say_at = now + self._dask.workers_s, now
        left = self._until - now
        if left <= 0:
            raise CoarticError(
                f"no Dask worker was connected to {address} for {self._dask.workers_s:g} s; "
                f"start some with: dask worker {address}; {_GOES_ON}"
            )
        if now >= self._say_at:
            self._say_at = now + _SAY_EVERY_S
            self._dask.say(
                f"no Dask worker is connected to {address}: waiting, {left:.0f} s at most"
            )
        return min(_ASK_EVERY_S, left)

    def end_wait(self) -> None:
        """There are workers: the next time that there are none is waited out in full."""
        if self._until is not None:
            self._dask.say(f"Dask workers are connected to {self._dask.shown}")
        self._until = None


async def _next(answers: AsyncIterator[Answer]) -> Answer | None:
    return await anext(answers, None)


async def _get(
    done: asyncio.Queue[Answer | CoarticError], seconds: float
) -> Answer | CoarticError | None:
    """What is done, or None where nothing is for that long."""
    with contextlib.suppress(TimeoutError):
        return await asyncio.wait_for(done.get(), seconds)
    return None


async def _briefly(goodbye: Callable[..., Any], *arguments: Any) -> None:
    """Say goodbye to a scheduler that may not listen any more."""
    with contextlib.suppress(Exception):
        async with asyncio.timeout(_CLOSE_S):
            await goodbye(*arguments)


@contextlib.contextmanager
def _without_logging() -> Iterator[None]:
    """Dask logs on the terminal what is said here in a sentence, or mended by itself."""
    before = logging.root.manager.disable
    logging.disable()
    try:
        yield
    finally:
        logging.disable(before)
