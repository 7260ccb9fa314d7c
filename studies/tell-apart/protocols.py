"""Run the three contrasts: models of people practise, are informed, and are measured.

    python studies/tell-apart/protocols.py results/tell-apart

writes changes.csv, starts.csv and steps.csv, in five minutes of one core. Tasks that the folder has
are not run again.
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
"""Test instances of both families take turns, so that what is done is a fair part of all."""


def main(folder):
    """Run the contrasts on all tasks: the first on all, the others on some random tasks."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    paths = {name: Path(folder) / f"{name}.csv" for name in ("changes", "starts", "steps")}
    rows = {name: pd.read_csv(path).to_dict("records") if path.exists() else []
            for name, path in paths.items()}  # fmt: skip
    done = {row["task"] for row in rows["changes"]}
    for seed, name in enumerate(TASKS):
        if name in done:
            continue
        task, keys = load_task(name), ["task", "distance", "model"]
        changes = pd.DataFrame(change_goals(task, seed)).groupby(keys, sort=False)
        rows["changes"] += changes.sum(min_count=1).reset_index().to_dict("records")
        rows["starts"] += start_elsewhere(task, seed) if 2 <= seed < 22 else []
        rows["steps"] += steps(task, seed) if len(task.hands) == 1 and seed < 18 else []
        for kind, path in paths.items():
            pd.DataFrame(rows[kind]).to_csv(path, float_format="%.5g", index=False)


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/tell-apart")
