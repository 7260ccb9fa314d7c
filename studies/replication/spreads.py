"""Measure the spread of EC4 on two-armed task 1 under other exploration and longer practice.

    python studies/replication/spreads.py

writes ec4.csv, a row for each setting, in four minutes of a core.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import CONDITIONS, learn_many

SETTINGS = {
    "published": (500, 10_000, {}),
    "epsilon 0.1": (200, 10_000, {"epsilon": 0.1}),
    "noise 0.04": (200, 10_000, {"noise_sd": 0.04}),
    "noise 0.06": (200, 10_000, {"noise_sd": 0.06}),
    "30,000 trials": (100, 30_000, {}),
}
"""Runs, trials, and fields that differ from EC4."""


def main():
    """Run the settings, with seeds that no other results have."""
    rows = []
    for setting, (runs, trials, fields) in SETTINGS.items():
        rules = replace(CONDITIONS["EC4"], **fields)
        seeds = range(5000, 5000 + runs)
        done = learn_many("two-armed-1", rules, seeds=seeds, trials=trials, jobs=1)
        rewards = np.array([run.reward for run in done if run.execute().hands == "LRLR"], float)
        row = {"setting": setting, "runs": runs, "lrlr": len(rewards)}
        rows.append(row | {"reward": rewards.mean(), "reward_sd": rewards.std(ddof=1)})
    stored = Path(__file__).with_name("ec4.csv")
    pd.DataFrame(rows).to_csv(stored, index=False, float_format="%.6g", lineterminator="\n")


if __name__ == "__main__":
    main()
