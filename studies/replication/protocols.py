"""Run what no suite has: random search in wide boxes, and EC4 with other spreads.

    python studies/replication/protocols.py

writes runs.csv.xz, a row for each run, and of it boxes.csv and ec4.csv, in nine minutes of a core.
boxes.csv asks if selection alone can show as much, where it succeeds: uniform targets in a box
around the corrective process's postures, and what the runs show that improve on the corrective
process alone. ec4.csv has the spread of EC4 on two-armed task 1 under other exploration and longer
practice.
"""

import itertools
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
    """Run random search in each box; a frame with a row for each run.

    ``first``: ticks by which the first movement is slower than the corrective process's;
    ``joint_1`` and so on: configuration at goal 1. Both of runs that improve on the corrective
    process alone.
    """
    rows = []
    for (width, runs), name in itertools.product(BOXES.items(), TASKS):
        task = coartic.load_task(name)
        alone = coartic.corrective_trial(task, "RRR")
        problem = coartic.objective(task, half_width=width)
        for seed in range(runs):
            rng, cost = np.random.default_rng([2013, seed]), problem.fresh()
            for _ in range(TRIALS // 500):
                cost.many(rng.uniform(*cost.bounds.T, (500, cost.dim)))
            row = {"half_width": width, "task": name, "seed": seed, "reward": -int(cost.best_cost)}
            if cost.best_cost < alone.ticks:
                run = coartic.execute(task, cost.solution)
                row["first"] = run.ticks_by_goal()[0] - alone.ticks_by_goal()[0]
                row |= {f"joint_{n}": angle for n, angle in enumerate(run.configurations[0], 1)}
            rows.append(row)
    return pd.DataFrame(rows)


def tabulate_boxes(runs):
    """Return the table of boxes: a row for each half width."""
    rows = []
    for width, of_width in runs.groupby("half_width", sort=False):
        row, means = {"half_width": width, "runs": BOXES[width]}, []
        for name in TASKS:
            improved = of_width[(of_width.task == name) & of_width["first"].notna()]
            row |= {f"improved_{name}": len(improved), f"first_{name}": improved["first"].mean()}
            means.append(improved.filter(like="joint_").mean())
        rows.append(row | {"posture_difference": np.linalg.norm(means[0] - means[1])})
    return pd.DataFrame(rows).set_index("half_width")


def vary_ec4():
    """Run the settings of EC4, with seeds that no other results have; a row for each run."""
    rows = []
    for setting, (runs, trials, fields) in SETTINGS.items():
        rules = replace(coartic.CONDITIONS["EC4"], **fields)
        seeds = range(5000, 5000 + runs)
        done = coartic.learn_many("two-armed-1", rules, seeds=seeds, trials=trials, jobs=1)
        for seed, run in zip(seeds, done, strict=True):
            row = {"setting": setting, "task": "two-armed-1", "seed": seed}
            rows.append(row | {"reward": run.reward, "hands": run.execute().hands})
    return pd.DataFrame(rows)


def tabulate_ec4(runs):
    """Return the table of settings of EC4: rewards of runs that end with hands LRLR."""
    table = runs.groupby("setting", sort=False).agg(runs=("reward", "size"))
    rewards = runs[runs.hands == "LRLR"].groupby("setting", sort=False).reward
    return table.assign(lrlr=rewards.size(), reward=rewards.mean(), reward_sd=rewards.std())


def main():
    """Make the runs, and the tables of them."""
    boxes, ec4 = search_boxes(), vary_ec4()
    runs = pd.concat([boxes, ec4], ignore_index=True)
    stored = {"boxes.csv": tabulate_boxes(boxes), "ec4.csv": tabulate_ec4(ec4),
              "runs.csv.xz": runs.set_index("task")}  # fmt: skip
    for name, table in stored.items():
        table.to_csv(Path(__file__).with_name(name), float_format="%.6g")


if __name__ == "__main__":
    main()
