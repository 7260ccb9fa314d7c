"""The learner against every other method of a task, and its conditions against each other.

Who is compared is decided before any reward is read:

- conditions of the learner with each other, the one that explores more first;
- a variant of a condition (other parameters, no corrective process) with that condition;
- every other method with the condition that explores most (EC1 on one-armed tasks, EC4 on
  two-armed ones), and where it keeps still the arm that is not chosen also with EC3, which
  does so too. Searches for the optimum are references, no methods to compare with.

So is the test. Conditions are compared as in the paper: a one-tailed bootstrap test that more
exploration is better, as independent samples. All other pairs are paired by seed where all runs of
both have a partner, and tested two-tailed by sign flips.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.cells import CellRuns
from coartic.analysis.comparisons.methods import method_rows
from coartic.analysis.methods import LEARNER, is_search
from coartic.analysis.statistics.estimates import (
    difference_of_means,
    interval,
    paired_by_seed,
    probability_of_improvement,
)
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm, sign_flip_test
from coartic.analysis.study import Study, cached
from coartic.learner.conditions import CONDITIONS
from coartic.robot import Array

Pair = tuple[str, CellRuns, CellRuns]
"""``conditions``, ``variant`` or ``method``, and two cells of a task; the first the learner's."""


def pairs(study: Study) -> Iterator[Pair]:
    """All pairs, task by task, in the order of the plan."""
    for task in dict.fromkeys(task for task, _ in study.cells):
        cells = {label: cell for (name, label), cell in study.cells.items() if name == task}
        plain = {name: cells[LEARNER + name] for name in CONDITIONS if LEARNER + name in cells}
        if not plain:
            continue
        for less, more in itertools.combinations(plain.values(), 2):
            yield "conditions", more, less
        most = list(plain)[-1]
        without_other_arm = replace(CONDITIONS[most], modify_other=False)
        for label, cell in cells.items():
            if label.removeprefix(LEARNER) in plain or is_search(label):
                continue
            condition = cell.method.removeprefix(LEARNER).split("-")[0]
            if cell.method.startswith(LEARNER) and condition in plain:
                yield "variant", plain[condition], cell
                continue
            yield "method", plain[most], cell
            for name in plain:
                does_so_too = CONDITIONS[name] == replace(without_other_arm, id=name)
                arm = method_rows(study).other_arm[task, label]
                if name != most and does_so_too and arm == "still":
                    yield "method", plain[name], cell


@cached
def pairs_table(study: Study) -> pd.DataFrame:
    """One row a pair; of runs with a solution, rewards in ticks.

    ``difference``: mean reward of the first less the second's with its 95 % BCa interval;
    ``pairs``: runs that share a seed, if it is paired; ``better``: probability that a run of the
    first has the higher reward, a tie counting half; ``p`` of a test of the same
    difference, ``p_holm`` adjusted over the task's pairs that are not of conditions; ``note``: why
    there is no interval or test.
    """
    rows = []
    for kind, first, second in pairs(study):
        rows.append(
            {
                "task": first.task,
                "kind": kind,
                "first": first.label,
                "second": second.label,
                "runs_first": len(first.good),
                "runs_second": len(second.good),
                "p": math.nan,
                "p_holm": math.nan,
                "note": "no run with a solution",
                **(compared(kind, first, second) if len(first.good) and len(second.good) else {}),
            }
        )
    frame = pd.DataFrame(rows)
    for _, of_task in frame.groupby("task", sort=False) if rows else ():
        corrected = of_task[of_task.kind != "conditions"]
        frame.loc[corrected.index, "p_holm"] = holm(corrected.p.tolist())
    return frame


def compared(kind: str, first: CellRuns, second: CellRuns) -> dict[str, Any]:
    """Difference and test of two cells' rewards.

    A second that is run once always does the same: its reward is a number, not a sample.
    """
    once = len(second.runs) == 1 < len(first.runs)
    samples: tuple[Array, Array | float]
    samples = first.rewards, float(second.rewards[0]) if once else second.rewards
    better = probability_of_improvement(*samples)
    x, y = paired_by_seed(first.good, second.good)
    all_paired = len(x) == len(first.rewards) == len(second.rewards) > 0
    shared = len(x) if all_paired and kind != "conditions" and not once else 0
    if shared:
        samples = x - y, 0.0
    difference = difference_of_means(*samples)
    if shared or once:
        test = sign_flip_test(np.subtract(*samples))
    else:
        test = bootstrap_test(*samples, "greater" if kind == "conditions" else "two-sided")
    notes = dict.fromkeys(
        inference.note for inference in (difference, test, better) if inference.note
    )
    return {
        **interval("difference", difference),
        "pairs": shared,
        **interval("better", better),
        "p": test.p,
        "note": "; ".join(notes),
    }
