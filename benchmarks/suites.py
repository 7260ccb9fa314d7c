"""Suites: methods x tasks x parameters x runs. Data in ``benchmarks/suites``."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from benchmarks.declaration import decapitalised
from benchmarks.methods import Entry, Registry, unknown
from benchmarks.provenance import surroundings
from benchmarks.specification import UNLIMITED, Limits, RunSpec
from coartic import (
    CONDITIONS,
    VARIANTS,
    CoarticError,
    Task,
    builtin_tasks,
    load_task,
    parse_task,
)
from coartic.learner import METHOD_PREFIX
from coartic.record import run_seed
from coartic.tables import DeclaredMethod, Manifest, Plan, PlanLimits, PlannedCell, variant_of

SUITE_FOLDER = Path(__file__).parent / "suites"
ALL = "*"
Scalar = bool | int | float | str


class _Move(BaseModel):
    """A family of tasks that differ in where one goal is."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    goal: Annotated[int, Field(ge=1, strict=True)]
    """Which goal, from 1."""
    by: Annotated[tuple[tuple[float, float], ...], Field(min_length=1)]
    """Displacements in x and y, length unit; one task each."""


class _Block(BaseModel):
    """Some methods on some tasks, under all combinations of some parameters."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    tasks: Annotated[tuple[str, ...], Field(min_length=1)]
    methods: Annotated[tuple[str, ...], Field(min_length=1)]
    move: _Move | None = None
    parameters: dict[str, Scalar] = {}
    grid: dict[str, Annotated[tuple[Scalar, ...], Field(min_length=1)]] = {}


class Suite(BaseModel):
    """A suite as its file states it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    title: str
    description: str
    runs: Annotated[int, Field(gt=0, strict=True)]
    """Runs per cell of a stochastic method; the others are run once."""
    trials: Annotated[int, Field(gt=0, strict=True)] | None = None
    """Trials per run, for methods that have this parameter."""
    time_limit_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = 600.0
    cells: Annotated[tuple[_Block, ...], Field(min_length=1)]


@dataclass(frozen=True)
class Cell:
    """One method with parameters on one task."""

    task: Task
    entry: Entry
    parameters: tuple[tuple[str, Scalar], ...] = ()

    @property
    def variant(self) -> str:
        """Parameters that differ from the method's defaults, such as ``noise_sd=0.1``."""
        return variant_of(dict(self.parameters), self.entry.declared.defaults)

    @property
    def method(self) -> str:
        """Id of the method."""
        return self.entry.name

    @property
    def label(self) -> str:
        """The method with its variant."""
        return f"{self.method} {self.variant}".strip()


def suites() -> dict[str, Suite]:
    """The shipped suites by name."""
    return {path.stem: _read(path) for path in sorted(SUITE_FOLDER.glob("*.toml"))}


def load_suite(name: str) -> Suite:
    """A shipped suite by name, or a suite file by path (``.toml``).

    Raises CoarticError for an unknown name or a file that cannot be used.
    """
    if name.endswith(".toml"):
        return _read(Path(name))
    known = suites()
    if name not in known:
        raise unknown("suite", name, known)
    return known[name]


def _read(path: Path) -> Suite:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        return Suite(**{"name": path.stem, **content})
    except OSError as error:
        raise CoarticError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CoarticError(f"{path}: is not valid TOML: {error}") from None
    except ValidationError as error:
        lines = [
            f"{path}: {'.'.join(map(str, detail['loc']))}: {decapitalised(detail['msg'])}"
            for detail in error.errors()
        ]
        raise CoarticError("\n".join(lines)) from None


def select_cells(
    suite: Suite,
    known: Registry,
    *,
    tasks: Sequence[str] = (),
    methods: Sequence[str] = (),
    task_files: Sequence[Path] = (),
) -> list[Cell]:
    """The cells of a suite, plus those of the user's own tasks, narrowed by name.

    A method of ``methods`` that the suite does not have runs on all of the suite's
    tasks that it applies to. A task from a file runs under every applicable method of
    ``methods``, or of all methods of the suite where none are named. Raises CoarticError
    for unknown names, for a task file whose name is taken, for parameters that a method
    does not take, and where nothing is left to run.
    """
    methods = [
        f"{METHOD_PREFIX}{name}" if name in CONDITIONS | VARIANTS else name for name in methods
    ]
    for name in methods:
        if name not in known:
            raise unknown("method", name, known)
    files: dict[str, Path] = {}
    own: dict[str, Task] = {}
    for path in task_files:
        task = load_task(Path(path))
        taken = "a shipped task" if task.name in builtin_tasks() else files.get(task.name)
        if taken == Path(path):
            raise CoarticError(f"{path}: the same task file is given twice")
        if taken is not None:
            raise CoarticError(f"{path}: name {task.name!r} is already taken by {taken}")
        files[task.name], own[task.name] = Path(path), task
    cells: list[Cell] = []
    for block in suite.cells:
        cells += _block_cells(suite, block, known, own)
    suite_methods = list(dict.fromkeys(cell.method for cell in cells))
    shipped = [cell.task for cell in cells if cell.task.name not in own]
    refused: list[str] = []

    def add(task: Task, names: Iterable[str]) -> None:
        for name in names:
            reason = known[name].why_not(task)
            if reason is None:
                cells.append(Cell(task, known[name]))
            else:
                refused.append(reason)

    for task in {task.name: task for task in shipped}.values():
        add(task, [name for name in methods if name not in suite_methods])
    for task in own.values():
        add(task, methods or suite_methods)

    known_tasks = list(dict.fromkeys([*(cell.task.name for cell in cells), *own]))
    for name in tasks:
        if name not in known_tasks:
            raise unknown("task", name, known_tasks)
    distinct: dict[tuple[str, str], Cell] = {}
    for cell in cells:
        distinct.setdefault((cell.task.name, cell.label), cell)
    chosen = [
        cell
        for cell in distinct.values()
        if (not tasks or cell.task.name in tasks) and (not methods or cell.method in methods)
    ]
    # A user's own task that nothing applies to is an error, not a silent gap.
    idle = [
        name
        for name in own
        if (not tasks or name in tasks) and all(cell.task.name != name for cell in chosen)
    ]
    if idle or not chosen:
        pairs = ", ".join(f"{cell.task.name} x {cell.label}" for cell in cells)
        why = "; ".join(refused) if refused else f"suite {suite.name!r} has {pairs}"
        what = f"task {idle[0]!r}" if idle else "what was asked for"
        raise CoarticError(f"no method to run on {what}: {why}.")
    return chosen


def run_specs(
    cells: Sequence[Cell],
    *,
    runs: int,
    seed: int,
    trials: int | None = None,
    limits: Limits = UNLIMITED,
) -> list[tuple[Cell, RunSpec]]:
    """Every run of every cell, in order. ``trials`` goes to methods that have it."""
    planned = []
    for cell in cells:
        parameters = dict(cell.parameters)
        if trials is not None and "trials" in cell.entry.declared.defaults:
            parameters.setdefault("trials", trials)
        cell.entry.complete(parameters)  # refuse wrong parameters before any run
        for run in range(runs if cell.entry.declared.stochastic else 1):
            spec = RunSpec(
                task=cell.task,
                entry=cell.entry,
                parameters=tuple(parameters.items()),
                run=run,
                seed=run_seed(seed, cell.task.name, run),
                limits=limits,
            )
            planned.append((cell, spec))
    return planned


def _block_cells(
    suite: Suite, block: _Block, known: Registry, own: Mapping[str, Task]
) -> list[Cell]:
    """The cells of a block; blocks for all tasks are for the user's as well."""
    tasks = [*builtin_tasks(), *own] if ALL in block.tasks else block.tasks
    for name in block.methods:
        if name not in known and name != ALL:
            raise unknown(f"method of suite {suite.name!r}", name, known)
    cells = []
    for name in tasks:
        if block.move is not None and ALL in block.tasks and name in own:
            continue
        for task in _family(suite, own.get(name) or load_task(name), block.move):
            cells += _cells_of(suite, block, known, task)
    return cells


def _cells_of(suite: Suite, block: _Block, known: Registry, task: Task) -> list[Cell]:
    """The cells of a block on one task."""
    every = ALL in block.methods
    cells = []
    for name in known if every else block.methods:
        reason = known[name].why_not(task, block.parameters)
        if reason is not None:
            if every or ALL in block.tasks:
                continue  # "all that applies"
            raise CoarticError(f"suite {suite.name!r}: {reason}")
        for combination in itertools.product(*block.grid.values()):
            point = dict(zip(block.grid, combination, strict=True))
            parameters = {**block.parameters, **point}
            cell = Cell(task, known[name], tuple(parameters.items()))
            cell.entry.complete(parameters)
            cells.append(cell)
    return cells


def _family(suite: Suite, task: Task, move: _Move | None) -> list[Task]:
    """The task itself, or its variants with one goal moved."""
    if move is None:
        return [task]
    if move.goal > len(task.goals):
        raise CoarticError(
            f"suite {suite.name!r}: task {task.name!r} has no goal {move.goal} to move"
        )
    variants = []
    for dx, dy in move.by:
        goals = [list(goal) for goal in task.goals]
        goals[move.goal - 1][0] += dx
        goals[move.goal - 1][1] += dy
        content = {
            **task.model_dump(mode="json"),
            "name": f"{task.name}.goal{move.goal}_{dx:g}_{dy:g}",
            "description": f"{task.name} with goal {move.goal} moved by ({dx:g}, {dy:g})",
            "goals": goals,
        }
        variants.append(parse_task(content, f"suite {suite.name!r}"))
    return variants


def manifest_of(
    suite: Suite,
    runs: int,
    seed: int,
    planned: Sequence[tuple[Cell, RunSpec]],
    limits: Limits = UNLIMITED,
) -> Manifest:
    """What is asked for, and with what it is made."""
    return Manifest(
        specification=_plan(suite, runs, seed, planned),
        limits=PlanLimits(time_s=limits.time_s, trials=limits.trials),
        environment=surroundings(),
    )


def _plan(suite: Suite, runs: int, seed: int, planned: Sequence[tuple[Cell, RunSpec]]) -> Plan:
    by_cell: dict[tuple[str, str], tuple[Cell, list[RunSpec]]] = {}
    for cell, spec in planned:
        by_cell.setdefault((cell.task.name, cell.label), (cell, []))[1].append(spec)
    cells = [cell for cell, _ in by_cell.values()]
    trials = [spec.all_parameters.get("trials") for _, spec in planned]
    return Plan(
        suite=suite.name,
        runs=runs,
        seed=seed,
        trials=max((count for count in trials if isinstance(count, int)), default=0),
        tasks={cell.task.name: cell.task.model_dump(mode="json") for cell in cells},
        methods={
            cell.method: DeclaredMethod(
                **cell.entry.declared.model_dump(exclude={"name", "frozen", "quick"}),
                origin=cell.entry.origin,
                code=cell.entry.code,
            )
            for cell in cells
        },
        cells=tuple(
            PlannedCell(
                task=cell.task.name,
                method=cell.method,
                variant=cell.variant,
                parameters=dict(cell.parameters),
                complete=specs[0].all_parameters,
                run_ids=tuple(spec.run_id for spec in specs),
            )
            for cell, specs in by_cell.values()
        ),
    )
