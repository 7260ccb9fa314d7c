"""Can selection alone show as much, where it succeeds? Random search in wide boxes.

    python studies/replication/boxes.py

writes boxes.csv: uniform targets in a box of a half width around the corrective process's postures,
10,000 trials a run, and what the runs show that improve on the corrective process alone. Five
minutes of a core.
"""

from pathlib import Path

import numpy as np
import pandas as pd

import coartic

RUNS = {0.12: 100, 0.25: 400, 0.3: 400, 0.35: 800, 0.4: 800}
"""Runs on each task by half width, length unit and rad."""
TRIALS = 10_000
TASKS = "ascending", "descending"


def improved_runs(name, width, runs):
    """Return first movements, ticks slower than the corrective process's, and configurations at
    goal 1 of the runs that improve on the corrective process alone."""
    task = coartic.load_task(name)
    alone = coartic.corrective_trial(task, "RRR")
    problem = coartic.objective(task, half_width=width)
    first, postures = [], []
    for seed in range(runs):
        rng, cost = np.random.default_rng([2013, seed]), problem.fresh()
        for _ in range(TRIALS // 500):
            cost.many(rng.uniform(*cost.bounds.T, (500, cost.dim)))
        if cost.best_cost < alone.ticks:
            run = coartic.execute(task, cost.solution)
            first.append(run.ticks_by_goal()[0] - alone.ticks_by_goal()[0])
            postures.append(run.configurations[0])
    return first, postures


def main():
    """Measure every width and write the table."""
    rows = []
    for width, runs in RUNS.items():
        row, means = {"half_width": width, "runs": runs}, []
        for name in TASKS:
            first, postures = improved_runs(name, width, runs)
            row |= {f"improved_{name}": len(first), f"first_{name}": np.mean(first or [np.nan])}
            means.append(np.mean(postures, axis=0) if postures else np.nan)
        rows.append(row | {"posture_difference": np.linalg.norm(means[0] - means[1])})
        table = pd.DataFrame(rows).set_index("half_width")
        table.to_csv(Path(__file__).with_name("boxes.csv"), float_format="%.6g")


if __name__ == "__main__":
    main()
