"""Compare random search with itself, to see how often the tests of signatures are significant.

    python docs/scripts/calibrate_control.py docs/stored/random-search

Random search is the control of signatures. The script draws 500 pairs of samples from the shipped
runs of random search on both one-armed tasks. Each sample has 20 runs. The script compares the two
samples of a pair in the same way in which a learner is compared with random search. It writes
calibration.csv: for each test, the share of pairs in which the test is significant at 5 %.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import load
from coartic.analysis.signatures import beyond_p
from coartic.analysis.statistics import exchange_test
from coartic.estimates import LEVEL

PAIRS, RUNS = 500, 20
TASKS, SEARCH = ("ascending", "descending"), "random-search"


def calibrate(study):
    """Return the share of pairs that differ significantly, for each test."""
    rng = np.random.default_rng(0)
    first = [study.signature("first", task, SEARCH).dropna().to_numpy() for task in TASKS]
    at_goal = [study.configurations(task, SEARCH)[:, 0] for task in TASKS]
    rows = []
    for _ in range(PAIRS):
        drawn = [np.split(rng.permutation(len(values))[: 2 * RUNS], 2) for values in first]
        one, other = zip(*drawn, strict=True)
        row = {
            f"first movement, {task}": exchange_test(values[mine], values[theirs]).p
            for task, values, mine, theirs in zip(TASKS, first, one, other, strict=True)
        }
        mine, theirs = (
            [q[which] for q, which in zip(at_goal, side, strict=True)] for side in (one, other)
        )
        rows.append(row | {"posture": beyond_p(mine, theirs, rng, resamples=999)})
    shares = (pd.DataFrame(rows) < LEVEL).mean()
    return shares.rename("significant").rename_axis("compared").to_frame()


if __name__ == "__main__":
    calibrate(load("shipped").worlds[""]).to_csv(
        Path(sys.argv[1]) / "calibration.csv", float_format="%.3f"
    )
