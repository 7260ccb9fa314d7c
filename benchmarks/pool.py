"""Worker processes on this machine, with a limit of CPU time for each job.

The system counts a worker's CPU time, in all its threads, and ends it where a job has used up its
limit, whatever it is doing: other work on the machine changes no result. That of processes that a
method starts is not counted. What waits for ever is ended by wall time, much later.

Methods of this project share workers; any other method has workers of its own, which begin in a
temporary folder: that keeps a careless method out of the results of others.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from copy import copy
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from pebble import ProcessExpired, ProcessPool

from coartic.benchmarks.worker import Job, Outcome, fail, learns, perform_job, prepare
from coartic.errors import CoarticError
from coartic.tasks.task import Task
from coartic.text import error_line, plain
from coartic.threads import begin_worker, one_thread_each, threads_for

_POLL_S = 1.0  # between looks at the pool
_QUEUED = 2  # jobs a worker that wait for it
_LEAST_MEMORY = 2**30  # bytes of a worker, four times what this project's take
_LAST_WORDS = 3  # lines of what a worker that died has printed
_COUNTS_CPU = hasattr(signal, "setitimer")
WALL_TIMES = 20.0 if _COUNTS_CPU else 1.0
"""Limits of a job in wall time: more than a busy machine takes for one in CPU time."""


class Executor(Protocol):
    """Performs jobs, somewhere."""

    @property
    def workers(self) -> int:
        """How many at once."""
        ...

    def perform(self, jobs: Sequence[Job]) -> Iterator[tuple[int, list[Outcome]]]:
        """The number of each job with its outcomes, as they come, in any order."""
        ...


class Local:
    """Worker processes on this machine; ``jobs`` of them, or one a core.

    A job is ended after its limit of CPU time, or ``wall_times`` as much wall time.
    """

    def __init__(self, jobs: int = -1, *, wall_times: float = WALL_TIMES) -> None:
        self.workers = threads_for(jobs)
        self.wall_times = wall_times

    def perform(self, jobs: Sequence[Job]) -> Iterator[tuple[int, list[Outcome]]]:
        """The number of each job with its outcomes, as they come."""
        numbered = sorted(enumerate(jobs), key=lambda pair: owner_of(pair[1]))
        for owner, jobs_of_owner in groupby(numbered, key=lambda pair: owner_of(pair[1])):
            yield from self.perform_in_pool(list(jobs_of_owner), foreign=bool(owner))

    def perform_in_pool(
        self, jobs: list[tuple[int, Job]], *, foreign: bool
    ) -> Iterator[tuple[int, list[Outcome]]]:
        """Numbers and outcomes of jobs that share workers; foreign ones begin in a new folder."""
        workers = min(self.workers, len(jobs))
        of_jobs = [(job.setting.task, learns(job.setting.method)) for _, job in jobs]
        tasks = list({(task.robot, learned): (task, learned) for task, learned in of_jobs}.values())
        with tempfile.TemporaryDirectory(prefix="coartic-") as folder, one_thread_each():
            pool = ProcessPool(
                workers, initializer=begin_job_worker, initargs=(folder, foreign, workers, tasks),
                context=worker_context(),
            )  # fmt: skip
            running: dict[Future[list[Outcome]], tuple[int, Job]] = {}
            waiting = iter(jobs)
            try:
                while True:
                    for number, job in waiting:
                        future: Any = pool.schedule(
                            perform_within_limit, args=(job,), timeout=self.wall_limit(job)
                        )
                        running[future] = number, job
                        if len(running) == (1 + _QUEUED) * workers:
                            break
                    # While a worker compiles the learner: what it hands over is executed here.
                    with contextlib.suppress(Exception):  # workers say the same
                        prepare((task, False) for task, _ in tasks)
                    tasks = []
                    if not running:
                        break
                    done, _ = wait(running, timeout=_POLL_S, return_when=FIRST_COMPLETED)
                    if not done and not pool.active:
                        raise BrokenProcessPool  # which leaves what waits as it is
                    for future in done:
                        number, job = running.pop(future)
                        yield number, self.outcomes_of(future, job, Path(folder))
            except RuntimeError:  # the pool's own
                messages = sorted({last_words(file) for file in Path(folder).glob("*.txt")})
                raise CoarticError(
                    f"worker processes cannot begin ({'; '.join(messages)}); finished runs are kept"
                ) from None
            finally:
                pool.stop()  # type: ignore[no-untyped-call]
                pool.join()

    def wall_limit(self, job: Job) -> float | None:
        """Seconds of wall time after which a job is ended, if it has a limit."""
        return None if job.time_limit_s is None else self.wall_times * job.time_limit_s

    def outcomes_of(self, future: Future[list[Outcome]], job: Job, folder: Path) -> list[Outcome]:
        """The outcomes of a job, or that it failed."""
        try:
            return future.result()
        except TimeoutError:
            limit = self.wall_limit(job) or math.inf  # there is one
            return fail(job, "timeout", f"wall time limit of {limit:g} s exceeded", wall_s=limit)
        except ProcessExpired as error:
            if _COUNTS_CPU and error.exitcode == -signal.SIGPROF and job.time_limit_s is not None:
                reason = f"CPU time limit of {job.time_limit_s:g} s exceeded"
                return fail(job, "timeout", reason, cpu_s=job.time_limit_s)
            how = f"exit code {error.exitcode}"
            if error.exitcode is not None and error.exitcode < 0:
                with contextlib.suppress(ValueError):
                    how = f"killed by {signal.Signals(-error.exitcode).name}"
            reason = f"the worker process ended ({how}): {last_words(folder / f'{error.pid}.txt')}"
            return fail(job, "crashed", reason)
        except BrokenProcessPool:
            raise
        except Exception as error:  # its outcomes cannot be read
            return fail(job, "crashed", error_line(error))


def owner_of(job: Job) -> str:
    """Whose workers perform a job: this project's methods share theirs."""
    return "" if job.method.is_ours else f"{job.method.name} {job.method.code}"


def perform_within_limit(job: Job) -> list[Outcome]:
    """Perform a job in a worker, which is killed by SIGPROF after as much CPU time as the limit."""
    if not _COUNTS_CPU or job.time_limit_s is None:
        return perform_job(job)
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # whatever a method before has set
    signal.setitimer(signal.ITIMER_PROF, job.time_limit_s)
    try:
        return perform_job(job)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def last_words(file: Path) -> str:
    """The last lines that a worker has printed into its file."""
    try:
        lines = file.read_text(errors="replace").strip().splitlines()
    except OSError:
        lines = []
    return plain("\n".join(lines[-_LAST_WORDS:]), 1000) or "it left no message"


def begin_job_worker(
    folder: str, foreign: bool, workers: int, tasks: list[tuple[Task, bool]]
) -> None:
    """What a worker does first."""
    printed = os.open(f"{folder}/{os.getpid()}.txt", os.O_WRONLY | os.O_CREAT)
    os.dup2(printed, 1)
    os.dup2(printed, 2)
    begin_worker()
    bound_memory(workers)
    prepare(tasks)
    if foreign:
        tempfile.tempdir = os.environ["TMPDIR"] = tempfile.mkdtemp(dir=folder)
        os.chdir(tempfile.tempdir)


def bound_memory(workers: int) -> None:
    """A method that allocates without end gets a MemoryError, not the whole machine."""
    try:
        import resource

        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ImportError, ValueError, OSError):
        return
    share = max(total * 8 // (10 * workers), _LEAST_MEMORY)
    resource.setrlimit(resource.RLIMIT_DATA, (share, share))


_START = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
_Ordinary: Any = multiprocessing.get_context(_START).Process  # type: ignore[attr-defined]


class WorkerProcess(_Ordinary):  # type: ignore[misc]
    """A process in which the program that is running is not run again."""

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return _Ordinary._Popen(process)
        finally:
            sys.modules["__main__"] = main


def worker_context() -> Any:
    """How workers begin: forked from a server that has imported what they need, where there is
    such a thing."""
    context: Any = copy(multiprocessing.get_context(_START))
    context.set_forkserver_preload(["coartic.benchmarks.pool"])
    context.Process = WorkerProcess
    return context
