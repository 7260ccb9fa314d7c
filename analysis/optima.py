"""Find the best known rewards of tasks, from which gaps are measured, and proven bounds."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic import Task
from coartic.analysis.methods import SEARCHES
from coartic.robot import Array
from coartic.runs.plan import label_of
from coartic.tasks.optima import BASE, KnownOptimum, best_shipped


@dataclass(frozen=True)
class BestKnown(KnownOptimum):
    """The best known reward of a task, and its source."""

    source: str = "shipped"
    """Where the reward comes from:

    - ``shipped``;
    - the label of a method, if its best run has a higher reward than the shipped one;
    - ``corrective process alone``, if the reward of this process is higher than both.
    """
    run_id: str = ""
    """Id of the best run; empty if the source is not a run."""
    only_here: bool = False
    """True if no reward is shipped, and no search for the optimum (with the task's own base) has a
    solution."""


def best_known(runs: pd.DataFrame, tasks: Iterable[Task]) -> dict[str, BestKnown]:
    """Return the best known reward of each task, from shipped rewards and runs.

    All solved runs count, including searches and runs copied from other folders. Runs with another
    base do not count, because they solve another task. A task is left out if

    - its best reward is 0, because a gap could not be computed;
    - no reward is known;
    - only runs of one method with one setting are known, and this method is not a search. These
      runs would be compared with themselves.

    Parameters
    ----------
    runs : DataFrame
        Stored runs of the plan, with ``task``, ``method``, ``setting``, ``run_id``, ``status``,
        ``parameters``, ``reward`` (negative ticks), ``hands``.
    tasks : iterable of Task

    Returns
    -------
    dict
        Best known rewards by the name of the task.
    """
    solved = runs[(runs.status == "ok") & (restrictions(runs).base == BASE)]
    is_search = solved.method.isin(SEARCHES)
    solved = pd.concat([solved[is_search], solved[~is_search]])  # in a tie, a search comes first
    by_task, rewards = dict([*solved.groupby("task")]), {}
    for task in tasks:
        here, shipped = by_task.get(task.name, solved[:0]), best_shipped(task)
        searches = here[is_search[here.index]]
        labels = {*map(label_of, here.method, here.setting)}
        if shipped is None and not len(searches) and len(labels) < 2:
            continue
        bound = None if shipped is None else shipped.bound
        if shipped is not None and not (here.reward > shipped.reward).any():
            best = BestKnown(shipped.reward, bound, shipped.hands)
        else:
            run = here.iloc[int(here.reward.astype(int).to_numpy().argmax())]
            only_here = shipped is None and not len(searches)
            source = label_of(run.method, run.setting), str(run.run_id)
            best = BestKnown(int(run.reward), bound, str(run.hands), *source, only_here)
        if best.reward < 0:
            rewards[task.name] = best
    return rewards


def restrictions(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the parameters with which searches for the optimum restrict movements, for each run.

    The columns are ``base`` and ``other_arm``; the index is that of ``runs``. For methods that are
    not searches, the values are ``task`` and ``free``, even if they have parameters of these names.
    """
    default = {"base": BASE, "other_arm": "free"}
    pairs = [*zip(runs.method, runs.parameters, strict=True)]
    asked = {
        (method, text): default | (json.loads(text) if method in SEARCHES else {})
        for method, text in {*pairs}
    }
    return pd.DataFrame(
        {name: [asked[pair][name] for pair in pairs] for name in default}, runs.index
    )


def gap_share(rewards: ArrayLike, optimum: ArrayLike) -> Array:
    """Return (optimum − reward) / |optimum|, which is 0.01 for 1 % more ticks."""
    return np.asarray(np.subtract(optimum, rewards, dtype=np.float64) / np.abs(optimum))
