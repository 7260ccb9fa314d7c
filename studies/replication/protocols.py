"""Run EC4 on two-armed task 1 with other exploration and with longer practice.

    python studies/replication/protocols.py

The script writes runs.csv.xz, with a row for each run, and ec4.csv, with the spread of rewards.
"""

from dataclasses import replace
from pathlib import Path

import pandas as pd

import coartic

TRIALS = 10_000
SETTINGS = {
    "published": (500, TRIALS, {}),
    "epsilon 0.1": (200, TRIALS, {"epsilon": 0.1}),
    "noise 0.04": (200, TRIALS, {"noise_sd": 0.04}),
    "noise 0.06": (200, TRIALS, {"noise_sd": 0.06}),
    "30,000 trials": (100, 30_000, {}),
}
"""Number of runs, number of trials, and fields that differ from EC4, by setting."""


def vary_ec4():
    """Run the settings of EC4, and return a row for each run.

    The seeds are not used for any other results.
    """
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
    """Make the runs, and write both tables."""
    runs = vary_ec4()
    stored = {"ec4.csv": tabulate_ec4(runs), "runs.csv.xz": runs.set_index("task")}
    for name, table in stored.items():
        table.to_csv(Path(__file__).with_name(name), float_format="%.6g")


if __name__ == "__main__":
    main()
