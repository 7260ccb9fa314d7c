"""Run the informed learner along the dial, from trial and error to planning.

    python studies/dial/protocols.py results/dial

writes ``runs.csv``, a row for each run of the learner, ``others.csv``, a row for each run of
another method, and ``shifts.csv``, a row for each goal before a goal that is moved. A task is done
at a time; what is done is not done again. It takes about an hour on two cores.
"""

import csv
import runpy
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np

from coartic import (
    CONDITIONS,
    MethodError,
    corrective_trial,
    execute,
    learn,
    learn_many,
    load_task,
    objective,
)
from coartic.baselines.cma_es import CMAES
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.trajectory_optimisation import PathLength
from coartic.method import run_method

FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
INSTANCES = [f"{family}/v1/i{number:03d}" for number in range(40) for family in FAMILIES]
DRIFTS, NOISES = (0.03, 0.1, 0.3, 1.0), (0.01, 0.05)
TRIALS, RUNS, AFTER = 10_000, 3, (30, 100, 1_000, 10_000)
SETTINGS = {
    **{f"0 {sigma}": {"noise_sd": sigma} for sigma in NOISES},
    **{
        f"{kappa:g} {sigma} {direction}": {
            "drift": kappa, "noise_sd": sigma, "direction": direction
        }
        for kappa in DRIFTS for sigma in NOISES for direction in ("next-goal", "stay", "start")
    },
    "1 0": {"drift": 1.0, "noise_sd": 0.0},
    "correction": {"pull": 0.05},
    "hands": {"hand_exploration": "nearest-posture"},
    "all": {"drift": 0.3, "pull": 0.05, "hand_exploration": "nearest-posture"},
    "drawn": {"drift": (0.0, *DRIFTS)},
}  # fmt: skip
"""Fields that differ from the paper's condition: EC1 on tasks for one arm, EC4 on tasks for two."""
FEW = 1_000
"""Trials of settings that are not among the next."""
LONG = (
    "0 0.05", *(f"{kappa:g} 0.05 next-goal" for kappa in DRIFTS), "1 0.01 next-goal", "1 0",
    "1 0.05 start", "hands", "drawn", "all",
)  # fmt: skip
"""Settings with all trials: the dial itself, and what claims ask of the end."""
COLUMNS = [
    "task", "family", "setting", "run", "initial", "best_known",
    *(f"reward_{trials}" for trials in AFTER), "quarter", "half", "first", "hands",
]  # fmt: skip
OTHERS = {
    "CMA-ES": (CMAES, RUNS),
    "posture planning": (TwoGoals, 1),
    "shortest path": (PathLength, 1),
}
"""Other methods than the learner, and their runs on a task; planners are the same in each."""
SHIFTED = ("0 0.05", *(f"{kappa:g} 0.05 next-goal" for kappa in DRIFTS[1:]), "1 0.01 next-goal")
"""Settings that practise, hear of a goal that has moved, and practise again."""
SHIFT_TASKS = [f"{family}/v1/i{number:03d}" for number in range(30) for family in FAMILIES[:2]]
SHIFT_AFTER = (1, 2, 3, 10, 30, 100, 300, 1_000, 10_000)
"""Trials after the change at which the solution is looked at; the last is all of practice."""
SHIFT_COLUMNS = ["task", "setting", "goal", "same", "square", *(f"dot_{n}" for n in SHIFT_AFTER)]


def base_of(task):
    """Return the paper's condition that explores most of what the robot has."""
    return CONDITIONS["EC1" if len(task.hands) == 1 else "EC4"]


def run_task(name):
    """Run every setting on a task; rows of :data:`COLUMNS`."""
    task, rows = load_task(name), []
    one_armed, best_known = len(task.hands) == 1, -objective(task).best_known
    base = base_of(task)
    for setting, fields in SETTINGS.items():
        if one_armed and setting in ("hands", "all"):
            fields = {key: value for key, value in fields.items() if key != "hand_exploration"}
        trials = TRIALS if setting in LONG else FEW
        runs = learn_many(task, replace(base, **fields), seeds=range(RUNS), trials=trials, jobs=1)
        for number, run in enumerate(runs):
            best = np.maximum.accumulate(run.rewards.filled(-(10**9)))
            start = int(best[0])
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


def trials_to_shares(best, start, best_known):
    """Return the trials until the best reward so far is a quarter and half of the way from a first
    reward to the best known, one more than all where it never is."""
    targets = [np.ceil(start + share * (best_known - start)) for share in (0.25, 0.5)]
    return np.searchsorted(best, targets) + 1.0


def run_others(name):
    """Run the other methods on a task; rows of :data:`COLUMNS`.

    The gain counts from the learner's initial solution. A planner makes no trial: its plan is
    executed once. A method that fails gains nothing.
    """
    task, rows = load_task(name), []
    start = int(learn(task, base_of(task), seed=0, trials=1).rewards[0])
    best_known = -objective(task).best_known
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


def run_shifts(name):
    """Let learners practise a task, move the goal after a goal by half a link, and follow the
    posture at that goal while they practise on; rows of :data:`SHIFT_COLUMNS`.

    As in study tell-apart: at the change the learner keeps its movements and drops the rewards.
    ``dot_N`` is the shift of the posture after N trials times the shift after all of them,
    ``square`` the latter squared, ``same`` such a product for practice without a change.
    """
    tell_apart = runpy.run_path(str(Path(__file__).parents[1] / "tell-apart" / "protocols.py"))
    task, seed, rows = load_task(name), SHIFT_TASKS.index(name), []
    moved = tell_apart["moves"](task, seed)
    cases = [(g, other) for g, distance, other in moved if distance == 0.5]
    for setting in SHIFTED:
        condition = replace(base_of(task), **SETTINGS[setting])

        def postures(changed, seed, trials, start, condition=condition):
            run = learn(changed, condition, seed=seed, trials=trials, start=start)
            return execute(changed, run.solution).configurations

        practised = learn(task, condition, seed=10 * seed, trials=TRIALS).solution
        before = execute(task, practised).configurations
        went_on = postures(task, 10 * seed + 1, TRIALS, practised)
        for g, other in cases:
            after = [postures(other, 10 * seed + 1, n, practised)[g] for n in SHIFT_AFTER]
            shifts = np.array(after) - before[g]
            same = (went_on[g] - before[g]) @ shifts[-1]
            rows.append([name, setting, g, same, shifts[-1] @ shifts[-1], *(shifts @ shifts[-1])])
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
