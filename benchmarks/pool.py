"""Perform jobs in worker processes on this machine, with a limit of CPU time for each job.

A process performs jobs of one method, one after the other. It works in its own folder and writes
each answer into a file there, which is complete or missing: what a method breaks in its process
affects no other method; of what it prints the end is kept. A process that ends loses its current
job; a new process performs the other jobs. Processes that a worker has started end with the worker,
unless they have left its group. If the common folder is removed or full, answers are lost, and the
suite ends.

The system counts the CPU time of a process in all its threads, and ends the process when a job has
used up its limit. The CPU time of processes that a method starts is not counted.
A job that waits forever is ended later, by wall time, and repeated once, because the machine may
have slept; a job that waits twice has timed out.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import math
import multiprocessing
import os
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
import weakref
from collections import defaultdict, deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from multiprocessing import connection, resource_tracker
from pathlib import Path
from types import ModuleType
from typing import Any

from coartic.benchmarks.own_code import libraries
from coartic.benchmarks.worker import answer_of, fail, outcomes_from, perform_job
from coartic.errors import CoarticError
from coartic.internal.arguments import checked_arguments
from coartic.internal.files import write_atomically
from coartic.internal.interruption import blocked_signals
from coartic.internal.limits import MOST_SECONDS, check_limits
from coartic.internal.text import error_line, plain
from coartic.internal.threads import (
    begin_worker,
    end_group,
    environment,
    threads_for,
    worker_variables,
)
from coartic.learner.conditions import METHOD_PREFIX
from coartic.learner.learning import warm_up
from coartic.runs.plan import Job
from coartic.runs.record import Outcome

_POLL_S = 0.2  # pause between looks for answers and at limits
_LONGEST_S = 24 * 3600.0  # CPU time of a job without a limit
_LEAST_MEMORY = 2**30  # bytes of a process, four times the need of the built-in methods
_LARGEST_FILE = 2**28  # bytes of an answer, and of any other file
_LEAST_FILES = 64  # open files, of which a process and its server need up to twenty
_ROOM = 2**20  # bytes that must be free for answers
_LAST_LINES = 3  # last lines of a dead process's output in a reason
_PRINTED = 4000  # bytes of the output that are kept
_STARTS = 5  # processes in a row that end before their first job: then the suite ends
_UNKEPT = 74  # exit code of a process that could not write its answer
_REPEATED = (None, -9, 255, _UNKEPT)  # exit codes (late, killed, lost server): repeat a job once
_IDLE_S = 60.0  # longest wait of a process for jobs
_SPINS_S = 2.0  # CPU time beyond its limit after which a job is ended from outside
_END_S = 1.0  # time for a killed process to end
MORE_FILES = "after `ulimit -n 1024`, which allows more open files"
_BEGUN = "begun"  # file among the answers of a process
_NEXT_JOB = b"\0next job\0"  # in the output of a process


class Local:
    """Executor that performs jobs in processes on this machine, at most ``jobs`` at once (-1: one
    a core).

    A job is ended after its limit of CPU time (a day without a limit), and in any case after three
    times that in wall time plus ``timeout_s``. A job that has waited so long without using its CPU
    time is repeated once; then its runs have timed out. Most kernels are compiled before this time.
    ``verbose`` shows what methods print, log (from INFO on) and crash with. Raises ValueError for
    numbers out of bounds.
    """

    @checked_arguments
    def __init__(self, jobs: int = -1, *, timeout_s: float = 60.0, verbose: bool = False) -> None:
        check_limits("timeout_s", timeout_s, 0.0, MOST_SECONDS)
        self.workers = threads_for(jobs)
        self.timeout_s = timeout_s
        self.verbose = verbose

    def perform(
        self, jobs: Sequence[Job], *, in_order: bool = False
    ) -> Generator[tuple[Job, list[Outcome]], None, None]:
        """Let new workers perform jobs; yield each job with the outcomes of its runs
        (:meth:`Workers.perform`)."""
        with closing(Workers(self)) as workers:
            yield from workers.perform(jobs, in_order=in_order)


class Workers:
    """Worker processes with the options of ``local``, and the folder of their answers. With
    ``stays`` a worker without jobs, one at most, waits up to a minute for further jobs of its
    method."""

    def __init__(self, local: Local, *, stays: bool = False) -> None:
        self.local, self.stays = local, stays
        self.folder = tempfile.mkdtemp(prefix="coartic-")
        # Removed in silence also where an interrupted command drops its workers.
        self._remove = weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        self._idle: Worker | None = None

    def close(self) -> None:
        """End the worker that waits for jobs, if there is one, and remove the folder of answers."""
        if self._idle is not None:
            self._idle.end()
        self._remove()

    def perform(
        self, jobs: Sequence[Job], *, in_order: bool = False
    ) -> Iterator[tuple[Job, list[Outcome]]]:
        """Yield each job with the outcomes of its runs, as jobs finish. The jobs of a method are
        divided among at most as many workers as may work at once; with ``in_order`` one worker
        performs them all, in their order, while its process lives.

        A job during which its process ends is repeated once if the process was late, was killed by
        SIGKILL, or has exit code 255 (its server ended) or 74 (it could not write an answer);
        otherwise, and the second time, its outcomes are ``timeout`` or ``crashed``. Raises
        CoarticError if five processes in a row end before their first job, and if the folder of
        answers is gone or full.
        """
        by_method = defaultdict[Any, list[Job]](list)
        for job in jobs:
            by_method[job.cell.method.key].append(job)
        most = self.local.workers
        parts = 1 if in_order else most
        waiting = deque(
            of_method[first::parts]  # every part has runs of every cell
            for of_method in by_method.values()
            for first in range(min(parts, len(of_method)))
        )
        workers, lost, repeated = list[Worker](), 0, set[int]()
        try:
            while waiting or workers:
                while waiting and len(workers) < most:
                    part = waiting.popleft()
                    workers.append(self.worker_for(part[0].cell.method.key))
                    workers[-1].give(part)
                sentinels = [w.process.sentinel for w in workers if w.process.pid is not None]
                connection.wait(sentinels, _POLL_S)
                for worker in tuple(workers):
                    exit_code = worker.exit_code  # before its answers, which end with it
                    yield from worker.answers()
                    spins = exit_code is None and worker.spins
                    if exit_code is None and worker.jobs and not (spins or worker.is_late):
                        continue
                    workers.remove(worker)
                    if exit_code is None and not (worker.jobs or self._idle) and self.stays:
                        self._idle = worker
                        continue
                    worker.end()
                    if not worker.jobs:
                        continue
                    room = Path(self.folder, "room")  # without room an answer can be lost
                    room.write_bytes(bytes(_ROOM))
                    room.unlink()
                    job = worker.jobs[0]
                    begun = worker.since_s < math.inf or exit_code == _UNKEPT
                    lost = 0 if begun else lost + 1
                    if lost == _STARTS:
                        reason = worker.last_output
                        _, is_sentence, sentence = reason.rpartition("CoarticError: ")
                        reason = f": {sentence}" if is_sentence else f" {reason}"
                        words = f"processes cannot begin{reason}; finished runs are kept"
                        raise CoarticError(words)
                    if lost:
                        time.sleep(_POLL_S)  # a killed server may not have ended yet
                    elif exit_code in _REPEATED and not (spins or id(job) in repeated):
                        repeated.add(id(job))
                    else:
                        yield job, worker.failure(exit_code, spins=spins)
                        worker.jobs.popleft()
                    rest = list(worker.jobs)  # a job is repeated alone: answers may be lost
                    alone = 1 if rest and id(rest[0]) in repeated else 0
                    waiting.extendleft(part for part in (rest[alone:], rest[:alone]) if part)
        except OSError as error:
            place = f" ({error.filename})" if error.filename else ""
            what = f"worker processes have no place for answers: {error.strerror or error}{place}"
            how = MORE_FILES if error.errno == errno.EMFILE else "with a TMPDIR that has room"
            raise CoarticError(
                f"{what}. Finished runs are kept: repeat the command, {how}"
            ) from None
        finally:
            for worker in workers:
                worker.end()

    def worker_for(self, method: tuple[str, str, str]) -> Worker:
        """Return the worker that waits for jobs if it has this method (:attr:`MethodInfo.key`);
        otherwise end it, if there is one, and return a new worker, not yet started."""
        waits, self._idle = self._idle, None
        if waits is not None:
            if waits.method == method:
                return waits
            waits.end()
        return Worker(self.folder, method, self.local)


class Worker:
    """A process that performs jobs of one method in order."""

    def __init__(self, folder: str, method: tuple[str, str, str], local: Local) -> None:
        self.method = method
        """Module or file, id and code of the method (:attr:`MethodInfo.key`)."""
        self.jobs = deque[Job]()
        """Jobs without an answer."""
        self.since_s = math.inf
        """Clock at the beginning of the first of these jobs, s; infinite until it has begun."""
        self._timeout_s, self._since_cpu_s = local.timeout_s, math.inf
        self._answered = 0
        self._folder = Path(tempfile.mkdtemp(dir=folder))
        theirs, self._ours = multiprocessing.Pipe(duplex=False)
        output, prints = multiprocessing.Pipe(duplex=False)
        arguments = self._folder, theirs, prints, local.workers, local.verbose
        self.process = CONTEXT.Process(target=_perform_jobs, args=arguments)
        self._theirs, self._printed = (theirs, prints), bytearray()
        self._reader = threading.Thread(target=_read, args=(output, self._printed), daemon=True)

    def give(self, jobs: Sequence[Job]) -> None:
        """Send jobs to the process, start it if it is new, and compile kernels for the first job's
        task in this process, too. If the process cannot start, nothing is raised, and
        :attr:`exit_code` is 1."""
        self.jobs.extend(jobs)
        self.since_s = self._since_cpu_s = math.inf
        (self._folder / _BEGUN).unlink(missing_ok=True)
        try:
            if self.process.pid is None:
                start_process(self.process)
                for end in self._theirs:
                    end.close()
                self._reader.start()
            self._ours.send(jobs)
        except (OSError, EOFError) as error:
            self._printed[:] = error_line(error).encode()
            return
        # This process executes solutions: it compiles kernels meanwhile.
        with contextlib.suppress(Exception):  # the worker reports the same error
            warm_up(self.jobs[0].cell.task, "trials")

    @property
    def exit_code(self) -> int | None:
        """Exit code, or minus the number of the signal that ended the process; None while it runs,
        1 before it has started."""
        return 1 if self.process.pid is None else self.process.exitcode

    @property
    def is_late(self) -> bool:
        """True if the current job, which must exist, has exceeded its limit of wall time."""
        return time.monotonic() > self.since_s + self.wall_limit_s

    @property
    def spins(self) -> bool:
        """True if the current job has used more than 2 s of CPU time, as far as :attr:`cpu_s` shows
        it, beyond its limit (a day without a limit): its method ignores the signal that ends the
        process."""
        limit_s = (self.jobs and self.jobs[0].time_limit_s) or _LONGEST_S
        return self.cpu_s > self._since_cpu_s + limit_s + _SPINS_S

    @property
    def cpu_s(self) -> float:
        """CPU time of the process so far, s; 0 before its start, once it is gone, and where the
        system does not report it (Linux does)."""
        if self.process.pid is not None:
            with contextlib.suppress(AttributeError, OSError, OverflowError):
                return time.clock_gettime((~self.process.pid << 3) | 2)
        return 0.0

    @property
    def wall_limit_s(self) -> float:
        """Limit of wall time for the current job, which must exist, s: three times its limit of CPU
        time (a day without a limit), plus ``timeout_s``."""
        return 3 * (self.jobs[0].time_limit_s or _LONGEST_S) + self._timeout_s

    def answers(self) -> Iterator[tuple[Job, list[Outcome]]]:
        """Yield each job that has been answered since the last call, in order, with the outcomes of
        its runs. The job leaves :attr:`jobs`, and the clock of the next job (:attr:`since_s`)
        starts; the clock of the first job starts in the first call after the job has begun."""
        if self.since_s == math.inf and (self._folder / _BEGUN).exists():
            self.since_s, self._since_cpu_s = time.monotonic(), self.cpu_s
        while self.jobs and (answer := self._folder / str(self._answered)).is_file():
            job = self.jobs.popleft()
            self._answered += 1
            self.since_s, self._since_cpu_s = time.monotonic(), self.cpu_s
            yield job, outcomes_from(job, answer.read_bytes())
            answer.unlink()

    @property
    def last_output(self) -> str:
        """End of the process, and the last three lines that it printed in the current job (if not
        ``verbose``), or why it did not start, as in ``(exit code 1): LINES``."""
        code = self.exit_code or 0
        if self._reader.is_alive():
            self._reader.join(_END_S)
        text = bytes(self._printed).rpartition(_NEXT_JOB)[2]
        lines = text.decode(errors="replace").strip().splitlines()
        last = "\n".join(line[:300] for line in lines[-_LAST_LINES:])
        how = f"killed by {signal_name(-code)}" if code < 0 else f"exit code {code}"
        return f"({how}): {plain(last, 1000) or 'it left no message'}"

    def failure(self, exit_code: int | None, *, spins: bool) -> list[Outcome]:
        """Return the outcomes, ``timeout`` or ``crashed`` with a reason, of the current job of a
        process that has ended with ``exit_code``, or (None) that :attr:`spins` or is late."""
        job, cpu_s = self.jobs[0], self.jobs[0].time_limit_s or _LONGEST_S
        if exit_code is None and not spins:
            reason = f"wall time limit of {self.wall_limit_s:g} s exceeded twice: it waited"
            return fail(job, "timeout", reason, wall_s=self.wall_limit_s)
        if exit_code is None or (exit_code < 0 and signal_name(-exit_code) == "SIGPROF"):
            return fail(job, "timeout", f"CPU time limit of {cpu_s:g} s exceeded", cpu_s=cpu_s)
        if exit_code == _UNKEPT:
            why = "a method removes its folder or limits the size of files"
            return fail(job, "crashed", f"its answer could not be written, as where {why}")
        return fail(job, "crashed", f"the worker process ended {self.last_output}")

    def end(self) -> None:
        """End the process and all processes of its group, which it has started."""
        if self.process.pid is not None:
            end_group(self.process.pid)
            self.process.join(_END_S)


def signal_name(number: int) -> str:
    """Return the name of a signal, such as ``SIGKILL``, or, for a signal without a name here, its
    number, as in ``signal 40``."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _read(output: connection.Connection, kept: bytearray) -> None:
    """Read what a process prints into pipe ``output`` until no process can write there any more;
    keep the last 4000 bytes in ``kept``, which is changed in place."""
    with output:
        while text := os.read(output.fileno(), 2**16):
            kept[:] = (kept + text)[-_PRINTED:]


def _perform_jobs(folder: Path, pipe: Any, prints: Any, workers: int, verbose: bool) -> None:
    """Perform lists of jobs that come through ``pipe``, in one of ``workers`` processes, until it
    is closed or no list comes for a minute; write an answer to each job into ``folder``, files
    ``0``, ``1`` and so on, and ``begun`` when the first job of a list begins. Prints go into pipe
    ``prints``, if ``verbose`` to the terminal."""
    os.environ.pop("PYTHONSAFEPATH", None)  # see start_process
    begin_worker(folder.parent, streams=1 if verbose else 3)
    if verbose:
        logging.basicConfig(level=logging.INFO)
        logging.getLogger("coartic").setLevel(logging.DEBUG)
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    else:
        for stream in (1, 2):
            os.dup2(prints.fileno(), stream)
    _bound_resources(workers)
    process, number = os.getpid(), 0
    while pipe.poll(_IDLE_S):
        try:
            jobs = pipe.recv()
        except EOFError:  # there are no more jobs
            return
        for job in jobs:  # compile or load kernels before the clock of a run starts
            if not job.cell.method.is_ours:
                libraries()  # which reads the names of all installed packages once
            learns = job.cell.method.name.startswith(METHOD_PREFIX)
            warm_up(job.cell.task, "learner" if learns else "motion", "trials")
        if not number:
            place = folder / "place"
            place.mkdir()
            tempfile.tempdir = os.environ["TMPDIR"] = str(place)
            os.chdir(place)
        (folder / _BEGUN).touch()
        for job in jobs:
            with contextlib.suppress(OSError):  # an earlier job may have closed it
                os.write(prints.fileno(), _NEXT_JOB)
            text = _answer_to(job)
            if os.getpid() != process:  # a child that a method has forked
                os._exit(1)
            try:
                write_atomically(folder / str(number), text)
            except OSError:
                os._exit(_UNKEPT)
            number += 1
    end_group(process)  # no job came in time


def _answer_to(job: Job) -> bytes:
    """Perform a job, and return its outcomes as JSON, an outcome ``crashed`` for each run if JSON
    cannot hold them. Meanwhile the job's limit of CPU time, a day without one, is set
    (:func:`_limit_cpu_time`)."""
    _limit_cpu_time(job.time_limit_s or _LONGEST_S)
    outcomes = perform_job(job)
    _limit_cpu_time(0)
    try:
        return answer_of(outcomes)
    except Exception as error:
        reason = f"its outcome cannot be kept: {error_line(error)}"
        return answer_of(fail(job, "crashed", reason))


def _limit_cpu_time(limit_s: float) -> None:
    """Let the system end this process by SIGPROF after ``limit_s`` more seconds of CPU time; 0
    lifts the limit."""
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # an earlier method may have changed it
    signal.setitimer(signal.ITIMER_PROF, limit_s)


def _bound_resources(workers: int) -> None:
    """Limit the memory of this process, one of ``workers`` that share 80 % of the machine's memory
    (at least 1 GiB each), and the size of each of its files to 256 MiB."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    share = max(total * 8 // (10 * workers), _LEAST_MEMORY)
    for what, most in ((resource.RLIMIT_DATA, share), (resource.RLIMIT_FSIZE, _LARGEST_FILE)):
        soft, _ = resource.getrlimit(what)
        with contextlib.suppress(ValueError):  # a limit from outside is lower
            lower = most if soft == resource.RLIM_INFINITY else min(soft, most)
            resource.setrlimit(what, (lower, most))


# Processes are forked from a server that has imported their modules, if the path of its socket is
# short: the system takes 103 characters, and Python adds some.
_START = "forkserver" if len(tempfile.gettempdir()) <= 70 else "spawn"
CONTEXT: Any = multiprocessing.get_context(_START)


def start_process(process: Any) -> None:
    """Start a process of :data:`CONTEXT` with the environment variables of a worker
    (:func:`.worker_variables`), without running the main program again in the process. Raises
    OSError or EOFError if the process does not start."""
    try:
        os.getcwd()
    except FileNotFoundError:
        text = "the working folder was removed; change to another folder"
        raise FileNotFoundError(errno.ENOENT, text) from None
    # Without PYTHONSAFEPATH Python imports from the working folder first, whoever wrote it.
    safe = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    if 0 <= resource.getrlimit(resource.RLIMIT_NOFILE)[0] < _LEAST_FILES:  # -1: no limit
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    main = sys.modules["__main__"]
    with environment(worker_variables() | safe):
        multiprocessing.set_forkserver_preload([__name__, "coartic.benchmarks.preload"])
        resource_tracker.ensure_running()  # before signals are blocked: it unblocks them
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            with blocked_signals():  # Ctrl-C reaches every process of a terminal
                process.start()
        finally:
            sys.modules["__main__"] = main


@contextlib.contextmanager
def process_pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes with the environment variables of workers, with which x86-64
    processors with AVX2 round alike, for programs that run methods or proofs themselves.

    Examples
    --------
    >>> with process_pool(2) as pool:  # doctest: +SKIP
    ...     rows = list(pool.map(solve_task, names))
    """
    with environment(worker_variables()), ProcessPoolExecutor(processes, CONTEXT) as pool:
        yield pool
