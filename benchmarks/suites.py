"""Read suite files, which list the tasks, methods, parameters and runs of a suite."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainValidator, ValidationError
from pydantic_core import PydanticCustomError

from coartic import CoarticError, Task, builtin_tasks, parse_task
from coartic.internal.limits import MAX_RUNS, MAX_SECONDS, MAX_TRIALS
from coartic.internal.text import Line, plain, unknown
from coartic.internal.toml_files import read_toml
from coartic.internal.validation import FileData, described_error, explain
from coartic.model import WORLD, MotionModel, check_model
from coartic.robot import Finite
from coartic.runs.contrasts import Contrast, Term
from coartic.runs.shipped import SHIPPED_SUITES
from coartic.runs.store import RUNS_FILE
from coartic.tasks.families import named_by, shipped_families
from coartic.tasks.task import MAX_NAME_LENGTH, NAME_PATTERN

SUITE_FOLDER = Path(__file__).parent / "suites"
WILDCARD = "*"
_Plain = bool | int | float | str | tuple[float, ...]
TaskNamed = Callable[[str], Task]
"""Function that returns a task by its name or file."""


def _plain_value(value: Any) -> _Plain:
    """Validate the value of a parameter of a method, and return it.

    The value is True, False, a finite number, a string or a list of finite numbers. A list is
    returned as a tuple. Raises a validation error for any other value.
    """
    numbers = value if isinstance(value, list | tuple) else [value]
    largest = sys.float_info.max
    if numbers and all(isinstance(x, int | float) and abs(x) <= largest for x in numbers):
        return value if value is numbers[0] else tuple(numbers)
    if isinstance(value, str):
        return value
    problem = "should be true, false, a finite number, a string or a list of finite numbers"
    raise PydanticCustomError("scalar", "{text}", {"text": problem})


RunCount = Annotated[int, Field(ge=1, le=MAX_RUNS, strict=True)]
TrialCount = Annotated[int, Field(ge=1, le=MAX_TRIALS, strict=True)]
Seconds = Annotated[float, Field(ge=1e-3, le=MAX_SECONDS, strict=True)]
_Value = Annotated[_Plain, PlainValidator(_plain_value)]
_SOME = Field(min_length=1)
_Names = Annotated[tuple[str, ...], _SOME]
_Number = Annotated[int, Field(ge=1, strict=True)]


def _worlds(value: Any) -> tuple[MotionModel, ...]:
    """Validate a table ``model``, and return the worlds that it describes.

    The table maps constants (:data:`.WORLD`) to a value or to a list of values. The result
    contains a world for each combination of the values. A tuple of worlds is returned unchanged.
    Raises a validation error for an unknown constant, a wrong value or an empty table.
    """
    if isinstance(value, tuple) and all(isinstance(world, MotionModel) for world in value):
        return value
    if not isinstance(value, Mapping) or not value:
        raise described_error(
            f"model is {value!r}; it must be a table of constants, such as {{ motor_noise = 0.01 }}"
        )
    for name in value:
        if name not in WORLD:
            raise described_error(f"model has no constant {name!r}; it has {', '.join(WORLD)}")
        if value[name] in ([], ()):
            raise described_error(f"model.{name} is empty; it must be a value or a list of values")
    lists = [
        value[name] if isinstance(value[name], list | tuple) else [value[name]] for name in value
    ]
    try:
        return tuple(
            check_model(MotionModel(**dict(zip(value, values, strict=True))))
            for values in itertools.product(*lists)
        )
    except (TypeError, ValueError) as error:
        raise described_error(str(error)) from None


Worlds = Annotated[tuple[MotionModel, ...], PlainValidator(_worlds)]
"""Worlds of a table ``model`` (:func:`_worlds`)."""


class Move(FileData):
    """Displacements of one goal of a task. Each displacement defines a new task."""

    goal: _Number
    """Number of the goal, from 1."""
    by: Annotated[tuple[tuple[Finite, Finite], ...], _SOME]
    """Displacements (x, y) of the goal, in length units, one for each new task."""


class _Block(FileData):
    """A block of a suite: methods on tasks, with a grid of parameters."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True)

    called: Annotated[Line, Field(min_length=1)] | None = Field(None, alias="as")
    """Key ``as``: name of the runs of the block in rankings, figures and contrasts, such as
    ``CMA-ES, small population``. On each task, the block then has only one setting."""
    tasks: _Names
    """Names of tasks, paths of task files, or ranges of instances such as ``long/v1/i000..i039``.
    The entry ``"*"`` stands for all shipped tasks and all tasks that a command adds."""
    methods: _Names
    """Ids of methods, exploration conditions, or wildcards. The entry ``"*"`` stands for all
    methods. If an entry of ``tasks`` or ``methods`` has a ``*``, methods are left out on tasks to
    which they do not apply; otherwise each method must apply to each task."""
    move: Move | None = None
    """Table ``move``: displacements of a goal. Each task is replaced by tasks in which this goal is
    displaced."""
    free_base: Annotated[bool, Field(strict=True)] = False
    """True to free the base in x and y on all tasks of the block, whose base must be locked."""
    goals: tuple[_Number, ...] | None = None
    """Allowed numbers of goals. Tasks with another number of goals are left out. By default all
    numbers are allowed."""
    runs: RunCount | None = None
    """Number of runs of each stochastic method on each task; by default that of the suite."""
    parameters: dict[str, _Value] = Field(default_factory=dict)
    """Dict that maps parameters of the methods to their values."""
    grid: dict[str, Annotated[tuple[_Value, ...], _SOME]] = Field(default_factory=dict)
    """Grid: a dict that maps parameters of the methods to lists of values. Each combination of the
    values is run. The values in ``grid`` take the place of those in ``parameters``."""
    model: Worlds | None = None
    """Table ``model``: the worlds in which methods practise and are scored. The table maps the
    constants (:data:`.WORLD`) that differ from the paper's to a value, or to a list of values;
    there is a world for each combination of the values. By default it is the table of the suite."""


class Suite(FileData):
    """A suite, with the keys of a suite file as its fields."""

    name: Annotated[str, Field(pattern=NAME_PATTERN, max_length=MAX_NAME_LENGTH)]
    """Name of the suite; by default the name of its file without ``.toml``."""
    title: Line
    """Title of the suite in lists and reports."""
    description: Line
    """Sentence that describes the suite in lists and reports."""
    runs: RunCount
    """Number of runs of each stochastic method on each task. Other methods are run once."""
    trials: TrialCount | None = None
    """Number of trials of a run, for methods that have parameter ``trials``. By default it is the
    default of each method."""
    model: Worlds | None = None
    """Table ``model`` of all blocks that have no such table; by default the paper's world."""
    time_limit_s: Seconds | None = 600.0
    """Limit of the CPU time of a job (in s). A job consists of one run, or of several runs of a
    method that are performed side by side."""
    blocks: Annotated[tuple[_Block, ...], _SOME]
    """Tables ``[[blocks]]``, each with its tasks and methods."""
    contrasts: tuple[Contrast, ...] = ()
    """Tables ``[[contrasts]]``: questions that the suite asks about its methods."""


_TAKEN_BY = {
    "results folder": "coartic report {}",
    "suite": "coartic run {}",
    "task": "coartic run SUITE --tasks {}",
    "family": "coartic run SUITE --tasks {}/i000..i009",
    "method file": "coartic check METHOD --method-file {}",
    "shipped family": "coartic list {}",
}
"""Dict that maps each kind of name (:func:`kind_of`) to a command that accepts such a name. The
name takes the place of ``{}`` in the command."""


def kind_of(name: str) -> str:
    """Return what kind of thing a name that a user typed stands for.

    Parameters
    ----------
    name : str
        Name, or path of a file or folder.

    Returns
    -------
    str
        - ``suite`` for the name of a shipped suite;
        - ``shipped family`` for the name of a shipped family, with or without ``/v1``;
        - ``method file`` for a name that ends in ``.py``;
        - ``suite``, ``family`` or ``task`` for a TOML file, which is recognised by its keys;
        - ``results folder`` for a folder with results, a folder that cannot be opened, or the word
          ``shipped``;
        - an empty string for anything else, such as a TOML file that cannot be read.

    Examples
    --------
    >>> kind_of("comparison"), kind_of("two-armed"), kind_of("mine.py"), kind_of("EC4")
    ('suite', 'shipped family', 'method file', '')
    """
    if name in suites():
        return "suite"
    if {name, f"{name}/v1"} & {*shipped_families()}:
        return "shipped family"
    if name.endswith(".py"):
        return "method file"
    if name in SHIPPED_SUITES:
        return "results folder"
    if not name.endswith(".toml"):
        closed = os.path.isdir(name) and not os.access(name, os.X_OK)
        return "results folder" if closed or os.path.isfile(Path(name) / RUNS_FILE) else ""
    try:
        content = read_toml(Path(name))
    except CoarticError:
        return ""
    keys = {"blocks": "suite", "region": "family", "goals": "task"}  # a key that only this kind has
    return next((kind for key, kind in keys.items() if key in content), "")


def check_kind(name: str, *kinds: str) -> None:
    """Raise CoarticError if the kind of a name is not one of ``kinds``.

    :func:`kind_of` determines the kind. The error message says which command accepts the name. For
    a name of unknown kind nothing is raised.
    """
    kind = kind_of(name)
    if kind and kind not in kinds:
        raise CoarticError(f"{name} is a {kind}: use `{_TAKEN_BY[kind].format(quote(name))}`")


def suites() -> dict[str, Suite]:
    """Read the shipped suites, and return a dict that maps names to suites."""
    return {path.stem: _read_suite(path) for path in sorted(SUITE_FOLDER.glob("*.toml"))}


def load_suite(name: str) -> Suite:
    """Return a shipped suite by its name, or the suite of a suite file.

    Parameters
    ----------
    name : str
        Name of a shipped suite, or path of a suite file, which ends in ``.toml``.

    Returns
    -------
    Suite

    Raises
    ------
    CoarticError
        The name is unknown, or stands for something other than a suite; or the file cannot be read
        or is not a valid suite.
    """
    shipped = suites()
    if name not in shipped:
        check_kind(name, "suite")
        if name.endswith(".toml"):
            return _read_suite(Path(name))
        hint = " A suite of your own is a file that ends in .toml." if os.sep in name else ""
        raise CoarticError(f"{unknown('suite', name, shipped)}{hint}")
    return shipped[name]


def _read_suite(path: Path) -> Suite:
    """Read a suite from its file.

    Raises CoarticError if the file cannot be read or is not a valid suite.
    """
    content = read_toml(path)
    try:
        return Suite.model_validate({"name": path.stem, **content})
    except ValidationError as error:
        kinds = (Suite, _Block, Move, Contrast, Term)
        keys = [field.alias or key for kind in kinds for key, field in kind.model_fields.items()]
        raise CoarticError(f"{plain(str(path))}: {explain(error, keys)}") from None


@contextmanager
def errors_of_block(suite: Suite, number: int) -> Iterator[None]:
    """Add a suite's name and a block's number to errors of a ``with`` block.

    The message of each CoarticError begins with the name of the suite and the number of the block,
    ``number``, from 1.
    """
    try:
        yield
    except CoarticError as error:
        raise CoarticError(f"suite {suite.name!r}, block {number}: {error}") from None


def tasks_of(block: _Block, own: Collection[str], task_named: TaskNamed) -> Iterator[Task]:
    """Yield the tasks of a block of a suite, changed as the block asks.

    A block can ask for tasks with a free base (``free_base``) and for tasks with a displaced goal
    (``move``).

    Parameters
    ----------
    block : _Block
    own : collection of str
        Names of further tasks, which belong to a block with the entry ``*`` in ``tasks``.
    task_named : callable
        Function that returns the task with a given name or file.

    Yields
    ------
    Task
        The tasks, in the order of the block. A name that occurs twice counts once. Tasks with a
        number of goals that the block does not allow (``goals``) are left out.

    Raises
    ------
    CoarticError
        A task cannot be loaded, or cannot be changed as the block asks.
    """
    all_tasks = [*builtin_tasks(), *own]
    names = (all_tasks if entry == WILDCARD else named_by(entry) for entry in block.tasks)
    for name in dict.fromkeys(itertools.chain(*names)):
        if name.endswith(".toml") and not os.path.exists(name):
            raise CoarticError(f"file {name} does not exist; paths start from the current folder")
        task = task_named(name)
        if block.goals is None or len(task.goals) in block.goals:
            yield from _changed_tasks(task, block)


def _changed_tasks(task: Task, block: _Block) -> list[Task]:
    """Return the tasks that a block of a suite makes of a task.

    - If the block has ``free_base``, the base is freed. Raises CoarticError if it is free already.
    - If the block has ``move``, the list contains a task for each displacement of the goal that
      ``move`` names. Raises CoarticError if the task does not have this goal, or if the displaced
      goal is out of reach.
    - A block can have both. If it has neither, the list contains only the task itself.
    """

    def changed(name: str, difference: str, **changes: Any) -> Task:
        named = {"name": f"{task.name}.{name}", "description": f"{task.name} with {difference}"}
        return parse_task(task.model_dump(mode="json") | named | changes, named["name"])

    if block.free_base:
        if not task.locked_base:
            raise CoarticError(f"free_base has no effect on task {task.name!r}, whose base is free")
        provenance = {
            "status": "chosen",
            "source": f"not that of {task.name}, to see what its lock does",
        }
        task = changed(
            "free-base",
            "a base that moves in both directions",
            title=f"{task.title}, base free",
            locked_base=[],
            provenance=task.provenance | {"locked_base": provenance},
        )
    if block.move is None:
        return [task]
    number = block.move.goal
    if number > len(task.goals):
        raise CoarticError(
            f"move asks for goal {number}, and task {task.name!r} has {len(task.goals)} goals"
        )
    moved = []
    for x, y in block.move.by:
        # Names have six digits of a number if these are exact, and otherwise all digits.
        dx, dy = (f"{d:g}" if float(f"{d:g}") == d else repr(d) for d in (x, y))
        goals = [list(goal) for goal in task.goals]
        goals[number - 1] = [goals[number - 1][0] + x, goals[number - 1][1] + y]
        name, difference = f"goal{number}_{dx}_{dy}", f"goal {number} moved by ({dx}, {dy})"
        moved.append(changed(name, difference, goals=goals))
    return moved
