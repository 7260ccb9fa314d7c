"""Find the best known rewards of tasks, from which gaps are measured, and proven bounds."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic import Task
from coartic.analysis.methods import SEARCHES
from coartic.model import PAPER, MotionModel
from coartic.robot import Array
from coartic.runs.plan import label_of
from coartic.tasks.optima import BASE, KnownOptimum, best_shipped


@dataclass(frozen=True)
class BestKnown(KnownOptimum):
    """The best known reward of a task in a world, and its source."""

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


CANDIDATES = 5
"""How many runs on a task are executed afresh, to find the best of them in a world with noise."""
FRESH_EXECUTIONS = 1_000
"""Number of executions by which a reference is judged in a world with noise."""


def run_values(runs: pd.DataFrame) -> pd.Series:
    """Return the value of each run, which all rankings compare.

    The value is the reward of a run in a world without noise, and minus its ``mean_ticks`` in a
    world with noise, where rewards are missing. It is NaN for a failed run.

    Parameters
    ----------
    runs : DataFrame
        With ``reward`` (negative ticks) and optionally ``mean_ticks``.

    Returns
    -------
    Series
        Values (negative ticks, float64) by the index of ``runs``.
    """
    names = [name for name in ("reward", "mean_ticks") if name in runs]
    numbers = runs[names].astype("Float64").to_numpy(np.float64, na_value=np.nan)
    reward, ticks = numbers[:, 0], numbers[:, -1]
    values = np.where(np.isnan(reward), -ticks, reward) if len(names) > 1 else reward
    return pd.Series(values, runs.index, name="value")


def best_known(
    runs: pd.DataFrame,
    tasks: Iterable[Task],
    *,
    models: Mapping[str, MotionModel] | None = None,
    fresh: Callable[[str, Sequence[str]], Sequence[float]] | None = None,
) -> dict[str, BestKnown]:
    """Return the best known reward of each task in one world, from shipped rewards and runs.

    All solved runs count, including searches and runs copied from other folders. Runs with another
    base do not count, because they solve another task. A task is left out if

    - its best reward is 0, because a gap could not be computed;
    - no reward is known;
    - only runs of one method with one setting are known, and this method is not a search. These
      runs would be compared with themselves.

    In a world with noise the best of many stored values would partly be luck. There the five runs
    with the best values are executed afresh, and the best of these means is the reward.

    Parameters
    ----------
    runs : DataFrame
        Stored runs of one world, with ``task``, ``method``, ``setting``, ``run_id``, ``status``,
        ``parameters``, ``reward`` and ``mean_ticks`` (:func:`run_values`), ``hands``.
    tasks : iterable of Task
    models : mapping of MotionModel, optional
        The world by the name of the task; the paper's if it is missing.
    fresh : callable, only in a world with noise
        Function of a task's name and ids of runs on it. It returns minus the mean ticks of
        :data:`FRESH_EXECUTIONS` executions of each run.

    Returns
    -------
    dict
        Best known rewards by the name of the task.
    """
    values = run_values(runs)
    solved = runs.assign(value=values)[
        (runs.status == "ok") & values.notna() & (restrictions(runs).base == BASE)
    ]
    is_search = solved.method.isin(SEARCHES)
    solved = pd.concat([solved[is_search], solved[~is_search]])  # in a tie, a search comes first
    by_task, rewards, models = dict([*solved.groupby("task")]), {}, models or {}
    for task in tasks:
        here = by_task.get(task.name, solved[:0])
        shipped = best_shipped(task, models.get(task.name, PAPER))
        searches = here[is_search[here.index]]
        labels = {*map(label_of, here.method, here.setting)}
        if shipped is None and not len(searches) and len(labels) < 2:
            continue
        bound = None if shipped is None else shipped.bound
        if fresh is not None and len(here):
            here = here.nlargest(CANDIDATES, "value")
            here = here.assign(value=fresh(task.name, [*map(str, here.run_id)]))
        if shipped is not None and not (here.value > shipped.reward).any():
            best = BestKnown(shipped.reward, bound, shipped.hands)
        else:
            run = here.iloc[int(here.value.to_numpy().argmax())]
            reward = int(run.value) if fresh is None else float(run.value)
            only_here = shipped is None and not len(searches)
            source = label_of(run.method, run.setting), str(run.run_id)
            best = BestKnown(reward, bound, str(run.hands), *source, only_here)
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


def relative_gap(rewards: ArrayLike, optimum: ArrayLike) -> Array:
    """Return (optimum − reward) / |optimum|, which is 0.01 for 1 % more ticks."""
    return np.asarray(np.subtract(optimum, rewards, dtype=np.float64) / np.abs(optimum))
