"""Suites: which methods run on which tasks, how often. Data in ``benchmarks/suites``."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from benchmarks.methods import METHODS, unknown
from coartic import CoarticError, ExplorationCondition, Task, builtin_tasks, load_task

SUITE_FOLDER = Path(__file__).parent / "suites"


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str
    methods: tuple[str, ...]


class Suite(BaseModel):
    """A suite as its file states it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    title: str
    description: str
    runs: int = Field(gt=0)
    trials: int = Field(gt=0)
    cells: tuple[_Entry, ...]


@dataclass(frozen=True)
class Cell:
    """One method on one task."""

    task: Task
    method: str

    @property
    def condition(self) -> ExplorationCondition:
        """The exploration condition behind the method id."""
        return METHODS[self.method]


def suites() -> dict[str, Suite]:
    """The shipped suites by name."""
    found = {}
    for path in sorted(SUITE_FOLDER.glob("*.toml")):
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        found[path.stem] = Suite(name=path.stem, **content)
    return found


def load_suite(name: str) -> Suite:
    """A shipped suite; raises CoarticError for an unknown name."""
    known = suites()
    if name not in known:
        raise unknown("suite", name, known)
    return known[name]


def select_cells(
    suite: Suite,
    *,
    tasks: Sequence[str] = (),
    methods: Sequence[str] = (),
    task_files: Sequence[Path] = (),
) -> list[Cell]:
    """The cells of a suite, plus those of the user's own tasks, narrowed by name.

    A task from a file runs under every applicable method of ``methods``, or of all
    methods where none are named. Raises CoarticError for unknown names, for a task
    file whose name is taken, and where nothing is left to run.
    """
    for name in methods:
        if name not in METHODS:
            raise unknown("method", name, METHODS)
    cells = [
        Cell(load_task(entry.task), method) for entry in suite.cells for method in entry.methods
    ]
    own: dict[str, Path] = {}
    inapplicable: list[str] = []
    for path in task_files:
        task = load_task(Path(path))
        taken = "a shipped task" if task.name in builtin_tasks() else own.get(task.name)
        if taken is not None:
            raise CoarticError(f"{path}: name {task.name!r} is already taken by {taken}")
        own[task.name] = Path(path)
        for method in methods or METHODS:
            reason = METHODS[method].why_not(task)
            if reason is None:
                cells.append(Cell(task, method))
            else:
                inapplicable.append(reason)
    known_tasks = list(dict.fromkeys([*(cell.task.name for cell in cells), *own]))
    for name in tasks:
        if name not in known_tasks:
            raise unknown(f"task of suite {suite.name!r}", name, known_tasks)
    chosen = [
        cell
        for cell in cells
        if (not tasks or cell.task.name in tasks) and (not methods or cell.method in methods)
    ]
    # A user's own task that nothing applies to is an error, not a silent gap.
    idle = [
        name
        for name in own
        if (not tasks or name in tasks) and all(cell.task.name != name for cell in chosen)
    ]
    if idle or not chosen:
        pairs = ", ".join(f"{cell.task.name} x {cell.method}" for cell in cells)
        why = "; ".join(inapplicable) if idle else f"suite {suite.name!r} has {pairs}"
        what = f"task {idle[0]!r}" if idle else "what was asked for"
        raise CoarticError(f"no method to run on {what}: {why}.")
    return chosen
