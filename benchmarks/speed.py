"""How fast the compiled learner is, against the step-by-step loop in plain NumPy.

``python -m benchmarks.speed`` measures both sides in one run, on the cells of suite
``paper`` at full size. The slow side is measured on a few trials of every cell and
extrapolated; its cost per trial hardly changes with learning (a learned trial of
the paper has 1 to 30 % fewer ticks than the first).
"""

from __future__ import annotations

import math
import tempfile
import time
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from benchmarks.registry import registry
from benchmarks.run import plan_suite
from benchmarks.suites import Suite, load_suite, select_cells
from coartic import CONDITIONS, Robot, learn, reference
from coartic.compiled import entry, inner, joint_chain
from coartic.learning import METHOD_PREFIX, TRIALS, warm_up
from coartic.robot import chain

SLOW_TRIALS = 60


def main() -> None:
    """Measure and print."""
    suite = load_suite("paper")
    trials = suite.trials or TRIALS
    cells = [
        (cell.task, CONDITIONS[cell.method.removeprefix(METHOD_PREFIX)])
        for cell in select_cells(suite, registry())
    ]
    warm_up()

    print(f"{'cell':32}{'NumPy, ms/trial':>17}{'compiled, ms/trial':>20}{'ratio, one core':>17}")
    slow_total = fast_total = 0.0
    for task, condition in cells:
        name = f"{task.name} {condition.id}"
        clock = time.perf_counter()
        slow = reference.learn(task, condition, seed=0, trials=SLOW_TRIALS)
        slow_trial = (time.perf_counter() - clock) / SLOW_TRIALS
        run = learn(task, condition, seed=0, trials=trials)
        if not np.array_equal(run.rewards[:SLOW_TRIALS], slow.rewards):
            raise SystemExit(f"{name}: the two sides disagree")
        fast_trial = run.wall_s / trials
        slow_total += slow_trial * trials * suite.runs
        fast_total += run.wall_s * suite.runs
        ratio = slow_trial / fast_trial
        print(f"{name:32}{slow_trial * 1e3:17.2f}{fast_trial * 1e3:20.4f}{ratio:17.0f}")

    bare, harness = _suite(suite, trials)
    print(
        f"\nSuite paper, {len(cells) * suite.runs} runs of {trials} trials, all cores: "
        f"{bare:.1f} s; step by step about {slow_total / 3600:.1f} h\n"
        f"(extrapolated from {SLOW_TRIALS} trials a cell, rewards equal). "
        f"Ratio {slow_total / bare:.0f} on all cores, {slow_total / fast_total:.0f} on one.\n"
        f"Through the harness (processes, records on disk, tables): {harness:.1f} s, "
        f"{harness / bare:.2f} times the bare kernels."
    )
    library, own = _kinematics()
    print(
        f"Forward kinematics in the kernels: {own:.0f} ns; with the C library's cosine and "
        f"sine {library:.0f} ns (ratio {library / own:.1f})."
    )


def _suite(suite: Suite, trials: int) -> tuple[float, float]:
    """Seconds for the whole suite: kernels on threads, and everything the harness does."""
    plan = plan_suite(suite, trials=trials)
    work = [
        (spec.task, CONDITIONS[spec.method.removeprefix(METHOD_PREFIX)], spec.seed)
        for _, spec in plan.planned
    ]
    clock = time.perf_counter()
    runs = Parallel(n_jobs=-1, prefer="threads")(
        delayed(learn)(task, condition, seed=seed, trials=trials) for task, condition, seed in work
    )
    bare = time.perf_counter() - clock
    with tempfile.TemporaryDirectory() as folder:
        clock = time.perf_counter()
        report = plan.perform(folder)
        harness = time.perf_counter() - clock
    for run, record in zip(runs, report.records.values(), strict=True):
        if record.solution is None or record.solution.reward != run.reward:
            raise SystemExit(f"{record.run_id}: the two sides disagree")
    return bare, harness


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
