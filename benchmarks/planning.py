"""From a suite and the options of a command to a plan: every run with all its parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from coartic import CoarticError, Task
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import Suite, load_suite, select_cells
from coartic.inputs import MOST_RUNS, MOST_SECONDS, MOST_SEED, MOST_TRIALS, brief_value
from coartic.runs.plan import Cell, Plan, hash_of, trials_in
from coartic.tasks.families import own_families
from coartic.tasks.task import check_task

LIMITS = {
    "runs": (1, MOST_RUNS),
    "trials": (1, MOST_TRIALS),
    "seed": (0, MOST_SEED),
    "trial_budget": (1, MOST_TRIALS),
    "time_limit_s": (1e-3, MOST_SECONDS),
}
"""Least and greatest value of options that are numbers; whole ones where the least value is."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a suite is run; None stands for the suite's own number.

    Raises CoarticError for a number out of its limits, and for what is no list.
    """

    runs: int | None = None
    """Runs of each cell."""
    trials: int | None = None
    """Trials of each run, for methods that have this parameter."""
    seed: int = 0
    """Seed of the suite."""
    time_limit_s: float | None = None
    """CPU time of a run."""
    trial_budget: int | None = None
    """Physical trials of a run, of any method; None for no budget."""

    def __post_init__(self) -> None:
        for name, (least, most) in LIMITS.items():
            if getattr(self, name) is not None or name == "seed":  # the suite has none
                check_number(name, getattr(self, name), least, most)


@dataclass(frozen=True)
class Selection:
    """Which part of a suite is run, and what of one's own beside it.

    As in :func:`coartic.benchmarks.suites.select_cells`: without names, all of it.
    """

    tasks: Sequence[str | Path] = ()
    methods: Sequence[str] = ()
    method_files: Sequence[str | Path] = ()
    family_files: Sequence[str | Path] = ()

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            check_list(name, value)


def check_list(name: str, value: object) -> None:
    """Raises CoarticError for what is no list of names, one text above all."""
    if isinstance(value, str | Path):
        raise CoarticError(f"{name} is a list: write {name}=[{str(value)!r}]")
    if not isinstance(value, Sequence) or not all(isinstance(item, str | Path) for item in value):
        raise CoarticError(f"{name} is {value!r}; it must be a list of names or paths")


def check_number(name: str, number: object, least: float, most: int) -> None:
    """Raises CoarticError for a number out of its limits, or one that has to be whole and is
    not."""
    kind = int if isinstance(least, int) else int | float
    is_number = isinstance(number, kind) and not isinstance(number, bool)
    if not (is_number and least <= number <= most):  # type: ignore[operator]
        raise CoarticError(f"{name} is {number!r}; it must be from {least} to {most:_}")


WHOLE_SUITE = Selection()


def plan_suite(
    suite: str | Path | Suite,
    *,
    select: Selection = WHOLE_SUITE,
    cells: Iterable[Cell] | None = None,
    **options: Any,
) -> Plan:
    """Every run of a suite: a shipped one by name, a file by path (``.toml``), or a Suite.

    ``options`` are fields of :class:`Options`. ``cells`` made by hand stand in place of the
    suite's. Raises CoarticError for anything unknown, out of bounds, or that does not go together.
    """
    chosen = Options(**options)
    if not isinstance(select, Selection):
        raise CoarticError(f"select is {brief_value(select)}; it must be a Selection")
    if not isinstance(suite, Suite):
        suite = load_suite(str(suite))
    if cells is None:
        cells = select_cells(
            suite,
            registry(map(Path, select.method_files)),
            tasks=[str(name) for name in select.tasks],
            methods=select.methods,
            families=own_families(map(Path, select.family_files)),
        )
    trials = suite.trials if chosen.trials is None else chosen.trials
    tasks: dict[str, Task] = {}
    planned: dict[str, Cell] = {}
    for cell in cells:
        name = cell.task.name
        if name not in tasks:
            tasks[name] = check_task(cell.task)
        elif tasks[name] != cell.task:  # results are told apart by names
            raise CoarticError(f"two different tasks are called {name!r}: give one another name")
        wanted = complete_cell(replace(cell, task=tasks[name]), trials, chosen.runs)
        # A cell that is written in two ways is performed once.
        first = planned.setdefault(hash_of([name, cell.method.name, wanted.complete]), wanted)
        if first.runs != wanted.runs:
            raise CoarticError(
                f"{name} x {cell.label}: the suite asks for {first.runs} runs of this cell, and "
                f"then for {wanted.runs}; give one number"
            )
    limit_s = chosen.time_limit_s
    return Plan(
        suite=suite.name,
        seed=chosen.seed,
        runs=chosen.runs or suite.runs,
        trials=max((trials_in(cell.complete) for cell in planned.values()), default=0),
        time_limit_s=suite.time_limit_s if limit_s is None else limit_s,
        trial_budget=chosen.trial_budget,
        cells=tuple(planned.values()),
    )


def complete_cell(cell: Cell, trials: int | None, runs: int | None) -> Cell:
    """A cell with all its parameters: the suite's go before ``trials``; ``runs`` go before the
    suite's. Raises CoarticError for more trials than are kept."""
    takes_trials = trials is not None and "trials" in cell.method.defaults
    default_trials = {"trials": trials} if takes_trials else {}
    complete = cell.method.complete(default_trials | cell.parameters)
    if trials_in(complete) > MOST_TRIALS:
        raise CoarticError(
            f"{cell.task.name} x {cell.label}: {trials_in(complete):_} trials a run; "
            f"at most {MOST_TRIALS:_} are kept"
        )
    count = (runs or cell.runs) if cell.method.stochastic else 1
    return replace(cell, complete=complete, runs=count)
