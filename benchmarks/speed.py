"""How fast the compiled learner is, against the step-by-step loop in plain NumPy.

``python -m benchmarks.speed`` measures both sides in one run, on the cells of suite
``paper`` at full size. The slow side is measured on a few trials of every cell and
extrapolated; its cost per trial hardly changes with learning (a learned trial of
the paper has 1 to 30 % fewer ticks than the first).
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from benchmarks.runner import Plan, execute_plan
from benchmarks.suites import load_suite, select_cells
from coartic import Robot, learn, reference
from coartic.compiled import entry, inner, joint_chain
from coartic.robot import chain

SLOW_TRIALS = 60


def main() -> None:
    """Measure and print."""
    suite = load_suite("paper")
    cells = select_cells(suite)
    for cell in cells:  # compile before any clock runs
        learn(cell.task, cell.condition, seed=0, trials=1)

    print(f"{'cell':32}{'NumPy, ms/trial':>17}{'compiled, ms/trial':>20}{'ratio, one core':>17}")
    slow_total = fast_total = 0.0
    for cell in cells:
        clock = time.perf_counter()
        slow = reference.learn(cell.task, cell.condition, seed=0, trials=SLOW_TRIALS)
        slow_trial = (time.perf_counter() - clock) / SLOW_TRIALS
        run = learn(cell.task, cell.condition, seed=0, trials=suite.trials)
        if not np.array_equal(run.rewards[:SLOW_TRIALS], slow.rewards):
            raise SystemExit(f"{cell.task.name} {cell.method}: the two sides disagree")
        fast_trial = run.wall_s / suite.trials
        slow_total += slow_trial * suite.trials * suite.runs
        fast_total += run.wall_s * suite.runs
        name = f"{cell.task.name} {cell.method}"
        print(
            f"{name:32}{slow_trial * 1e3:17.2f}{fast_trial * 1e3:20.4f}"
            f"{slow_trial / fast_trial:17.0f}"
        )

    plan = Plan(suite.name, tuple(cells), suite.runs, suite.trials, seed=0)
    clock = time.perf_counter()
    runs = sum(1 for _ in execute_plan(plan))
    wall = time.perf_counter() - clock
    print(
        f"\nSuite paper, {runs} runs of {suite.trials} trials: {wall:.1f} s on all cores; "
        f"step by step about {slow_total / 3600:.1f} h\n"
        f"(extrapolated from {SLOW_TRIALS} trials a cell, rewards equal). "
        f"Ratio {slow_total / wall:.0f} on all cores, {slow_total / fast_total:.0f} on one."
    )
    library, own = _kinematics()
    print(
        f"Forward kinematics in the kernels: {own:.0f} ns; with the C library's cosine and "
        f"sine {library:.0f} ns (ratio {library / own:.1f})."
    )


_chain = inner(chain)


@entry
def _many_own(postures: Any, arm: Any, xs: Any, ys: Any) -> float:
    total = 0.0
    for q in postures:
        joint_chain(q, arm, xs, ys)
        total += xs[len(arm.links)]
    return total


@entry
def _many_library(postures: Any, arm: Any, xs: Any, ys: Any) -> float:
    total = 0.0
    for q in postures:
        _chain(q, arm, xs, ys, math.cos, math.sin)
        total += xs[len(arm.links)]
    return total


def _kinematics(count: int = 200_000) -> tuple[float, float]:
    """Nanoseconds per evaluation, with the library's and with our own functions."""
    arm = Robot().arm("right")
    postures = np.random.default_rng(0).uniform(-2, 2, (count, Robot().dof))
    times = []
    for function in (_many_library, _many_own):
        best = math.inf
        for _ in range(6):  # the first one compiles
            clock = time.perf_counter()
            function(postures, arm, np.empty(5), np.empty(5))
            best = min(best, time.perf_counter() - clock)
        times.append(best / count * 1e9)
    return times[0], times[1]


if __name__ == "__main__":
    main()
