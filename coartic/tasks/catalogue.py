"""Tasks by name: shipped ones, members of an ensemble, instances of a family, files."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

from coartic.errors import TaskError
from coartic.inputs import brief_value
from coartic.tasks.families import check_instance, instance
from coartic.tasks.task import Task, read_task, shipped_tasks
from coartic.text import unknown


def builtin_tasks() -> tuple[str, ...]:
    """The tasks that come with the package.

    Returns
    -------
    tuple of str
        Their names, in the paper's order. :func:`load_task` takes each of them.
    """
    return tuple(shipped_tasks())


def load_task(name_or_path: str | Path) -> Task:
    """Load a task by its name, or from a file.

    Parameters
    ----------
    name_or_path : str or pathlib.Path
        The name of a task that comes with the package (``"ascending"``), of a member of its
        ensemble (``"two-armed-1-m017"``) or of an instance of a family (``"two-armed/v1/i017"``),
        or the path of a task file. A text that ends in ``.toml`` is a path.

    Returns
    -------
    Task
        The task, checked.

    Raises
    ------
    TaskError
        There is no such task, or the file cannot be used. The message names the file and the key.
    TypeError
        The argument is neither a text nor a path.
    """
    if not isinstance(name_or_path, str | Path):
        raise TypeError(
            f"task is {brief_value(name_or_path)}; it must be the name of a task, such as "
            "'ascending', or the path of a task file"
        )
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


MEMBERS_FOLDER = Path(__file__).parent / "members"


def with_members() -> tuple[str, ...]:
    """Names of the tasks that have any."""
    return tuple(sorted(path.stem for path in MEMBERS_FOLDER.glob("*.csv")))


@cache
def members(task: str) -> dict[str, Task]:
    """The members of a task by their names as tasks, in order; none where it has none.

    ``members/TASK.csv`` has a row a member: its goals, and its figures beside the printed ones
    (made by ``docs/scripts/reconstruct.py``; docs/reconstruction.md). A member is a task by the
    name ``TASK-MEMBER``, such as ``two-armed-1-m017``; m001 has the goals of the task itself.
    Members with other names come from earlier searches.
    """
    if task not in with_members():
        return {}
    plain, tasks = shipped_tasks()[task], {}
    with (MEMBERS_FOLDER / f"{task}.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            name = f"{task}-{row['member']}"
            title = f"{plain.title}, {row['member']}"
            description = f"{plain.title} with the goals of reconstruction {row['member']}."
            numbers = range(1, len(plain.goals) + 1)
            goals = tuple((float(row[f"x{n}"]), float(row[f"y{n}"])) for n in numbers)
            changed = {"name": name, "title": title, "description": description, "goals": goals}
            tasks[name] = plain.model_copy(update=changed)
    return tasks


def task_of(name: str) -> str | None:
    """The task that a member is of, by the member's name; None for what is no member."""
    return next((task for task in with_members() if name in members(task)), None)


def is_admitted(member: str) -> bool:
    """Whether a member's goals give everything that is printed of the corrective process alone.

    Only v0.1 is not admitted, which has the goals of the first release.
    """
    return not member.endswith("-v0.1")
