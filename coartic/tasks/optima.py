"""The best known rewards that come with the package, and proven bounds on rewards.

- ``optima.json`` contains the best known rewards of the paper's tasks, also with further locks of
  the base or a still idle arm, with run ids and solutions.
- ``best_known.csv`` contains the best known rewards of test instances of families.
- ``best_in_noise.csv`` contains the fewest mean ticks known, with motor noise 0.01, for the paper's
  tasks and for test instances of families.

The study ``studies/optima`` copies better rewards from results folders, and proves the bounds.
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
"""Value of the key ``base`` in entries without additional locks of the base (:func:`entries`).
:func:`best_shipped` uses only such entries."""
DATA = Path(__file__).with_name("optima.json")
"""Entries of the paper's tasks (:func:`entries`)."""
BEST_KNOWN = Path(__file__).with_name("best_known.csv")
"""Columns ``instance``, ``reward``, ``bound`` (empty if nothing is proven), ``nodes`` (of the
search that proved the bound), ``hands`` and ``essence`` (:func:`task_hash`)."""
BEST_IN_NOISE = Path(__file__).with_name("best_in_noise.csv")
"""Columns ``task``, ``motor_noise`` (in length units and rad), ``mean_ticks`` (mean over 1,000
executions), ``standard_error`` of the mean, ``hands``, ``method`` (id of the method that found the
solution) and ``essence`` (:func:`task_hash`)."""

HASHED_FIELDS = ("start", "radius", "hands", "locked_base", "robot")
"""Fields of a task on which :func:`task_hash` depends, in addition to the goals."""


@dataclass(frozen=True)
class KnownOptimum:
    """The best known reward of a task under a motion model, and its proven bound."""

    reward: int | float
    """Total reward of the best known solution: minus its ticks, an integer. With motor noise it is
    minus the mean ticks of 1,000 executions, a float. Both arms may move."""
    bound: int | None
    """Reward that no solution exceeds; None if nothing is proven."""
    hands: str = ""
    """Hand sequence of a solution with this reward."""

    @property
    def proven(self) -> bool:
        """True if the reward equals its proven bound, so that no solution is better."""
        return self.bound == self.reward


def task_hash(task: Task) -> str:
    """Return a hash of the fields that define a task: 16 hex digits.

    The hash depends on start, goals, radius, hands, locked base and robot. It does not depend on
    other fields, such as the name and the initial hands.
    """
    content = task.model_dump(mode="json")
    text = json.dumps({key: content[key] for key in ("goals", *HASHED_FIELDS)}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def best_shipped(task: Task, model: MotionModel = PAPER) -> KnownOptimum | None:
    """Look up the best known reward of a task under a motion model.

    Tasks with equal :func:`task_hash` have the same best known reward, whatever their names. The
    shipped files contain best known rewards for

    - the paper's model, and the paper's model with motor noise 0.01, but no other models;
    - the paper's tasks, and the first 40 test instances of each shipped family (with motor noise
      only of families with up to eight goals).

    The result is None for any other task or model.
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

    There is an entry for each combination of a task of the paper, a restriction of the base, and a
    restriction of the idle arm. (For a task that locks y itself, there is no entry for ``y``.) An
    entry is a dict with the keys

    - ``task``: name of the task;
    - ``essence``: :func:`task_hash` of the task without the restriction;
    - ``base``: base coordinates that are locked, ``y`` or ``xy``; the value ``task`` stands for
      the coordinates that the task itself locks;
    - ``other_arm``: ``free`` if the idle arm may move, ``still`` if it may not;
    - ``run_ids``: list of the ids of the runs of the searches;
    - ``made_by``: dict with the versions of coartic and Python, the commit, a hash of the code, and
      the date of the runs.

    If a solution is known, there are also

    - ``reward`` and ``hands``: reward and hand sequence of the best solution;
    - ``bound``: reward that no solution exceeds;
    - ``searches``: dict that maps the id that each search had at the time to its best reward;
    - ``solution``: a list ``[goal, hand, kind, target, waypoints]`` for each movement;
    - ``nodes``, only in one entry: number of nodes of the search that proved the bound.

    Otherwise the entry has the key ``infeasible``: the reason why no search found a solution.
    """
    content: dict[str, list[dict[str, Any]]] = json.loads(DATA.read_text(encoding="utf-8"))
    return content["optima"]
