"""The learner against every other method of a task, and its conditions against each other.

Who is compared is decided before any reward is read:

- conditions of the learner with each other, the one that explores more first;
- a variant of a condition (other parameters, no corrective process) with that condition;
- every other method with the condition that explores most (EC1 on one-armed tasks, EC4 on
  two-armed ones), and where it keeps still the arm that is not chosen also with EC3, which
  does so too. Searches for the optimum are references, no methods to compare with.

So is the test. Conditions are compared as in the paper: a one-tailed bootstrap test that more
exploration is better, with the interval of independent samples. All other pairs are tested
two-tailed, and paired by seed where all runs of both have a partner.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from coartic.analysis.cells import CellRuns
from coartic.analysis.comparisons.methods import method_rows
from coartic.analysis.methods import LEARNER, is_search
from coartic.analysis.statistics.estimates import (
    difference_of_means,
    paired_by_seed,
    paired_difference,
    probability_of_improvement,
)
from coartic.analysis.statistics.hypotheses import (
    bootstrap_test,
    holm,
    permutation_test,
    sign_flip_test,
)
from coartic.analysis.study import Study, cached
from coartic.learner.conditions import CONDITIONS
from coartic.robot import Array

COLUMNS = (
    *("task", "kind", "first", "second", "runs_first", "runs_second"),
    *("difference", "difference_low", "difference_high", "pairs"),
    *("better", "better_low", "better_high", "p", "p_holm", "note"),
)
"""Of :func:`pairs_table`."""


@dataclass(frozen=True)
class Pair:
    """Two cells of a task; the first is the learner's."""

    kind: str
    """``conditions``, ``variant`` or ``method``."""
    first: CellRuns
    second: CellRuns

    @property
    def known(self) -> bool:
        """Whether the second is run once because it always does the same.

        Its reward then is a number, not a sample. Where the learner has one run as well
        nothing tells.
        """
        return len(self.second.runs) == 1 < len(self.first.runs)


def pairs(study: Study) -> Iterator[Pair]:
    """All pairs, task by task, in the order of the plan."""
    for task in dict.fromkeys(task for task, _ in study.cells):
        cells = {label: cell for (name, label), cell in study.cells.items() if name == task}
        plain = {name: cells[LEARNER + name] for name in CONDITIONS if LEARNER + name in cells}
        if not plain:
            continue
        for less, more in itertools.combinations(plain.values(), 2):
            yield Pair("conditions", more, less)
        most = list(plain)[-1]
        still = _keeping_still(most)
        for label, cell in cells.items():
            if label.removeprefix(LEARNER) in plain or is_search(label):
                continue
            condition = cell.method.removeprefix(LEARNER).split("-")[0]
            if cell.method.startswith(LEARNER) and condition in plain:
                yield Pair("variant", plain[condition], cell)
                continue
            yield Pair("method", plain[most], cell)
            if still in plain and method_rows(study)[task, label].other_arm == "still":
                yield Pair("method", plain[str(still)], cell)


@cached
def pairs_table(study: Study) -> pd.DataFrame:
    """One row a pair; of runs with a solution, rewards in ticks.

    ``difference``: mean reward of the first less the second's with its 95 % BCa interval;
    ``pairs``: runs that share a seed, if it is paired; ``better``: probability that a run of the
    first has the higher reward, a tie counting half; ``p_holm``: ``p`` adjusted over the task's
    pairs that are not of conditions; ``note``: why there is no interval or test.
    """
    rows = []
    for pair in pairs(study):
        rows.append(
            {
                "task": pair.first.task,
                "kind": pair.kind,
                "first": pair.first.label,
                "second": pair.second.label,
                "runs_first": len(pair.first.good),
                "runs_second": len(pair.second.good),
                "note": "no run with a solution",
                **(_compared(pair) if len(pair.first.good) and len(pair.second.good) else {}),
            }
        )
    frame = pd.DataFrame(rows, columns=list(COLUMNS))
    tested = frame[frame.kind != "conditions"]
    for _, own in tested.groupby("task", sort=False):
        frame.loc[own.index, "p_holm"] = holm(own.p.astype(float).tolist())
    return frame


def _compared(pair: Pair) -> dict[str, Any]:
    """Difference and test of two samples of rewards."""
    a, b = pair.first.rewards, pair.second.rewards
    x, y = paired_by_seed(pair.first.good, pair.second.good)
    paired = len(x) == len(a) == len(b) and pair.kind != "conditions" and not pair.known
    second: Array | float = float(b[0]) if pair.known else b
    difference = paired_difference(x, y) if paired else difference_of_means(a, second)
    if pair.kind == "conditions":
        test = bootstrap_test(a, second)
    else:
        test = (sign_flip_test if pair.known else permutation_test)(a, second, "two-sided")
    better = probability_of_improvement(a, second)
    notes = dict.fromkeys(found.note for found in (difference, test, better) if found.note)
    return {
        "difference": difference.estimate,
        "difference_low": difference.low,
        "difference_high": difference.high,
        "pairs": len(x) if paired else 0,
        "better": better.estimate,
        "better_low": better.low,
        "better_high": better.high,
        "p": test.p,
        "p_holm": math.nan,
        "note": "; ".join(notes),
    }


def _keeping_still(condition: str) -> str | None:
    """The condition that differs in keeping still the arm that is not chosen, if any."""
    most = CONDITIONS[condition]
    for name, other in reversed(CONDITIONS.items()):
        if most.modify_other and other == replace(most, id=name, modify_other=False):
            return name
    return None
