"""The best rewards known, as they are shipped, with what is proven about them.

``optima.json`` holds what suite ``optimum`` found for the shipped tasks, with run ids and
solutions; ``docs/scripts/renew_optima.py`` makes it from the results folder of that suite.
``best_known.csv`` holds the best reward that any method found for test instances of families;
``docs/scripts/renew_best_known.py`` makes it from results folders.
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from coartic.inputs import FileData
from coartic.tasks.task import Task

BASE = "task"
"""Base locked as the task has it: the case that rewards compare with."""
DATA = Path(__file__).with_name("optima.json")
BEST_KNOWN = Path(__file__).with_name("best_known.csv")
"""Columns ``instance``, ``reward``, ``bound`` (empty where nothing is proven), ``hands`` and
``essence``."""

OtherArm = Literal["free", "still"]
"""Whether the arm that is not chosen may move, or is kept still."""
KEPT = ("start", "radius", "hands", "locked_base", "robot")
"""What makes a task beside its goals."""


@dataclass(frozen=True)
class KnownOptimum:
    """The best reward known of a task, with all joints free and under the paper's model."""

    reward: int
    bound: int | None
    """Reward that no solution exceeds; None where nothing is proven."""
    hands: str = ""
    """Hand sequence of a solution that has the reward."""

    @property
    def proven(self) -> bool:
        """Whether no solution can be better."""
        return self.bound == self.reward


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


def best_shipped(task: Task) -> KnownOptimum | None:
    """The best reward that is shipped of a task, however it is called.

    None where none is: for a task of one's own, and for instances beyond the first of each family.
    """
    return _by_essence().get(essence(task))


@cache
def _by_essence() -> dict[str, KnownOptimum]:
    with BEST_KNOWN.open(encoding="ascii", newline="") as lines:
        known = {
            row["essence"]: KnownOptimum(
                int(row["reward"]), int(row["bound"]) if row["bound"] else None, row["hands"]
            )
            for row in csv.DictReader(lines)
        }
    for entry in entries():
        if (entry.base, entry.other_arm) == (BASE, "free") and entry.reward is not None:
            known[entry.essence] = KnownOptimum(entry.reward, entry.bound, entry.hands)
    return known


def entries() -> list[ShippedOptimum]:
    """The shipped data, one entry per task and restriction."""
    content = json.loads(DATA.read_text(encoding="utf-8"))
    return [ShippedOptimum.model_validate(entry) for entry in content["optima"]]
