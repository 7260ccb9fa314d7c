"""Compare intervals and a test with the truth, on samples of known populations.

    python docs/scripts/calibrate_intervals.py docs/stored/intervals

Writes coverage.csv, a row for each procedure and number of runs (or tasks): the smallest and the
largest share of 500 samples, over populations like rewards, in which a 95 % interval holds the true
value, or in which a test at 5 % rejects a hypothesis that is true.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from coartic import estimates
from coartic.analysis.statistics import bootstrap_test, other_tasks

SAMPLES, SIZES, LEVEL = 500, (5, 20, 100), 0.05
POPULATIONS = {
    "ties": lambda rng, n: -300 + rng.normal(0, 3, n).round(),
    "skew": lambda rng, n: -300 - rng.exponential(8, n).round(),
    "two levels": lambda rng, n: np.where(
        rng.random(n) < 0.7, -331 + rng.normal(0, 5, n), -355 + rng.normal(0, 1, n)
    ).round(),
}
"""Rewards as they occur: rounded, skewed, and on two levels by the hands that are learned."""
GAP, SPREAD = 0.1, 0.02
"""Means of exponential gaps of tasks, and of what a run adds to them."""


def holds(interval, truth):
    """Return whether an interval holds a value, to rounding."""
    return interval.low - 1e-9 <= truth <= interval.high + 1e-9


def of_rewards(rng, draw, n, truth):
    """Return what each procedure makes of two samples of one population with a known mean."""
    first, second = draw(rng, n), draw(rng, n)
    welch = stats.ttest_ind(first, second, equal_var=False).confidence_interval()
    return {
        "BCa, mean": holds(estimates.mean(first), truth),
        "BCa, difference of two means": holds(estimates.difference_of_means(first, second), 0),
        "BCa, mean of paired differences": holds(estimates.mean(first - second), 0),
        "Welch's, to a published mean": holds(welch, 0),
        **{
            f"rejected by the bootstrap, {side}": bootstrap_test(first, truth, side).p <= LEVEL
            for side in ("greater", "less")
        },
    }


def of_tasks(rng, n):
    """Return whether the interval over n random tasks, five runs each, holds the mean gap."""
    gaps = [gap + rng.exponential(SPREAD, 5) for gap in rng.exponential(GAP, n)]
    return {"mean over random tasks": holds(other_tasks({"family": gaps}), GAP + SPREAD)}


def calibrate():
    """Return the shares by procedure and size."""
    rng, rows = np.random.default_rng(0), []
    for n in SIZES:
        shares = [pd.DataFrame([of_tasks(rng, n) for _ in range(SAMPLES)]).mean()]
        for draw in POPULATIONS.values():
            truth = float(draw(rng, 4_000_000).mean())
            seen = pd.DataFrame([of_rewards(rng, draw, n, truth) for _ in range(SAMPLES)])
            shares.append(seen.mean())
        found = pd.concat(shares).groupby(level=0).agg(["min", "max"])
        rows.append(found.assign(runs=n).rename_axis("procedure"))
        print(rows[-1], flush=True)
    return pd.concat(rows)


if __name__ == "__main__":
    calibrate().to_csv(Path(sys.argv[1]) / "coverage.csv", float_format="%.3f")
