"""Measure what is left of the learner's excess over one selection where it has gained as much.

    coartic run studies/memory/one-selection.toml --out results/one-selection
    python studies/memory/one_selection.py results/one-selection

writes

- one_selection.csv.xz, with a row for each run;
- one_selection.csv, with a row for each task and signature. It has the value of random search (the
  best of 10,000 trials), and by how much the learner exceeds it after as many trials (``more``),
  and after the number of trials at which its gain is nearest to that of random search (``equal``).

On two arms, both have the hands in which the learner's runs end. Without a folder, the table is
made again from the stored runs.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from cells import (
    CONTEXTS,
    MEASURES,
    POSTURE,
    TRIALS,
    distance,
    measure_postures,
    measure_runs,
    postures,
)

from coartic.analysis import load
from coartic.estimates import Estimate, difference_of_means

HERE = Path(__file__)
RESAMPLES = 9_999
COLUMNS = ["task", "name", "trials", "run", "hands", *MEASURES, *POSTURE]


def rows_of(study):
    """Return the runs by task. Only runs on :data:`CONTEXTS` have the posture at goal 1."""
    runs = measure_runs(study)
    others = runs[~runs.task.isin(CONTEXTS)]
    rows = pd.concat([measure_postures(study, runs), others])
    return rows[COLUMNS].set_index("task")


def tabulate(runs):
    """Return the table; posture differences are those at the first goal of two tasks."""
    runs, rows = runs.reset_index(), {}
    for task, of_task in runs.groupby("task", sort=False):
        search = of_task[of_task.name == "random search"]
        learner = of_task[of_task.name == "learner"]
        commonest = learner.hands[learner.trials == TRIALS].mode()[0]
        learner = learner[learner.hands == commonest]
        equal = as_much(learner, search)
        for measure in MEASURES:
            theirs = search[measure].dropna()
            if len(theirs):
                rows[f"{task} {measure}"] = row_of(theirs.mean(), equal, {
                    word: difference_of_means(learner[measure][learner.trials == trials], theirs)
                    for word, trials in (("more", TRIALS), ("equal", equal))
                })  # fmt: skip
    both = runs[runs.task.isin(CONTEXTS)]
    search, learner = (both[both.name == name] for name in ("random search", "learner"))
    equal = as_much(learner, search)
    theirs = postures(search)
    rows["contexts posture"] = row_of(distance(theirs), equal, {
        word: excess(postures(learner[learner.trials == trials]), theirs)
        for word, trials in (("more", TRIALS), ("equal", equal))
    })  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def as_much(learner, search):
    """Return the number of trials at which the learner's gain is nearest to random search's.

    Gains are means over tasks, which all have the same weight.
    """
    gains = learner.groupby(["trials", "task"]).gain.mean().groupby("trials").mean()
    return int((gains - search.groupby("task").gain.mean().mean()).abs().idxmin())


def row_of(value, trials, excesses):
    """Return a row of the table: random search's value, and estimates by the word of the column."""
    row = {"random_search": value, "trials": trials}
    for word, estimate in excesses.items():
        row |= estimate.columns(word)
    return row


def excess(ours, theirs):
    """Return by how much a posture difference exceeds another, with an interval.

    The ends of the interval are percentiles of a bootstrap of runs.
    """
    rng, groups = np.random.default_rng(0), [*ours, *theirs]
    drawn = [distance(resampled[:2]) - distance(resampled[2:]) for resampled in (
        [group[rng.integers(len(group), size=len(group))] for group in groups]
        for _ in range(RESAMPLES)
    )]  # fmt: skip
    value = distance(ours) - distance(theirs)
    return Estimate(value, *map(float, np.quantile(drawn, [0.025, 0.975])))


if __name__ == "__main__":
    if sys.argv[1:]:
        rows_of(load(sys.argv[1])).to_csv(HERE.with_suffix(".csv.xz"), float_format="%.6g")
    stored = pd.read_csv(HERE.with_suffix(".csv.xz"), index_col=0)
    tabulate(stored).to_csv(HERE.with_suffix(".csv"), float_format="%.6g")
