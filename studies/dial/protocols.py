"""Run the informed learner along the dial, from trial and error to planning.

    python studies/dial/protocols.py results/dial

writes ``runs.csv``, a row for each run of the learner. A task is done at a time; what is done is
not done again. It takes about half an hour on two cores.
"""

import csv
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

import numpy as np

from coartic import CONDITIONS, corrective_trial, learn_many, load_task, objective

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


def run_task(name):
    """Run every setting on a task; rows of :data:`COLUMNS`."""
    task, rows = load_task(name), []
    one_armed, known = len(task.hands) == 1, -objective(task).best_known
    base = CONDITIONS["EC1" if one_armed else "EC4"]
    for setting, fields in SETTINGS.items():
        if one_armed and setting in ("hands", "all"):
            fields = {key: value for key, value in fields.items() if key != "hand_exploration"}
        trials = TRIALS if setting in LONG else FEW
        runs = learn_many(task, replace(base, **fields), seeds=range(RUNS), trials=trials, jobs=1)
        for number, run in enumerate(runs):
            best = np.maximum.accumulate(run.rewards.filled(-(10**9)))
            start = int(best[0])
            targets = [np.ceil(start + share * (known - start)) for share in (0.25, 0.5)]
            reached = np.searchsorted(best, targets) + 1.0
            reached[reached > trials] = np.inf if trials == TRIALS else np.nan
            done = run.execute()
            alone = corrective_trial(task, done.hands)
            first = np.nan
            if alone.completed:
                first = done.ticks_by_goal()[0] - alone.ticks_by_goal()[0]
            after = [int(best[made - 1]) if made <= trials else "" for made in AFTER]
            family = name.partition("/")[0]
            rows.append([
                name, family, setting, number, start, known, *after, *reached, first, done.hands,
            ])  # fmt: skip
    return rows


def main(folder):
    """Run all tasks, those of the paper first."""
    path = Path(folder) / "runs.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    with path.open(encoding="utf-8", newline="") as lines:
        done = {row["task"] for row in csv.DictReader(lines)}
    with ProcessPoolExecutor(2) as pool:
        tasks = [name for name in (*TASKS, *INSTANCES) if name not in done]
        for future in as_completed([pool.submit(run_task, name) for name in tasks]):
            with path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(future.result())


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/dial")
