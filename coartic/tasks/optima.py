"""The best known rewards that come with the package, and what is proven about them.

``optima.json`` has the best reward that any method found for each of the paper's tasks, with run
ids and solutions. ``best_known.csv`` has the best reward for test instances of families, and
``best_in_noise.csv`` the fewest mean ticks in a world with motor noise. The study
``studies/optima`` copies better rewards from results folders, and proves the bounds.
"""

from __future__ import annotations

import csv
import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from coartic.model import PAPER, MotionModel, same_world
from coartic.tasks.task import Task

BASE = "task"
"""Value of ``base`` (:func:`entries`) in the entry of a task whose base is locked as in the task
itself. Rewards are compared with this entry."""
DATA = Path(__file__).with_name("optima.json")
"""Entries of the paper's tasks (:func:`entries`)."""
BEST_KNOWN = Path(__file__).with_name("best_known.csv")
"""Columns ``instance``, ``reward``, ``bound`` (empty if nothing is proven), ``nodes`` (of the
search that proved the bound), ``hands`` and ``essence`` (:func:`task_hash`)."""
BEST_IN_NOISE = Path(__file__).with_name("best_in_noise.csv")
"""Columns ``task``, ``motor_noise`` (length units of the base, rad), ``mean_ticks`` over 1,000
executions, its ``standard_error``, ``hands``, the ``method`` of the solution and ``essence``."""

HASHED_FIELDS = ("start", "radius", "hands", "locked_base", "robot")
"""Fields that, with the goals, define a task."""


@dataclass(frozen=True)
class KnownOptimum:
    """The best known reward of a task in a world, with both arms free."""

    reward: int | float
    """Total reward: minus the ticks, an integer; in a world with motor noise minus the mean ticks
    of 1,000 executions."""
    bound: int | None
    """Reward that no solution exceeds; None if nothing is proven."""
    hands: str = ""
    """Hand sequence of a solution with this reward."""

    @property
    def proven(self) -> bool:
        """True if it is proven that no solution has a better reward."""
        return self.bound == self.reward


def task_hash(task: Task) -> str:
    """Return a hash of what defines a task: 16 hex digits.

    The hash depends on start, goals, radius, hands, locked base and robot. It does not depend on
    the task's name and initial hands.
    """
    content = task.model_dump(mode="json")
    text = json.dumps({key: content[key] for key in ("goals", *HASHED_FIELDS)}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def best_shipped(task: Task, model: MotionModel = PAPER) -> KnownOptimum | None:
    """Return the best known reward of a task in a world, and its bound, from the shipped files.

    The task is recognised by :func:`task_hash`, whatever its name. Return None if the files do not
    have the task in this world. They have the paper's world, and the paper's world with motor noise
    0.01. Of a shipped family they have only the first 40 instances of the test split, and with
    motor noise only those of families with up to eight goals.
    """
    if not same_world(model.without_noise(), PAPER, task.radius):
        return None
    return _by_task_hash().get((task_hash(task), model.motor_noise))


@cache
def _by_task_hash() -> dict[tuple[str, float], KnownOptimum]:
    with BEST_KNOWN.open(encoding="ascii", newline="") as lines:
        optima = {
            (row["essence"], 0.0): KnownOptimum(
                int(row["reward"]), int(row["bound"]) if row["bound"] else None, row["hands"]
            )
            for row in csv.DictReader(lines)
        }
    for entry in entries():
        if (entry["base"], entry["other_arm"]) == (BASE, "free") and "reward" in entry:
            best = KnownOptimum(entry["reward"], entry["bound"], entry["hands"])
            optima[entry["essence"], 0.0] = best
    with BEST_IN_NOISE.open(encoding="ascii", newline="") as lines:
        for row in csv.DictReader(lines):
            best = KnownOptimum(-float(row["mean_ticks"]), None, row["hands"])
            optima[row["essence"], float(row["motor_noise"])] = best
    return optima


def entries() -> list[dict[str, Any]]:
    """Read ``optima.json``, and return a new list of its entries.

    There is an entry for each task of the paper and each restriction of base and other arm. (A task
    that locks y itself has no entry for ``y``.) An entry is a dictionary with the keys

    - ``task``: name of the task;
    - ``essence``: :func:`task_hash`, without the restriction;
    - ``base``: coordinates that are locked, ``y`` or ``xy``, or ``task`` for those that the task
      locks;
    - ``other_arm``: whether the idle arm is ``free`` or ``still``;
    - ``run_ids``: ids of the runs;
    - ``made_by``: versions and the date.

    If a solution is known, there are also

    - ``reward`` and ``hands``: of the best solution;
    - ``bound``: reward that no solution exceeds;
    - ``searches``: best reward of each search, by its id at the time;
    - ``solution``: a list ``[goal, hand, kind, target, waypoints]`` for each movement;
    - ``nodes``, in one entry: number of nodes of the search that proved the bound.

    Otherwise the entry has the key ``infeasible``, the reason why no search has a solution.
    """
    content: dict[str, list[dict[str, Any]]] = json.loads(DATA.read_text(encoding="utf-8"))
    return content["optima"]
