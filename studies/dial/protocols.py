"""Run the informed learner along the dial: how far exploration leans towards the next goal.

    python studies/dial/protocols.py results/dial

writes

- ``runs.csv``, a row for each run of the learner;
- ``others.csv``, a row for each run of another method;
- ``shifts.csv``, a row for each goal before a goal that is moved;
- ``named_runs.csv``, a row for each run of a named setting on a task of the paper.

The rows of a task are written when all of its runs are finished. Tasks that a file has already are
not run again. All takes about an hour on two cores.
"""

import csv
import sys
from concurrent.futures import as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from settings import AFTER, FAMILIES, FEW, LONG, NAMED, RUNS, SETTINGS, TRIALS, base_of
from shifts import SHIFT_COLUMNS, SHIFT_TASKS, run_shifts

from coartic import MethodError, execute, learn_many, load_task, objective
from coartic.baselines.cma_es import CMAES
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.trajectory_optimisation import PathLength
from coartic.benchmarks.pool import process_pool
from coartic.method import run_method

TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
INSTANCES = [f"{family}/v1/i{number:03d}" for number in range(40) for family in FAMILIES]
COLUMNS = [
    "task", "family", "setting", "run", "corrective_best", "best_known",
    *(f"reward_{trials}" for trials in AFTER), "quarter", "half",
]  # fmt: skip
NAMED_RUNS = 20
NAMED_COLUMNS = ["task", "setting", "run", *(f"after_{trials}" for trials in AFTER[1:])]
MISSED = -(10**9)
"""Reward of a trial that misses a goal. It is lower than any other reward."""
OTHERS = {
    "CMA-ES": (CMAES, RUNS),
    "posture planning": (TwoGoals, 1),
    "shortest path": (PathLength, 1),
}
"""Methods other than the learner, with their numbers of runs on a task. All runs of a planner are
the same."""


def run_task(name):
    """Run every setting on a task, and return rows of :data:`COLUMNS`."""
    task, rows = load_task(name), []
    for setting, fields in SETTINGS.items():
        if len(task.hands) == 1:
            fields = {key: value for key, value in fields.items() if key != "hand_exploration"}
        condition = replace(base_of(task), **fields)
        trials = TRIALS if setting in LONG else FEW
        runs = learn_many(task, condition, seeds=range(RUNS), trials=trials, jobs=1)
        rows += [row_of(task, setting, number, run.rewards.filled(MISSED))
                 for number, run in enumerate(runs)]  # fmt: skip
    return rows


def row_of(task, setting, number, rewards):
    """Return a row of :data:`COLUMNS`.

    ``quarter`` and ``half`` are the numbers of trials until the best reward so far has covered this
    share of the distance from the reward of the corrective process alone to the best known reward.
    If a run does not get there, they are infinite, or NaN if it has fewer than :data:`TRIALS`
    trials.
    """
    start, best_known = span_of(task)
    best, trials = np.maximum.accumulate(rewards), len(rewards)
    targets = [np.ceil(start + share * (best_known - start)) for share in (0.25, 0.5)]
    reached = np.searchsorted(best, targets) + 1.0
    reached[reached > trials] = np.inf if trials == TRIALS else np.nan
    after = [int(best[n - 1]) if n <= trials else "" for n in AFTER]
    family = task.name.partition("/")[0]
    return [task.name, family, setting, number, start, best_known, *after, *reached]


def span_of(task):
    """Return the two rewards between which the gain on a task is measured.

    They are the reward of the corrective process alone with its best hands, and the best known
    reward.
    """
    problem = objective(task)
    return -int(problem.best_cost), -problem.best_known


def run_others(name):
    """Run the other methods on a task, and return rows of :data:`COLUMNS`.

    A planner makes no trial: its plan is executed once. A method that fails has no gain.
    """
    task, rows = load_task(name), []
    for setting, (method, runs) in OTHERS.items():
        for number in range(runs):
            try:
                result, session = run_method(method(), task, number)
                rewards = session.rewards or [execute(task, result.solution).reward]
            except MethodError:
                rewards = [span_of(task)[0]]
            every = np.full(TRIALS, MISSED)
            every[: len(rewards)] = [MISSED if reward is None else reward for reward in rewards]
            rows.append(row_of(task, setting, number, every))
    return rows


def run_named(name):
    """Run the named settings on a task, and return rows of :data:`NAMED_COLUMNS`.

    ``after_N`` is the best reward after N trials.
    """
    task, rows = load_task(name), []
    for setting, fields in NAMED.items():
        condition = replace(base_of(task), **fields)
        runs = learn_many(task, condition, seeds=range(NAMED_RUNS), trials=TRIALS, jobs=1)
        for number, run in enumerate(runs):
            best = np.maximum.accumulate(run.rewards.filled(MISSED))
            rows.append([name, setting, number, *(int(best[n - 1]) for n in AFTER[1:])])
    return rows


PARTS = {
    "runs": (run_task, COLUMNS, (*TASKS, *INSTANCES)),
    "others": (run_others, COLUMNS, (*TASKS, *(name for name in INSTANCES if name[-3:] < "010"))),
    "shifts": (run_shifts, SHIFT_COLUMNS, SHIFT_TASKS),
    "named_runs": (run_named, NAMED_COLUMNS, TASKS),
}
"""For each file: the function that makes the rows of a task, the columns, and the tasks."""


def main(folder):
    """Run all parts on all tasks, those of the paper first."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    with process_pool(2) as pool:
        futures = {}
        for part, (run, columns, tasks) in PARTS.items():
            path = Path(folder) / f"{part}.csv"
            if not path.exists():
                path.write_text(",".join(columns) + "\n", encoding="utf-8")
            done = {*pd.read_csv(path).task}
            futures |= {pool.submit(run, name): path for name in tasks if name not in done}
        for future in as_completed(futures):
            with futures[future].open("a", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(future.result())


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/dial")
