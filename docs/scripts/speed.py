"""Measure the CPU time of a trial, for public functions and the paper's experiments.

    python docs/scripts/speed.py

The script writes the times of the functions into the table of ``docs/howto/install.md``. Times
depend on the machine. Therefore compare only ratios of times, or times of the same run of the
script.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from plain_loop import trials_in_c

from coartic import CONDITIONS, Objective, Task, execute, learn_many, load_task
from coartic.baselines.cma_es import CMAES
from coartic.benchmarks.planning import plan_suite
from coartic.gym import TaskEnv
from coartic.learner.conditions import METHOD_PREFIX
from coartic.learner.learning import warm_up
from coartic.method import TRIALS, Session
from coartic.motion.kernels.slots import SLOTS
from coartic.motion.solution import movements_of


def main() -> None:
    """Print all times, and write the table of ``docs/howto/install.md``."""
    show_functions()
    warm_up(load_task("ascending"))
    print(f"{'experiment':20}{'one run':>12}{f'{SLOTS} runs':>12}   microseconds of a core a trial")
    for cell in (job.cell for job in plan_suite("paper")):
        task, condition = cell.task, cell.method.name.removeprefix(METHOD_PREFIX)
        one, many = (_us_a_trial(task, condition, runs) for runs in (1, SLOTS))
        print(f"{task.name:16}{condition:4}{one:12.1f}{many:12.1f}", flush=True)


PAGE = Path(__file__).parents[1] / "howto" / "install.md"
ROUNDS = 50
"""Number of times that each function is measured."""
HEAD = "| µs a trial |"
"""Beginning of the table on the page."""


def show_functions() -> None:
    """Print the time of a trial by each public function, and write the page's table."""
    columns = {name: functions(load_task(name)) for name in ("ascending", "two-armed-1")}
    rounds: dict[str, list[dict[str, float]]] = {name: [] for name in columns}
    for _ in range(ROUNDS):  # in turn, so that other work of the machine slows all functions
        for name, calls in columns.items():
            rounds[name].append({function: _us(*call) for function, call in calls.items()})
    statistics = ["median", "min", "max"]
    times = {name: pd.DataFrame(rows).agg(statistics).T for name, rows in rounds.items()}
    print("CPU microseconds a trial", pd.concat(times, axis=1).round(2).to_string(), sep="\n")
    table = pd.DataFrame({name: of_task["median"] for name, of_task in times.items()})
    rows = [f"{HEAD} {' | '.join(columns)} |", "| --- |" + " ---: |" * len(columns)]
    for function, cells in table.map("{:.3g}".format).iterrows():
        rows.append(f"| {function} | {' | '.join(cells)} |")
    before, found, after = PAGE.read_text(encoding="utf-8").partition(HEAD)
    assert found, f"{PAGE} has no table that begins with {HEAD}"
    after = after[after.index("\n\n") :]
    PAGE.write_text(before + "\n".join(rows) + after, encoding="utf-8")


def functions(task: Task) -> dict[str, tuple[int, Callable[[], object]]]:
    """Return, by name, a number of trials and a function that makes them.

    The targets are near the solution of CMA-ES, so that few goals are missed. The actions of
    environments are near the postures of the corrective process instead.
    """
    session = Session(task, 0, CMAES.information)
    solution = CMAES(CMAES.Parameters(trials=3000)).solve(session).solution
    hands = "".join(movement.hand[0].upper() for movement in solution)
    best = np.array([movement.target for movement in solution])
    cost = Objective(session, hands)
    noise = 0.005 * np.random.default_rng(0).standard_normal((1000, *best.shape)) * cost.joints
    targets = best + noise
    points, solutions = targets[:100, cost.joints], [movements_of(hands, t) for t in targets[:100]]
    reference = session.trials(hands, targets)
    in_c = trials_in_c(task, hands, targets)
    assert all((make() == reference.ticks).all() for make in in_c.values())
    env = TaskEnv(task)
    shape = (len(best), *env.action_space.shape)
    actions = np.random.default_rng(0).uniform(-0.1, 0.1, shape)

    def episode() -> None:
        env.reset()
        for action in actions:
            env.step(action)

    return {
        **{name: (1000, make) for name, make in in_c.items()},
        "objective, one by one": (100, lambda: [cost(point) for point in points]),
        "Session.trial, one by one": (100, lambda: [session.trial(each) for each in solutions]),
        "execute, one by one": (100, lambda: [execute(task, each) for each in solutions]),
        "environment, one by one": (25, lambda: [episode() for _ in range(25)]),
        "Session.trials, 10,000 at once": (
            10_000,
            lambda: session.trials(hands, np.tile(targets, (10, 1, 1))),
        ),
        "objective.many, 1000 at once": (1000, lambda: cost.many(targets[:, cost.joints])),
    }


def _us(trials: int, make: Callable[[], object]) -> float:
    """Return the CPU time of a trial, in µs, of a function that makes trials.

    The function ``make`` makes ``trials`` trials.
    """
    started = time.process_time()  # CPU time of all threads
    make()
    return (time.process_time() - started) / trials * 1e6


def _us_a_trial(task: Task, condition: str, runs: int) -> float:
    started = time.thread_time()
    learn_many(task, CONDITIONS[condition], seeds=range(runs), jobs=1)
    return (time.thread_time() - started) / runs / TRIALS * 1e6


if __name__ == "__main__":
    main()
