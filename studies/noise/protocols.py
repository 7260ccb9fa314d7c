"""Execute the shipped solutions with motor noise (question 1).

    python studies/noise/protocols.py results/noise

The solutions are those of the suites ``comparison`` and ``families`` as they ship. Each is executed
100 times at each level of noise, with constant and with signal-dependent noise. The rows of a task
are one file in ``results/noise/order``. Tasks that have their file are not done again, so a run
that was interrupted goes on.
"""

import lzma
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import execute_noisy
from coartic.analysis import load

LEVELS = (0.0, 0.002, 0.005, 0.01, 0.02)
"""Standard deviations of the motor noise, rad and length units."""
REPEATS = 100
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
SHIPPED = Path(__file__).parents[2] / "benchmarks" / "shipped"
NO_METHOD = "optimum/search"


def shipped(suite, folder):
    """Return the study of a suite's shipped results."""
    if suite == "comparison":
        return load("shipped")
    database = folder / suite / "runs.sqlite"
    if not database.exists():
        database.parent.mkdir(parents=True, exist_ok=True)
        database.write_bytes(lzma.decompress((SHIPPED / f"{suite}.sqlite.xz").read_bytes()))
    return load(database.parent)


def seed_of(run_id):
    """Return the seed with which the solution of a run is executed: the number of its id."""
    return int(run_id.partition("-")[0], 16)


def executions(task, solutions, levels, repeats=REPEATS):
    """Return a row for each of the solutions, by run id, at each level and kind of noise: mean and
    standard deviation of the ticks over executions that did not fail, and the number of failures.
    """
    seeds, rows = [*map(seed_of, solutions)], []
    for level in levels:
        for dependent in (False, True) if level else (False,):
            ticks = execute_noisy(
                task, solutions.values(), level, repeats, seeds, signal_dependent=dependent
            )
            for run_id, of_run in zip(solutions, ticks, strict=True):
                made = of_run[~np.isnan(of_run)]
                rows.append(
                    {
                        "run_id": run_id,
                        "motor_noise": level,
                        "signal_dependent": dependent,
                        "ticks": made.mean() if made.size else np.nan,
                        "sd": made.std() if made.size else np.nan,
                        "failures": repeats - made.size,
                    }
                )
    return pd.DataFrame(rows)


def execute_study(study, folder, levels=LEVELS, repeats=REPEATS):
    """Write the executions of a study's solutions, a file for each task that has none."""
    runs, movements = study.runs[study.runs.method != NO_METHOD], study.movements()
    folder.mkdir(parents=True, exist_ok=True)
    for name, task in study.tasks.items():
        file = folder / f"{name.replace('/', '.')}.csv"
        if file.exists() or (task.family and task.family.partition("/")[0] not in FAMILIES):
            continue
        of_task = runs[(runs.task == name) & (runs.status == "ok")].set_index("run_id")
        solutions = {run_id: movements[run_id] for run_id in of_task.index}
        made = executions(task, solutions, levels, repeats)
        columns = ["task", "method", "setting", "run", "reward", "best_known"]
        rows = made.join(of_task[columns], on="run_id")
        unfinished = file.with_suffix(".part")
        rows.to_csv(unfinished, index=False)
        unfinished.replace(file)
        print(name, len(solutions), flush=True)


def main(folder="results/noise"):
    """Execute both suites, one after the other."""
    for suite in ("comparison", "families"):
        execute_study(shipped(suite, Path(folder)), Path(folder) / "order")


if __name__ == "__main__":
    main(*sys.argv[1:])
