"""Tables of section *Cost*: running times and learning curves."""

from __future__ import annotations

import math

import numpy as np

from coartic.analysis.methods import (
    BY_TRIAL,
)
from coartic.analysis.running_times import (
    SPENDS,
    budget_for,
    runs_with_targets,
    share_reached,
    times_of,
    times_on_tasks,
)
from coartic.analysis.standings import (
    cells_of,
)
from coartic.analysis.study import Study, best_after, improvements, shared_cells, solved
from coartic.analysis.tables.language import Row, Rows, named, run_ids, table
from coartic.estimates import (
    Estimate,
)

BUDGETS = (100, 1_000, 10_000)
"""Numbers of trials after which the table of learning reports rewards."""
COSTS = (
    ("trials_to_quarter", "trials", 0.25),
    ("trials_to_half", "trials", 0.5),
    ("forward_kinematics_to_half", "forward_kinematics", 0.5),
    ("seconds_to_half", "solve_s", 0.5),
)
"""Columns of :func:`list_runtimes`. Each entry consists of the name of the column, the kind of cost
(one of :data:`.SPENDS`), and the fraction of the targets that must be reached."""


@table(
    "Cost of reaching shares of the targets",
    """
    method         | method                                  |   | tex
    reached        | targets reached (%)                     | 0 | tex
    trials         | trials                                  | 0
    trials_to_quarter[]          | trials to a quarter of the targets
    trials_to_half[]             | trials to half of the targets | | tex
    forward_kinematics_to_half[] | forward-kinematics evaluations to half of the targets | | tex
    seconds_to_half[]            | seconds to half of the targets
    half on *
    """,
)
def list_runtimes(study: Study) -> Rows:
    """Yield the cost at which each method reaches a quarter and half of the targets.

    There is a row for each method of :func:`.runs_with_targets`. Methods without a solution, or
    with an unknown number of trials on a task, are left out. In a world with noise there are no
    rows. Columns:

    - the columns of :data:`COSTS`; NaN if the cost of the method's runs on a task is unknown;
    - ``reached``: the fraction of targets that the method reaches at any cost;
    - ``trials``: the largest number of trials of a run;
    - ``half on TASK``, only for a method that uses the reward of each trial: the median, over runs
      on this task, of the number of trials to the target halfway between the reward of the
      corrective process alone with its best hands and the best known reward. The median is infinite
      if more than half of the runs do not reach this target.
    """
    for method, runs in runs_with_targets(study).items():
        times = {spend: times_on_tasks(study, runs, spend) for spend in SPENDS}
        if runs.value.isna().all() or not all(map(len, times["trials"])):
            continue
        reached = share_reached(times["trials"])
        row: Row = {"method": method, "reached": reached, "trials": runs.trials.max()}
        for name, spend, share in COSTS:
            is_known = all(map(len, times[spend]))
            cost = budget_for(times[spend], share) if is_known else Estimate(math.nan)
            row |= cost.columns(name)
        if study.methods.information[method] == BY_TRIAL:
            for task, label in cells_of(runs):
                half = times_of(study, task, label, "trials", (0.5,))
                row[f"half on {task}"] = float(np.quantile(half, 0.5, method="inverted_cdf"))
        yield method, row | run_ids(runs)


@table(
    "Best reward so far, mean over runs (ticks)",
    """
    task            | task                           |   | tex
    method          | method                         |   | tex
    runs            | runs                           |   | tex
    corrective_best | corrective process, best hands | 1
    after_100       | after 100 trials               | 1 | tex
    after_1000      | after 1000 trials              | 1 | tex
    after_10000     | after 10\u202f000 trials          | 1 | tex
    """,
)
def list_learning(study: Study) -> Rows:
    """Yield the mean best reward of each method after 100, 1,000 and 10,000 trials.

    There is a row for each individual task and each method, provided that each run of the method on
    the task is solved, made at least 100 trials, and has stored rewards of its trials. Searches for
    the optimum are left out. In a world with noise there are no rows.

    Columns ``after_100``, ``after_1000`` and ``after_10000`` are means over runs of the best reward
    so far, in negative ticks. A mean is NaN if a run made fewer trials than that, or had not found
    a solution by then. Column ``corrective_best`` is the reward of the corrective process alone
    with its best hands (:attr:`.Study.corrective_best`).
    """
    if study.is_noisy:  # the best trial so far is partly luck
        return
    learned = improvements(study)
    for (task, label), runs in shared_cells(study).items():
        is_shown = task in study.individual_tasks and not study.methods.is_search[label]
        is_solved = len(solved(runs)) == len(runs) and learned.keys() >= {*runs.run_id}
        fewest = runs.trials.min()
        if not (is_shown and is_solved and fewest >= BUDGETS[0]):  # with fewer nothing is learned
            continue
        row = named(study, runs) | {"corrective_best": study.corrective_best[task]}
        for budget in BUDGETS:
            best = [best_after(learned[run_id], budget) for run_id in runs.run_id]
            row[f"after_{budget}"] = np.mean(best) if budget <= fewest else math.nan
        yield f"{task} {label}", row
