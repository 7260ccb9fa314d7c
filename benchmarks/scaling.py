"""How the cost of planners and of the proof grows with goals and joints.

    python -m coartic.benchmarks.scaling

Development instances of the families, the median CPU time of three for each size, and the
exponent of a power of the number of goals or joints, by least squares on logarithms. Beyond
six goals planners stand twice: with the beam over hand sequences that they use there, and with
every sequence; with both go the median ticks of what they found.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np

from coartic import PAPER, Task, corrective_trial, execute, load_task
from coartic.baselines.certificate import certify
from coartic.baselines.optimum import DynamicProgramming
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.trajectory_optimisation import METHODS as PLANNERS
from coartic.baselines.trajectory_optimisation import TrajectoryParameters
from coartic.method import Method, MethodError, Session
from coartic.motion.initial import initial_hands

EVERY = 256  # hand sequences of the eight goals that tasks have at most
BEAM = TrajectoryParameters().most_sequences
NODES = 300  # cone programmes of a proof that is measured
WHOLE = ", every sequence"
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


def measured() -> dict[str, Callable[[Task], int | None]]:
    """What is timed, by name: ticks of the movement that it finds, None for a bound."""
    (path, jerk) = (
        next(method for method in PLANNERS if method.name.endswith(cost))
        for cost in ("path-length", "jerk")
    )
    planners: dict[str, tuple[type[Method], dict[str, object]]] = {
        TwoGoals.name: (TwoGoals, {"hands": "every"}),
        path.name: (path, {"graphs": 1}),
        jerk.name: (jerk, {"graphs": 1, "noisy_starts": 1}),
    }
    found: dict[str, Callable[[Task], int | None]] = {}
    for name, (method, parameters) in planners.items():
        found[name] = _solved(method, **parameters)
        found[f"{name}{WHOLE}"] = _solved(method, most_sequences=EVERY, **parameters)
    return found | {
        DynamicProgramming.name: _solved(DynamicProgramming, graphs=1),
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
        if options.only in name:
            _print(name, run, tasks)


def _print(
    name: str, run: Callable[[Task], int | None], tasks: list[tuple[str, int, Task]]
) -> None:
    """A line of what varies: medians by size, and the exponent over all of them."""
    made: dict[str, dict[int, list[tuple[float, int | None]]]] = {}
    for what, size, task in tasks:
        if name.endswith(WHOLE) and len(task.hands) ** len(task.goals) <= BEAM:
            continue  # the same as with the beam
        began = time.process_time()
        with contextlib.suppress(MethodError):
            ticks = run(task)
            seconds = time.process_time() - began
            made.setdefault(what, {}).setdefault(size, []).append((seconds, ticks))
    for what, sizes in made.items():
        medians, shown = {}, []
        for size, own in sizes.items():
            medians[size] = statistics.median(seconds for seconds, _ in own)
            found = [ticks for _, ticks in own if ticks is not None]
            shown.append(f"{size}: {medians[size]:.2f} s")
            shown[-1] += f" ({statistics.median(found):.0f} ticks)" if found else ""
        power = exponent(list(medians), list(medians.values())) if len(medians) > 2 else None
        line = f"{name}: {what} {', '.join(shown)}"
        print(line + (f"; exponent {power:.1f}" if power is not None else ""), flush=True)


def _solved(method: type[Method], **parameters: object) -> Callable[[Task], int]:
    def run(task: Task) -> int:
        made = method(method.Parameters(**parameters))
        found = made.solve(Session(task, 0, method.told, trusted=True))
        return execute(task, found.solution).ticks

    return run


def _bounded(task: Task) -> None:
    """A proof that what the corrective process takes is least: never done, cut at the budget."""
    ticks = corrective_trial(task, initial_hands(task)).ticks
    certify(task, ticks, still=False, model=PAPER, most_nodes=NODES)


if __name__ == "__main__":
    main()
