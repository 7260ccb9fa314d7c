"""From a suite and the options of a command to a plan: every run with all its parameters."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from coartic import CoarticError, Task
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import Suite, load_suite, select_cells
from coartic.internal.limits import (
    MOST_RUNS,
    MOST_SECONDS,
    MOST_SEED,
    MOST_TRIALS,
    brief_value,
    check_limits,
)
from coartic.runs.plan import Cell, Plan, hash_of, trials_in
from coartic.tasks.families import own_families
from coartic.tasks.task import check_task


def plan_suite(
    suite: str | Path | Suite,
    *,
    tasks: Sequence[str | Path | Task] = (),
    methods: Sequence[str] = (),
    method_files: Sequence[str | Path] = (),
    family_files: Sequence[str | Path] = (),
    cells: Sequence[Cell] | None = None,
    runs: int | None = None,
    trials: int | None = None,
    seed: int = 0,
    time_limit_s: float | None = None,
    trial_budget: int | None = None,
) -> Plan:
    """Plan every run of a suite.

    Parameters
    ----------
    suite : str, Path or Suite
        A shipped suite by name, or a suite file (``.toml``).
    tasks, methods : sequence of str
        The part of the suite that is run, as :func:`coartic.benchmarks.suites.select_cells` takes
        them, and own tasks (Task, or Path); without names, all of it.
    method_files, family_files : sequence of str or Path
        Files with methods and families of your own.
    cells : sequence of Cell, optional
        Cells in place of the suite's.
    runs, trials : int, optional
        Runs of each cell, and trials of each run for methods that have this parameter; by default
        the suite's numbers.
    seed : int
        Seed of the suite.
    time_limit_s : float, optional
        CPU time of a run, s; by default the suite's.
    trial_budget : int, optional
        Most physical trials of a run, of any method.

    Returns
    -------
    Plan
        Cells with all parameters, and the seeds of their runs.

    Raises
    ------
    CoarticError
        For anything unknown, out of bounds, or that does not go together.
    """
    lists = {"methods": methods, "method_files": method_files, "family_files": family_files}
    kinds: dict[str, tuple[Any, tuple[type, ...], str]] = {
        "tasks": (tasks, (str, Path, Task), "names, paths or tasks"),
        "cells": (() if cells is None else cells, (Cell,), "cells"),
        **{name: (names, (str, Path), "names or paths") for name, names in lists.items()},
    }
    for name, (items, allowed, what) in kinds.items():
        if isinstance(items, str | Path | Task) and name != "cells":
            shown = items if isinstance(items, Task) else str(items)
            raise CoarticError(f"{name} is a list: write {name}=[{brief_value(shown)}]")
        if not isinstance(items, Collection) or not all(
            isinstance(each, allowed) for each in items
        ):
            raise CoarticError(f"{name} is {brief_value(items)}; it must be a list of {what}")
    numbers = {
        "runs": (runs, 1, MOST_RUNS),
        "trials": (trials, 1, MOST_TRIALS),
        "trial_budget": (trial_budget, 1, MOST_TRIALS),
        "time_limit_s": (time_limit_s, 1e-3, MOST_SECONDS),
    }
    try:
        check_limits("seed", seed, 0, MOST_SEED)
        for name, (number, least, most) in numbers.items():
            if number is not None:
                check_limits(name, number, least, most)
    except ValueError as error:
        raise CoarticError(str(error)) from None
    if not isinstance(suite, Suite):
        suite = load_suite(str(suite))
    if cells is None:
        cells = select_cells(
            suite,
            registry(map(Path, method_files)),
            tasks=[each if isinstance(each, Task) else str(each) for each in tasks],
            methods=methods,
            families=own_families(map(Path, family_files)),
        )
    trials = suite.trials if trials is None else trials
    by_name: dict[str, Task] = {}
    planned: dict[str, Cell] = {}
    for cell in cells:
        name, method = cell.task.name, cell.method
        if name not in by_name:
            by_name[name] = check_task(cell.task)
        elif by_name[name] != cell.task:  # results are distinguished by names
            raise CoarticError(f"two different tasks are called {name!r}: give one another name")
        takes_trials = trials is not None and "trials" in method.defaults
        complete = method.complete(({"trials": trials} if takes_trials else {}) | cell.parameters)
        if trials_in(complete) > MOST_TRIALS:
            raise CoarticError(
                f"{name} x {cell.label}: {trials_in(complete):_} trials a run; "
                f"at most {MOST_TRIALS:_} are kept"
            )
        count = (runs or cell.runs) if method.stochastic else 1
        wanted = replace(cell, task=by_name[name], complete=complete, runs=count)
        # A cell that is written in two ways is performed once.
        first = planned.setdefault(hash_of([name, method.name, complete]), wanted)
        if first.runs != count:
            raise CoarticError(
                f"{name} x {cell.label}: the suite asks for {first.runs} runs of it, and "
                f"then for {count}; give one number"
            )
    return Plan(
        suite=suite.name,
        seed=seed,
        runs=runs or suite.runs,
        trials=max((trials_in(cell.complete) for cell in planned.values()), default=0),
        time_limit_s=suite.time_limit_s if time_limit_s is None else time_limit_s,
        trial_budget=trial_budget,
        cells=tuple(planned.values()),
    )
