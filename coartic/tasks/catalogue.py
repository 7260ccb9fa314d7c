"""Tasks by name: shipped ones, members of an ensemble, instances of a family, files."""

from __future__ import annotations

from pathlib import Path

from coartic.errors import TaskError
from coartic.tasks.families import check_instance, instance
from coartic.tasks.members import members, task_of
from coartic.tasks.task import Task, read_task, shipped_tasks
from coartic.text import unknown


def builtin_tasks() -> tuple[str, ...]:
    """Names of the tasks that come with the package, in the paper's order."""
    return tuple(shipped_tasks())


def load_task(name_or_path: str | Path) -> Task:
    """A shipped task, a member or an instance by name, or a task file by path.

    Raises TaskError, naming the file and the key, where it cannot be used.
    """
    if isinstance(name_or_path, Path) or name_or_path.endswith(".toml"):
        task = read_task(Path(name_or_path))
        if "/" in task.name:
            check_instance(task, str(name_or_path))
        return task
    if name_or_path in shipped_tasks():
        return shipped_tasks()[name_or_path]
    if "/" in name_or_path:
        return instance(name_or_path)
    reconstructed = task_of(name_or_path)
    if reconstructed is not None:
        return members(reconstructed)[name_or_path]
    raise TaskError(
        f"{unknown('task', name_or_path, builtin_tasks())} "
        "A task file's name ends in .toml; an instance is written FAMILY/v1/i017."
    )
