"""How fast the compiled learner is, how fast it could be, and how that grows.

``python -m coartic.benchmarks.speed`` measures in one run, on the cells of suite ``paper`` at full
size, microseconds of processor time a trial of: the compiled kernel with one run at a time; the
same with the runs of the cell side by side; with as many as fill the lanes; and the floor, which
is what the same steps could not do without: the kernel's own evaluations of forward kinematics
(those that its bounds on movements do not skip; better bounds would lower it), at the price of one
among full lanes with the check of its angles, and the random numbers. The price is the best of
five, all else one sample. ``--repeats`` gives the spread.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coartic import CONDITIONS, Robot, Task, learn_many, load_task, parse_task
from coartic.benchmarks.executors import Local
from coartic.benchmarks.registry import registry
from coartic.benchmarks.run import plan_suite
from coartic.benchmarks.suites import Suite, load_suite, select_cells
from coartic.learner.conditions import ExplorationCondition
from coartic.learner.kernel import rules_of
from coartic.learner.learning import METHOD_PREFIX, TRIALS, LearningRun, warm_up
from coartic.motion.compiled import addresses, entry, generator_at
from coartic.motion.lanes import LANES, board, lanes_for, near, place

GROWTH_TRIALS = 2_000
_LINKS = (3, 4, 6)  # of an arm
_BEST_OF = 5


@dataclass(frozen=True)
class Prices:
    """Nanoseconds."""

    kinematics: float
    """Forward kinematics of one arm, among full lanes."""
    normal: float
    uniform: float

    def floor_us(self, task: Task, condition: ExplorationCondition, run: LearningRun) -> float:
        """Microseconds a trial of a run's kinematics and random numbers at these prices."""
        rules, trials = rules_of(task, condition), len(run.rewards)
        chosen = [0, 1] if len(rules.hands) > 1 else list(rules.hands)
        normals = len(task.goals) * rules.explored[chosen].sum(axis=1).mean()
        uniforms = len(task.goals) if rules.exploration else 0
        kinematics = run.counters.forward_kinematics / trials * self.kinematics
        return float(kinematics + normals * self.normal + uniforms * self.uniform) / 1e3


@dataclass(frozen=True)
class Times:
    """Microseconds of processor time a trial of one cell."""

    name: str
    alone: float
    together: float
    full: float
    floor: float

    def row(self) -> str:
        """A line of the table."""
        return (
            f"{self.name:18}{self.alone:9.2f}{self.together:9.2f}{self.full:9.2f}{self.floor:8.2f}"
            f"{self.alone / self.together:10.2f}{self.together / self.floor:12.2f}"
            f"{self.full / self.floor:11.2f}"
        )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m coartic.benchmarks.speed", description=__doc__)
    parser.add_argument("--repeats", type=int, default=1, help="measure so many times")
    repeats = parser.parse_args().repeats
    suite = load_suite("paper")
    trials = suite.trials or TRIALS
    cells = [
        (cell.task, CONDITIONS[cell.method.removeprefix(METHOD_PREFIX)])
        for cell in select_cells(suite, registry())
    ]
    print("compiling, unless it was done before ...", flush=True)
    warm_up(load_task("ascending"))
    for number in range(repeats):
        print(f"\nMeasurement {number + 1} of {repeats}, microseconds of processor time a trial:\n")
        _print_cells(suite, cells, trials)
    _print_growth()


def _print_cells(
    suite: Suite, cells: Sequence[tuple[Task, ExplorationCondition]], trials: int
) -> None:
    print(
        f"{'cell':18}{'one run':>9}{f'{suite.runs} runs':>9}{f'{LANES} runs':>9}"
        f"{'floor':>8}{'one/runs':>10}{'runs/floor':>12}{'full/floor':>11}"
    )
    prices = _prices(Robot())
    times = []
    for task, condition in cells:
        times.append(_times(task, condition, trials, suite.runs, prices))
        print(times[-1].row(), flush=True)
    names = ("alone", "together", "full", "floor")
    total = Times("all", *(sum(getattr(row, name) for row in times) for name in names))
    print(total.row())
    print(
        f"One evaluation among {LANES} lanes: {prices.kinematics:.1f} ns; a normal "
        f"{prices.normal:.1f} ns, a uniform number {prices.uniform:.1f} ns."
    )
    one, two, harness = _suite(suite, trials)
    print(
        f"Suite {suite.name}, {len(cells) * suite.runs} runs of {trials} trials: {one:.1f} s on\n"
        f"one thread, {two:.1f} s on two (ratio {one / two:.2f}), {harness:.1f} s through the "
        f"harness with processes,\nrecords and tables ({harness / two:.2f} times two threads)."
    )


def _times(
    task: Task, condition: ExplorationCondition, trials: int, runs: int, prices: Prices
) -> Times:
    (alone,) = learn_many(task, condition, seeds=[0], trials=trials, jobs=1)
    together = learn_many(task, condition, seeds=range(runs), trials=trials, jobs=1)
    full = learn_many(task, condition, seeds=range(LANES), trials=trials, jobs=1)
    name = f"{task.name} {condition.id}"
    if not np.array_equal(alone.rewards, together[0].rewards):
        raise SystemExit(f"{name}: two sides disagree")
    floors = [prices.floor_us(task, condition, run) for run in full]
    return Times(
        name,
        _us([alone]),
        _us(together),
        _us(full),
        sum(floors) / len(full),
    )


def _us(runs: Sequence[LearningRun]) -> float:
    """Microseconds of one core that a trial of a run took."""
    return sum(run.cpu_s for run in runs) / sum(len(run.rewards) for run in runs) * 1e6


def _suite(suite: Suite, trials: int) -> tuple[float, float, float]:
    """Seconds for the whole suite: kernels on one thread and on two, and what the harness does."""
    plan = plan_suite(suite, trials=trials)
    cells: dict[Any, list[int]] = {}
    for _, spec in plan.planned:
        cells.setdefault((spec.method, spec.task.name), []).append(spec.seed)
    seconds: list[float] = []
    rewards: list[int | None] = []
    for jobs in (1, 2):
        clock, rewards = time.perf_counter(), []
        for (method, task), seeds in cells.items():
            condition = CONDITIONS[method.removeprefix(METHOD_PREFIX)]
            runs = learn_many(load_task(task), condition, seeds=seeds, trials=trials, jobs=jobs)
            rewards += [run.reward for run in runs]
        seconds.append(time.perf_counter() - clock)
    with tempfile.TemporaryDirectory() as folder:
        clock = time.perf_counter()
        report = plan.perform(folder, executor=Local(2))
        seconds.append(time.perf_counter() - clock)
        stored = report.records.values()
        if [record.solution and record.solution.reward for record in stored] != rewards:
            raise SystemExit("kernels and records disagree")
    one, two, harness = seconds
    return one, two, harness


def _print_growth() -> None:
    """How the time of a trial grows, with as many runs side by side as there are lanes."""
    print(f"\nGrowth, {LANES} runs side by side, microseconds of processor time a trial:\n")
    print(f"{'':32}{'a trial':>10}{'evaluations':>13}{'ns each':>10}")
    for name, task, condition, trials in _grown():
        runs = learn_many(task, condition, seeds=range(LANES), trials=trials, jobs=1)
        us = _us(runs)
        asked = sum(run.counters.forward_kinematics for run in runs) / LANES / trials
        print(f"{name:32}{us:10.2f}{asked:13.1f}{us / asked * 1e3:10.1f}", flush=True)


def _grown() -> Iterator[tuple[str, Task, str, int]]:
    task = load_task("two-armed-1")
    content = task.model_dump(mode="json")
    for goals in range(1, len(task.goals) + 1):
        fewer = {"goals": content["goals"][:goals], "initial_hands": "best-single-hand"}
        yield f"goals: {goals}", parse_task({**content, **fewer}, "goals"), "EC4", GROWTH_TRIALS
    length = sum(task.robot.left_links)
    for links in _LINKS:
        arm, bent = [length / links] * links, [1.5, *[0.02] * (links - 1)]  # rad
        robot = {**content["robot"], "left_links": arm, "right_links": arm}
        start = {**content["start"], "left": bent, "right": bent}
        other = parse_task({**content, "robot": robot, "start": start}, "joints")
        yield f"joints: {other.robot.dof}", other, "EC4", GROWTH_TRIALS
    for trials in (100, 1_000, 10_000):
        yield f"trials: {trials}", task, "EC4", trials


@entry
def _board_all(lanes: Any, starts: Any, arm: Any) -> None:
    for lane in range(LANES):
        board(lanes.at, lane, lane, starts[lane], arm)


@entry
def _place_often(at: Any, times: int) -> None:
    for _ in range(times):
        place(at, LANES, near(at, LANES))


@entry
def _draw(generators: Any, normals: int, uniforms: int) -> float:
    generator, total = generator_at(generators, 0), 0.0
    for _ in range(normals):
        total += generator.standard_normal()
    for _ in range(uniforms):
        total += generator.random()
    return total


def _prices(robot: Robot, count: int = 20_000) -> Prices:
    lanes, rng = lanes_for(robot), np.random.default_rng(0)
    _board_all(lanes, rng.uniform(-2, 2, (LANES, robot.dof)), robot.arm("right"))
    generators, many = addresses([rng]), 10 * count
    return Prices(
        _best_ns(lambda: _place_often(lanes.at, count)) / count / LANES,
        _best_ns(lambda: _draw(generators, many, 0)) / many,
        _best_ns(lambda: _draw(generators, 0, many)) / many,
    )


def _best_ns(act: Callable[[], object]) -> float:
    act()  # compiles
    seconds = []
    for _ in range(_BEST_OF):
        clock = time.thread_time()
        act()
        seconds.append(time.thread_time() - clock)
    return min(seconds) * 1e9


if __name__ == "__main__":
    main()
