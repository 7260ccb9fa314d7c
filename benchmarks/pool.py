"""Perform jobs in worker processes on this machine, with limits of CPU and wall time.

Built-in methods share worker processes. For each method from a file there are separate processes,
so that this method cannot break other methods. There are two limits:

- *CPU time.* The operating system counts the CPU time of all threads of a process, and ends the
  process when its job has used up the limit (timer ``ITIMER_PROF``, signal ``SIGPROF``).
- *Wall time.* The package ``pebble``, which starts and restarts the processes, ends a job that
  exceeds the limit.

When a worker process ends, the processes that it has started end, too, unless they have left the
process group of the worker.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool

from coartic.benchmarks.method_files import check_code
from coartic.benchmarks.processes import CONTEXT, PROGRAM_CONTEXT, signal_name
from coartic.benchmarks.worker import answer_of, fail, outcomes_from, perform_job
from coartic.errors import CoarticError
from coartic.internal.arguments import checked_arguments
from coartic.internal.interruption import raise_if_interrupted
from coartic.internal.limits import MAX_SECONDS, check_limits
from coartic.internal.text import error_line, plain
from coartic.internal.threads import begin_worker, end_with_parent, threads_for
from coartic.learner.conditions import METHOD_PREFIX
from coartic.learner.learning import warm_up
from coartic.runs.plan import Job
from coartic.runs.record import Outcome

_MAX_CPU_S = 24 * 3600.0  # CPU time of a job without a limit
_MIN_MEMORY = 2**30  # bytes for a process: four times as much as built-in methods need
_LAST_LINES = 3  # number of last lines of an ended process's errors in a reason
_LOOK_S = 1.0  # time between looks whether a pool is broken
_MAX_BROKEN_POOLS = 5  # pools of a group that may break before a job gets an answer
_REPEATED = (-signal.SIGKILL, 255)  # exit codes of a process that was killed or lost its server


@contextlib.contextmanager
def process_pool(processes: int, context: Any = PROGRAM_CONTEXT) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes that round floating-point numbers like the workers of suites.

    Use this context manager in programs that run methods or proofs themselves. The processes are
    started with the environment variables of workers, with which all x86-64 processors with AVX2
    round alike. By default each process imports the main program, as the processes of
    ``multiprocessing`` usually do. So call this function inside ``if __name__ == "__main__":``.

    Parameters
    ----------
    processes : int
        Number of processes.
    context : multiprocessing context
        Context that starts the processes. With the default ``PROGRAM_CONTEXT`` they import the main
        program; with ``CONTEXT`` they do not (both are in :mod:`coartic.benchmarks.processes`).

    Yields
    ------
    concurrent.futures.ProcessPoolExecutor
        The pool, which is shut down at the end of the ``with`` block.

    Examples
    --------
    >>> with process_pool(2) as pool:  # doctest: +SKIP
    ...     rows = list(pool.map(solve_task, names))
    """
    with ProcessPoolExecutor(processes, context, initializer=_begin_plainly) as pool:
        yield pool


class Local:
    """Executor that performs jobs in processes on this machine.

    The limit of CPU time is set by each job; without such a limit it is a day. The limit of wall
    time is three times the limit of CPU time plus ``timeout_s``. A job that reaches one of the
    limits is ended.

    Parameters
    ----------
    jobs : int
        Largest number of jobs that are performed at once; -1 for the number of cores.
    timeout_s : float
        Wall time that a job may take in addition to three times its limit of CPU time (in s).
    verbose : bool
        True to show what methods print, their log messages from level INFO, and the tracebacks of
        their errors.

    Raises
    ------
    ValueError
        ``jobs`` is neither -1 nor from 1 to 10,000, ``timeout_s`` is not from 0 to 1,000,000, or an
        argument has a wrong type.
    """

    @checked_arguments
    def __init__(self, jobs: int = -1, *, timeout_s: float = 60.0, verbose: bool = False) -> None:
        check_limits("timeout_s", timeout_s, 0.0, MAX_SECONDS)
        self.workers = threads_for(jobs)
        self.timeout_s = timeout_s
        self.verbose = verbose

    def perform(
        self, jobs: Sequence[Job], *, in_order: bool = False
    ) -> Generator[tuple[Job, list[Outcome]], None, None]:
        """Yield each job with the outcomes of its runs, as jobs finish.

        - A job is performed once more if it exceeds its limit of wall time, or if its process is
          killed by SIGKILL or loses the fork server. If the second attempt fails, too, the outcomes
          of its runs have status ``timeout`` or ``crashed``.
        - If the process of a job exceeds the limit of CPU time, the outcomes have status
          ``timeout``. If the process ends for another reason, they have status ``crashed``.
        - A process that ends while it has no job is replaced.

        Parameters
        ----------
        jobs : sequence of Job
        in_order : bool
            True to perform all jobs of a method in one process, in the order of ``jobs``. If the
            process ends, a new process performs the remaining jobs.

        Yields
        ------
        Job
            One of ``jobs``.
        list of Outcome
            Outcome of each run of the job, in the order of ``job.numbers``.

        Raises
        ------
        CoarticError
            Processes cannot start, processes end five times in a row before they begin a job, or
            the file of a method was changed after the plan was made.
        """
        groups = dict[Any, _Group]()
        for number, job in enumerate(jobs):
            is_shared = job.cell.method.is_ours and not in_order
            key = None if is_shared else job.cell.method.key
            groups.setdefault(key, _Group(self)).waiting.append((number, job))
        for group in groups.values():
            group.processes = 1 if in_order else min(self.workers, len(group.waiting))
        try:
            with (
                tempfile.TemporaryDirectory(
                    prefix="coartic-", ignore_cleanup_errors=True
                ) as folder,
                contextlib.ExitStack() as stack,
            ):
                for group in groups.values():
                    group.folder = Path(folder)
                    stack.callback(group.close)
                yield from self._perform([*groups.values()])
        except (BrokenExecutor, OSError) as error:
            why = error_line(error.__cause__ or error)
            raise CoarticError(
                f"worker processes cannot start or work ({why}). Finished runs are stored: repeat "
                "the command"
            ) from None

    def _perform(self, groups: Sequence[_Group]) -> Iterator[tuple[Job, list[Outcome]]]:
        """Yield each job of the groups with its outcomes, as jobs finish.

        The processes of a group are ended after the last job of the group (:meth:`_Group.close`).
        """
        running, repeated = dict[Future[Any], tuple[_Group, int, Job]](), set[int]()
        while running or any(group.waiting for group in groups):
            for group in groups:
                # A group whose processes are all busy gets one more job for the next free process.
                while group.waiting and (
                    group.running == group.processes
                    or (
                        group.running < group.processes
                        and sum(each.busy for each in groups) < self.workers
                    )
                ):
                    number, job = group.waiting.popleft()
                    try:
                        running[group.give(number, job)] = group, number, job
                    except BrokenExecutor:  # a process cannot start
                        raise
                    except RuntimeError:  # the pool is broken
                        group.waiting.appendleft((number, job))
                        break
            raise_if_interrupted()
            # A broken pool can leave futures without an answer.
            done = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED).done
            for group in groups:
                if group.is_broken:
                    self._replace_pool(group, running)
            for future in sorted(done & {*running}, key=lambda future: running[future][1]):
                group, number, job = running.pop(future)
                group.running -= 1
                error = future.exception()
                if isinstance(error, CoarticError):
                    raise error
                group.broken_pools = 0
                if error is None:
                    outcomes = outcomes_from(job, future.result())
                else:
                    printed = group.end_process(number)
                    exit_code = error.exitcode if isinstance(error, ProcessExpired) else None
                    is_late = isinstance(error, TimeoutError)
                    if number not in repeated and (is_late or exit_code in _REPEATED):
                        repeated.add(number)
                        group.waiting.appendleft((number, job))
                        continue
                    outcomes = self._failure(job, error, printed)
                yield job, outcomes
                if not (group.waiting or group.running):
                    group.close()

    @staticmethod
    def _replace_pool(group: _Group, running: dict[Future[Any], tuple[_Group, int, Job]]) -> None:
        """Close the broken process pool of a group.

        The next job of the group starts a new pool. The jobs of the broken pool that have no answer
        yet are put back into the queue. ``running`` is a dict that maps the future of each running
        job of all groups to a tuple: its group, its number and the job. Raises BrokenExecutor if
        five pools of the group have broken since a job of the group got an answer.
        """
        error: BaseException | None = None
        for future, (of, number, job) in [*running.items()]:
            failure = future.exception() if future.done() else BrokenExecutor()
            if of is group and isinstance(failure, BrokenExecutor):
                error = error or failure.__cause__
                del running[future]
                group.waiting.appendleft((number, job))
                group.running -= 1
        group.broken_pools += 1
        if group.broken_pools >= _MAX_BROKEN_POOLS:
            raise BrokenExecutor("processes end before they begin a job") from error
        group.close()

    def wall_limit_s(self, job: Job) -> float:
        """Return the limit of the wall time of a job (in s)."""
        return 3 * (job.time_limit_s or _MAX_CPU_S) + self.timeout_s

    def _failure(self, job: Job, error: BaseException, printed: str) -> list[Outcome]:
        """Return the outcomes of a job that has an error instead of an answer.

        ``printed`` are the last lines that the process of the job wrote to standard error.
        """
        if isinstance(error, TimeoutError):
            wall_s = self.wall_limit_s(job)
            reason = (
                f"wall time limit of {wall_s:g} s exceeded twice: the job, or the machine, waited"
            )
            return fail(job, "timeout", reason, wall_s=wall_s)
        if not isinstance(error, ProcessExpired):
            return fail(job, "crashed", error_line(error))
        if error.exitcode == -signal.SIGPROF:
            cpu_s = job.time_limit_s or _MAX_CPU_S
            return fail(job, "timeout", f"CPU time limit of {cpu_s:g} s exceeded", cpu_s=cpu_s)
        code = error.exitcode
        how = f"killed by {signal_name(-code)}" if code < 0 else f"exit code {code}"
        last = printed or "it printed no error"
        return fail(job, "crashed", f"the worker process ended ({how}): {last}")


@dataclass(eq=False)
class _Group:
    """Jobs that share one pool of processes.

    One group contains the jobs of all built-in methods; there is a further group for each method
    from a file. If jobs are performed in order, there is a group for each built-in method, too.
    """

    local: Local
    """Executor to which the group belongs."""
    waiting: deque[tuple[int, Job]] = field(default_factory=deque)
    """Queue of the jobs that were not given to the pool yet, each with its number."""
    processes: int = 1
    """Largest number of processes of the pool."""
    running: int = 0
    """Number of jobs that were given to the pool and have no answer yet."""
    folder: Path = Path()
    """Folder of temporary files. The file ``NUMBER-PID`` contains what job NUMBER writes to
    standard error in process PID."""
    broken_pools: int = 0
    """Number of pools of the group that have broken since a job of the group got an answer."""
    _pool: Any = None

    @property
    def is_broken(self) -> bool:
        """True if the pool has broken: it accepts no jobs and gives no answers."""
        return self._pool is not None and not self._pool.active

    @property
    def busy(self) -> int:
        """Number of processes of the group that perform a job."""
        return min(self.running, self.processes)

    def give(self, number: int, job: Job) -> Future[Any]:
        """Give a job to the pool, and return the future of its answer.

        The first job starts the pool. Raises RuntimeError if the pool is broken, and BrokenExecutor
        if a process cannot start.
        """
        if self._pool is None:
            begin = self.folder, self.local.workers, self.local.verbose
            self._pool = ProcessPool(
                self.processes, initializer=_begin, initargs=begin, context=CONTEXT
            )
            # This process executes solutions. It compiles its kernels while the worker starts.
            future = self._schedule(number, job)
            with contextlib.suppress(Exception):  # the worker reports the same error
                warm_up(job.cell.task, "trials")
            return future
        return self._schedule(number, job)

    def _schedule(self, number: int, job: Job) -> Future[Any]:
        arguments = self.folder, number, job, self.local.verbose
        limit_s = self.local.wall_limit_s(job)
        future: Future[Any] = self._pool.schedule(_answer_to, args=arguments, timeout=limit_s)
        self.running += 1
        return future

    def end_process(self, number: int) -> str:
        """Kill the process group of a job whose process has ended.

        Return the last three lines that the job wrote to standard error, as one printable line.
        ``number`` is the number of the job.
        """
        printed = ""
        for path in self.folder.glob(f"{number}-*"):
            pid = int(path.name.partition("-")[2])
            with contextlib.suppress(OSError):
                os.killpg(pid, signal.SIGKILL)
            with path.open("rb") as file:
                file.seek(max(path.stat().st_size - 2000, 0))
                lines = file.read().decode(errors="replace").strip().splitlines()
            printed = plain("\n".join(line[-300:] for line in lines[-_LAST_LINES:]), 1000)
            path.unlink(missing_ok=True)
        return printed

    def close(self) -> None:
        """End the processes of the group, and the processes that they have started."""
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None


def _show_errors() -> None:
    from coartic.benchmarks.preload import show_errors  # only for processes of workers

    show_errors()


def _begin_plainly() -> None:
    """Set up a process of :func:`process_pool`, which ends when its parent ends."""
    _show_errors()
    end_with_parent()


def _begin(folder: Path, workers: int, verbose: bool) -> None:
    """Set up a process that performs jobs.

    - The current folder of the process becomes a new folder in ``folder``, unless the disk is full.
    - What the process prints is shown only if ``verbose`` is True.
    - The limit of the memory for its data is 80 % of the machine's memory divided by the number of
      ``workers``, but at least 1 GiB.
    """
    os.environ.pop("PYTHONSAFEPATH", None)  # see WorkerProcess
    # Other processes cannot import the module of a method file. Forked ones have it.
    multiprocessing.set_start_method("fork", force=True)
    begin_worker(folder, streams=1 if verbose else 3)
    if verbose:
        _show_errors()
        logging.basicConfig(level=logging.INFO)
        logging.getLogger("coartic").setLevel(logging.DEBUG)
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    share = max(total * 8 // (10 * workers), _MIN_MEMORY)
    with contextlib.suppress(ValueError):  # a limit from outside is lower
        resource.setrlimit(resource.RLIMIT_DATA, (share, share))
    with contextlib.suppress(OSError):  # the disk is full
        work_folder = tempfile.mkdtemp(dir=folder)
        tempfile.tempdir = os.environ["TMPDIR"] = work_folder
        os.chdir(work_folder)


def _answer_to(folder: Path, number: int, job: Job, verbose: bool) -> bytes:
    """Perform a job under its limit of CPU time, and return the outcomes as JSON.

    If JSON cannot represent the outcomes, the outcome of each run has status ``crashed``.

    Parameters
    ----------
    folder : Path
        Folder in which a file is made with what the job writes to standard error. The file is
        removed when the job has an answer.
    number : int
        Number of the job, for the name of that file.
    job : Job
    verbose : bool
        True to show what the job writes to standard error, instead of writing it into the file.

    Raises
    ------
    CoarticError
        The file of the job's method was changed after the plan was made.
    """
    printed = folder / f"{number}-{os.getpid()}"
    with contextlib.suppress(OSError), printed.open("wb") as file:  # the disk may be full
        if not verbose:
            os.dup2(file.fileno(), 2)
    learns = job.cell.method.name.startswith(METHOD_PREFIX)
    warm_up(job.cell.task, "learner" if learns else "motion", "trials")  # before its clock starts
    if not job.cell.method.is_ours:
        check_code(job.cell.method)
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # an earlier method may have changed it
    signal.setitimer(signal.ITIMER_PROF, job.time_limit_s or _MAX_CPU_S)
    outcomes = perform_job(job)
    signal.setitimer(signal.ITIMER_PROF, 0)
    with contextlib.suppress(OSError):
        printed.unlink()
    try:
        return answer_of(outcomes)
    except Exception as error:
        return answer_of(fail(job, "crashed", f"its outcome cannot be stored: {error_line(error)}"))
