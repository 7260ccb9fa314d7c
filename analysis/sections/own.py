"""Section on methods from files, next to built-in methods on the same tasks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from coartic.analysis.frames import ranking
from coartic.analysis.method_frame import BY_TRIAL
from coartic.analysis.sections.costs import half_of_targets
from coartic.analysis.sections.ranking import SCORE_COLUMNS
from coartic.analysis.standings import board, compared, runs_on, solved_tasks, together
from coartic.analysis.study import Study
from coartic.analysis.table import Row, Rows, run_ids, table
from coartic.estimates import FEWER_RESAMPLES, Estimate, mean_of_means
from coartic.learner.conditions import CONDITIONS
from coartic.robot import Array


def own_methods(study: Study) -> list[str]:
    """Return the labels of the methods from files that solved every run on a task or more, the
    smallest gap first."""
    rows = board(study)
    return [*rows.index[~rows.built_in.astype(bool)]]


@table(
    "Own methods, and built-in methods on the tasks that they solved",
    "own: own method; method; gap[]: gap (%) .1; "
    "difference[]: gap less that of the own method (%) .1; "
    "share[]: share of the gain (%) .0; trials_to_half[]: trials to half of the targets; tasks; "
    "runs",
)
def list_own(study: Study) -> Rows:
    """List each method from a file, then the built-in method with the nearest gap and the same use
    of the reward, the learner that explores most, and CMA-ES, on the tasks on which the method from
    the file solved every run.

    Intervals are for other runs on the same tasks.
    """
    for own in own_methods(study):
        tasks = solved_tasks(study, own)
        parts = {name: runs_on(study, name, tasks) for name in compared(study)}
        scores = ranking(together(study, parts))
        rows = study.methods.loc[scores.index[scores.gap.notna()]]
        built_in = rows[rows.built_in & (rows.under == "")]
        same_use = built_in[built_in.information == study.methods.information[own]]
        apart = (scores.gap[same_use.index[~same_use.is_learner]] - scores.gap[own]).abs()
        explores = built_in.condition[built_in.is_learner].map([*CONDITIONS].index)
        others = [
            *apart.sort_values(kind="stable").index[:1],
            *explores.sort_values(kind="stable").index[-1:],
            *built_in.index[built_in.index == "cma-es/bandit"],
        ]
        for name in dict.fromkeys([own, *others]):
            runs = parts[name]
            row: Row = {"own": own, "method": name, "tasks": len(tasks), "runs": len(runs)}
            row |= {score: scores[score][name] for score in SCORE_COLUMNS}
            if study.methods.information[name] == BY_TRIAL:
                row |= half_of_targets(study, runs).columns("trials_to_half")
            if name != own:
                row |= _difference_of_gaps(study, parts, name, own).columns("difference")
            yield f"{own} {name}", row | run_ids(runs)


def _difference_of_gaps(
    study: Study, parts: Mapping[str, pd.DataFrame], first: str, second: str
) -> Estimate:
    """Return the mean gap of the ``first`` method less that of the ``second``, each a mean over the
    tasks of its runs in ``parts``, which are the same tasks.

    Tasks are not matched. Gaps of deterministic methods are taken as exact. The interval is for
    other runs on these tasks; two exact gaps have no interval.
    """
    exact, weights, drawn = 0.0, list[float](), list[Array]()
    for sign, method in ((1, first), (-1, second)):
        tasks = parts[method].groupby("task").gap
        for _, of_task in tasks:
            weight, gaps = sign / len(tasks), of_task.to_numpy(np.float64)
            if study.methods.stochastic[method]:
                weights.append(weight)
                drawn.append(gaps)
            else:
                exact += weight * gaps.mean()
    if not drawn:
        return Estimate(exact)
    sampled = mean_of_means(drawn, weights, FEWER_RESAMPLES)
    return Estimate(sampled.value + exact, sampled.low + exact, sampled.high + exact)
