"""The learner against every other method of a task, and its conditions against each other.

Who is compared is decided before any reward is read:

- conditions of the learner with each other, the one that explores more first;
- a variant of a condition (other parameters, biased noise, no corrective process) with that
  condition;
- every other method with the condition that explores most (EC1 on one-armed tasks, EC4 on
  two-armed ones), and where it keeps still the arm that is not chosen also with EC3, which
  does so too. The optimum's searches are references, no methods to compare with.

So is the direction of the one-tailed test. More exploration is expected to be better, as the
paper says. A method that is told something which the learner is not told is expected to be
better than the learner; one that is told the same or less, to be worse.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import pandas as pd

from analysis.comparisons.methods import TOLD
from analysis.comparisons.targets import SHARES
from analysis.methods import LEARNER
from analysis.results.folder import CellRuns
from analysis.statistics.estimates import (
    SEED,
    Inference,
    cliffs_delta,
    difference_of_means,
    paired_by_seed,
    paired_difference,
    probability_of_improvement,
)
from analysis.statistics.hypotheses import bootstrap_test, holm, permutation_test, sign_flip_test
from analysis.statistics.power import runs_needed, smallest_difference
from analysis.statistics.spread import sd
from coartic.exploration import CONDITIONS
from coartic.record import SEARCH
from coartic.robot import Array

if TYPE_CHECKING:
    from analysis.study import Study

SPENDS = {
    "trials": ("trials",),
    "movement_ticks": ("movement_ticks",),
    "evaluations": ("forward_kinematics", "jacobians"),
    "solve_s": ("solve_s",),
}
"""What a run spends: sums of columns of :class:`analysis.comparisons.methods.MethodRow`."""
RUNS_FOR = {f"runs_{share:.0%}".removesuffix("%"): share for share in SHARES}
"""Differences, as shares of the optimum, for which so many runs are needed."""
Kind = Literal["conditions", "variant", "method"]


@dataclass(frozen=True)
class Pair:
    """Two cells of a task; the first is the learner's."""

    kind: Kind
    first: CellRuns
    second: CellRuns
    expected: Literal["greater", "less"]
    """Whether the first's mean is expected to be higher or lower."""

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
            yield Pair("conditions", more, less, "greater")
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
            for name in against:
                more_told = _told(study, cell) - _told(study, plain[name])
                yield Pair(kind, plain[name], cell, "less" if more_told else "greater")


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
    difference: float
    """Mean reward of the first less the second's."""
    low: float
    """Of its 95 % BCa interval."""
    high: float
    interval: str
    """What that is of: pairs of runs that share a seed, independent samples, or a sample
    against a number (:attr:`Pair.known`)."""
    pairs: int
    """Runs that share a seed."""
    correlation: float
    """Pearson's, of their rewards."""
    independent_low: float
    """Of the interval that leaves pairing out."""
    independent_high: float
    expected: Literal["higher", "lower"]
    """Of the first."""
    p_bootstrap: float
    """One-tailed, in the direction expected."""
    p_bootstrap_holm: float
    """Adjusted over all pairs of the task."""
    p_permutation: float
    """Two-tailed; by the signs of the differences where the second is known."""
    p_permutation_holm: float
    delta: float
    """Cliff's."""
    delta_low: float
    delta_high: float
    improvement: float
    """P(first higher), a tie half."""
    improvement_low: float
    improvement_high: float
    trials: float
    """What the second spent in a run over what the first did, medians; NaN where the first
    spent none."""
    movement_ticks: float
    evaluations: float
    """Forward kinematics and Jacobians."""
    solve_s: float
    told_more: str
    """Letters of the information that only the second is told
    (:data:`analysis.comparisons.methods.TOLD`)."""
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
    """One row a pair of :func:`pairs`, p-values adjusted over the pairs of a task."""
    rows = [_row(study, pair) for pair in pairs(study)]
    adjusted = []
    for _, family in itertools.groupby(rows, key=lambda row: row.task):
        of_task = list(family)
        bootstrap = holm([row.p_bootstrap for row in of_task])
        permutation = holm([row.p_permutation for row in of_task])
        adjusted += [
            replace(row, p_bootstrap_holm=one, p_permutation_holm=two)
            for row, one, two in zip(of_task, bootstrap, permutation, strict=True)
        ]
    return tuple(adjusted)


def pairs_table(rows: Sequence[PairRow]) -> pd.DataFrame:
    """The rows with the fields of :class:`PairRow` as columns."""
    columns = [field.name for field in fields(PairRow)]
    return pd.DataFrame([vars(row) for row in rows], columns=columns)


def _row(study: Study, pair: Pair) -> PairRow:
    """A pair, its p-values not yet adjusted."""
    a, b = _rewards(pair.first), _rewards(pair.second)
    told, told_second = _told(study, pair.first), _told(study, pair.second)
    found = _inferred(pair, a, b)
    sd_first, sd_second = sd(a), 0.0 if pair.known and len(b) else sd(b)
    optimum = study.optima.get((pair.first.task, "free"))
    best = abs(optimum.reward) if optimum else math.nan
    fewest = len(a) if pair.known else min(len(a), len(b))
    smallest = _smallest(sd_first, sd_second, fewest)
    return PairRow(
        task=pair.first.task,
        kind=pair.kind,
        first=pair.first.label,
        second=pair.second.label,
        runs_first=len(pair.first.runs),
        runs_second=len(pair.second.runs),
        n_first=len(a),
        n_second=len(b),
        mean_first=_mean(a),
        mean_second=_mean(b),
        sd_first=sd_first,
        sd_second=sd_second,
        difference=found.difference.estimate,
        low=found.difference.low,
        high=found.difference.high,
        interval=found.interval,
        pairs=found.pairs,
        correlation=found.correlation,
        independent_low=found.independent.low,
        independent_high=found.independent.high,
        expected="higher" if pair.expected == "greater" else "lower",
        p_bootstrap=found.bootstrap.p,
        p_bootstrap_holm=math.nan,
        p_permutation=found.permutation.p,
        p_permutation_holm=math.nan,
        **_with_ends("delta", cliffs_delta(found.improvement)),
        **_with_ends("improvement", found.improvement),
        **_spent(study, pair),
        told_more=_letters(told_second - told),
        told_less=_letters(told - told_second),
        **{name: _runs_for(share * best, sd_first, sd_second) for name, share in RUNS_FOR.items()},
        smallest=smallest,
        smallest_share=smallest / best if best > 0 else math.nan,
        note="; ".join(found.notes),
    )


class _Inferred(NamedTuple):
    """Difference, tests and effect size of two samples of rewards."""

    difference: Inference
    independent: Inference
    bootstrap: Inference
    permutation: Inference
    improvement: Inference
    interval: str = ""
    pairs: int = 0
    correlation: float = math.nan

    @property
    def notes(self) -> list[str]:
        every = (self.difference, self.bootstrap, self.permutation, self.improvement)
        return list(dict.fromkeys(found.note for found in every if found.note))


def _inferred(pair: Pair, a: Array, b: Array) -> _Inferred:
    if not (len(a) and len(b)):
        nothing = Inference(math.nan, (len(a), len(b)), "", note="no run with a solution")
        return _Inferred(*(nothing,) * 5)
    second = float(b[0]) if pair.known else b
    independent = difference_of_means(a, second, seed=SEED)
    bootstrap = bootstrap_test(a, second, pair.expected, seed=SEED)
    better = probability_of_improvement(a, second, seed=SEED)
    if pair.known:
        flips = sign_flip_test(a, second, "two-sided", seed=SEED)
        every = independent, independent, bootstrap, flips, better
        return _Inferred(*every, "against a known value")
    permutation = permutation_test(a, second, "two-sided", seed=SEED)
    x, y = paired_by_seed(pair.first.good, pair.second.good)
    if not len(x):
        every = independent, independent, bootstrap, permutation, better
        return _Inferred(*every, "independent")
    differ = len(x) > 2 and np.ptp(x) and np.ptp(y)
    correlation = float(np.corrcoef(x, y)[0, 1]) if differ else math.nan
    paired = paired_difference(x, y, seed=SEED)
    every = paired, independent, bootstrap, permutation, better
    return _Inferred(*every, "paired by seed", len(x), correlation)


def _with_ends(name: str, found: Inference) -> dict[str, float]:
    return {name: found.estimate, f"{name}_low": found.low, f"{name}_high": found.high}


def _spent(study: Study, pair: Pair) -> dict[str, float]:
    """What the second spends over what the first does."""
    ratios = {}
    rows = study.method_rows
    first, second = (rows[cell.task, cell.label] for cell in (pair.first, pair.second))
    for name, columns in SPENDS.items():
        ours, theirs = (
            sum(getattr(spent, column) for column in columns) for spent in (first, second)
        )
        ratios[name] = theirs / ours if ours else math.nan
    return ratios


def _runs_for(difference: float, first_sd: float, second_sd: float) -> float:
    """Runs that find it; NaN where a number is unknown."""
    known = difference > 0 and not (math.isnan(first_sd) or math.isnan(second_sd))
    return runs_needed(difference, first_sd, second_sd) if known else math.nan


def _smallest(first_sd: float, second_sd: float, runs: int) -> float:
    if math.isnan(first_sd) or math.isnan(second_sd):
        return math.nan
    return smallest_difference(first_sd, second_sd, runs)


def _keeping_still(condition: str) -> str | None:
    """The condition that differs in keeping still the arm that is not chosen, if any."""
    most = CONDITIONS[condition]
    for name, other in reversed(CONDITIONS.items()):
        if most.modify_other and other == replace(most, id=name, modify_other=False):
            return name
    return None


def _rewards(cell: CellRuns) -> Array:
    return np.asarray(cell.good.reward.to_numpy(dtype=np.float64))


def _told(study: Study, cell: CellRuns) -> set[str]:
    return set(study.method_rows[cell.task, cell.label].told)


def _letters(told: set[str]) -> str:
    return "".join(letter for letter in TOLD.values() if letter in told)


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else math.nan
