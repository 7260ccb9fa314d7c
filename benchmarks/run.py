"""Run a suite into a folder, from Python: what ``coartic run`` does, without a terminal.

``run_suite("quick", "results/quick", runs=2, trials=200)`` plans a suite and performs what the
folder lacks; ``coartic.analysis.load("results/quick")`` reads it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from coartic import CoarticError, Task
from coartic.benchmarks.outcome import kept
from coartic.benchmarks.pool import Executor, Local
from coartic.benchmarks.provenance import command, environment, now
from coartic.benchmarks.registry import Entry, registry
from coartic.benchmarks.suites import Cell, Suite, load_suite, select_cells
from coartic.benchmarks.worker import Answer, Job, job_of
from coartic.files import folder_named
from coartic.inputs import MOST_RUNS, MOST_SECONDS, MOST_SEED, MOST_TRIALS
from coartic.runs.plan import Plan, PlannedCell, hash_of, run_id, run_seed, trials_in, variant_of
from coartic.runs.store import Run, Store, writing
from coartic.tasks.readings import condition_under, load_readings, model_under
from coartic.tasks.task import check_task
from coartic.text import counted

LEAST_TOGETHER = 8
"""Runs of a cell that are not divided among workers."""
_SURE = frozenset({"ok", "infeasible"})  # whoever was beside
_RETRIED = frozenset({"timeout", "crashed"})


def check_list(name: str, value: object) -> None:
    """Raises CoarticError for what is no list of names, one text above all."""
    if isinstance(value, str | Path):
        raise CoarticError(f"{name} is a list: write {name}=[{str(value)!r}]")
    if not isinstance(value, Sequence) or not all(isinstance(item, str | Path) for item in value):
        raise CoarticError(f"{name} is {value!r}; it must be a list of names or paths")


def check_number(name: str, number: float | None, least: float, most: int) -> None:
    """Raises CoarticError for a number out of its bounds, or one that has to be whole, as its
    least value is, and is not. None stands for the suite's own number."""
    kind = int if isinstance(least, int) else int | float
    is_number = isinstance(number, kind) and not isinstance(number, bool)
    if number is not None and not (is_number and least <= number <= most):
        raise CoarticError(f"{name} is {number!r}; it must be from {least} to {most:_}")


@dataclass(frozen=True)
class Selection:
    """Which part of a suite is run, and what of one's own beside it.

    As in :func:`coartic.benchmarks.suites.select_cells`: without names, all of it.
    """

    tasks: Sequence[str] = ()
    methods: Sequence[str] = ()
    task_files: Sequence[str | Path] = ()
    method_files: Sequence[str | Path] = ()

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            check_list(name, value)


ALL_OF_IT = Selection()


@dataclass
class Progress:
    """How far a plan is."""

    total: int
    present: int = 0
    """Runs that were there before."""
    stale: int = 0
    """Runs that were there before, of other code."""
    done: int = 0
    """Runs performed now."""
    failed: int = 0
    """Of all runs, those that are not ok."""
    crashed: int = 0
    """Of all runs, those that crashed."""


Watcher = Callable[[Progress, str], None]
"""Called with how far a plan is before the first run and after each, and with what was run: the
task and the method, empty before the first."""


@dataclass(frozen=True, repr=False)
class RunReport:
    """What performing a plan came to; shown as a sentence."""

    folder: Path
    progress: Progress
    wall_s: float
    """Seconds from the call until the last run was kept, or nothing found to do."""
    others: int
    """Runs in the folder that were not asked for."""

    def __repr__(self) -> str:
        """How many runs were made in how long, how many failed, and where they are."""
        progress, seconds = self.progress, self.wall_s
        time_taken = (
            f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min {seconds % 60:.0f} s"
        )
        reused = f" ({progress.present} reused)" if progress.present else ""
        failed = f"{progress.failed} failed" if progress.failed else "none failed"
        unasked = self.others - progress.stale
        left_out = [
            f"{counted(count, 'run')} {what}"
            for count, what in (
                (progress.stale, "made by a different version of the code"),
                (unasked, "of earlier commands, which are kept"),
            )
            if count > 0
        ]
        without = f" (leaving out {' and '.join(left_out)})" if left_out else ""
        return (
            f"{counted(progress.total, 'run')}{reused} in {time_taken}, {failed}: "
            f"{self.folder}{without}"
        )


@dataclass(frozen=True)
class SuitePlan:
    """Every run of a suite, ready to be performed into a folder (:func:`plan_suite`)."""

    plan: Plan
    entries: dict[str, Entry] = field(repr=False)
    """Methods by id."""
    tasks: dict[str, Task] = field(repr=False)

    def perform(
        self,
        folder: str | Path,
        *,
        executor: Executor | None = None,
        retry_failed: bool = False,
        redo: bool = False,
        watch: Watcher = lambda progress, what: None,
    ) -> RunReport:
        """Perform what a results folder lacks.

        ``executor`` is this machine, a process for every core, by default; ``retry_failed`` and
        ``redo`` perform anew what timed out or crashed, or everything; ``watch`` is called before
        the first run and after each.

        A KeyboardInterrupt ends it and keeps what is done; so does whatever else. Called again,
        it goes on from there. Raises CoarticError where something else is in the way in the
        folder, another process is at work in it, or it cannot be written.
        """
        folder, clock = folder_named(folder), time.perf_counter()
        executor = executor or Local()
        with writing(folder) as store:
            store.ask(self.plan, environment(), command(), now())
            progress, missing = self.missing_runs(store, retry_failed, redo)
            watch(progress, "")
            for position, run in self.perform_lots(missing, executor, store):
                cell = self.plan.cells[position]
                progress.done += 1
                progress.failed += run.status != "ok"
                progress.crashed += run.status == "crashed"
                watch(progress, f"{cell.task} {cell.method}")
            wall_s = time.perf_counter() - clock
            return RunReport(folder, progress, wall_s, store.count() - self.plan.size)

    def missing_runs(
        self, store: Store, retry_failed: bool, redo: bool
    ) -> tuple[Progress, dict[int, list[int]]]:
        """What is there, and the numbers of the runs to perform, by the position of the cell."""
        missing = {p: set(range(cell.runs)) for p, cell in enumerate(self.plan.cells)}
        progress = Progress(self.plan.size, stale=store.stale())
        for position, number, status, had_s in store.present() if not redo else ():
            limit_s = self.plan.time_limit_s
            longer = had_s is not None and (limit_s is None or limit_s > had_s)
            again = status in _RETRIED and (retry_failed or (status == "timeout" and longer))
            if not again:
                missing[position].discard(number)
                progress.present += 1
                progress.failed += status != "ok"
                progress.crashed += status == "crashed"
        return progress, {p: sorted(numbers) for p, numbers in missing.items() if numbers}

    def perform_lots(
        self, missing: dict[int, list[int]], executor: Executor, store: Store
    ) -> Iterator[tuple[int, Run]]:
        """Each run with the position of its cell, once it is kept."""
        lots = list(self.lots(missing, executor.workers))
        while lots:
            alone: list[tuple[int, list[int]]] = []
            jobs = [self.job(position, numbers) for position, numbers in lots]
            for index, answer in executor.perform(jobs):
                position, numbers = lots[index]
                runs = self.runs_of(position, numbers, answer)
                if len(numbers) > 1:  # one that went wrong beside others may have had it from them
                    alone += [(position, [r.row["run"]]) for r in runs if r.status not in _SURE]
                    runs = [run for run in runs if run.status in _SURE]
                store.write(position, runs)
                yield from ((position, run) for run in runs)
            lots = alone

    def lots(self, missing: dict[int, list[int]], workers: int) -> Iterator[tuple[int, list[int]]]:
        """Runs that are performed side by side; results do not depend on which these are.

        A run beside many takes a fraction of its time alone, so lots are as large as methods take
        them. Where there are few runs, each worker has its part; the last lots are divided that
        would not go round.
        """
        total = sum(map(len, missing.values()))
        share = max(math.ceil(total / workers), LEAST_TOGETHER)
        lots: list[tuple[int, list[int]]] = []
        for position, numbers in missing.items():
            cell = self.plan.cells[position]
            entry = self.entries[cell.method]
            most = entry.with_parameters(cell.complete).most_together() if entry.is_ours else 1
            lots += [(position, part) for part in in_parts(numbers, min(most, share))]
        rest = len(lots) % workers
        yield from lots[: len(lots) - rest]
        for position, numbers in lots[len(lots) - rest :]:
            size = max(math.ceil(len(numbers) * rest / workers), LEAST_TOGETHER)
            yield from ((position, part) for part in in_parts(numbers, size))

    def job(self, position: int, numbers: list[int]) -> Job:
        """Runs of a cell that are performed side by side."""
        cell, plan = self.plan.cells[position], self.plan
        return job_of(
            self.entries[cell.method],
            plan.tasks[cell.task],
            cell.complete,
            tuple(run_seed(plan.seed, cell.task, number) for number in numbers),
            model=plan.model,
            trial_budget=plan.trial_budget,
            time_limit_s=plan.time_limit_s,
        )

    def runs_of(self, position: int, numbers: list[int], answer: Answer) -> list[Run]:
        """The runs of a job as they are kept."""
        cell, plan = self.plan.cells[position], self.plan
        asked, code = plan.asked[position], plan.methods[cell.method].code
        identities = [
            {
                "run_id": run_id(asked, plan.seed, number, code),
                "suite_seed": plan.seed,
                "run": number,
                "seed": run_seed(plan.seed, cell.task, number),
                "time_limit_s": plan.time_limit_s,
            }
            for number in numbers
        ]
        return kept(identities, answer, self.tasks[cell.task], plan.model)


def run_suite(
    suite: str | Path | Suite,
    folder: str | Path,
    *,
    runs: int | None = None,
    trials: int | None = None,
    seed: int = 0,
    select: Selection = ALL_OF_IT,
    readings: Sequence[str] = (),
    executor: Executor | None = None,
    watch: Watcher = lambda progress, what: None,
) -> RunReport:
    """Run what a folder lacks of a suite.

    :func:`plan_suite`, then :meth:`SuitePlan.perform`, which have more to choose from.
    """
    plan = plan_suite(suite, runs=runs, trials=trials, seed=seed, select=select, readings=readings)
    return plan.perform(folder, executor=executor, watch=watch)


def plan_suite(
    suite: str | Path | Suite,
    *,
    runs: int | None = None,
    trials: int | None = None,
    seed: int = 0,
    select: Selection = ALL_OF_IT,
    cells: Iterable[Cell] | None = None,
    time_limit_s: float | None = None,
    trial_budget: int | None = None,
    readings: Sequence[str] = (),
) -> SuitePlan:
    """Every run of a suite: a shipped one by name, a file by path (``.toml``), or a Suite.

    ``cells`` made by hand stand in place of the suite's and of what is selected of them.

    ``runs`` per cell, ``trials`` per run and the limit of CPU time are the suite's own by default.
    ``readings`` of the paper, as ``"ties=right"``, hold in all cells, beside the suite's. Raises
    CoarticError for anything unknown, out of bounds, or that does not go together.
    """
    check_list("readings", readings)
    if not isinstance(suite, Suite):
        suite = load_suite(str(suite))
    if cells is None:
        cells = select_cells(
            suite,
            registry(map(Path, select.method_files)),
            tasks=select.tasks,
            methods=select.methods,
            task_files=[Path(path) for path in select.task_files],
        )
    check_number("runs", runs, 1, MOST_RUNS)
    check_number("trials", trials, 1, MOST_TRIALS)
    check_number("seed", seed, 0, MOST_SEED)
    check_number("trial_budget", trial_budget, 1, MOST_TRIALS)
    check_number("time_limit_s", time_limit_s, 1e-3, MOST_SECONDS)
    chosen = load_readings([*suite.readings, *readings])
    model, read = model_under(chosen), condition_under(chosen)
    trials = suite.trials if trials is None else trials
    planned: dict[str, PlannedCell] = {}
    entries: dict[str, Entry] = {}
    tasks: dict[str, Task] = {}
    for cell in cells:
        entry = entries.setdefault(cell.method, cell.entry)
        name = cell.task.name
        if name not in tasks:
            tasks[name] = check_task(cell.task, model)
        # What is asked for of all cells goes before what the suite says of one.
        count = runs or cell.runs or suite.runs
        wanted = planned_cell(cell, entry, read, trials, count)
        # What is written in two ways is performed once.
        first = planned.setdefault(hash_of([name, entry.name, wanted.complete]), wanted)
        if first.runs != wanted.runs:
            raise CoarticError(
                f"{name} x {cell.label}: the suite asks for {first.runs} runs of this cell, and "
                f"then for {wanted.runs}; give one number"
            )
    cells_once = tuple(planned.values())
    plan = Plan(
        suite=suite.name,
        seed=seed,
        runs=runs or suite.runs,
        trials=max((trials_in(cell.complete) for cell in cells_once), default=0),
        readings=tuple(map(str, chosen)),
        time_limit_s=suite.time_limit_s if time_limit_s is None else time_limit_s,
        trial_budget=trial_budget,
        tasks={name: task.model_dump(mode="json") for name, task in tasks.items()},
        methods={name: entry.declared for name, entry in entries.items()},
        cells=cells_once,
    )
    return SuitePlan(plan, entries, tasks)


def planned_cell(
    cell: Cell, entry: Entry, read: Mapping[str, object], trials: int | None, runs: int
) -> PlannedCell:
    """A cell with all its parameters: the suite's for it go before those of the readings of the
    paper, which go before ``trials``. Raises CoarticError for more trials than are kept."""
    defaults = entry.defaults
    parameters = {key: value for key, value in read.items() if key in defaults}
    parameters |= dict(cell.parameters)
    default_trials = {"trials": trials} if trials is not None and "trials" in defaults else {}
    complete = entry.complete(default_trials | parameters)
    if trials_in(complete) > MOST_TRIALS:
        raise CoarticError(
            f"{cell.task.name} x {cell.label}: {trials_in(complete):_} trials a run; "
            f"at most {MOST_TRIALS:_} are kept"
        )
    return PlannedCell(
        task=cell.task.name,
        method=entry.name,
        variant=variant_of(parameters, defaults),
        parameters=parameters,
        complete=complete,
        runs=runs if entry.method.stochastic else 1,
    )


def in_parts(numbers: list[int], size: int) -> Iterator[list[int]]:
    """Runs in parts of so many, the last one of what is left."""
    for first in range(0, len(numbers), size):
        yield numbers[first : first + size]
