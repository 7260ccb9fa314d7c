"""Copy better solutions in the world with motor noise 0.01 from results folders.

    python studies/optima/renew_in_noise.py results/in-noise results/comparison

Every folder can have runs of any methods in this world. On each task the five runs with the fewest
mean ticks, those of the search in the model and the shipped solution are executed 1,000 times, with
the same noise, which no method has practised. The best of them ships with its mean. A run whose
mean ticks are more than 1 % above the shipped ones is not executed again.

The search in the model ran on the paper's tasks and the first 40 test instances of five families:

    coartic run studies/optima/in-noise.toml --out results/in-noise
"""

import sys
from pathlib import Path

import pandas as pd
import shipped

from coartic import PAPER
from coartic.analysis.optima import CANDIDATES, FRESH_EXECUTIONS
from coartic.internal.text import describe_parameters
from coartic.model import differences
from coartic.motion.execution import execute_noisy
from coartic.runs.plan import reference_seed
from coartic.runs.shipped import open_results
from coartic.tasks.optima import best_shipped, task_hash

MODEL = PAPER._replace(motor_noise=0.01)
WORLD = describe_parameters(differences(MODEL))


def candidates_of(runs):
    """Return the rows of the runs that are executed again."""
    runs = runs[(runs.world == WORLD) & (runs.status == "ok") & (runs.failed_executions == 0)]
    best = runs.sort_values("mean_ticks").groupby("task").head(CANDIDATES)
    searches = runs[runs.method == "optimum/in-model"]
    return pd.concat([best, searches]).drop_duplicates("run_id")


def entry_of(task, content, method, hands):
    """Return the entry of a solution, or None if an execution fails."""
    answer = [shipped.movements_of(content)]
    seed = reference_seed(0, task.name)
    ticks = execute_noisy(task, answer, MODEL.motor_noise, FRESH_EXECUTIONS, seed)[0]
    if not ticks.mean() > 0.0:
        return None
    error = ticks.std(ddof=1) / len(ticks) ** 0.5
    return {
        "task": task.name,
        "motor_noise": MODEL.motor_noise,
        "mean_ticks": f"{ticks.mean():.3f}",
        "standard_error": f"{error:.3f}",
        "hands": hands,
        "method": method,
        "essence": task_hash(task),
        "solution": content,
    }


def take_over(store, known):
    """Copy solutions that take fewer mean ticks into ``known``, and return their number.

    Tasks whose best known rewards do not ship are left out.
    """
    before, tasks = dict(known), {job.cell.task.name: job.cell.task for job in store.plan()}
    for run in candidates_of(store.runs()).itertuples():
        least = float(known[run.task]["mean_ticks"]) if run.task in known else float("inf")
        if best_shipped(tasks[run.task]) is None or run.mean_ticks > 1.01 * least:
            continue
        content = shipped.answer_in_short(store.run(run.run_id).part("solution"))
        entry = entry_of(tasks[run.task], content, run.method, run.hands)
        if entry is not None and float(entry["mean_ticks"]) < least:
            known[run.task] = entry
    return sum(entry is not before.get(task) for task, entry in known.items())


def main(folders):
    """Copy improvements of all folders into the shipped data. A folder may be unfinished."""
    known = shipped.read_in_noise()
    for folder in folders:
        with open_results(Path(folder)) as store:
            print(f"{folder}: {take_over(store, known)} better solutions with motor noise")
    shipped.write_in_noise(known)


if __name__ == "__main__":
    main(sys.argv[1:])
