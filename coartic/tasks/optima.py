"""The optima that are shipped: ``optima.json`` holds what suite ``optimum`` found for the shipped
tasks, with the run ids and the solutions.

``docs/scripts/renew_optima.py`` makes it from the results folder of that suite.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal

from coartic.inputs import FileData
from coartic.tasks.task import Task

BASE = "task"
"""Base locked as the task has it: the case that rewards compare with."""
DATA = Path(__file__).with_name("optima.json")

OtherArm = Literal["free", "still"]
"""Whether the arm that is not chosen may move, or is kept still."""
KEPT = ("start", "radius", "hands", "locked_base", "robot")
"""What makes a task beside its goals."""


class ShippedOptimum(FileData):
    """What is shipped of one task under one restriction: a reward, or why there is none."""

    task: str
    essence: str
    """The task's :func:`essence`."""
    base: str
    """Directions in which the base is locked; ``task``: as the task locks it."""
    other_arm: OtherArm
    run_ids: tuple[str, ...]
    made_by: dict[str, Any]
    reward: int | None = None
    hands: str = ""
    bound: int | None = None
    """Reward that no solution exceeds; None where nothing is proven."""
    searches: Mapping[str, int] = {}
    """Reward that each search found, by method."""
    solution: tuple[dict[str, Any], ...] = ()
    """Movements as :func:`coartic.runs.run.movements_from` reads them, in full precision."""
    infeasible: str = ""
    """Why no search has a solution."""

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is about: task, lock of the base, other arm."""
        return self.task, self.base, self.other_arm


def essence(task: Task) -> str:
    """Hash of what makes a task: start, goals, radius, hands, locks, robot."""
    content = task.model_dump(mode="json")
    text = json.dumps({key: content[key] for key in ("goals", *KEPT)}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def best_shipped(task: Task) -> ShippedOptimum | None:
    """What is shipped of a task under its own restrictions, with all joints free and under the
    paper's model; None where nothing is, as for instances of families."""
    return _by_essence().get(essence(task))


@cache
def _by_essence() -> dict[str, ShippedOptimum]:
    free = [entry for entry in entries() if (entry.base, entry.other_arm) == (BASE, "free")]
    return {entry.essence: entry for entry in free}


def entries() -> list[ShippedOptimum]:
    """The shipped data, one entry per task and restriction."""
    content = json.loads(DATA.read_text(encoding="utf-8"))
    return [ShippedOptimum.model_validate(entry) for entry in content["optima"]]
