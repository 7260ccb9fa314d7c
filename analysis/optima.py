"""The optimum of each task: the best known reward and the proven bound."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic import Task
from coartic.analysis.solutions import initial_solution
from coartic.robot import Array
from coartic.runs.plan import SEARCH
from coartic.tasks.optima import BASE, KnownOptimum, best_shipped


def known_optima(runs: pd.DataFrame, tasks: Mapping[str, Task]) -> dict[str, KnownOptimum]:
    """Best known reward with all joints free by task, for the tasks of a folder.

    What the shipped data say where the task is the same in all that matters, bettered by
    what the folder's own searches found. Searches of an instance of a family are short, and any
    run of the folder may better them. A reward of 0, which leaves no gap, does not count.
    """
    optima: dict[str, KnownOptimum] = {}
    solved = runs[runs.status == "ok"]
    asked = restrictions(solved)
    solved = solved[asked.base == BASE]
    searches = solved[solved.method.str.startswith(SEARCH)]
    searches = searches[asked.other_arm[searches.index] == "free"]
    for name, task in tasks.items():
        of_task = searches[searches.task == name]
        candidates = [from_runs(of_task)] if len(of_task) else []
        if (entry := best_shipped(task)) is not None:
            candidates.append(entry)
        of_task = solved[solved.task == name]
        if task.family is not None and len(of_task):
            candidates.append(KnownOptimum(int(of_task.reward.max()), None))
        reward = max((each.reward for each in candidates), default=0)
        if reward < 0:
            bounds = [each.bound for each in candidates if each.bound is not None]
            optima[name] = KnownOptimum(reward, min(bounds, default=None))
    return optima


def locks_base(runs: pd.DataFrame) -> bool:
    """Whether a parameter of these runs locks the base: another problem, another optimum."""
    return any(json.loads(text).get("base", BASE) != BASE for text in runs.parameters.unique())


def restrictions(runs: pd.DataFrame) -> pd.DataFrame:
    """Lock of the base and other arm of each run, by its parameters."""
    default = {"base": BASE, "other_arm": "free"}
    asked = {text: default | json.loads(text) for text in runs.parameters.unique()}
    return pd.DataFrame(
        {name: [asked[text][name] for text in runs.parameters] for name in default}, runs.index
    )


def gap_share(rewards: ArrayLike, optimum: ArrayLike) -> Array:
    """(optimum − reward) / |optimum|: 0 at the optimum; 0.01 is 1 % more ticks than it."""
    return np.asarray(np.subtract(optimum, rewards, dtype=np.float64) / np.abs(optimum))


def initial_reward(task: Task) -> float:
    """Reward of the initial solution; NaN where there is none."""
    solution = initial_solution(task)
    return math.nan if solution is None else float(-solution.ticks)


def from_runs(runs: pd.DataFrame) -> KnownOptimum:
    """The best of these solved runs, with the lowest bound that they prove."""
    bounds = runs.proven_bound.dropna()
    return KnownOptimum(int(runs.reward.max()), int(bounds.min()) if len(bounds) else None)
