"""Best known rewards of tasks, to which gaps are taken, and proven bounds."""

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
    """``shipped``; label of the method of the best run, if its reward exceeds all that is shipped;
    or ``corrective process alone``, if the reward of this process exceeds both."""
    run_id: str = ""
    """Id of the best run; empty if the source is no run."""
    only_here: bool = False
    """True if no reward is shipped and no search for the optimum (with the task's own base) has a
    solution."""


def best_known(runs: pd.DataFrame, tasks: Iterable[Task]) -> dict[str, BestKnown]:
    """Return the best known reward of each task, from shipped rewards and the runs of a study.

    All solved runs count, including searches and runs copied from other folders, except runs with
    another base, which solve another task. A task is not in the result if its best reward is 0,
    which leaves no gap, if nothing is known of it, or if only runs of one method with one setting,
    no search, are known, which would be compared with themselves.

    Parameters
    ----------
    runs : DataFrame
        Stored runs of the plan, with ``task``, ``method``, ``setting``, ``run_id``, ``status``,
        ``parameters``, ``reward`` (negative ticks), ``hands``.
    tasks : iterable of Task

    Returns
    -------
    dict
        By the name of the task.
    """
    solved = runs[(runs.status == "ok") & (restrictions(runs).base == BASE)]
    is_search = solved.method.isin(SEARCHES)
    solved = pd.concat([solved[is_search], solved[~is_search]])  # of equal runs a search counts
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
    """Return the parameters ``base`` and ``other_arm`` of each run, with which searches for the
    optimum restrict movements, as columns by the index of ``runs``; ``task`` and ``free`` for other
    methods, whose parameters may have the same names."""
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
    """Return (optimum − reward) / |optimum|: 0 at the optimum, 0.01 for 1 % more ticks."""
    return np.asarray(np.subtract(optimum, rewards, dtype=np.float64) / np.abs(optimum))
