"""Estimate how long the missing runs of a plan will take."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from functools import cache

from coartic.method import TRIALS
from coartic.runs.plan import Cell, Job, trials_in
from coartic.runs.shipped import open_shipped

_Kind = tuple[str, str, int]
"""Kind of a run: id of the method, name of the task, and number of trials (0 for a method without
trials). Runs of the same kind take about equally long."""
_EARLY = 0.1
"""Until this share of the work is done there is no estimate, because at first processes are
starting."""
_RECENT = 0.15
"""Half-life of the weight of a finished run, as a share of the total time of all finished runs.
Earlier runs have less weight, because the load of a machine changes."""


class TimeLeft:
    """Estimate of the wall time until all expected runs are finished.

    The estimate is the sum of the expected times of the missing runs, divided by the number of runs
    that are made at once.

    - *Method with shipped results.* The expected time of a run is the mean time of the shipped runs
      of the method on this task (on all tasks, if none are shipped for this one), in proportion to
      the number of trials, times a factor of this machine. The factor is the same for all such
      methods: the time of their finished runs divided by the time of such runs in the shipped
      results.
    - *Any other method.* The expected time of a run is the mean time of the finished runs of this
      method, in proportion to the number of trials.
    - *Weights.* In the factor, and in the mean time of finished runs, recent runs have more weight
      than earlier runs.
    - *Runs at once.* The number of runs that are made at once is ``workers`` or, if that is larger,
      the total time of the finished runs divided by the elapsed wall time.

    Several threads can use the same object.

    Parameters
    ----------
    workers : int
        Number of runs that are made at once.
    """

    def __init__(self, workers: int = 1) -> None:
        self._workers = workers
        self._waiting = Counter[_Kind]()
        self._done_s = 0.0
        self._begun = self._last = time.monotonic()
        # Weighted sums of times of finished runs: here, and of their :func:`_shipped_s`.
        self._took_s, self._usual_s = defaultdict[str, float](float), defaultdict[str, float](float)
        self._lock = threading.Lock()

    def expect(self, jobs: Iterable[Job]) -> None:
        """Set the runs that are still to be made to those of ``jobs``."""
        with self._lock:
            self._waiting.clear()
            for job in jobs:
                self._waiting[_kind_of(job.cell)] += len(job.numbers)

    def finish(self, cell: Cell, wall_s: float | None) -> None:
        """Count an expected run as finished, and learn from its time.

        Parameters
        ----------
        cell : Cell
            Cell of the run.
        wall_s : float or None
            Wall time of the run (in s); None if it is unknown.
        """
        kind = _kind_of(cell)
        with self._lock:
            self._last = time.monotonic()
            self._waiting[kind] -= 1
            if wall_s is not None:
                self._done_s += wall_s
                weight = 0.5 ** (wall_s / max(_RECENT * self._done_s, 1e-9))
                group = _group_of(kind[0])
                self._took_s[group] = weight * self._took_s[group] + wall_s
                self._usual_s[group] = weight * self._usual_s[group] + _shipped_s(kind)

    @property
    def seconds(self) -> float:
        """Estimated wall time that is left (in s); 0 if no run is missing.

        The estimate is NaN in two cases:

        - less than a tenth of the work is done;
        - the time of a missing run is unknown, because no run of its method (or, for methods with
          shipped results, of any such method) has finished.

        If no run finishes for a long time, the estimate grows again.
        """
        with self._lock:
            left_s = sum(
                count * _shipped_s(kind) * self._factor(kind[0])
                for kind, count in self._waiting.items()
                if count > 0
            )
            done_s, since_s = self._done_s, time.monotonic() - self._last
            at_once = max(self._workers, done_s / max(self._last - self._begun, 1.0))
        if not left_s:
            return 0.0
        if not done_s >= _EARLY * (done_s + left_s):  # True for NaN
            return math.nan
        return max(left_s / at_once - since_s, since_s / 4)

    def _factor(self, method: str) -> float:
        """Return the time of finished runs, divided by their expected time (:func:`_shipped_s`).

        Both times are sums over runs, in which later runs have more weight. The finished runs are
        those of the method's group (:func:`_group_of`). The factor is NaN before the first run of
        the group has finished.
        """
        usual_s = self._usual_s[_group_of(method)]
        return self._took_s[_group_of(method)] / usual_s if usual_s else math.nan


def _group_of(method: str) -> str:
    """Return the name of the group of methods to which a method belongs.

    All methods of :func:`_shipped_means` belong to one group, whose name is empty. Any other method
    is a group of its own, and the name of the group is the id of the method.
    """
    return "" if method in _shipped_means() else method


def _kind_of(cell: Cell) -> _Kind:
    trials = trials_in(cell.parameters)
    return cell.method.name, cell.task.name, min(trials, cell.trial_budget or trials)


def _shipped_s(kind: _Kind) -> float:
    """Return the expected time of a run by the shipped results (in s).

    The time is the mean wall time of the shipped runs of the method on the task (on all tasks, if
    none are shipped for this one), in proportion to the number of trials. If no runs of the method
    are shipped, the time is 1 s for a run with 10,000 trials or without trials.
    """
    method, task, trials = kind
    by_task = _shipped_means().get(method, {})
    mean = by_task.get(task) or sum(by_task.values()) / (len(by_task) or 1) or 1.0
    return mean * (trials / TRIALS if trials else 1.0)


@cache
def _shipped_means() -> Mapping[str, Mapping[str, float]]:
    """Return the mean wall times of shipped runs (in s) for each method and task.

    The result is a dict that maps ids of methods to dicts that map names of tasks to means. The
    means are over the shipped runs in the paper's world with the default parameters.
    """
    with open_shipped("comparison") as store:
        runs = store.runs()
    runs = runs[(runs.world == "") & (runs.setting == "")]
    means = runs.groupby(["method", "task"]).wall_s.mean()
    return {str(method): dict(of[method]) for method, of in means.groupby("method")}
