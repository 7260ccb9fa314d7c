"""Run a suite into a folder, as ``coartic run`` does.

``run_suite("quick", "results/quick", runs=2, trials=200)`` plans a suite and performs what the
folder lacks; ``coartic.analysis.load("results/quick")`` reads it.
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
from coartic.internal.files import folder_named
from coartic.internal.limits import brief_value
from coartic.internal.text import counted, error_line
from coartic.runs.method_info import VERSION
from coartic.runs.plan import Cell, Job, size_of, trials_in
from coartic.runs.record import UNREPEATED, Run
from coartic.runs.store import Store, writing

_LEAST_BATCH = 8
"""Most runs of a cell that are not divided among workers, if a method performs them together."""
_MOST_TRIALS = 400_000
"""Most trials of a job, if it has more runs than that: some seconds, which is what an interruption
loses."""
_SURE = frozenset({"ok", "infeasible"})  # statuses that do not depend on other runs of the job


@dataclass
class Progress:
    """The progress of a plan in a folder."""

    folder: Path
    total: int
    """Runs of the plan."""
    present: int = 0
    """Runs of the plan that the folder had before, except runs that are performed again."""
    stale: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    """Runs that the folder has from another version or code of their method, by the method, that
    version and the present one. They are kept, and no report shows them."""
    done: int = 0
    """Runs performed by this call."""
    failed: int = 0
    """Runs of the plan that are not ok."""
    crashed: int = 0
    """Runs of the plan that crashed."""
    marks: dict[str, list[str]] = field(default_factory=dict)
    """Sentences on methods against which runs of the folder speak (:meth:`Store.marks`)."""
    others: int = 0
    """Runs of earlier commands in the folder that the plan does not ask for, without :attr:`stale`
    runs."""
    wall_s: float = 0.0
    """Wall time of the call, s; 0 until it ends."""
    time_left: TimeLeft = field(default_factory=TimeLeft)
    """Estimate of the time that the runs to perform take."""
    repeats: int = 0
    """Runs still to perform that only show whether results of own methods repeat."""

    def count(self, status: str) -> None:
        """Count a run of the plan by its status (:attr:`.Outcome.status`): any but ``ok`` in
        :attr:`failed`, ``crashed`` in :attr:`crashed`, too."""
        self.failed += status != "ok"
        self.crashed += status == "crashed"

    def finish(self, run: Run) -> None:
        """Count a run that has just been performed."""
        self.done += 1
        self.count(run.outcome.status)
        self.time_left.finish(run)

    @property
    def unused(self) -> Iterator[str]:
        """Sentences on stored runs that are not used because another version of their method made
        them: a sentence for each method and version."""
        for (method, old, now), count in self.stale.items():
            changed = f"by version {old}, and here it is {now}"
            if not (VERSION.fullmatch(old) and VERSION.fullmatch(now)):
                changed = "from before a change of its code, or of what this imports or reads"
            yield f"Not used: {counted(count, 'run')} of {method} {changed}. They are kept."

    def __str__(self) -> str:
        """Return a sentence: how many runs are there, after which time, how many failed, and the
        folder."""
        minutes, seconds = divmod(self.wall_s, 60)
        long = self.wall_s >= 100
        time_taken = f"{minutes:.0f} min {seconds:.0f} s" if long else f"{self.wall_s:.0f} s"
        there = self.present + self.done
        runs = counted(there, "run") if there == self.total else f"{there} of {self.total} runs"
        runs += f" ({self.present} reused)" if self.present else ""
        failed = f"{self.failed} failed" if self.failed else "none failed"
        left_out = [
            f"{counted(count, 'run')} {what}"
            for count, what in (
                (self.stale.total(), "by another version of their method"),
                (self.others, "of earlier commands, which are kept"),
            )
            if count > 0
        ]
        without = f" (leaving out {' and '.join(left_out)})" if left_out else ""
        return f"{runs} in {time_taken}, {failed}: {self.folder}{without}"


Watcher = Callable[[Progress, Cell | None], None]
"""Function that is called with the progress: before the first run with None, then with the cell of
each run, also of repeats, and once before the repeats. After an exception in it, which gives a
warning, it is not called again."""


def run_suite(
    suite: str | Path | Suite,
    folder: str | Path,
    *,
    executor: Local | Dask | None = None,
    watch: Watcher | None = None,
    **options: Any,
) -> Progress:
    """Run the runs of a suite that a folder lacks: :func:`plan_suite`, then :func:`perform`.

    Parameters
    ----------
    suite : str, Path or Suite
        A suite, a shipped suite by name, or a suite file (``.toml``).
    folder : str or Path
        Results folder, which is made if it is missing.
    executor, watch
        Place where methods run, and function called before the first run and after each
        (:func:`perform`).
    options
        Fields of :class:`~coartic.benchmarks.planning.Request`, such as ``tasks``, ``methods``,
        ``runs`` per cell and ``trials`` per run.

    Returns
    -------
    Progress
        Counts of runs; ``str`` of it is a sentence.

    Raises
    ------
    CoarticError
        A name or a number is refused (:func:`plan_suite`), or the folder cannot be used
        (:func:`perform`).

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

    The plan replaces the plan of the folder; other runs stay there, and no report shows them. Runs
    that fail are stored and counted, and raise nothing; runs that crashed, or timed out under a
    lower limit, are performed again by the next call. An interruption keeps finished runs. Of each
    method of a file, the quickest ok run of this call is made again in another process; a warning,
    and a mark in reports, say if the result differs.

    Parameters
    ----------
    plan : sequence of Job
        Jobs from :func:`plan_suite`, at least one.
    folder : str or Path
        Results folder, which is made if it is missing.
    executor : Local or Dask, optional
        Place where methods run: this machine (:class:`coartic.benchmarks.pool.Local`, by default
        with a process for every core) or a Dask cluster
        (:class:`coartic.benchmarks.cluster.Dask`).
    watch : callable, optional
        Function that is called before the first run and after each run (:data:`Watcher`).

    Returns
    -------
    Progress
        Counts of runs; ``str`` of it is a sentence.

    Raises
    ------
    CoarticError
        The plan has no jobs, the folder holds something else or cannot be written, another process
        writes into it, or a method with missing runs has no code here.
    """
    folder, clock = folder_named(folder), time.perf_counter()
    watches = [watch] if watch else []

    def tell(cell: Cell | None) -> None:
        try:
            for each in watches:
                each(progress, cell)
        except Exception as error:
            watches.clear()
            warnings.warn(f"watch is not called again: {error_line(error)}", stacklevel=3)

    def seconds(run: Run) -> float:
        return run.outcome.times.wall_s or math.inf

    executor = Local() if executor is None else executor
    if not isinstance(executor, Local | Dask):
        raise CoarticError(f"executor is {brief_value(executor)}; it must be a Local or a Dask")
    if not plan:
        raise CoarticError("the plan has no jobs")
    with writing(folder) as store:
        store.replace_plan(plan, made_with())
        progress = Progress(folder, size_of(plan), stale=store.stale())
        progress.others = store.others() - progress.stale.total()
        progress.marks = store.marks()
        missing = _missing_jobs(plan, store, progress)
        own = {job.cell.method.name: job for job in missing if not job.cell.method.is_ours}
        repeats = [replace(job, numbers=job.numbers[:1]) for job in own.values()]
        progress.time_left = TimeLeft(executor.workers)
        progress.time_left.expect([*missing, *repeats])
        tell(None)
        jobs, chosen = _divided(missing, executor.workers), dict[str, Run]()
        while jobs:
            alone: list[Job] = []
            with closing(executor.perform(jobs)) as answers:  # ends workers after an error here
                for job, outcomes in answers:
                    runs = score(job, outcomes)
                    if len(runs) > 1:  # a failure may come from other runs of the job
                        alone += [run.job for run in runs if run.outcome.status not in _SURE]
                        runs = [run for run in runs if run.outcome.status in _SURE]
                    store.write(runs)
                    for run in runs:
                        if run.outcome.status == "ok" and not run.cell.method.is_ours:
                            name = run.cell.method.name
                            chosen[name] = min(chosen.get(name, run), run, key=seconds)
                        progress.finish(run)
                        tell(run.cell)
            jobs = alone
        progress.time_left.expect([run.job for run in chosen.values()])
        progress.repeats = len(chosen)
        for run in list(chosen.values())[:1]:
            tell(run.cell)
        workers = min(executor.workers, Local().workers)
        for again in perform_in_order([run.job for run in chosen.values()], workers):
            name = again.cell.method.name
            run = chosen[name]
            if changes := compare_runs(run, again)[:1]:
                details = run.outcome.details | {UNREPEATED: changes[0]}
                store.write([replace(run, outcome=replace(run.outcome, details=details))])
            progress.time_left.finish(again)
            progress.repeats -= 1
            tell(again.cell)
        known, progress.marks = {*chain(*progress.marks.values())}, store.marks()
        for mark in chain(*progress.marks.values()):
            if mark not in known:
                warnings.warn(mark, stacklevel=2)
        progress.wall_s = time.perf_counter() - clock
        return progress


def _missing_jobs(plan: Sequence[Job], store: Store, progress: Progress) -> list[Job]:
    """Return the missing runs of the plan and, if the code of their method is here, runs that
    crashed or timed out under a lower limit, a job for each cell; count the other runs in
    ``progress``. Raises CoarticError if runs are missing whose method has no code here."""
    there: set[tuple[int, int]] = set()
    for position, number, status, had_s in store.present():
        job = plan[position]
        if number not in job.numbers:
            continue
        longer = had_s is not None and (job.time_limit_s is None or job.time_limit_s > had_s)
        failed = status == "crashed" or (status == "timeout" and longer)
        if not (job.cell.method.where and failed):
            there.add((position, number))
            progress.present += 1
            progress.count(status)
    missing = []
    for position, job in enumerate(plan):
        numbers = tuple(number for number in job.numbers if (position, number) not in there)
        if numbers and not job.cell.method.where:
            raise CoarticError(
                f"{store.folder} lacks runs of {job.cell.label} on {job.cell.task.name}, and the "
                "code of this method is not here: plan them with its method file"
            )
        if numbers:
            missing.append(replace(job, numbers=numbers))
    return missing


def _divided(jobs: Sequence[Job], workers: int) -> list[Job]:
    """Divide jobs for workers, and return the smaller jobs, each with some of the runs: first jobs
    of methods without a number of trials, then the others, by trials, the most first."""
    # A run among many takes a fraction of its time alone: jobs are as large as methods allow, in
    # some seconds, and each worker has a part. Long jobs come first, so that none is alone at the
    # end; one run of a planner, which has no number of trials, can take as long as thousands of
    # trials: it is first.

    def divide(job: Job, size: int) -> Iterator[Job]:
        for first in range(0, len(job.numbers), size):
            yield replace(job, numbers=job.numbers[first : first + size])

    share = max(math.ceil(size_of(jobs) / workers), _LEAST_BATCH)
    parts: list[Job] = []
    for job in jobs:
        method, parameters = job.cell.method, job.cell.parameters
        most = method.configure(parameters).max_batch() if method.is_ours else 1
        few = max(_MOST_TRIALS // (trials_in(parameters) or 1), _LEAST_BATCH)
        parts += divide(job, min(most, share, few))
    even = len(parts) - len(parts) % workers
    ordered, last = parts[:even], parts[even:]
    for job in last:
        ordered += divide(job, max(math.ceil(len(job.numbers) * len(last) / workers), _LEAST_BATCH))

    def trials(job: Job) -> float:
        return trials_in(job.cell.parameters) * len(job.numbers) or math.inf

    return sorted(ordered, key=trials, reverse=True)
