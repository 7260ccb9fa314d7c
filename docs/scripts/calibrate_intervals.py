"""Measure the coverage of intervals and a test's error rate on known populations.

    python docs/scripts/calibrate_intervals.py docs/stored/intervals

The script writes coverage.csv, with a row for each procedure and number of runs (or tasks). From
each of several populations that resemble rewards, it draws 500 samples. For an interval, it counts
the share of samples whose 95 % interval contains the true value. For a test, it counts the share of
samples in which the test at 5 % rejects a null hypothesis that is true. The columns ``min`` and
``max`` are the smallest and the largest of these shares over the populations.
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
"""Populations that resemble rewards: functions of a random generator and a number of values.
Rewards are rounded to ticks; some are skewed, and some have two levels, which depend on the hands
that a run learns."""
GAP, SPREAD = 0.1, 0.02
"""Mean of the exponential distribution of the gaps of tasks, and mean of the exponential
distribution of what a run adds to the gap of its task."""


def holds(interval, truth):
    """Return True if an interval (an Estimate) contains a value, up to rounding."""
    return interval.low - 1e-9 <= truth <= interval.high + 1e-9


def of_rewards(rng, draw, n, truth):
    """Apply each procedure to two samples from a population with known mean.

    Each sample has n values. Returns a dict of booleans: for each interval, whether it contains the
    true value; and for each test, whether it rejects the null hypothesis, which is true.
    """
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
    """Return whether the interval over n random tasks contains the mean gap."""
    gaps = [gap + rng.exponential(SPREAD, 5) for gap in rng.exponential(GAP, n)]
    return {"mean over random tasks": holds(other_tasks({"family": gaps}), GAP + SPREAD)}


def calibrate():
    """Return the smallest and the largest share for each procedure and each sample size."""
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
