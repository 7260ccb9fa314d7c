"""Reconstructions of the tasks whose goals the paper does not print, as an ensemble.

``members/TASK.csv`` has a row a member: its goals, and its figures beside the printed ones
(made by ``coartic paper goals``; docs/reconstruction.md). A member is a task by the name
``TASK-MEMBER``, such as ``two-armed-1-m017``; m001 has the goals of the task itself. Members with
other names come from earlier searches. v0.1 is what the task was in the first release, and is not
admitted.
"""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

from coartic.tasks.task import Task, shipped_tasks

MEMBERS_FOLDER = Path(__file__).parent / "members"


def with_members() -> tuple[str, ...]:
    """Names of the tasks that have any."""
    return tuple(sorted(path.stem for path in MEMBERS_FOLDER.glob("*.csv")))


@cache
def members(task: str) -> dict[str, Task]:
    """The members of a task by their names as tasks, in order; none where it has none."""
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
