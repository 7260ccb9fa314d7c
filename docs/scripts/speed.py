"""How fast trials are, through each public way and in each of the paper's cells; and commands.

    python docs/scripts/speed.py [--long]

writes the ways into the page ``docs/how-fast.md``. Times depend on the machine; compare ratios, and
times of one call. ``--long`` also runs suite ``comparison``, which takes minutes.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import plain_loop

from coartic import CONDITIONS, Objective, Task, execute, learn_many, load_task
from coartic.baselines.cma_es import CMAES
from coartic.benchmarks.planning import plan_suite
from coartic.gym import TaskEnv, TaskVectorEnv
from coartic.learner.conditions import METHOD_PREFIX
from coartic.learner.learning import TRIALS, warm_up
from coartic.method import Session
from coartic.model import PAPER
from coartic.motion.batch import SLOTS, batch_for
from coartic.motion.solution import movements_of
from coartic.motion.trial import (
    ALL_STOP,
    Requests,
    compiled_task,
    empty_accounts,
    hand_codes,
    reach_kernel,
)
from coartic.robot import Array


def main(*, is_long: bool = False) -> None:
    """Measure and print."""
    show_ways()
    warm_up(load_task("ascending"))
    print(f"{'experiment':20}{'one run':>12}{f'{SLOTS} runs':>12}   microseconds of a core a trial")
    for cell in (job.cell for job in plan_suite("paper")):
        task, condition = cell.task, cell.method.name.removeprefix(METHOD_PREFIX)
        alone, many = (_us_a_trial(task, condition, runs) for runs in (1, SLOTS))
        print(f"{task.name:16}{condition:4}{alone:12.1f}{many:12.1f}", flush=True)
    show_commands(is_long=is_long)


PAGE = Path(__file__).parents[1] / "how-fast.md"
INTERNAL = ("kernel, one by one", "kernel, 1000 at once")
"""Ways that the page leaves out."""
ROUNDS = 50
"""Number of times that each way is measured."""
HEAD = """\
# How fast

CPU microseconds of one core for a trial, by the function that makes it: medians of one run of
`make speed`, which measures all ways in turn. Times depend on the machine, ratios less. Here the
plain loop takes {in_c} times as long with Numba as in C.

| µs a trial | {heads} |
| --- | {rules} |
"""
FOOT = """
*Plain loop*: the model as a programmer would first write it, with Numba or in C
(`docs/scripts/plain_loop.c`); *bounds* skip steps in which the hand provably misses, as here.
"""


def write_page(columns: list[dict[str, float]], tasks: tuple[str, ...]) -> None:
    """Write the page: microseconds by way and task."""
    ratios = (f"{us['plain loop'] / us['plain loop in C']:.1f}" for us in columns)
    in_c = " and ".join(dict.fromkeys(ratios))
    rules = " | ".join(["---:"] * len(tasks))
    text = HEAD.format(heads=" | ".join(tasks), rules=rules, in_c=in_c)
    for way in (way for way in columns[0] if way not in INTERNAL):
        cells = (f"{us[way]:.3g}" for us in columns)
        text += f"| {way} | {' | '.join(cells)} |\n"
    PAGE.write_text(text + FOOT, encoding="utf-8")


def show_ways() -> None:
    """Print what a trial costs through each public way, and write the page."""
    tasks = ("ascending", "two-armed-1")
    medians: list[dict[str, float]] = [{} for _ in tasks]
    columns = [ways(load_task(name)) for name in tasks]
    heads = "".join(f"{name:>14}{'least':>8}{'most':>8}" for name in tasks)
    print(f"{'way':32}{heads}   CPU microseconds a trial, median")
    times: dict[tuple[str, int], list[float]] = {}
    for _ in range(ROUNDS):  # all ways in turn: what else the machine does slows each of them
        for place, column in enumerate(columns):
            for way, (trials, make) in column.items():
                times.setdefault((way, place), []).append(_us(trials, make))
    for way in columns[0]:
        text = f"{way:32}"
        for place, of_task in enumerate(medians):
            each = times[way, place]
            of_task[way] = float(np.median(each))
            text += f"{of_task[way]:14.2f}{min(each):8.2f}{max(each):8.2f}"
        print(text)
    write_page(medians, tasks)


def ways(task: Task) -> dict[str, tuple[int, Callable[[], object]]]:
    """Ways to make trials: how many each makes, and a function that makes them.

    They lie around the solution of CMA-ES, so that few goals are missed; trials of environments lie
    around the postures of the corrective process.
    """
    session = Session(task, 0, CMAES.information)
    solution = CMAES(CMAES.Parameters(trials=3000)).solve(session).solution
    hands = "".join(movement.hand[0].upper() for movement in solution)
    best = np.array([movement.target for movement in solution])
    cost = Objective(session, hands)
    noise = 0.005 * np.random.default_rng(0).standard_normal((1000, *best.shape)) * cost.joints
    targets = best + noise
    points, solutions = targets[:100, cost.joints], [movements_of(hands, t) for t in targets[:100]]
    compiled, codes = compiled_task(task, PAPER), hand_codes(task, hands, 1000)

    def arguments(targets: Array) -> tuple[Any, ...]:
        some = codes[: len(targets)]
        arms = Requests(compiled.starts, some, targets[:, :, None], ALL_STOP, compiled.goals)
        accounts = empty_accounts(task.robot, len(targets), len(task.goals))
        return compiled.parameters, *accounts, *arms, *batch_for(task.robot)

    together, *alone = map(arguments, (targets, *targets[:100, None]))
    plain = plain_loop.arguments(task, hands)
    reference = session.trials(hands, targets)
    assert (plain_loop.trials(task.q0, targets, *plain) == reference.ticks).all()
    in_c = plain_loop.trials_in_c(task, hands, targets)
    assert all((make() == reference.ticks).all() for make in in_c.values())
    env, many = TaskEnv(task), TaskVectorEnv(1000, task)
    shape = (len(best), *many.action_space.shape)
    actions = np.random.default_rng(0).uniform(-0.1, 0.1, shape)
    many.reset()

    def episode() -> None:
        env.reset()
        for action in actions[:, 0]:
            env.step(action)

    return {
        "plain loop": (1000, lambda: plain_loop.trials(task.q0, targets, *plain)),
        **{way: (1000, make) for way, make in in_c.items()},
        "kernel, one by one": (100, lambda: [reach_kernel(*each) for each in alone]),
        "objective, one by one": (100, lambda: [cost(point) for point in points]),
        "Session.trial, one by one": (100, lambda: [session.trial(each) for each in solutions]),
        "execute, one by one": (100, lambda: [execute(task, each) for each in solutions]),
        "environment, one by one": (25, lambda: [episode() for _ in range(25)]),
        "kernel, 1000 at once": (1000, lambda: reach_kernel(*together)),
        "Session.trials, 10,000 at once": (
            10_000,
            lambda: session.trials(hands, np.tile(targets, (10, 1, 1))),
        ),
        "objective.many, 1000 at once": (1000, lambda: cost.many(targets[:, cost.joints])),
        "environments, 1000 at once": (1000, lambda: [*map(many.step, actions)]),
    }


def _us(trials: int, make: Callable[[], object]) -> float:
    """CPU time of a trial in microseconds; ``make`` makes so many trials."""
    clock = time.process_time()  # of all threads
    make()
    return (time.process_time() - clock) / trials * 1e6


def _us_a_trial(task: Task, condition: str, runs: int) -> float:
    clock = time.thread_time()
    learn_many(task, CONDITIONS[condition], seeds=range(runs), jobs=1)
    return (time.thread_time() - clock) / runs / TRIALS * 1e6


class Spent(NamedTuple):
    """Time and memory of a command."""

    cpu_s: float
    """Of its process and of all that it starts."""
    wall_s: float
    peak_mb: float
    """Memory of its own process."""


def show_commands(*, is_long: bool) -> None:
    """Print the CPU time of commands: of a fresh process and of all that it starts."""
    print(
        f"{'command':32}{'median':>9}{'least':>9}{'most':>9}   CPU seconds of all processes"
        f"{'wall s':>9}{'MB':>7} of its own"
    )
    with tempfile.TemporaryDirectory() as folder:
        results, compared = f"{folder}/quick", f"{folder}/comparison"
        long = [
            ("run comparison", ["run", "comparison", "--out", compared], 1),
            ("report of comparison", ["report", compared], 3),
            ("verify of comparison", ["verify", compared], 3),
        ]
        for name, command, repeats in [
            ("first check, compiling", ["check", "EC4"], 1),
            ("run quick, compiling", ["run", "quick", "--out", f"{folder}/first"], 1),
            ("run quick", ["run", "quick", "--out", results], 1),
            ("report", ["report", results], 3),
            ("verify", ["verify", results], 3),
            ("check", ["check", "EC4"], 5),
            ("draw", ["draw", "--out", f"{folder}/tasks.svg", "--replace"], 5),
            ("list", ["list"], 5),
            ("cite", ["cite"], 5),
            ("--help", ["--help"], 5),
            *(long if is_long else []),
        ]:
            spent = sorted(spent_by(command, cache=folder) for _ in range(repeats))
            median = spent[len(spent) // 2]
            seconds = (median.cpu_s, spent[0].cpu_s, spent[-1].cpu_s)
            columns = "".join(f"{second:9.2f}" for second in seconds)
            print(f"{name:32}{columns}{median.wall_s:40.1f}{median.peak_mb:7.0f}", flush=True)


def spent_by(command: list[str], cache: str) -> Spent:
    """Measure a command, with kernels kept in a folder.

    On Linux also the processes that end after it, such as the server of worker processes.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER: they become our children
    before, clock = os.times(), time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "coartic", *command],
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall_s = time.perf_counter() - clock
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    with contextlib.suppress(ChildProcessError):  # there are no more
        while True:
            os.wait()
    after = os.times()
    user = after.children_user - before.children_user
    cpu_s = user + after.children_system - before.children_system
    return Spent(cpu_s, wall_s, usage.ru_maxrss / 1024)


if __name__ == "__main__":
    main(is_long="--long" in sys.argv)
