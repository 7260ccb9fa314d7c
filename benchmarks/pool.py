"""Worker processes on this machine, with a limit of CPU time for each job.

The system counts a worker's CPU time, in all its threads, and ends it where a job has used up its
limit, whatever it is doing: other work on the machine changes no result. That of processes that a
method starts is not counted. What waits for ever is ended by wall time, much later.

Methods of this project share workers; any other method has workers of its own, which begin in a
temporary folder: that keeps a careless method out of the results of others. A worker answers in
JSON, a line a job; a worker that ends costs the job that it was at, and the processes that it has
started end with it unless they have left its group.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections import deque
from collections.abc import Generator, Sequence
from copy import copy
from itertools import groupby
from multiprocessing import connection, reduction
from types import ModuleType
from typing import Any, Protocol

from coartic.benchmarks.worker import (
    Job,
    Outcome,
    fail,
    learns,
    outcomes_from,
    perform_job,
    plain_outcome,
    prepare,
)
from coartic.errors import CoarticError
from coartic.interruption import at_end, blocked_signals, temporary_folder, unbroken
from coartic.learner.learning import warm_up
from coartic.motion.lanes import links_for
from coartic.tasks.task import Task
from coartic.text import error_line, plain
from coartic.threads import (
    begin_worker,
    end_group,
    environment,
    one_thread_each,
    set_environment,
    threads_for,
)

_POLL_S = 1.0  # between looks at limits
_AHEAD = 2**13  # bytes of a job that a worker has while it is at another: a pipe holds more
_LEAST_MEMORY = 2**30  # bytes of a worker, four times what this project's take
_MOST_UNREAD = 2**28  # bytes of a worker that has ended
_LAST_WORDS = 3  # lines of what a worker that died has printed
_PRINTED = 4000  # bytes that are kept of it
_STARTS = 5  # workers in a row that may end before they begin a job
_COUNTS_CPU = hasattr(signal, "setitimer")
WALL_TIMES = 20.0 if _COUNTS_CPU else 1.0
"""Limits of a job in wall time: more than a busy machine takes for one in CPU time."""
Numbered = tuple[int, Job]


class Executor(Protocol):
    """Performs jobs, somewhere."""

    @property
    def workers(self) -> int:
        """How many at once."""
        ...

    def perform(self, jobs: Sequence[Job]) -> Generator[tuple[int, list[Outcome]], None, None]:
        """The number of each job with its outcomes, as they come, in any order."""
        ...


class Local:
    """Worker processes on this machine; ``jobs`` of them, or one a core.

    A job is ended after its limit of CPU time, or ``wall_times`` as much wall time.
    """

    def __init__(self, jobs: int = -1, *, wall_times: float = WALL_TIMES) -> None:
        self.workers = threads_for(jobs)
        self.wall_times = wall_times

    def perform(self, jobs: Sequence[Job]) -> Generator[tuple[int, list[Outcome]], None, None]:
        """The number of each job with its outcomes, as they come."""
        numbered = sorted(enumerate(jobs), key=lambda pair: owner_of(pair[1]))
        for owner, jobs_of_owner in groupby(numbered, key=lambda pair: owner_of(pair[1])):
            yield from self.perform_in_pool(list(jobs_of_owner), foreign=bool(owner))

    def perform_in_pool(
        self, jobs: list[Numbered], *, foreign: bool
    ) -> Generator[tuple[int, list[Outcome]], None, None]:
        """Numbers and outcomes of jobs that share workers; foreign ones begin in a new folder.

        Raises CoarticError where one worker after another ends before it begins a job.
        """
        workers = min(self.workers, len(jobs))
        of_jobs = [(job.setting.task, learns(job.setting.method)) for _, job in jobs]
        tasks = list({(task.robot, learned): (task, learned) for task, learned in of_jobs}.values())
        robots = {links_for(task.robot): task for task, _ in tasks}.values()
        waiting, crew, lost = deque(jobs), list[Worker](), 0

        def kill_crew() -> None:
            for worker in crew:
                worker.kill()

        with (
            temporary_folder() if foreign else contextlib.nullcontext("") as folder,
            one_thread_each(),
            at_end(kill_crew),
        ):
            try:
                while waiting or crew:
                    while waiting and len(crew) < workers:
                        with unbroken:  # or nobody would end it
                            # Two that compile begin with different kernels.
                            crew.append(Worker(folder, workers, tasks[:: (-1) ** len(crew)]))
                        crew[-1].give(waiting)
                    # While workers compile theirs: what they hand over is executed here.
                    with contextlib.suppress(Exception):  # workers say the same
                        for task in robots:
                            warm_up(task, "trials")
                    limits = [self.wall_limit(job) for worker in crew for _, job in worker.jobs]
                    connection.wait(
                        [source for worker in crew for source in worker.sources],
                        timeout=_POLL_S if any(limits) else None,
                    )
                    done: list[tuple[int, list[Outcome]]] = []
                    for worker in tuple(crew):
                        answers = worker.hear()
                        done += answers
                        lost = 0 if answers or worker.began_s is not None else lost
                        outcome = self.outcome_of_end(worker)
                        if outcome is not None or not (worker.jobs or waiting):
                            crew.remove(worker)
                            worker.end()
                        elif len(waiting) > workers or not worker.jobs:
                            worker.give(waiting)
                        if outcome is not None:
                            if worker.began_s is not None:
                                number, job = worker.jobs.popleft()
                                done.append((number, fail(job, **outcome)))
                            elif (lost := lost + 1) == _STARTS:
                                words = f"worker processes cannot begin ({outcome['reason']})"
                                raise CoarticError(f"{words}; finished runs are kept")
                            waiting.extendleft(reversed(worker.jobs))
                    yield from done
            finally:
                for worker in crew:
                    worker.end()

    def wall_limit(self, job: Job) -> float | None:
        """Seconds of wall time after which a job is ended, if it has a limit."""
        return None if job.time_limit_s is None else self.wall_times * job.time_limit_s

    def outcome_of_end(self, worker: Worker) -> dict[str, Any] | None:
        """How the job that a worker is at has failed, where the worker has ended or is to end."""
        job = worker.jobs[0][1] if worker.jobs else None
        if worker.is_alive:
            limit = self.wall_limit(job) if job is not None else None
            began_s = worker.began_s
            if limit is None or began_s is None or time.monotonic() < began_s + limit:
                return None
            reason = f"wall time limit of {limit:g} s exceeded"
            return {"status": "timeout", "reason": reason, "wall_s": limit}
        exit_code = worker.exit_code
        limit = job.time_limit_s if job is not None else None
        if _COUNTS_CPU and exit_code == -signal.SIGPROF and limit is not None:
            reason = f"CPU time limit of {limit:g} s exceeded"
            return {"status": "timeout", "reason": reason, "cpu_s": limit}
        how = "it ended its answers" if exit_code is None else f"exit code {exit_code}"
        if exit_code is not None and exit_code < 0:
            with contextlib.suppress(ValueError):
                how = f"killed by {signal.Signals(-exit_code).name}"
        return {
            "status": "crashed",
            "reason": f"the worker process ended ({how}): {worker.last_words}",
        }


class Worker:
    """A worker process: the jobs that it has, in its order, and what it says of them."""

    def __init__(self, folder: str, workers: int, tasks: list[tuple[Task, bool]]) -> None:
        context = worker_context("coartic.motion.compiler")  # once for all workers
        theirs, self._orders = context.Pipe(duplex=False)
        self._answers, answers = context.Pipe(duplex=False)
        self._prints, prints = context.Pipe(duplex=False)
        self._said: list[bytes] = []
        self._printed = b""
        self._is_open = True
        self.exit_code: int | None = None
        """Exit code, or minus the signal that ended it; None while it ran when it was heard."""
        self.jobs: deque[Numbered] = deque()
        self.began_s: float | None = None
        """When it began the first of them."""
        variables = {name: os.environ.get(name) for name in ("PYTHONSAFEPATH", "PYTHONPATH")}
        self._process = context.Process(
            target=perform_jobs,
            args=(theirs, answers, prints, folder, workers, variables),
        )
        try:
            start_process(self._process)
        except (OSError, EOFError) as error:  # no process, which is seen below
            self._printed = error_line(error).encode()
        for end in (theirs, answers, prints):
            end.close()
        self._send(tasks)

    @property
    def sources(self) -> list[Any]:
        """What is ready when it says something, or ends."""
        ends = [self._answers] * self._is_open + [self._prints] * (not self._prints.closed)
        return [*ends, self._process.sentinel] if self._process.pid is not None else ends

    @property
    def is_alive(self) -> bool:
        """Whether it may still answer."""
        return self._is_open and self.exit_code is None

    @property
    def last_words(self) -> str:
        """The last lines that it has printed."""
        lines = self._printed.decode(errors="replace").strip().splitlines()
        last = "\n".join(line[:300] for line in lines[-_LAST_WORDS:])
        return plain(last, 1000) or "it left no message"

    def give(self, waiting: deque[Numbered]) -> None:
        """Hand it the next job; one that is large only if it has none."""
        if waiting and len(self.jobs) < 2:
            order = bytes(reduction.ForkingPickler.dumps(waiting[0]))
            if not self.jobs or len(order) <= _AHEAD:
                self.jobs.append(waiting.popleft())
                self._send(order)

    def _send(self, order: Any) -> None:
        with contextlib.suppress(OSError):  # it has ended, which is seen where it is heard
            if isinstance(order, bytes):
                self._orders.send_bytes(order)
            else:
                self._orders.send(order)

    def hear(self) -> list[tuple[int, list[Outcome]]]:
        """Outcomes of the jobs that it has finished since."""
        said = self._read(self._answers)
        if not self._is_open and self._process.pid is not None:
            self._process.join(_POLL_S)  # it ends at this moment, or has closed the pipe
        self.exit_code = 1 if self._process.pid is None else self._process.exitcode
        ended = self.exit_code is not None  # and so nothing more is to come
        said += self._read(self._answers, all_of_it=True) if ended else b""
        self._printed = (self._printed + self._read(self._prints, all_of_it=ended))[-_PRINTED:]
        self._said.append(said)
        lines: list[bytes] = []
        if b"\n" in said:
            *lines, rest = b"".join(self._said).split(b"\n")
            self._said = [rest]
        heard = []
        for line in lines:
            number, _, answer = line.partition(b" ")
            if not self.jobs or number != b"%d" % self.jobs[0][0]:
                continue  # a process that a method has forked may say anything
            if not answer:
                self.began_s = time.monotonic()
                continue
            self.began_s = None
            position, job = self.jobs.popleft()
            heard.append((position, outcomes_from(job, answer)))
        return heard

    def _read(self, pipe: Any, *, all_of_it: bool = False) -> bytes:
        """What is in a pipe, without waiting: some of it, or all."""
        read = b""
        while not pipe.closed and pipe.poll(0):
            try:
                piece = os.read(pipe.fileno(), 2**16) if os.name == "posix" else pipe.recv_bytes()
            except (EOFError, OSError):
                piece = b""
            if not piece:
                self._is_open = self._is_open and pipe is not self._answers
                pipe.close()
            read += piece
            if not all_of_it or len(read) > _MOST_UNREAD:
                break
        return read

    def kill(self) -> None:
        """End it, with the processes that it has started."""
        if self._process.pid is not None:
            end_group(self._process.pid)

    def end(self) -> None:
        """The same, and give back what it took."""
        self.kill()
        if self._process.pid is not None:
            self._process.join(_POLL_S)
        for end in (self._orders, self._answers, self._prints):
            end.close()


def owner_of(job: Job) -> str:
    """Whose workers perform a job: this project's methods share theirs."""
    return "" if job.method.is_ours else f"{job.method.name} {job.method.code}"


def perform_jobs(
    orders: Any,
    answers: Any,
    prints: Any,
    folder: str,
    workers: int,
    variables: dict[str, str | None],
) -> None:
    """What a worker process does; in a folder of its own below ``folder``, unless that is empty."""
    set_environment(variables)
    if os.name == "posix":
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(prints.fileno(), 1)
        os.dup2(prints.fileno(), 2)
    begin_worker(folder)
    bound_memory(workers)
    prepare(orders.recv())
    if folder:
        tempfile.tempdir = os.environ["TMPDIR"] = tempfile.mkdtemp(dir=folder)
        os.chdir(tempfile.tempdir)
    worker = os.getpid()
    with contextlib.suppress(EOFError):
        while True:
            number, job = orders.recv()
            answer(answers, b"%d\n" % number)
            try:
                outcomes = list(map(plain_outcome, perform_within_limit(job)))
                text = json.dumps(outcomes)
            except Exception as error:
                failed = fail(job, "crashed", f"its outcome cannot be kept: {error_line(error)}")
                text = json.dumps(list(map(plain_outcome, failed)))
            if os.getpid() != worker:  # a method has forked it
                os._exit(1)
            answer(answers, b"%d %s\n" % (number, text.encode()))


def answer(answers: Any, line: bytes) -> None:
    """Say a line to the parent process."""
    if os.name != "posix":
        answers.send_bytes(line)
        return
    with open(answers.fileno(), "wb", closefd=False) as file:
        file.write(line)


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


def bound_memory(workers: int) -> None:
    """A method that allocates without end gets a MemoryError, not the whole machine."""
    try:
        import resource

        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ImportError, ValueError, OSError):
        return
    share = max(total * 8 // (10 * workers), _LEAST_MEMORY)
    resource.setrlimit(resource.RLIMIT_DATA, (share, share))


def start_method() -> str:
    """How workers begin: forked from a server that has imported what they need, where there is
    such a thing and the path of its socket is not too long."""
    has_server = "forkserver" in multiprocessing.get_all_start_methods()
    return "forkserver" if has_server and len(tempfile.gettempdir()) <= _LONGEST_PLACE else "spawn"


_LONGEST_PLACE = 70  # characters: the system takes sockets of 103, and some are to come
_START = start_method()
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


def worker_context(*imported: str) -> Any:
    """How workers begin, and what the server that they are forked from has imported beside this
    module, if it has not begun yet."""
    context: Any = copy(multiprocessing.get_context(_START))
    context.set_forkserver_preload(["coartic.benchmarks.pool", *imported])
    context.Process = WorkerProcess
    return context


def start_process(process: Any) -> None:
    """Start a process of :func:`worker_context`. Raises OSError or EOFError where it does not."""
    if _START == "forkserver":
        from multiprocessing import forkserver, resource_tracker

        # They would look for modules in the working folder first, whoever has filled it.
        safe = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        with environment(safe):
            resource_tracker.ensure_running()  # first: it lets signals through again
            with blocked_signals():
                forkserver.ensure_running()
    with blocked_signals():
        process.start()
