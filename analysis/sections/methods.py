"""Section on every method on every task: rewards, hands and costs."""

from __future__ import annotations

import math
from collections import Counter

from coartic.analysis.sections.costs import solve_times
from coartic.analysis.study import CellRuns, Study, one_by_one, typical_run
from coartic.analysis.table import SHORT_ID, Rows, row_of_cell, table
from coartic.analysis.words import tally


@table(
    "task; method; runs; solved: -; reward± .1; reward_median: -; gap: gap (%) .1; hands; trials; "
    "forward_kinematics: forward-kinematics evaluations; solve_s: solving time (s); median_run"
)
def list_methods(study: Study) -> Rows:
    """List every method on every task: mean reward, gap, hands and costs (medians).

    Within a task, searches for the optimum come first, then methods by mean reward. ``median_run``
    is the beginning of the id of the run with the reward nearest to the median.
    """
    places = {task: place for place, task in enumerate(one_by_one(study))}
    cells = [cell for cell in study.cells.values() if cell.task in places]
    is_search = study.methods.kind == "optimum search"

    def place(cell: CellRuns) -> tuple[int, bool, float]:
        mean = cell.rewards.mean() if len(cell.good) else -math.inf
        return places[cell.task], not is_search[cell.label], -mean

    for cell in sorted(cells, key=place):
        good, runs = cell.good, cell.runs
        row = row_of_cell(study, cell) | {
            "hands": tally(Counter(good.hands)) if len(good) > 1 else "".join(good.hands),
            "trials": runs.trials.astype(float).median(),
            "forward_kinematics": runs.forward_kinematics.astype(float).median(),
            "solve_s": solve_times(good).astype(float).median(),
        }
        if len(good):
            row["median_run"] = typical_run(good)[:SHORT_ID]
            row["reward_median"] = good.reward.astype(float).median()
        yield f"{cell.task} {cell.label}", row
