"""The learner against every other method of a task, and its conditions against each other.

Who is compared is decided before any reward is read:

- conditions of the learner with each other, the one that explores more first;
- a variant of a condition (other parameters, biased noise, no corrective process) with that
  condition;
- every other method with the condition that explores most (EC1 on one-armed tasks, EC4 on
  two-armed ones), and where it keeps still the arm that is not chosen also with EC3, which
  does so too. The optimum's searches are references, no methods to compare with.

So is the test. Conditions are compared as in the paper and in the claims register: one-tailed
bootstrap test that more exploration is better, interval of independent samples. All other pairs
are tested two-tailed. A pair has this one p-value wherever it is shown.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from coartic.analysis.comparisons.methods import MethodRow
from coartic.analysis.comparisons.targets import SHARES
from coartic.analysis.methods import LEARNER
from coartic.analysis.results.folder import CellRuns
from coartic.analysis.statistics.estimates import (
    cliffs_delta,
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
from coartic.analysis.statistics.power import runs_needed, smallest_difference
from coartic.exploration import CONDITIONS
from coartic.record import SEARCH
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.study import Study

SPENDS = ("trials", "movement_ticks", "evaluations", "solve_s")
"""What a run spends, of :class:`coartic.analysis.comparisons.methods.MethodRow`."""
RUNS_FOR = {f"runs_{share:.0%}".removesuffix("%"): share for share in SHARES}
"""Differences, as shares of the optimum, for which so many runs are needed."""
Kind = Literal["conditions", "variant", "method"]


@dataclass(frozen=True)
class Pair:
    """Two cells of a task; the first is the learner's."""

    kind: Kind
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
    for task in dict.fromkeys(cell.task for cell in study.cells.values()):
        cells = {cell.label: cell for cell in study.cells.values() if cell.task == task}
        plain = {name: cells[LEARNER + name] for name in CONDITIONS if LEARNER + name in cells}
        if not plain:
            continue
        for less, more in itertools.combinations(plain.values(), 2):
            yield Pair("conditions", more, less)
        most = list(plain)[-1]
        still = _keeping_still(most)
        for label, cell in cells.items():
            condition = label.removeprefix(LEARNER)
            if condition in plain or cell.method.startswith(SEARCH):
                continue
            own = cell.method.removeprefix(LEARNER).split("-")[0]
            kind: Kind = "method"
            against = [most]
            if cell.method.startswith(LEARNER) and own in plain:
                kind, against = "variant", [own]
            elif still in plain and study.method_rows[task, label].other_arm == "still":
                against.append(str(still))
            yield from (Pair(kind, plain[name], cell) for name in against)


@dataclass(frozen=True, kw_only=True)
class PairRow:
    """What two cells of a task show beside each other; NaN where there is no number.

    Of runs with a solution, rewards in ticks. The fields are the columns of
    ``comparisons.csv``.
    """

    task: str
    kind: Kind
    first: str
    """The learner's label."""
    second: str
    runs_first: int
    runs_second: int
    n_first: int
    """Runs with a solution: all that follows is of those."""
    n_second: int
    mean_first: float
    mean_second: float
    sd_first: float
    sd_second: float
    difference: float = math.nan
    """Mean reward of the first less the second's."""
    low: float = math.nan
    """Of its 95 % BCa interval."""
    high: float = math.nan
    interval: str = ""
    """What that is of: pairs of runs that share a seed, independent samples, or a sample
    against a number (:attr:`Pair.known`)."""
    pairs: int = 0
    """Runs that share a seed."""
    correlation: float = math.nan
    """Pearson's, of their rewards."""
    independent_low: float = math.nan
    """Of the interval that leaves pairing out."""
    independent_high: float = math.nan
    test: str = ""
    """Whose p-value follows, in words."""
    p: float = math.nan
    p_holm: float = math.nan
    """Adjusted over the task's pairs that are not of conditions, whose one adjusted p-value is
    that of the claims (:mod:`coartic.analysis.claims`)."""
    delta: float = math.nan
    """Cliff's."""
    delta_low: float = math.nan
    delta_high: float = math.nan
    improvement: float = math.nan
    """P(first higher), a tie half."""
    improvement_low: float = math.nan
    improvement_high: float = math.nan
    trials: float
    """What the second spent in a run over what the first did, medians; NaN where the first
    spent none."""
    movement_ticks: float
    evaluations: float
    """Forward kinematics and Jacobians."""
    solve_s: float
    told_more: str
    """Letters of the information that only the second is told
    (:data:`coartic.analysis.comparisons.methods.TOLD`)."""
    told_less: str
    """That only the first is told."""
    runs_5: float
    """Runs of each that a one-tailed test at 5 % needs to find a difference of 5 % of the
    optimum with power 80 %, at these SDs."""
    runs_2: float
    runs_1: float
    smallest: float
    """Difference that the runs at hand (the fewer of the two) find so, ticks."""
    smallest_share: float
    """The same as a share of the optimum."""
    note: str
    """Why there is no interval or test."""


def compared(study: Study) -> tuple[PairRow, ...]:
    """One row a pair of :func:`pairs`, p-values adjusted over a task's pairs but conditions."""
    rows = [_row(study, pair) for pair in pairs(study)]
    adjusted = []
    for _, of_task in itertools.groupby(rows, lambda row: row.task):
        own = list(of_task)
        found = holm([math.nan if row.kind == "conditions" else row.p for row in own])
        adjusted += [replace(row, p_holm=p) for row, p in zip(own, found, strict=True)]
    return tuple(adjusted)


def pairs_table(rows: Sequence[PairRow]) -> pd.DataFrame:
    """The rows with the fields of :class:`PairRow` as columns."""
    return pd.DataFrame(list(rows), columns=[field.name for field in fields(PairRow)])


def _row(study: Study, pair: Pair) -> PairRow:
    """A pair, its p-values not yet adjusted."""
    one, two = (study.method_rows[cell.task, cell.label] for cell in (pair.first, pair.second))
    optimum = study.optima.get((one.task, "free"))
    found = _inferred(pair) if one.solved and two.solved else {"note": "no run with a solution"}
    found |= {name: getattr(two, name) / (getattr(one, name) or math.nan) for name in SPENDS}
    return PairRow(
        task=one.task,
        kind=pair.kind,
        first=one.label,
        second=two.label,
        runs_first=one.runs,
        runs_second=two.runs,
        n_first=one.solved,
        n_second=two.solved,
        mean_first=one.reward,
        mean_second=two.reward,
        told_more=_told_beyond(two, one),
        told_less=_told_beyond(one, two),
        **found,
        **_sizes(pair, one, two, abs(optimum.reward) if optimum else math.nan),
    )


def _inferred(pair: Pair) -> dict[str, Any]:
    """Difference, tests and effect size of two samples of rewards."""
    a, b = pair.first.rewards, pair.second.rewards
    x, y = paired_by_seed(pair.first.good, pair.second.good)
    second: Array | float = b
    paired = len(x) and pair.kind != "conditions"  # the paper's design is unpaired
    interval = "paired by seed" if paired else "independent"
    if pair.known:
        x, y, paired = x[:0], y[:0], False
        second, interval = float(b[0]), "against a known value"
    independent = difference_of_means(a, second)
    difference = paired_difference(x, y) if paired else independent
    if pair.kind == "conditions":
        test = bootstrap_test(a, second)
    else:
        test = (sign_flip_test if pair.known else permutation_test)(a, second, "two-sided")
    improvement = probability_of_improvement(a, second)
    delta = cliffs_delta(improvement)
    spread = len(x) > 2 and np.ptp(x) and np.ptp(y)
    notes = (found.note for found in (difference, test, improvement))
    return {
        "difference": difference.estimate,
        "low": difference.low,
        "high": difference.high,
        "interval": interval,
        "pairs": len(x),
        "correlation": float(np.corrcoef(x, y)[0, 1]) if spread else math.nan,
        "independent_low": independent.low,
        "independent_high": independent.high,
        "test": test.method,
        "p": test.p,
        "delta": delta.estimate,
        "delta_low": delta.low,
        "delta_high": delta.high,
        "improvement": improvement.estimate,
        "improvement_low": improvement.low,
        "improvement_high": improvement.high,
        "note": "; ".join(dict.fromkeys(filter(None, notes))),
    }


def _sizes(pair: Pair, one: MethodRow, two: MethodRow, best: float) -> dict[str, Any]:
    """SDs, and the runs and differences that follow; ``best``: absolute reward of the optimum."""
    sds = one.reward_sd, 0.0 if pair.known and two.solved else two.reward_sd
    fewest = one.solved if pair.known else min(one.solved, two.solved)
    known = not any(map(math.isnan, sds))
    smallest = smallest_difference(*sds, fewest) if known else math.nan
    sizes = {
        name: runs_needed(share * best, *sds) if known and best > 0 else math.nan
        for name, share in RUNS_FOR.items()
    }
    sizes |= {"smallest": smallest, "smallest_share": smallest / best if best > 0 else math.nan}
    return {"sd_first": sds[0], "sd_second": sds[1], **sizes}


def _keeping_still(condition: str) -> str | None:
    """The condition that differs in keeping still the arm that is not chosen, if any."""
    most = CONDITIONS[condition]
    for name, other in reversed(CONDITIONS.items()):
        if most.modify_other and other == replace(most, id=name, modify_other=False):
            return name
    return None


def _told_beyond(one: MethodRow, other: MethodRow) -> str:
    return "".join(letter for letter in one.told if letter not in other.told)
