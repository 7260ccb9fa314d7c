"""Run what no suite has: random search in wide boxes, and EC4 with other spreads.

    python studies/replication/protocols.py

writes boxes.csv and ec4.csv, in nine minutes of a core. boxes.csv asks if selection alone can show
as much, where it succeeds: uniform targets in a box around the corrective process's postures, and
what the runs show that improve on the corrective process alone. ec4.csv has the spread of EC4 on
two-armed task 1 under other exploration and longer practice.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import coartic

BOXES = {0.12: 100, 0.25: 400, 0.3: 400, 0.35: 800, 0.4: 800}
"""Runs on each task by half width, length unit and rad."""
TRIALS = 10_000
TASKS = "ascending", "descending"
SETTINGS = {
    "published": (500, TRIALS, {}),
    "epsilon 0.1": (200, TRIALS, {"epsilon": 0.1}),
    "noise 0.04": (200, TRIALS, {"noise_sd": 0.04}),
    "noise 0.06": (200, TRIALS, {"noise_sd": 0.06}),
    "30,000 trials": (100, 30_000, {}),
}
"""Runs, trials, and fields that differ from EC4."""


def search_boxes():
    """Return the table of boxes: a row for each half width."""
    rows = []
    for width, runs in BOXES.items():
        row, means = {"half_width": width, "runs": runs}, []
        for name in TASKS:
            first, postures = improved_runs(name, width, runs)
            row |= {f"improved_{name}": len(first), f"first_{name}": np.mean(first or [np.nan])}
            means.append(np.mean(postures, axis=0) if postures else np.nan)
        rows.append(row | {"posture_difference": np.linalg.norm(means[0] - means[1])})
    return pd.DataFrame(rows).set_index("half_width")


def improved_runs(name, width, runs):
    """Return first movements, ticks slower than the corrective process's, and configurations at
    goal 1 of the runs that improve on the corrective process alone."""
    task = coartic.load_task(name)
    alone = coartic.corrective_trial(task, "RRR")
    problem = coartic.objective(task, half_width=width)
    first, postures = [], []
    for seed in range(runs):
        rng, cost = np.random.default_rng([2013, seed]), problem.fresh()
        for _ in range(TRIALS // 500):
            cost.many(rng.uniform(*cost.bounds.T, (500, cost.dim)))
        if cost.best_cost < alone.ticks:
            run = coartic.execute(task, cost.solution)
            first.append(run.ticks_by_goal()[0] - alone.ticks_by_goal()[0])
            postures.append(run.configurations[0])
    return first, postures


def vary_ec4():
    """Return the table of settings of EC4, with seeds that no other results have."""
    rows = []
    for setting, (runs, trials, fields) in SETTINGS.items():
        rules = replace(coartic.CONDITIONS["EC4"], **fields)
        seeds = range(5000, 5000 + runs)
        done = coartic.learn_many("two-armed-1", rules, seeds=seeds, trials=trials, jobs=1)
        rewards = np.array([run.reward for run in done if run.execute().hands == "LRLR"], float)
        row = {"setting": setting, "runs": runs, "lrlr": len(rewards)}
        rows.append(row | {"reward": rewards.mean(), "reward_sd": rewards.std(ddof=1)})
    return pd.DataFrame(rows).set_index("setting")


if __name__ == "__main__":
    for name, table in (("boxes", search_boxes()), ("ec4", vary_ec4())):
        table.to_csv(Path(__file__).with_name(f"{name}.csv"), float_format="%.6g")
