"""The best rewards known, as they are shipped, with what is proven about them.

``optima.json`` has the best reward that any method found for the paper's tasks, with run ids and
solutions, ``best_known.csv`` the best reward for test instances of families. ``studies/optima``
takes over better rewards from results folders, and proves the bounds.
"""

from __future__ import annotations

import csv
import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from coartic.tasks.task import Task

BASE = "task"
"""Base locked as the task has it: the case that rewards compare with."""
DATA = Path(__file__).with_name("optima.json")
"""Entries of the paper's tasks (:func:`entries`)."""
BEST_KNOWN = Path(__file__).with_name("best_known.csv")
"""Columns ``instance``, ``reward``, ``bound`` (empty where nothing is proven), ``nodes`` (of the
search that proved the bound), ``hands`` and ``essence``."""

KEPT = ("start", "radius", "hands", "locked_base", "robot")
"""Fields that, with the goals, define a task."""


@dataclass(frozen=True)
class KnownOptimum:
    """The best reward known of a task, with both arms free and under the paper's model."""

    reward: int
    """Total reward, minus the ticks."""
    bound: int | None
    """Reward that no solution exceeds; None where nothing is proven."""
    hands: str = ""
    """Hand sequence of a solution that has the reward."""

    @property
    def proven(self) -> bool:
        """True if it is proven that no solution can have a better reward."""
        return self.bound == self.reward


def essence(task: Task) -> str:
    """Return a hash, 16 hex digits, of what defines a task: start, goals, radius, hands, locked
    base, robot; not its name and initial hands."""
    content = task.model_dump(mode="json")
    text = json.dumps({key: content[key] for key in ("goals", *KEPT)}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def best_shipped(task: Task) -> KnownOptimum | None:
    """Return the best reward known of a task, and its bound, from the shipped files; the task is
    recognised by :func:`essence`, whatever its name. Return None for a task that is not there, such
    as instances of a shipped family except the first 40 of its test split."""
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
        if (entry["base"], entry["other_arm"]) == (BASE, "free") and "reward" in entry:
            best = KnownOptimum(entry["reward"], entry["bound"], entry["hands"])
            known[entry["essence"]] = best
    return known


def entries() -> list[dict[str, Any]]:
    """Read ``optima.json``; return a new list with a dictionary for each task of the paper and each
    restriction (base and other arm); a task that locks y itself has none for ``y``.

    Keys: ``task``, ``essence`` (:func:`essence`, without the restriction), ``base`` (coordinates
    that are locked: ``y``, ``xy``, or ``task``, as the task locks them), ``other_arm`` (the idle
    arm: ``free`` or ``still``), ``run_ids`` and ``made_by`` (versions, and the date); then
    ``reward``, ``hands``, ``bound`` (reward that no solution exceeds), ``searches`` (best reward of
    each search, by its id at the time), ``solution`` (a list ``[goal, hand, kind, target,
    waypoints]`` for each movement) and, in one entry, ``nodes`` (number of nodes of the search that
    proved the bound); or instead ``infeasible``, the reason why no search has a solution.
    """
    content: dict[str, list[dict[str, Any]]] = json.loads(DATA.read_text(encoding="utf-8"))
    return content["optima"]
