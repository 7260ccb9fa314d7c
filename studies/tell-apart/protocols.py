"""Run the three contrasts: models of people practise, are informed, and are measured.

    python studies/tell-apart/protocols.py results/tell-apart

writes changes.csv, starts.csv and steps.csv, in five minutes of one core.
"""

import sys
from itertools import chain
from pathlib import Path

import pandas as pd
from changes import change_goals
from starts import start_elsewhere
from steps import steps

from coartic import load_task
from coartic.benchmarks.pool import process_pool

INSTANCES = [f"{family}/v1/i{n:03d}" for n in range(30) for family in ("one-armed", "two-armed")]
TASKS = ["ascending", "descending", *INSTANCES]
"""Test instances of both families take turns; places are seeds."""


def contrasts_on(seed):
    """Return the rows of the three contrasts on a task, by its place in :data:`TASKS`: the first is
    on all tasks, the others are on some random tasks."""
    task = load_task(TASKS[seed])
    starts = start_elsewhere(task, seed) if 2 <= seed < 22 else []
    moved = steps(task, seed) if len(task.hands) == 1 and seed < 18 else []
    return [*change_goals(task, seed)], [*starts], [*moved]


def main(folder):
    """Run the contrasts on all tasks."""
    with process_pool(1) as pool:
        of_tasks = zip(*pool.map(contrasts_on, range(len(TASKS))), strict=True)
    changes, starts, moved = map(chain.from_iterable, of_tasks)
    sums = pd.DataFrame(changes).groupby(["task", "distance", "model"], sort=False)
    tables = {
        "changes": sums.sum(min_count=1).reset_index(),
        "starts": pd.DataFrame(starts),
        "steps": pd.DataFrame(moved),
    }
    Path(folder).mkdir(parents=True, exist_ok=True)
    for kind, table in tables.items():
        table.to_csv(Path(folder) / f"{kind}.csv", float_format="%.5g", index=False)


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/tell-apart")
