"""Run a suite, and store the runs in a results folder, as ``coartic run`` does.

``run_suite("quick", "results/quick", runs=2, trials=200)`` plans the runs of suite ``quick`` and
performs those that the folder lacks. ``coartic.analysis.load("results/quick")`` reads the folder.
"""

from __future__ import annotations

import math
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

from coartic.benchmarks.cluster import Dask
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.pool import Local
from coartic.benchmarks.provenance import made_with
from coartic.benchmarks.reproduce import compare_runs, perform_in_order
from coartic.benchmarks.scoring import score
from coartic.benchmarks.suites import Suite
from coartic.benchmarks.time_left import TimeLeft
from coartic.errors import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import error_line, pluralize
from coartic.runs.method_info import VERSION
from coartic.runs.plan import Cell, Job, size_of, trials_in
from coartic.runs.record import UNREPEATED, Row, judged
from coartic.runs.shipped import own_folder
from coartic.runs.store import Store, open_store_for_writing

_MIN_BATCH = 8
"""Smallest number of runs that :func:`_divided` puts into a job, except for the last part of a
divided job, and for methods that allow only fewer runs."""
_MAX_TRIALS = 400_000
"""Largest number of trials of a job that has more than :data:`_MIN_BATCH` runs. So many trials take
some seconds. An interruption loses the runs of the jobs that are being performed."""
_SURE = frozenset({"ok", "infeasible"})  # statuses that do not depend on other runs of the job


@dataclass
class Progress:
    """Progress of a plan in a results folder: numbers of runs, warnings and times."""

    folder: Path
    total: int
    """Number of runs of the plan."""
    present: int = 0
    """Number of runs of the plan that the folder had before this call, without the stored runs that
    are performed again."""
    outdated: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    """Counter of the planned runs that another version (or code) of their method made, keyed by
    triples: id of the method, version that made the runs, and version in the plan. These runs stay
    in the folder, but reports do not show them."""
    done: int = 0
    """Number of runs that this call has performed so far."""
    failed: int = 0
    """Number of runs of the plan whose status is not ``ok``."""
    crashed: int = 0
    """Number of runs of the plan with status ``crashed``."""
    marks: dict[str, list[str]] = field(default_factory=dict)
    """Dict that maps methods to warnings about their runs in the folder (:meth:`Store.marks`)."""
    others: int = 0
    """Number of runs in the folder outside its stored plan (:meth:`.Store.others`), without
    :attr:`outdated`."""
    wall_s: float = 0.0
    """Wall time of the call, in s; 0 until the call ends."""
    time_left: TimeLeft = field(default_factory=TimeLeft)
    """Estimate of the wall time until all runs are performed."""
    repeats: int = 0
    """Number of runs that are still to be repeated (:func:`perform`); 0 until all missing runs are
    performed."""

    def count(self, status: str) -> None:
        """Count a run of the plan in :attr:`failed` and :attr:`crashed` by its status."""
        self.failed += status != "ok"
        self.crashed += status == "crashed"

    def finish(self, run: Row) -> None:
        """Count a run that has just been performed."""
        self.done += 1
        self.count(run["status"])
        self.time_left.finish(run.cell, run["wall_s"])

    @property
    def unused(self) -> Iterator[str]:
        """Sentences on :attr:`outdated` runs, one for each method and version."""
        for (method, old, new), count in self.outdated.items():
            origin = f"made by version {old}; its version here is {new}"
            if not (VERSION.fullmatch(old) and VERSION.fullmatch(new)):
                origin = "made before its file, or a file that it imports or reads, changed"
            runs = pluralize(count, "run")
            yield f"Not used: {runs} of {method}, {origin}. They stay in the folder."

    def __str__(self) -> str:
        """Return a sentence on the numbers of runs, the time, the failures and the folder."""
        minutes, seconds = divmod(self.wall_s, 60)
        long = self.wall_s >= 100
        time_taken = f"{minutes:.0f} min {seconds:.0f} s" if long else f"{self.wall_s:.0f} s"
        count = self.present + self.done
        runs = pluralize(count, "run") if count == self.total else f"{count} of {self.total} runs"
        runs += f" ({self.present} reused)" if self.present else ""
        failed = f"{self.failed} failed" if self.failed else "none failed"
        left_out = [
            f"{pluralize(count, 'run')} {what}"
            for count, what in (
                (self.outdated.total(), "by another version of their method"),
                (self.others, "of earlier commands"),
            )
            if count > 0
        ]
        without = f" (without {' and '.join(left_out)})" if left_out else ""
        return f"{runs} in {time_taken}, {failed}: {self.folder}{without}"


Watcher = Callable[[Progress, Cell | None], None]
"""Function that is called with the progress and a cell, or None:

- before the first run, with None;
- after each run and each repeated run, with the cell of the run;
- before the first repeated run, with its cell.

If the function raises an exception, :func:`perform` warns, and does not call it again."""


def run_suite(
    suite: str | Path | Suite,
    folder: str | Path,
    *,
    executor: Local | Dask | None = None,
    watch: Watcher | None = None,
    **options: Any,
) -> Progress:
    """Plan a suite, and perform the runs that a results folder lacks.

    This function calls :func:`plan_suite` and then :func:`perform`.

    Parameters
    ----------
    suite : str, Path or Suite
        A suite, the name of a shipped suite, or a suite file (``.toml``).
    folder : str or Path
        Results folder. A missing folder is made.
    executor : Local or Dask, optional
        Machine or cluster on which methods run (:func:`perform`).
    watch : callable, optional
        Function that is called before the first run and after each run (:data:`Watcher`).
    **options
        Fields of :class:`~coartic.benchmarks.planning.Request`, such as ``tasks``, ``methods``,
        ``runs`` of each cell and ``trials`` of each run.

    Returns
    -------
    Progress
        Numbers of runs. ``str(progress)`` is a sentence about them.

    Raises
    ------
    CoarticError
        An option is wrong (:func:`plan_suite`), or the folder cannot be used (:func:`perform`).

    Examples
    --------
    >>> print(run_suite("paper", "results/first", tasks=["ascending"], runs=3))  # doctest: +SKIP
    3 runs in 4 s, none failed: results/first
    """
    return perform(plan_suite(suite, **options), folder, executor=executor, watch=watch)


def perform(
    plan: Sequence[Job],
    folder: str | Path,
    *,
    executor: Local | Dask | None = None,
    watch: Watcher | None = None,
) -> Progress:
    """Perform the runs of a plan that a results folder lacks.

    - *Plan.* ``plan`` replaces the plan that is stored in the folder. Runs that the new plan does
      not ask for stay in the folder, but reports do not show them.
    - *Failures.* Runs that fail are stored and counted; no error is raised. The next call performs
      two kinds of runs again, if the code of their method is available: runs that crashed, and runs
      that timed out under a limit of CPU time below the limit in the new plan.
    - *Interruption.* The runs of jobs that finished before an interruption are stored.
    - *Motor noise.* If the stored mean ticks of a run follow another version of the rule of noise,
      they are computed again.
    - *Repetition.* A method from a file could keep state from one run to the next. So for each such
      method, one run of this call that has status ``ok`` is performed a second time, in another
      process. If the results differ, this call warns, and reports mark the method. The repeated run
      is the quickest of these runs that was not the first run of its process; if there is none, it
      is the quickest of all.

    Parameters
    ----------
    plan : sequence of Job
        Jobs from :func:`plan_suite`, at least one.
    folder : str or Path
        Results folder. A missing folder is made.
    executor : Local or Dask, optional
        Machine or cluster on which methods run: this machine
        (:class:`coartic.benchmarks.pool.Local`, by default with a process for each core) or a Dask
        cluster (:class:`coartic.benchmarks.cluster.Dask`).
    watch : callable, optional
        Function that is called before the first run and after each run (:data:`Watcher`).

    Returns
    -------
    Progress
        Numbers of runs. ``str(progress)`` is a sentence about them.

    Raises
    ------
    CoarticError
        One of these is the case:

        - the plan has no jobs, or ``executor`` is neither a Local nor a Dask;
        - the folder contains other files or results of another suite, or cannot be written;
        - another process writes into the folder;
        - the code of a method with missing runs is not available here;
        - the executor cannot perform jobs (:meth:`.Local.perform`, :meth:`.Dask.perform`).

    Warns
    -----
    UserWarning
        The repetition of a run differs, other runs of a method were made with other versions of the
        packages that its file imports, or ``watch`` raised an exception.
    """
    folder, started = own_folder(folder), time.perf_counter()
    watchers = [watch] if watch else []

    def tell(cell: Cell | None) -> None:
        try:
            for watcher in watchers:
                watcher(progress, cell)
        except Exception as error:
            watchers.clear()
            warnings.warn(f"watch is not called again: {error_line(error)}", stacklevel=3)

    executor = Local() if executor is None else executor
    if not isinstance(executor, Local | Dask):
        raise CoarticError(f"executor is {brief_value(executor)}; it must be a Local or a Dask")
    if not plan:
        raise CoarticError("plan is empty; it must have at least one job")
    with open_store_for_writing(folder) as store:
        store.replace_plan(plan, made_with())
        progress = Progress(folder, size_of(plan), outdated=store.count_outdated_runs())
        progress.others = store.others() - progress.outdated.total()
        progress.marks = store.marks()
        missing = _missing_jobs(plan, store, progress)
        own_methods = {job.cell.method.name: job for job in missing if not job.cell.method.is_ours}
        repeats = [replace(job, numbers=job.numbers[:1]) for job in own_methods.values()]
        for ids in store.outdated_noise():
            store.write(judged([store.run(run_id) for run_id in ids]))
        progress.time_left = TimeLeft(executor.workers)
        progress.time_left.expect([*missing, *repeats])
        tell(None)
        jobs, quickest = _divided(missing, executor.workers), dict[str, Row]()
        while jobs:
            retried: list[Job] = []
            with closing(executor.perform(jobs)) as answers:  # an error below ends the workers
                for job, outcomes in answers:
                    runs = score(job, outcomes)
                    if len(runs) > 1:  # other runs of the job may have caused a failure
                        retried += [run.job for run in runs if run["status"] not in _SURE]
                        runs = [run for run in runs if run["status"] in _SURE]
                    store.write(runs)
                    for run in runs:
                        _note_quickest(run, quickest)
                        progress.finish(run)
                        tell(run.cell)
            jobs = retried
        _repeat_runs(quickest, store, progress, min(executor.workers, Local().workers), tell)
        old_marks, progress.marks = {*chain(*progress.marks.values())}, store.marks()
        for mark in chain(*progress.marks.values()):
            if mark not in old_marks:
                warnings.warn(mark, stacklevel=2)
        progress.wall_s = time.perf_counter() - started
        return progress


def _note_quickest(run: Row, quickest: dict[str, Row]) -> None:
    """Enter a run into ``quickest`` if it is the quickest of its method.

    ``quickest`` is a dict that maps the id of each method from a file to its quickest run. A run
    that was the first run of its method in a process is treated as slower than all other runs. Runs
    whose status is not ``ok``, and runs of built-in methods, are ignored.
    """

    def seconds(run: Row) -> tuple[bool, float]:
        return not run["warm"], run["wall_s"] or math.inf

    if run["status"] == "ok" and not run.cell.method.is_ours:
        name = run.cell.method.name
        quickest[name] = min(quickest.get(name, run), run, key=seconds)


def _repeat_runs(
    quickest: dict[str, Row],
    store: Store,
    progress: Progress,
    workers: int,
    tell: Callable[[Cell | None], None],
) -> None:
    """Perform a run of each method from a file again, and store differences.

    Parameters
    ----------
    quickest : dict of str to Row
        Dict that maps the id of each method from a file to the run that is performed again, in a
        new process.
    store : Store
        Opened results folder. In the details of a run that differs, entry :data:`.UNREPEATED` is
        set to the first difference.
    progress : Progress
        Progress, which is updated.
    workers : int
        Largest number of processes.
    tell : callable
        Function that is called with the cell of the first run before that run, and with the cell
        of each run after it.
    """
    progress.time_left.expect([run.job for run in quickest.values()])
    progress.repeats = len(quickest)
    for run in list(quickest.values())[:1]:
        tell(run.cell)
    for _, repeated in perform_in_order([run.job for run in quickest.values()], workers):
        run = quickest[repeated.cell.method.name]
        if changes := compare_runs(run, repeated)[:1]:
            store.write([replace(run, details=run.details | {UNREPEATED: changes[0]})])
        progress.time_left.finish(repeated.cell, repeated["wall_s"])
        progress.repeats -= 1
        tell(repeated.cell)


def _missing_jobs(plan: Sequence[Job], store: Store, progress: Progress) -> list[Job]:
    """Return a job for each planned cell in which runs have to be performed.

    A run has to be performed in two cases:

    - The run is not stored.
    - The stored run crashed, or timed out under a lower limit of CPU time than the limit of the
      plan, and the code of the method is available here.

    All other runs of the plan are counted in ``progress``. Raises CoarticError if a run has to be
    performed, and the code of its method is not available here.
    """
    present: set[tuple[int, int]] = set()
    for position, number, status, old_limit_s in store.present():
        job = plan[position]
        if number not in job.numbers:
            continue
        has_longer_limit = old_limit_s is not None and (
            job.time_limit_s is None or job.time_limit_s > old_limit_s
        )
        failed = status == "crashed" or (status == "timeout" and has_longer_limit)
        if not (job.cell.method.where and failed):
            present.add((position, number))
            progress.present += 1
            progress.count(status)
    missing = []
    for position, job in enumerate(plan):
        numbers = tuple(number for number in job.numbers if (position, number) not in present)
        if numbers and not job.cell.method.where:
            raise CoarticError(
                f"{store.folder} lacks runs of {job.cell.label} on {job.cell.task.name}, and the "
                "code of this method is not available: pass its method file"
            )
        if numbers:
            missing.append(replace(job, numbers=numbers))
    return missing


def _divided(jobs: Sequence[Job], workers: int) -> list[Job]:
    """Divide jobs into smaller jobs, in the order in which workers should start them.

    - *Size.* Many methods need less time for many runs side by side than for the same runs one by
      one. So a job has as many runs as the method allows: :meth:`.Method.max_batch` for a built-in
      method, and one run for a method from a file. A job has fewer runs, but as a rule at least 8,
      if it would take more than some seconds, or if some of the ``workers`` processes would get no
      runs.
    - *Order.* Jobs with more trials start earlier, so that no long job is left alone at the end.
      Jobs of methods without a number of trials, such as planners, start first, because one run of
      such a method can take as long as thousands of trials.
    """

    def divide(job: Job, size: int) -> Iterator[Job]:
        for begin in range(0, len(job.numbers), size):
            yield replace(job, numbers=job.numbers[begin : begin + size])

    share = max(math.ceil(size_of(jobs) / workers), _MIN_BATCH)
    parts: list[Job] = []
    for job in jobs:
        method, parameters = job.cell.method, job.cell.parameters
        allowed = method.configure(parameters).max_batch() if method.is_ours else 1
        quick = max(_MAX_TRIALS // (trials_in(parameters) or 1), _MIN_BATCH)
        parts += divide(job, min(allowed, share, quick))
    even = len(parts) - len(parts) % workers
    ordered, last_parts = parts[:even], parts[even:]
    for job in last_parts:
        size = max(math.ceil(len(job.numbers) * len(last_parts) / workers), _MIN_BATCH)
        ordered += divide(job, size)

    def trials(job: Job) -> float:
        return trials_in(job.cell.parameters) * len(job.numbers) or math.inf

    return sorted(ordered, key=trials, reverse=True)
