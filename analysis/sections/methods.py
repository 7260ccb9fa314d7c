"""Section on every method on every task: rewards, hands, costs and failed runs."""

from __future__ import annotations

import math

from coartic.analysis.sections.costs import solve_times
from coartic.analysis.study import Study, one_by_one, solved, typical_run
from coartic.analysis.table import SHORT_ID, Rows, row_of_cell, run_ids, table
from coartic.analysis.words import commonest, tally


@table(
    "Reward, gap to the {reference}, hands and runs, and costs of a run (medians)",
    "task; method; runs; solved: -; reward± .1; reward_median: -; gap: gap (%) .1; hands; trials; "
    "forward_kinematics: forward-kinematics evaluations; solve_s: solving time (s); median_run",
)
def list_methods(study: Study) -> Rows:
    """Yield a name and a row (:data:`.Rows`) for each method on each task of :func:`.one_by_one`:
    the entries of :func:`.row_of_cell`, such as mean reward and gap, hands and median costs.

    Within a task, searches for the optimum come first, then methods from the highest mean reward
    on. ``median_run`` is the beginning of the id of the run with the reward nearest to the median;
    None without a solved run.
    """
    places, rows = {task: place for place, task in enumerate(one_by_one(study))}, []
    for (task, label), runs in study.cells.items():
        if task not in places:
            continue
        good = solved(runs)
        row = row_of_cell(study, runs) | {
            "hands": tally(good.hands) if len(good) > 1 else "".join(good.hands),
            "trials": runs.trials.astype(float).median(),
            "forward_kinematics": runs.forward_kinematics.astype(float).median(),
            "solve_s": solve_times(good).astype(float).median(),
            "median_run": typical_run(good)[:SHORT_ID] if len(good) else None,
        }
        below = -row["reward"] if len(good) else math.inf
        rows.append(((places[task], not study.methods.is_search[label], below), label, row))
    for (place, *_), label, row in sorted(rows, key=lambda each: each[0]):
        yield f"{[*places][place]} {label}", row


@table("Runs without a solution", "task; method; failed: failed runs; runs; reasons")
def list_failed(study: Study) -> Rows:
    """Yield a row for each method on each task on which runs failed: their number and three
    commonest reasons."""
    for (task, label), runs in study.cells.items():
        if len(failed := runs[runs.status != "ok"]):
            reasons = "; ".join(commonest(failed.reason.fillna("")))
            row = row_of_cell(study, runs) | {"failed": len(failed), "reasons": reasons}
            yield f"{task} {label}", row | run_ids(failed)
