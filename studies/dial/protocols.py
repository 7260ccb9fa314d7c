"""Run the informed learner along the dial: how far exploration leans towards the next goal.

    python studies/dial/protocols.py results/dial

writes ``runs.csv``, a row for each run of the learner, ``others.csv``, a row for each run of
another method, and ``shifts.csv``, a row for each goal before a goal that is moved. A task is done
at a time; what is done is not done again. It takes about an hour on two cores.
"""

import csv
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np
from settings import AFTER, FAMILIES, FEW, LONG, RUNS, SETTINGS, TRIALS, base_of
from shifts import SHIFT_COLUMNS, SHIFT_TASKS, run_shifts

from coartic import (
    MethodError,
    corrective_trial,
    execute,
    learn_many,
    load_task,
    objective,
)
from coartic.baselines.cma_es import CMAES
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.trajectory_optimisation import PathLength
from coartic.method import run_method

TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
INSTANCES = [f"{family}/v1/i{number:03d}" for number in range(40) for family in FAMILIES]
COLUMNS = [
    "task", "family", "setting", "run", "corrective_best", "best_known",
    *(f"reward_{trials}" for trials in AFTER), "quarter", "half", "first", "hands",
]  # fmt: skip
OTHERS = {
    "CMA-ES": (CMAES, RUNS),
    "posture planning": (TwoGoals, 1),
    "shortest path": (PathLength, 1),
}
"""Other methods than the learner, and their runs on a task; planners are the same in each."""


def run_task(name):
    """Run every setting on a task; rows of :data:`COLUMNS`."""
    task, rows = load_task(name), []
    one_armed, base = len(task.hands) == 1, base_of(task)
    start, best_known = span_of(task)
    for setting, fields in SETTINGS.items():
        if one_armed and setting in ("hands", "all"):
            fields = {key: value for key, value in fields.items() if key != "hand_exploration"}
        trials = TRIALS if setting in LONG else FEW
        runs = learn_many(task, replace(base, **fields), seeds=range(RUNS), trials=trials, jobs=1)
        for number, run in enumerate(runs):
            best = np.maximum.accumulate(run.rewards.filled(-(10**9)))
            reached = trials_to_shares(best, start, best_known)
            reached[reached > trials] = np.inf if trials == TRIALS else np.nan
            done = run.execute()
            alone = corrective_trial(task, done.hands)
            first = np.nan
            if alone.completed:
                first = done.ticks_by_goal()[0] - alone.ticks_by_goal()[0]
            after = [int(best[n - 1]) if n <= trials else "" for n in AFTER]
            family = name.partition("/")[0]
            rows.append([
                name, family, setting, number, start, best_known, *after, *reached, first,
                done.hands,
            ])  # fmt: skip
    return rows


def span_of(task):
    """Return the reward of the corrective process alone with its best hands, from which the gain
    counts, and the best known reward."""
    problem = objective(task)
    return -int(problem.best_cost), -problem.best_known


def trials_to_shares(best, start, best_known):
    """Return the trials until the best reward so far is a quarter and half of the way from a first
    reward to the best known, one more than all where it never is."""
    targets = [np.ceil(start + share * (best_known - start)) for share in (0.25, 0.5)]
    return np.searchsorted(best, targets) + 1.0


def run_others(name):
    """Run the other methods on a task; rows of :data:`COLUMNS`.

    A planner makes no trial: its plan is executed once. A method that fails gains nothing.
    """
    task, rows = load_task(name), []
    start, best_known = span_of(task)
    for setting, (method, runs) in OTHERS.items():
        for number in range(runs):
            try:
                result, session = run_method(method(), task, number)
                done = execute(task, result.solution)
                rewards, hands = session.rewards or [done.reward] * TRIALS, done.hands
            except MethodError:
                rewards, hands = [start] * TRIALS, ""
            best = np.maximum.accumulate([-(10**9) if r is None else r for r in rewards])
            best = np.append(best, [best[-1]] * (TRIALS - len(best)))
            reached = trials_to_shares(best, start, best_known)
            reached[reached > TRIALS] = np.inf
            after = [int(best[n - 1]) for n in AFTER]
            family = name.partition("/")[0]
            rows.append([
                name, family, setting, number, start, best_known, *after, *reached, np.nan, hands
            ])  # fmt: skip
    return rows


PARTS = {
    "runs": (run_task, COLUMNS, (*TASKS, *INSTANCES)),
    "others": (run_others, COLUMNS, (*TASKS, *(name for name in INSTANCES if name[-3:] < "010"))),
    "shifts": (run_shifts, SHIFT_COLUMNS, SHIFT_TASKS),
}
"""Files, the function that makes the rows of a task, their columns, and the tasks."""


def main(folder):
    """Run all parts on all tasks, those of the paper first."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(2) as pool:
        futures = {}
        for part, (run, columns, tasks) in PARTS.items():
            path = Path(folder) / f"{part}.csv"
            if not path.exists():
                path.write_text(",".join(columns) + "\n", encoding="utf-8")
            with path.open(encoding="utf-8", newline="") as lines:
                done = {row["task"] for row in csv.DictReader(lines)}
            futures |= {pool.submit(run, name): path for name in tasks if name not in done}
        for future in as_completed(futures):
            with futures[future].open("a", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(future.result())


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/dial")
