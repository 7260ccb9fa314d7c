"""How the cost of planners and of the proof grows with goals and joints.

    python -m coartic.benchmarks.scaling

Development instances of the families, the median CPU time of three for each size, and the
exponent of a power of the number of goals or joints, by least squares on logarithms.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np

from coartic import PAPER, Task, corrective_trial, load_task
from coartic.baselines.certificate import certify
from coartic.baselines.optimum import DynamicProgramming
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.trajectory_optimisation import METHODS as PLANNERS
from coartic.initial import initial_hands
from coartic.method import Method, MethodError, Session

NODES = 300  # cone programmes of a proof that is measured
GOALS = (2, 3, 4, 5, 6, 7, 8)
JOINTS = (8, 10, 12, 14, 16, 18)


def instances(count: int) -> Iterator[tuple[str, int, Task]]:
    """What is varied, its value, and so many tasks of each."""
    for what, sizes, families in (
        ("goals", GOALS, ("two-armed", "long")),
        ("joints", JOINTS, ("redundancy",)),
    ):
        found: dict[int, list[Task]] = {size: [] for size in sizes}
        for family, number in itertools.product(families, range(100)):
            if all(len(tasks) == count for tasks in found.values()):
                break
            task = load_task(f"{family}/v1/d{number:03d}")
            if "x" in task.locked_base or (what == "joints" and len(task.goals) != 3):
                continue
            tasks = found[len(task.goals) if what == "goals" else task.robot.dof]
            if len(tasks) < count:
                tasks.append(task)
        for size, tasks in found.items():
            for task in tasks:
                yield what, size, task


def measured() -> dict[str, Callable[[Task], object]]:
    """What is timed, by name."""
    (path, jerk) = (
        next(method for method in PLANNERS if method.name.endswith(cost))
        for cost in ("path-length", "jerk")
    )
    return {
        "posture-based/two-goals every": _solved(TwoGoals, hands="every"),
        "trajectory-optimisation/path-length": _solved(path, graphs=1),
        "trajectory-optimisation/jerk": _solved(jerk, graphs=1, noisy_starts=1),
        "optimum/dynamic-programming": _solved(DynamicProgramming, graphs=1),
        f"proof, {NODES} cone programmes": _bounded,
    }


def exponent(sizes: list[int], times: list[float]) -> float:
    """Slope of log time over log size."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=3, help="instances of each size")
    parser.add_argument("--most", type=int, default=8, help="largest number of goals")
    parser.add_argument("--only", default="", help="methods whose name contains this")
    options = parser.parse_args()
    tasks = [
        (what, size, task)
        for what, size, task in instances(options.count)
        if what == "joints" or size <= options.most
    ]
    for name, run in measured().items():
        if options.only not in name:
            continue
        times: dict[tuple[str, int], list[float]] = {}
        for what, size, task in tasks:
            began = time.process_time()
            try:
                run(task)
            except MethodError:
                continue
            times.setdefault((what, size), []).append(time.process_time() - began)
        for what in ("goals", "joints"):
            medians = {s: statistics.median(t) for (w, s), t in times.items() if w == what}
            if len(medians) > 1:
                power = exponent(list(medians), list(medians.values()))
                shown = ", ".join(f"{size}: {median:.2f}" for size, median in medians.items())
                print(f"{name}: {what} {shown} s; exponent {power:.1f}", flush=True)


def _solved(method: type[Method], **parameters: object) -> Callable[[Task], object]:
    def run(task: Task) -> object:
        made = method(method.Parameters(**parameters))
        return made.solve(Session(task, 0, method.told, trusted=True))

    return run


def _bounded(task: Task) -> object:
    """A proof that what the corrective process takes is least: never done, cut at the budget."""
    ticks = corrective_trial(task, initial_hands(task)).ticks
    return certify(task, ticks, still=False, model=PAPER, most_nodes=NODES)


if __name__ == "__main__":
    main()
