"""Run a suite into a folder, from Python: what ``coartic run`` does, without a terminal.

``run_suite("quick", "results/quick", runs=2, trials=200)`` plans a suite, performs what the
folder lacks, and writes its tables, which
``coartic.analysis.load("results/quick")`` reads.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from coartic import CoarticError
from coartic.benchmarks.executors import Executor, Local
from coartic.benchmarks.harness import Progress, Watcher, perform_missing
from coartic.benchmarks.registry import registry
from coartic.benchmarks.specification import Limits, RunSpec
from coartic.benchmarks.store import Store
from coartic.benchmarks.suites import (
    Cell,
    CellPlan,
    Suite,
    cell_plans,
    load_suite,
    manifest_of,
    select_cells,
)
from coartic.benchmarks.tables import (
    check_results_folder,
    is_done,
    statuses,
    write_tables,
)
from coartic.files import folder_named
from coartic.inputs import MOST_RUNS, MOST_SECONDS, MOST_SEED, MOST_TRIALS
from coartic.runs.packs import Chosen, Packs
from coartic.runs.record import Record
from coartic.runs.tables import Manifest
from coartic.tasks.readings import ChosenReading, load_readings
from coartic.text import counted


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
        for name, given in vars(self).items():
            _check_list(name, given)
            for item in given:
                _check(f"an item of {name}", item, str | Path, "a name or a path")


def _check(name: str, given: object, kind: Any, words: str) -> None:
    """Raises CoarticError where an argument is not of its kind."""
    if not isinstance(given, kind) or isinstance(given, bool):
        raise CoarticError(f"{name} is {given!r}; it must be {words}")


def _check_list(name: str, given: object) -> None:
    """Raises CoarticError for what is no list, one text above all."""
    if isinstance(given, str | Path):
        raise CoarticError(f"{name} is a list: write {name}=[{str(given)!r}]")
    _check(name, given, Sequence, "a list")


ALL_OF_IT = Selection()


@dataclass(frozen=True, repr=False)
class RunReport:
    """What performing a plan came to; shown as a sentence."""

    folder: Path
    progress: Progress
    wall_s: float
    """Seconds from the call until the last run was kept, or nothing found to do."""
    manifest: Manifest
    """What was asked for."""
    kept: int
    """Runs that the folder has a record of, asked for or not."""

    @cached_property
    def records(self) -> Mapping[str, Record]:
        """The records of the plan by run id, in its order, each read when it is asked for."""
        return Chosen(Packs(self.folder), self._ids())

    @property
    def others(self) -> int:
        """Runs in the folder that were not asked for: of another suite, of more of this one, or
        the same ones made by other code."""
        return self.kept - self.progress.total

    @cached_property
    def stale(self) -> int:
        """Runs in the folder that were asked for and are of other code."""
        return len(Store(self.folder).stale(self._ids())) if self.others else 0

    @property
    def crashed(self) -> int:
        """Runs that crashed, now or before."""
        return statuses(self.folder)["crashed"]

    def __repr__(self) -> str:
        return self.sentence(self.wall_s)

    def sentence(self, seconds: float) -> str:
        """How many runs were made in so many seconds, how many failed, and where they are."""
        progress = self.progress
        time = (
            f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min {seconds % 60:.0f} s"
        )
        reused = f" ({progress.present} reused)" if progress.present else ""
        failed = f"{progress.failed} failed" if progress.failed else "none failed"
        return (
            f"{counted(progress.total, 'run')}{reused} in {time}, {failed}: {self.folder}"
            f"{self._without}"
        )

    def _ids(self) -> list[str]:
        cells = self.manifest.specification.cells
        return [id_ for cell in cells for id_ in self.manifest.run_ids(cell)]

    @property
    def _without(self) -> str:
        """What else the folder keeps: runs that this command did not ask for."""
        parts, unasked = [], self.others - self.stale
        if self.stale:
            parts.append(f"{counted(self.stale, 'run')} made by a different version of the code")
        if unasked:
            parts.append(f"{counted(unasked, 'run')} that this command did not ask for")
        return f" (leaving out {' and '.join(parts)})" if parts else ""


@dataclass(frozen=True)
class SuitePlan:
    """Every run of a suite, ready to be performed into a folder (:func:`plan_suite`)."""

    suite: Suite
    cells: Sequence[CellPlan] = field(repr=False)
    runs: int
    seed: int
    limits: Limits
    readings: tuple[ChosenReading, ...] = ()
    """Those that are not the default."""

    @property
    def planned(self) -> list[tuple[Cell, RunSpec]]:
        """Every run, in order."""
        return [(plan.cell, spec) for plan in self.cells for spec in plan.specs()]

    def perform(
        self,
        folder: str | Path,
        *,
        executor: Executor | None = None,
        retry_failed: bool = False,
        redo: bool = False,
        watch: Watcher | None = None,
    ) -> RunReport:
        """Perform what a results folder lacks, then write its tables.

        ``executor`` is this machine, a process for every core, by default; ``retry_failed`` and
        ``redo`` perform anew what timed out or crashed, or everything; ``watch`` is called before
        the first run and after each.

        A KeyboardInterrupt ends it and keeps what is done; so does whatever else. Called again,
        it goes on from there. Raises CoarticError where something else is in the way in the
        folder, another suite is at work in it, it cannot be written, or runs keep getting lost.
        """
        if executor is not None:
            _check(
                "executor",
                executor,
                Executor,
                "one of coartic.benchmarks.executors, as Local(jobs=2)",
            )
        folder = folder_named(folder)
        manifest, clock = self._manifest(), time.perf_counter()
        check_results_folder(folder)
        store = Store(folder)
        with store.locked():
            watch = watch or (lambda progress, spec: None)
            if not (retry_failed or redo) and is_done(store, manifest):
                total = sum(cell.runs for cell in self.cells)
                failed = total - statuses(folder)["ok"]
                progress = Progress(total, present=total, failed=failed)
                watch(progress, None)
                return RunReport(
                    folder, progress, time.perf_counter() - clock, manifest, len(store.packs())
                )
            threading.Thread(target=_import_early).start()  # while workers begin
            progress = perform_missing(
                [spec for cell in self.cells for spec in cell.specs()],
                store,
                executor or Local(),
                retry_failed=retry_failed,
                redo=redo,
                watch=watch,
            )
            wall_s = time.perf_counter() - clock
            store.drop_superseded()
            write_tables(store, manifest)
            return RunReport(folder, progress, wall_s, manifest, len(store.packs()))

    def _manifest(self) -> Manifest:
        return manifest_of(self.suite, self.runs, self.seed, self.cells, self.limits, self.readings)


def _import_early() -> None:
    """What pyarrow imports when the first table is made."""
    with contextlib.suppress(Exception):  # it is said where it is needed
        import pandas  # noqa: F401


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
    watch: Watcher | None = None,
) -> RunReport:
    """Run what a folder lacks of a suite, and write its tables.

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
    limits: Limits | None = None,
    readings: Sequence[str] = (),
) -> SuitePlan:
    """Every run of a suite: a shipped one by name, a file by path (``.toml``), or a Suite.

    ``runs`` per cell, ``trials`` per run and ``limits`` are the suite's own by default.
    ``readings`` of the paper, as ``"ties=right"``, hold in all cells, beside the suite's. Raises
    CoarticError for anything unknown, out of bounds, or that does not go together.
    """
    _check("select", select, Selection, "a Selection, as Selection(tasks=['ascending'])")
    _check_list("readings", readings)
    if not isinstance(suite, Suite):
        _check("suite", suite, str | Path, "a name, a path or a Suite")
        suite = load_suite(str(suite))
    cells = select_cells(
        suite,
        registry(map(Path, select.method_files)),
        tasks=select.tasks,
        methods=select.methods,
        task_files=[Path(path) for path in select.task_files],
    )
    return plan_cells(
        suite, cells, runs=runs, trials=trials, seed=seed, limits=limits, readings=readings
    )


def plan_cells(
    suite: Suite,
    cells: Sequence[Cell],
    *,
    runs: int | None = None,
    trials: int | None = None,
    seed: int = 0,
    limits: Limits | None = None,
    readings: Sequence[str] = (),
) -> SuitePlan:
    """As :func:`plan_suite`, of cells made by hand in place of the suite's."""
    if runs is not None:  # asked for of all cells
        cells = [replace(cell, runs=None) for cell in cells]
    runs = suite.runs if runs is None else runs
    trials = suite.trials if trials is None else trials
    limits = Limits(suite.time_limit_s) if limits is None else limits
    for name, number, least, most in (
        ("runs", runs, 1, MOST_RUNS),
        ("trials", trials, 1, MOST_TRIALS),
        ("seed", seed, 0, MOST_SEED),
        ("limits.trials", limits.trials, 1, MOST_TRIALS),
    ):
        if number is not None:
            _check(name, number, int, f"an int from {least} to {most:_}")
            if not least <= number <= most:
                raise CoarticError(f"{name} is {number}; it must be from {least} to {most:_}")
    if limits.time_s is not None and not 0 < limits.time_s <= MOST_SECONDS:
        raise CoarticError(
            f"limits.time_s is {limits.time_s:g}; it must be above 0, at most {MOST_SECONDS:_}"
        )
    chosen = load_readings([*suite.readings, *readings])
    plans = cell_plans(cells, runs=runs, seed=seed, trials=trials, limits=limits, chosen=chosen)
    return SuitePlan(suite, plans, runs, seed, limits, chosen)
