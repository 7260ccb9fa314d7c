"""Tune the policy gradient, and hill climbing with a learned spread, on development instances.

    python docs/scripts/tune_rivals.py results/tuning docs/stored/tuning

Rule, which was written before the runs:

- Hill climbing with a learned spread, the policy gradient with a learned spread, and the policy
  gradient with a fixed spread have sixteen settings each (:data:`GRIDS`). Four settings of the
  policy gradient with a learned spread had been seen before, when its rule for the hands was chosen
  on the same instances: batches of 50, steps 2 and 4, spread steps 0.1 and 0.3.
- Each setting makes two runs of 10,000 trials on instances d000 to d002 of five families, without
  motor noise and with motor noise 0.01. No test instance and no task of the paper is seen.
- The value of a run is the number of ticks of its answer: without noise of its best trial; with
  noise the mean of 100 executions with noise in which it has not practised. A failed execution, and
  a run that fails, count as twice the ticks of the corrective process with its best hands.
- The setting with the smallest mean of the logarithm of this value, over families and worlds,
  becomes the default in both worlds.

Each run is written as a row into results/tuning/runs.csv as soon as it is made. Runs in this file
are not made again; remove the file after a change of a method. From these rows, the script writes
rivals.csv.
"""

import itertools
import os
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import PAPER, execute_noisy, load_task
from coartic.benchmarks.pool import process_pool
from coartic.method import MethodError, built_in_methods, run_method
from coartic.motion.initial_hands import best_hands
from coartic.runs.plan import judge_seed
from coartic.runs.record import NOISY_EXECUTIONS

FAMILIES = "one-armed", "two-armed", "aligned", "redundancy", "long"
INSTANCES = "d000", "d001", "d002"
NOISES = 0.0, 0.01
RUNS = 2
GRIDS = {
    ("hill-climbing", "learned"): {
        "window": (10, 25, 50, 100),
        "floor": (0.005, 0.01, 0.02, 0.03),
    },
    ("policy-gradient", "learned"): {
        "batch": (25, 50),
        "step": (2.0, 4.0),
        "spread_step": (0.01, 0.03, 0.1, 0.3),
    },
    ("policy-gradient", "fixed"): {
        "batch": (10, 25, 50, 100),
        "step": (1.0, 2.0, 4.0, 8.0),
    },
}
"""Maps each method and its value of the parameter ``spread`` to a grid: the values of each
parameter that is tuned."""
KEYS = ["run", "method", "spread", "setting", "family", "instance", "motor_noise"]


def planned():
    """Yield the keys of all runs (:data:`KEYS`), the first run of each setting first."""
    for run in range(RUNS):
        for (method, spread), grid in GRIDS.items():
            for values in itertools.product(*grid.values()):
                setting = ", ".join(map("{}={}".format, grid, values))
                for where in itertools.product(FAMILIES, INSTANCES, NOISES):
                    yield run, method, spread, setting, *where


def ticks_of(key):
    """Make the run of a key (:data:`KEYS`), and return its value in ticks."""
    run, name, spread, setting, family, instance, noise = key
    method = built_in_methods()[name]
    grid = GRIDS[name, spread]
    chosen = dict(item.split("=") for item in setting.split(", "))
    values = {name: type(grid[name][0])(value) for name, value in chosen.items()}
    task, world = load_task(f"{family}/v1/{instance}"), PAPER._replace(motor_noise=noise)
    failed = 2.0 * best_hands(task, PAPER)[1]
    solver = method(method.Parameters(spread=spread, **values))
    try:
        result, session = run_method(solver, task, run, model=world)
    except MethodError:
        return failed
    if noise == 0.0:
        return -float(max(reward for reward in session.rewards if reward is not None))
    seed = judge_seed(0, task.name, run)
    ticks = execute_noisy(task, [result.solution], noise, NOISY_EXECUTIONS, seed)[0]
    return float(np.where(np.isnan(ticks), failed, ticks).mean())


def make_runs(file):
    """Make the runs that a CSV file lacks, and append their rows.

    Each row is appended as soon as its run is made.
    """
    done = set()
    if file.is_file():
        done = {*pd.read_csv(file)[KEYS].itertuples(index=False, name=None)}
    keys = [key for key in planned() if key not in done]
    with process_pool(2) as pool, file.open("a", encoding="utf-8") as rows:
        if not done:
            print(*KEYS, "ticks", sep=",", file=rows)
        for key, ticks in zip(keys, pool.map(ticks_of, keys, chunksize=6), strict=True):
            run, method, spread, setting, *where = key
            print(
                run, method, spread, f'"{setting}"', *where, ticks, sep=",", file=rows, flush=True
            )


def table_of(runs):
    """Return a frame with a row for each setting, a method's best setting first.

    A row has the mean logarithm of ticks, and the geometric means of ticks over all runs, over the
    runs in each world, and over the runs in each family.
    """
    runs = runs.assign(log=np.log(runs.ticks), noise="noise=" + runs.motor_noise.astype(str))
    kinds = ["method", "spread", "setting"]
    means = runs.groupby(kinds).log.mean()
    parts = [
        runs.pivot_table(values="log", index=kinds, columns=column, sort=False)
        for column in ("noise", "family")
    ]
    table = means.to_frame("mean_log_ticks").join(np.exp(means).rename("ticks"))
    table = table.join([np.exp(part) for part in parts])
    table = table.reset_index()
    place = table.method + table.spread
    order = place.map({method + spread: n for n, (method, spread) in enumerate(GRIDS)})
    return table.iloc[np.lexsort([table.mean_log_ticks, order])]


def main():
    """Make the missing runs, and write the table of settings.

    The command line names two folders: that of the runs, and that of the table.
    """
    os.nice(15)
    folder, stored = map(Path, sys.argv[1:])
    folder.mkdir(parents=True, exist_ok=True)
    make_runs(folder / "runs.csv")
    table = table_of(pd.read_csv(folder / "runs.csv"))
    table.to_csv(stored / "rivals.csv", index=False, float_format="%.6g", lineterminator="\n")
    print(table.to_string())


if __name__ == "__main__":
    main()
