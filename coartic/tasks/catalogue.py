"""Tasks by name: shipped tasks, instances of families, and task files."""

from __future__ import annotations

from pathlib import Path

from coartic.errors import TaskError
from coartic.internal.limits import brief_value
from coartic.internal.text import foreign_file, unknown
from coartic.tasks.families import instance, is_family, shipped_families
from coartic.tasks.task import Task, read_task, shipped_tasks

TaskLike = Task | str | Path
"""A task, its name, or the path of its file."""


def builtin_tasks() -> tuple[str, ...]:
    """List the tasks that come with the package.

    Returns
    -------
    tuple of str
        Names of the tasks, in the paper's order. :func:`load_task` accepts each of them.
    """
    return tuple(shipped_tasks())


def load_task(name_or_path: str | Path) -> Task:
    """Load a task by its name, or from a file.

    Parameters
    ----------
    name_or_path : str or pathlib.Path
        One of

        - the name of a task that comes with the package, such as ``"ascending"``;
        - the name of an instance of a family, such as ``"two-armed/v1/i017"``, or
          ``"mine.v1.toml/i017"`` for the family of a file;
        - the path of a task file; a string that ends in ``.toml`` is a path.

    Returns
    -------
    Task
        The task, checked.

    Raises
    ------
    TaskError
        The task does not exist, its family or file cannot be used, or the file is the file of a
        family.
    TypeError
        The argument is neither a string nor a path.
    """
    if not isinstance(name_or_path, str | Path):
        raise TypeError(
            f"task is {brief_value(name_or_path)}; it must be a task, the name of one, such as "
            "'ascending', or the path of a task file"
        )
    if problem := foreign_file(str(name_or_path)):
        raise TaskError(problem)
    if isinstance(name_or_path, Path) or name_or_path.endswith(".toml"):
        if is_family(str(name_or_path)):
            raise TaskError(
                f"{name_or_path} is a family: name an instance, such as {name_or_path}/i000"
            )
        task = read_task(Path(name_or_path))
        is_own = task.family not in (None, *shipped_families())
        if "/" in task.name and not is_own and task != instance(task.name):
            raise TaskError(
                f"{name_or_path}: the task is called {task.name!r}, but it differs from the "
                "instance with this name. Give it another name, or write the instance again: "
                f"`coartic draw {task.name} --out FOLDER`"
            )
        return task
    if name_or_path in shipped_tasks():
        return shipped_tasks()[name_or_path]
    if "/" in name_or_path:
        return instance(name_or_path)
    raise TaskError(
        f"{unknown('task', name_or_path, builtin_tasks())} "
        "A task file's name ends in .toml; an instance is written FAMILY/v1/i017."
    )


def as_task(task: TaskLike) -> Task:
    """Return a task itself, or load it by its name or from its file (:func:`load_task`).

    Raises TaskError if the task cannot be loaded, and TypeError for another type.
    """
    return task if isinstance(task, Task) else load_task(task)
