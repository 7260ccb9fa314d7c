"""Measure named settings of the dial on the paper's tasks.

    python studies/dial/named.py

writes named.csv: mean rewards after 100, 1,000 and 10,000 trials of twenty runs, of the paper's
learner, of the default informed learner, and of a learner that leans towards the next goal with
less noise and more exploration of hands, next to its control without drift.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from settings import base_of

import coartic

AFTER, RUNS = (100, 1_000, 10_000), 20
LESS_NOISE = {"noise_sd": 0.01, "epsilon": 0.4}
NAMED = {
    "paper": {},
    "informed": {"drift": 1.0},
    "drift 1, noise 0.01, epsilon 0.4": {"drift": 1.0, **LESS_NOISE},
    "no drift, noise 0.01, epsilon 0.4": LESS_NOISE,
}
"""Fields that differ from the paper's condition."""


def main():
    """Run every setting on every task of the paper and write the table."""
    rows = []
    for name in coartic.builtin_tasks():
        task = coartic.load_task(name)
        for setting, fields in NAMED.items():
            condition = replace(base_of(task), **fields)
            runs = coartic.learn_many(task, condition, seeds=range(RUNS), trials=max(AFTER))
            best = [np.fmax.accumulate(run.rewards)[np.array(AFTER) - 1] for run in runs]
            means = dict(zip((f"after_{n}" for n in AFTER), np.mean(best, axis=0), strict=True))
            rows.append({"row": f"{name} {setting}", "task": name, "setting": setting,
                         "runs": RUNS, **means})  # fmt: skip
    table = pd.DataFrame(rows).set_index("row")
    table.to_csv(Path(__file__).with_name("named.csv"), float_format="%.6g")


if __name__ == "__main__":
    main()
