"""Estimate how long the missing runs of a plan will take, from the times of other runs."""

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
"""Method, task and number of trials (0 without trials). Runs of a kind take about equally long."""
_EARLY = 0.1
"""Share of the work before which there is no estimate, because processes are starting."""
_RECENT = 0.15
"""Share of the finished work after which the weight of an earlier run is halved. The weight falls
because the load of a machine changes."""


class TimeLeft:
    """Estimate of the time until all expected runs are made.

    Several threads can use the same object.

    The estimate assumes that

    - a run of a shipped method takes as long as the shipped runs of the method on this task, or on
      all tasks if this one is not shipped, times a factor of this machine;
    - a run of another method takes as long as its runs here;
    - recent runs have more weight than earlier ones;
    - ``workers`` runs are made at once, or more if the times of finished runs add up to more.
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
        """Set the runs to be made from now on."""
        with self._lock:
            self._waiting.clear()
            for job in jobs:
                self._waiting[_kind_of(job.cell)] += len(job.numbers)

    def finish(self, cell: Cell, wall_s: float | None) -> None:
        """Count an expected run of a cell that was made in ``wall_s`` s; None if unknown."""
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
        """Time left, in s.

        The estimate is NaN until a tenth of the work is done, and while runs of a method are
        missing whose time is unknown. If no run finishes for a long time, the estimate grows again.
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
        """Return the time of a method's runs here as a multiple of :func:`_shipped_s`.

        It is NaN before the first run of the method's group.
        """
        usual_s = self._usual_s[_group_of(method)]
        return self._took_s[_group_of(method)] / usual_s if usual_s else math.nan


def _group_of(method: str) -> str:
    """Return the group of a method. Its runs have the same factor; shipped methods are a group."""
    return "" if method in _shipped_means() else method


def _kind_of(cell: Cell) -> _Kind:
    trials = trials_in(cell.parameters)
    return cell.method.name, cell.task.name, min(trials, cell.trial_budget or trials)


def _shipped_s(kind: _Kind) -> float:
    """Return the mean time (in s) of a shipped run of this kind, scaled to its number of trials.

    If no runs of the method are shipped, 1 s stands for a run with the default number of trials.
    """
    method, task, trials = kind
    by_task = _shipped_means().get(method, {})
    mean = by_task.get(task) or sum(by_task.values()) / (len(by_task) or 1) or 1.0
    return mean * (trials / TRIALS if trials else 1.0)


@cache
def _shipped_means() -> Mapping[str, Mapping[str, float]]:
    """Return the mean time (in s) of the shipped runs by method and task.

    These are runs in the paper's world with the default setting.
    """
    with open_shipped("comparison") as store:
        runs = store.runs()
    runs = runs[(runs.world == "") & (runs.setting == "")]
    means = runs.groupby(["method", "task"]).wall_s.mean()
    return {str(method): dict(of[method]) for method, of in means.groupby("method")}
