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
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from analysis.comparisons.frontier import SHARES
from analysis.comparisons.methods import LEARNER, TOLD
from analysis.results.folder import CellRuns
from analysis.results.optima import METHODS as OPTIMUM
from analysis.statistics.estimates import (
    SEED,
    Inference,
    bootstrap_test,
    cliffs_delta,
    difference_of_means,
    holm,
    paired_by_seed,
    paired_difference,
    permutation_test,
    probability_of_improvement,
    sign_flip_test,
)
from analysis.statistics.power import runs_needed, smallest_difference
from analysis.statistics.spread import sd
from coartic.exploration import CONDITIONS
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
COLUMNS = (
    "task kind first second runs_first runs_second n_first n_second mean_first mean_second "
    "sd_first sd_second difference low high interval pairs correlation independent_low "
    "independent_high expected p_bootstrap p_bootstrap_holm p_permutation p_permutation_holm "
    "delta delta_low delta_high improvement improvement_low improvement_high trials "
    "movement_ticks evaluations solve_s told_more told_less runs_5 runs_2 runs_1 smallest "
    "smallest_share note"
)
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
            if condition in plain or cell.method.startswith(OPTIMUM):
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


def pairwise_frame(study: Study) -> pd.DataFrame:
    """One row a pair of :func:`pairs`.

    ``task``, ``kind``, ``first`` (the learner's), ``second``; of each ``runs_``, ``n_`` (runs
    with a solution, all that follows is of those), ``mean_`` and ``sd_``.

    ``difference``: mean reward of the first less the second's, ticks, with its 95 % BCa
    interval ``low`` to ``high`` and what that is of (``interval``): pairs of runs that share
    a seed, independent samples, or a sample against a number (:attr:`Pair.known`).
    ``pairs`` and ``correlation`` (Pearson's) are of runs that share a seed,
    ``independent_low`` and ``independent_high`` the interval that leaves pairing out.

    ``p_bootstrap``: one-tailed, in the direction ``expected`` of the first. ``p_permutation``:
    two-tailed, by the signs of the differences where the second is known. ``_holm``: adjusted
    over all pairs of the task. ``delta`` (Cliff's) and ``improvement`` (P(first higher),
    a tie half), each with ``_low`` and ``_high``.

    ``trials``, ``movement_ticks``, ``evaluations`` (forward kinematics and Jacobians),
    ``solve_s``: what the second spent in a run over what the first did, medians, NaN where
    the first spent none. ``told_more``, ``told_less``: letters of the information that only
    the second, only the first is told (:data:`analysis.comparisons.methods.TOLD`).

    ``runs_5``, ``runs_2``, ``runs_1``: runs of each that a one-tailed test at 5 % needs to
    find a difference of that share (%) of the optimum with power 80 %, at these SDs.
    ``smallest``: difference that the runs at hand (the fewer of the two) find so, ticks, and
    ``smallest_share`` of the optimum. ``note``: why there is no interval or test.
    """
    rows = [_row(study, pair) for pair in pairs(study)]
    for _, family in itertools.groupby(rows, key=lambda row: row["task"]):
        of_task = list(family)
        for name in ("p_bootstrap", "p_permutation"):
            adjusted = holm([row[name] for row in of_task])
            for row, p in zip(of_task, adjusted, strict=True):
                row[f"{name}_holm"] = p
    return pd.DataFrame(rows, columns=COLUMNS.split())


def _row(study: Study, pair: Pair) -> dict[str, Any]:
    a, b = _rewards(pair.first), _rewards(pair.second)
    task = pair.first.task
    row: dict[str, Any] = {
        "task": task,
        "kind": pair.kind,
        "first": pair.first.label,
        "second": pair.second.label,
        "runs_first": len(pair.first.runs),
        "runs_second": len(pair.second.runs),
        "n_first": len(a),
        "n_second": len(b),
        "mean_first": _mean(a),
        "mean_second": _mean(b),
        "sd_first": sd(a),
        "sd_second": 0.0 if pair.known and len(b) else sd(b),
    }
    row |= _inference(pair, a, b)
    first, second = (study.method_rows[task, cell.label] for cell in (pair.first, pair.second))
    for name, columns in SPENDS.items():
        ours, theirs = (
            sum(getattr(spent, column) for column in columns) for spent in (first, second)
        )
        row[name] = theirs / ours if ours else math.nan
    row["told_more"] = _letters(_told(study, pair.second) - _told(study, pair.first))
    row["told_less"] = _letters(_told(study, pair.first) - _told(study, pair.second))
    optimum = study.optima.get((task, "free"))
    return row | _sizes(row, abs(optimum.reward) if optimum else math.nan, pair.known)


def _inference(pair: Pair, a: Array, b: Array) -> dict[str, Any]:
    """Difference, tests and effect sizes of two samples of rewards."""
    nothing = Inference(math.nan, (len(a), len(b)), "", note="no run with a solution")
    apart = independent = test = permutation = better = nothing
    kind, pairs_n, correlation = "", 0, math.nan
    if len(a) and len(b):
        second = float(b[0]) if pair.known else b
        independent = difference_of_means(a, second, seed=SEED)
        apart, kind = independent, "against a known value" if pair.known else "independent"
        test = bootstrap_test(a, second, pair.expected, seed=SEED)
        better = probability_of_improvement(a, second, seed=SEED)
        if pair.known:
            permutation = sign_flip_test(a, second, "two-sided", seed=SEED)
        else:
            permutation = permutation_test(a, second, "two-sided", seed=SEED)
            x, y = paired_by_seed(pair.first.good, pair.second.good)
            if pairs_n := len(x):
                apart, kind = paired_difference(x, y, seed=SEED), "paired by seed"
            if pairs_n > 2 and np.ptp(x) and np.ptp(y):
                correlation = float(np.corrcoef(x, y)[0, 1])
    delta = cliffs_delta(better)
    notes = dict.fromkeys(n.note for n in (apart, test, permutation, better) if n.note)
    return {
        "difference": apart.estimate,
        "low": apart.low,
        "high": apart.high,
        "interval": kind,
        "pairs": pairs_n,
        "correlation": correlation,
        "independent_low": independent.low,
        "independent_high": independent.high,
        "expected": "higher" if pair.expected == "greater" else "lower",
        "p_bootstrap": test.p,
        "p_permutation": permutation.p,
        "delta": delta.estimate,
        "delta_low": delta.low,
        "delta_high": delta.high,
        "improvement": better.estimate,
        "improvement_low": better.low,
        "improvement_high": better.high,
        "note": "; ".join(notes),
    }


def _sizes(row: dict[str, Any], optimum: float, known: bool) -> dict[str, Any]:
    sds = row["sd_first"], row["sd_second"]
    measured = not any(map(math.isnan, sds))
    fewest = row["n_first"] if known else min(row["n_first"], row["n_second"])
    found = {
        f"runs_{share:.0%}".removesuffix("%"): runs_needed(share * optimum, *sds)
        if measured and optimum > 0
        else math.nan
        for share in SHARES
    }
    smallest = smallest_difference(*sds, fewest) if measured else math.nan
    share = smallest / optimum if optimum > 0 else math.nan
    return {**found, "smallest": smallest, "smallest_share": share}


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
