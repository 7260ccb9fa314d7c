"""Find the best known reward of each task, and the proven bound of this reward.

Gaps are measured from the best known rewards.
"""

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
    - the label of a method, if its best run has a higher reward than the shipped reward, or if no
      reward is shipped;
    - ``corrective process alone``, if the reward of this process is higher than all others.
    """
    run_id: str = ""
    """Id of the best run; empty if the source is not a run."""
    only_here: bool = False
    """True if the reward is known only from methods that are not searches for the optimum. Then no
    reward is shipped for the task, and no search of this folder solved the task without additional
    locks of the base."""


CANDIDATES = 5
"""Number of runs on each task that are executed again in a world with noise, to find the best of
them. These are the runs with the best stored values."""
FRESH_EXECUTIONS = 1_000
"""Number of executions with motor noise from which a best known reward is computed."""


def run_values(runs: pd.DataFrame) -> pd.Series:
    """Return the value of each run, from which gaps and rankings are computed.

    The value of a run is its reward. In a world with noise, where the reward is missing, the value
    is minus the run's ``mean_ticks``. It is NaN if both are missing, as for a failed run.

    Parameters
    ----------
    runs : DataFrame
        A row for each run, with column ``reward`` (negative ticks) and optionally ``mean_ticks``.

    Returns
    -------
    Series
        Values in negative ticks, as float64, with the index of ``runs``.
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
    """Return the best known reward of each task in one world.

    The best known reward is the highest among the shipped reward and the rewards of all solved
    runs, including the runs of searches for the optimum. Runs of searches with additional locks of
    the base are left out, because they solve another task. A task is left out if

    - its best reward is 0, because the gap is divided by this reward;
    - no reward is known;
    - no reward is shipped, and all solved runs are of one method with one setting, which is not a
      search for the optimum. These runs would be compared with themselves.

    In a world with noise, the highest of many stored values is partly luck. Therefore the five runs
    on each task with the highest values are executed again with other noise. The highest of these
    five new means is compared with the shipped reward.

    Parameters
    ----------
    runs : DataFrame
        Stored runs of one world, with ``task``, ``method``, ``setting``, ``run_id``, ``status``,
        ``parameters``, ``reward`` and ``mean_ticks`` (:func:`run_values`), ``hands``.
    tasks : iterable of Task
        The tasks of the study.
    models : mapping of str to MotionModel, optional
        Maps the name of each task to the motion model of the world. A task without an entry has the
        paper's model.
    fresh : callable, only in a world with noise
        Function of two arguments: the name of a task, and a list of ids of runs on this task. It
        executes each run :data:`FRESH_EXECUTIONS` times, and returns a list with minus the mean
        ticks of each run.

    Returns
    -------
    dict of str to BestKnown
        Maps the name of each task that is not left out to its best known reward.
    """
    values = run_values(runs)
    solved = runs.assign(value=values)[
        (runs.status == "ok") & values.notna() & (restrictions(runs).base == BASE)
    ]
    solved = solved[["task", "method", "setting", "run_id", "hands", "value"]]
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
    """Return how each run of a search for the optimum restricted the base and the idle arm.

    Parameters
    ----------
    runs : DataFrame
        Stored runs, with columns ``method`` and ``parameters`` (JSON).

    Returns
    -------
    DataFrame
        Columns ``base`` and ``other_arm``, the values of these parameters in each run, with the
        index of ``runs``. For a method that is not a search for the optimum, the two values are
        ``task`` and ``free`` (no restriction), even if the method has parameters with these names.
    """
    default = {"base": BASE, "other_arm": "free"}
    pairs = [*zip(runs.method.tolist(), runs.parameters.tolist(), strict=True)]
    asked = {
        (method, text): default | (json.loads(text) if method in SEARCHES else {})
        for method, text in {*pairs}
    }
    return pd.DataFrame(
        {name: [asked[pair][name] for pair in pairs] for name in default}, runs.index
    )


def relative_gap(rewards: ArrayLike, optimum: ArrayLike) -> Array:
    """Return (optimum − reward) / |optimum|, a fraction: 0.01 is 1 % more ticks.

    ``rewards`` and ``optimum`` are in negative ticks, and are broadcast against each other.
    """
    return np.asarray(np.subtract(optimum, rewards, dtype=np.float64) / np.abs(optimum))
