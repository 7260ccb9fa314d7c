"""Reconstructions of the tasks whose goals the paper does not print, as an ensemble.

``members/TASK.csv`` has a row a member: its goals, and its figures beside the printed ones
(made by ``coartic paper goals``; docs/reconstruction.md). A member is a task by the name
``TASK-MEMBER``, such as ``two-armed-1-m017``; m001 is the one that the search chose, and the
task itself; v0.1 is what the task was in the first release, and not admitted.
"""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

from coartic.tasks.task import Task, shipped_tasks

MEMBERS_FOLDER = Path(__file__).parent / "members"


def members_file(task: str) -> Path:
    """Where the members of a task are."""
    return MEMBERS_FOLDER / f"{task}.csv"


def with_members() -> tuple[str, ...]:
    """Names of the tasks that have any."""
    return tuple(sorted(path.stem for path in MEMBERS_FOLDER.glob("*.csv")))


@cache
def members(task: str) -> dict[str, Task]:
    """The members of a task by their names as tasks, in order; none where it has none."""
    path = members_file(task)
    if not path.exists():
        return {}
    plain = shipped_tasks()[task]
    with path.open(encoding="utf-8", newline="") as file:
        found = (_member(plain, row) for row in csv.DictReader(file))
        return {member.name: member for member in found}


def _member(task: Task, row: dict[str, str]) -> Task:
    goals = tuple(
        (float(row[f"x{number}"]), float(row[f"y{number}"]))
        for number in range(1, len(task.goals) + 1)
    )
    name = row["member"]
    changed = {
        "name": f"{task.name}-{name}",
        "title": f"{task.title}, {name}",
        "description": f"{task.title} with the goals of reconstruction {name}.",
        "goals": goals,
    }
    return task.model_copy(update=changed)


def task_of(name: str) -> str | None:
    """The task that a member is of, by the member's name; None for what is no member."""
    for task in with_members():
        if name in members(task):
            return task
    return None
