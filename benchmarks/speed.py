"""How fast trials are: the learner's kernel, and suite ``paper`` through the harness.

    python -m coartic.benchmarks.speed

Times depend on the machine; compare ratios, and times of one call.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from coartic import CONDITIONS, Task, learn_many, load_task
from coartic.benchmarks.pool import Local
from coartic.benchmarks.run import plan_suite
from coartic.learner.learning import METHOD_PREFIX, TRIALS, warm_up
from coartic.motion.lanes import LANES
from coartic.runs.store import open_store


def main() -> None:
    """Measure and print."""
    plan = plan_suite("paper")
    cells = [
        (load_task(cell.task), cell.method.removeprefix(METHOD_PREFIX)) for cell in plan.plan.cells
    ]
    warm_up(load_task("ascending"))
    print(f"{'cell':20}{'one run':>12}{f'{LANES} runs':>12}   microseconds of a core a trial")
    for task, condition in cells:
        alone, many = (_us_a_trial(task, condition, runs) for runs in (1, LANES))
        print(f"{task.name:16}{condition:4}{alone:12.1f}{many:12.1f}", flush=True)
    runs = plan.plan.runs
    for threads in (1, 2):
        clock = time.perf_counter()
        for task, condition in cells:
            learn_many(task, CONDITIONS[condition], seeds=range(runs), jobs=threads)
        print(f"{plan.plan.size} runs, {threads} threads: {time.perf_counter() - clock:.1f} s")
    with tempfile.TemporaryDirectory() as folder:
        clock = time.perf_counter()
        plan.perform(folder, executor=Local(2))
        print(f"through the harness, 2 processes: {time.perf_counter() - clock:.1f} s")
        clock = time.perf_counter()
        with open_store(Path(folder)) as store:
            store.frame("runs")
        print(f"read back: {time.perf_counter() - clock:.2f} s")


def _us_a_trial(task: Task, condition: str, runs: int) -> float:
    clock = time.thread_time()
    learn_many(task, CONDITIONS[condition], seeds=range(runs), jobs=1)
    return (time.thread_time() - clock) / runs / TRIALS * 1e6


if __name__ == "__main__":
    main()
