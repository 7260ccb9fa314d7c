"""Processes on this machine in which methods run, with a limit of CPU time for each job.

A process performs jobs of one method, one after the other. It begins in a folder of its own and
writes each answer into a file there, which is whole or not there: what a method does, breaks or
prints is no matter of other methods. A process that ends costs the job that it was at; the others
begin in a new one. What it has started ends with it unless it has left its group.

The system counts a process's CPU time, in all its threads, and ends it where a job has used up its
limit: other work on the machine changes no result. That of processes that a method starts is not
counted. What waits for ever is ended by wall time, later.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections import defaultdict, deque
from collections.abc import Generator, Iterator, Sequence
from multiprocessing import connection
from pathlib import Path
from types import ModuleType
from typing import Any

from coartic.benchmarks.worker import Job, Outcome, answer_of, fail, outcomes_from, perform_job
from coartic.errors import CoarticError
from coartic.files import write_atomically
from coartic.interruption import blocked_signals
from coartic.learner.conditions import METHOD_PREFIX
from coartic.learner.learning import warm_up
from coartic.text import error_line, plain
from coartic.threads import ONE_THREAD, begin_worker, end_group, environment, threads_for

_POLL_S = 0.2  # between looks for answers and at limits
_LONGEST_S = 24 * 3600.0  # CPU time of a job without a limit
_LEAST_MEMORY = 2**30  # bytes of a process, four times what this project's methods take
_LARGEST_FILE = 2**28  # bytes of an answer, or of what a job prints
_LAST_WORDS = 3  # lines of what a process that died has printed
_PRINTED = 4000  # bytes that are read of it
_STARTS = 5  # processes in a row that may end before they begin a job
_KILLED = (-9, 255)  # exit codes of a process that somebody has killed, or whose server
_END_S = 1.0  # that a process which is killed has to end
_OUT_OF_TIME = ("SIGPROF", "SIGXCPU")
_BEGUN, _SAID = "begun", "said"  # files beside the answers of a process


class Local:
    """Processes on this machine; ``jobs`` of them at once, or one a core.

    A job is ended after its limit of CPU time, a day where it has none; where it uses less, after
    three times as much wall time and ``patience_s``.
    """

    def __init__(self, jobs: int = -1, *, patience_s: float = 60.0) -> None:
        self.workers = threads_for(jobs)
        self.patience_s = patience_s

    def perform(self, jobs: Sequence[Job]) -> Generator[tuple[Job, list[Outcome]], None, None]:
        """Each job with its outcomes, as they come; by one process, those of a method in order.

        Raises CoarticError where one process after another ends before it begins a job.
        """
        by_method = defaultdict[Any, list[Job]](list)
        for job in jobs:
            by_method[job.method.key].append(job)
        waiting = deque(
            of_method[first :: self.workers]  # each has some of every cell
            for of_method in by_method.values()
            for first in range(min(self.workers, len(of_method)))
        )
        crew, lost, repeated = list[Worker](), 0, set[int]()
        with tempfile.TemporaryDirectory(prefix="coartic-", ignore_cleanup_errors=True) as folder:
            try:
                while waiting or crew:
                    while waiting and len(crew) < self.workers:
                        crew.append(Worker(folder, waiting.popleft(), self))
                        crew[-1].start()
                    sentinels = [w.process.sentinel for w in crew if w.process.pid is not None]
                    connection.wait(sentinels, _POLL_S)
                    for worker in tuple(crew):
                        exit_code = worker.exit_code  # first: after the end comes no answer
                        yield from worker.answers()
                        if exit_code is None and worker.jobs and not worker.is_late:
                            continue
                        worker.end()
                        crew.remove(worker)
                        if not worker.jobs:
                            continue
                        job = worker.jobs[0]
                        lost = lost + 1 if worker.since_s == math.inf else 0
                        if lost == _STARTS:
                            raise CoarticError(
                                f"processes cannot begin {worker.last_words}; finished runs are "
                                "kept"
                            )
                        if lost:
                            time.sleep(_POLL_S)  # a server that was killed may yet be there
                        elif exit_code in _KILLED and id(job) not in repeated:
                            repeated.add(id(job))
                        else:
                            yield job, worker.failure(exit_code)
                            worker.jobs.popleft()
                        if worker.jobs:
                            waiting.appendleft(list(worker.jobs))
            finally:
                for worker in crew:
                    worker.end()


class Worker:
    """A process that performs jobs of one method in their order."""

    def __init__(self, folder: str, jobs: Sequence[Job], local: Local) -> None:
        self.jobs = deque(jobs)
        """Jobs that are not answered yet."""
        self.since_s = math.inf
        """Clock when it began the first of these."""
        self._patience_s = local.patience_s
        self._answered = 0
        self._folder = Path(tempfile.mkdtemp(dir=folder))
        arguments = self._folder, jobs, local.workers
        self.process = CONTEXT.Process(target=perform_jobs, args=arguments)

    def start(self) -> None:
        """Begin it; where it cannot begin, it has ended."""
        try:
            start_process(self.process)
        except (OSError, EOFError) as error:
            (self._folder / _SAID).write_text(error_line(error))
            return
        # While it compiles kernels: what it hands over is executed here.
        with contextlib.suppress(Exception):  # the process says the same
            warm_up(self.jobs[0].specification.task, "trials")

    @property
    def exit_code(self) -> int | None:
        """Exit code, or minus the signal that ended it; None while it runs."""
        return 1 if self.process.pid is None else self.process.exitcode

    @property
    def is_late(self) -> bool:
        """Whether its job takes too long."""
        return time.monotonic() > self.since_s + self.wall_limit_s

    @property
    def wall_limit_s(self) -> float:
        """Wall time after which its job is ended."""
        return 3 * (self.jobs[0].time_limit_s or _LONGEST_S) + self._patience_s

    def answers(self) -> Iterator[tuple[Job, list[Outcome]]]:
        """The jobs that it has answered since, with their outcomes."""
        if self.since_s == math.inf and (self._folder / _BEGUN).exists():
            self.since_s = time.monotonic()
        while self.jobs and (answer := self._folder / str(self._answered)).is_file():
            job = self.jobs.popleft()
            self._answered += 1
            self.since_s = time.monotonic()
            yield job, outcomes_from(job, answer.read_bytes())
            answer.unlink()

    @property
    def last_words(self) -> str:
        """How it has ended, and the last lines that it has printed."""
        words, code = b"", self.exit_code or 0
        with contextlib.suppress(OSError), open(self._folder / _SAID, "rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - _PRINTED))
            words = file.read()
        lines = words.decode(errors="replace").strip().splitlines()
        last = "\n".join(line[:300] for line in lines[-_LAST_WORDS:])
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return f"({how}): {plain(last, 1000) or 'it left no message'}"

    def failure(self, exit_code: int | None) -> list[Outcome]:
        """The outcomes of the job that it has not answered: it is late, or has ended."""
        job, cpu_s = self.jobs[0], self.jobs[0].time_limit_s or _LONGEST_S
        if exit_code is None:
            reason = f"wall time limit of {self.wall_limit_s:g} s exceeded"
            return fail(job, "timeout", reason, wall_s=self.wall_limit_s)
        if exit_code < 0 and signal.Signals(-exit_code).name in _OUT_OF_TIME:
            return fail(job, "timeout", f"CPU time limit of {cpu_s:g} s exceeded", cpu_s=cpu_s)
        return fail(job, "crashed", f"the worker process ended {self.last_words}")

    def end(self) -> None:
        """End it, with the processes that it has started."""
        if self.process.pid is not None:
            end_group(self.process.pid)
            self.process.join(_END_S)


def perform_jobs(folder: Path, jobs: Sequence[Job], workers: int) -> None:
    """Perform jobs in this process, which answers in a folder of its own."""
    os.environ.pop("PYTHONSAFEPATH", None)  # see start_process
    begin_worker(folder.parent)
    descriptor = os.open(folder / _SAID, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    bound_resources(workers)
    for job in jobs:  # kernels are compiled, or loaded, on no run's clock
        learns = job.specification.method.startswith(METHOD_PREFIX)
        warm_up(job.specification.task, "learner" if learns else "motion", "trials")
    place = folder / "place"
    place.mkdir()
    tempfile.tempdir = os.environ["TMPDIR"] = str(place)
    os.chdir(place)
    (folder / _BEGUN).touch()
    process = os.getpid()
    for number, job in enumerate(jobs):
        os.truncate(folder / _SAID, 0)
        limit_cpu_time(job.time_limit_s or _LONGEST_S)
        outcomes = perform_job(job)
        limit_cpu_time(0)
        try:
            text = answer_of(outcomes)
        except Exception as error:
            reason = f"its outcome cannot be kept: {error_line(error)}"
            text = answer_of(fail(job, "crashed", reason))
        if os.getpid() != process:  # a method has forked it
            os._exit(1)
        write_atomically(folder / str(number), text)


def limit_cpu_time(limit_s: float) -> None:
    """Let the system end this process when it has taken so much more CPU time, by SIGPROF, or
    SIGXCPU where a method has turned that off; 0 lifts the limit."""
    if not hasattr(signal, "setitimer"):
        return
    import resource

    for number in (signal.SIGPROF, signal.SIGXCPU):  # whatever a method before has set
        signal.signal(number, signal.SIG_DFL)
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    with contextlib.suppress(ValueError):  # a limit from outside is lower
        whole_s = math.ceil(time.process_time() + (limit_s or _LONGEST_S)) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (whole_s, most))
    signal.setitimer(signal.ITIMER_PROF, limit_s)


def bound_resources(workers: int) -> None:
    """Limit memory and size of files, so that a method gets an error before the machine swaps."""
    try:
        import resource

        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ImportError, ValueError, OSError):
        return
    share = max(total * 8 // (10 * workers), _LEAST_MEMORY)
    for what, most in ((resource.RLIMIT_DATA, share), (resource.RLIMIT_FSIZE, _LARGEST_FILE)):
        with contextlib.suppress(ValueError):  # a limit from outside is lower
            resource.setrlimit(what, (most, most))


# Processes are forked from a server that has imported what they need, where there is such a thing
# and the path of its socket is not too long: the system takes 103 characters, and some are to come.
_HAS_SERVER = "forkserver" in multiprocessing.get_all_start_methods()
_START = "forkserver" if _HAS_SERVER and len(tempfile.gettempdir()) <= 70 else "spawn"
CONTEXT: Any = multiprocessing.get_context(_START)


def start_process(process: Any) -> None:
    """Start a process of :data:`CONTEXT` with one thread for BLAS, in which the program that is
    running is not run again. Raises OSError or EOFError where it does not start."""
    # It would look for modules in the working folder first, whoever has filled it.
    safe = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    main = sys.modules["__main__"]
    with environment(ONE_THREAD | safe):
        if _START == "forkserver":
            from multiprocessing import resource_tracker

            multiprocessing.set_forkserver_preload([__name__, "coartic.motion.compiler"])
            resource_tracker.ensure_running()  # first: it lets signals through again
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            with blocked_signals():  # Ctrl-C tells all that a terminal has
                process.start()
        finally:
            sys.modules["__main__"] = main
