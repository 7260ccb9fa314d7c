"""Run the three contrasts: models of people practise, are informed, and are measured.

    python studies/tell-apart/protocols.py results/tell-apart

writes changes.csv, starts.csv and steps.csv, in five minutes of one core.
"""

import sys
from pathlib import Path

import pandas as pd
from changes import change_goals
from starts import start_elsewhere
from steps import steps

from coartic import load_task

INSTANCES = [f"{family}/v1/i{n:03d}" for n in range(30) for family in ("one-armed", "two-armed")]
TASKS = ["ascending", "descending", *INSTANCES]
"""Test instances of both families take turns; places are seeds."""


def main(folder):
    """Run the contrasts on all tasks: the first on all, the others on some random tasks."""
    changes, starts, moved = [], [], []
    for seed, name in enumerate(TASKS):
        task = load_task(name)
        changes += change_goals(task, seed)
        starts += start_elsewhere(task, seed) if 2 <= seed < 22 else []
        moved += steps(task, seed) if len(task.hands) == 1 and seed < 18 else []
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
