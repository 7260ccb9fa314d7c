"""The time that missing runs take, on a clock that the test sets."""

import heapq

import pytest

from coartic import load_task
from coartic.benchmarks import time_left
from coartic.runs.plan import Job, cell_of
from tests.support.suites import KNOWN

METHODS = {
    "random-search": {"ascending": 0.05, "descending": 0.05},
    "cma-es/bandit": {"ascending": 0.3, "descending": 0.4},
    "trajectory-optimisation/jerk": {"ascending": 1.5, "descending": 2.5},
}
"""Times of runs, s, on a machine a little unlike the one that made the shipped runs."""


@pytest.mark.parametrize("slower", [1.0, 5.0])
@pytest.mark.parametrize("order", [1, -1])
def test_in_the_last_third_the_time_left_is_true(monkeypatch, slower, order):
    """Of two processes, which take jobs in turn, ``slower`` times as long as in :data:`METHODS`,
    whether quick or slow methods come last."""
    clock = [0.0]
    monkeypatch.setattr(time_left.time, "monotonic", lambda: clock[0])
    tasks = [load_task(name) for name in ("ascending", "descending")]
    jobs = [
        Job(cell_of(task, KNOWN[name], {}), 0, (number,))
        for name in [*METHODS][::order]
        for task in tasks
        for number in range(20)
    ]
    estimate = time_left.TimeLeft(2)
    estimate.expect(jobs)
    free, ends = [0.0, 0.0], []
    for job in jobs:
        took = slower * METHODS[job.cell.method.name][job.cell.task.name]
        end = heapq.heappop(free) + took
        heapq.heappush(free, end)
        ends.append((end, took, job))
    late = 0
    for clock[0], took, job in sorted(ends, key=lambda each: each[0]):
        estimate.finish(job.cell, took)
        left = max(free) - clock[0]
        if 0.03 < left / max(free) < 1 / 3:
            assert left / 1.5 < estimate.seconds < 1.5 * left
            late += 1
    assert late
    assert left == estimate.seconds == 0
