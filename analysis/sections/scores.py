"""Section on the share of the possible gain, by arms and by trials, and its cost."""

from __future__ import annotations

import numpy as np
import pandas as pd

from coartic.analysis import standings
from coartic.analysis.frames import ranking
from coartic.analysis.sections.costs import improvements
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table

EARLY = 1_000
"""Trials after which methods are scored as well."""


def compared_runs(study: Study) -> pd.DataFrame:
    """Return the runs of compared methods on the tasks over which algorithms are compared, with the
    label of the row of :attr:`.Study.methods` in the column ``method``."""
    parts = [
        cell.runs.assign(method=method, setting="")
        for method in standings.compared(study)
        for cell in standings.cells_on(study, method, standings.common_tasks(study))
    ]
    return pd.concat(parts, ignore_index=True) if parts else study.runs[:0]


def after(study: Study, runs: pd.DataFrame, trials: int) -> pd.DataFrame:
    """Return runs with the best reward of their first trials; runs of methods that make no trials
    keep theirs."""
    early, learned = runs.copy(), improvements(study)
    for row, run_id in zip(runs.index, runs.run_id, strict=True):
        if run_id in learned:
            numbers, rewards = learned[run_id]
            last = int(np.searchsorted(numbers, trials, side="right")) - 1
            early.loc[row, "reward"] = int(rewards[last]) if last >= 0 else pd.NA
    return early


@cached
def scores(study: Study) -> dict[str, pd.DataFrame]:
    """Return :func:`.ranking` over all compared tasks, over those for one arm and for two, and over
    all after a thousand trials."""
    runs = compared_runs(study)
    every = {
        "": runs,
        "_one_armed": runs[runs.arms == 1],
        "_two_armed": runs[runs.arms == 2],
        "_early": after(study, runs, EARLY),
    }
    return {name: ranking(frame) for name, frame in every.items() if len(frame)}


@table(
    "method; share[]: share of the possible gain (%) .0; gap[]: gap (%) .1; "
    "share_one_armed[]: share, one arm (%) .0; gap_one_armed: gap, one arm (%) .1; "
    "share_two_armed[]: share, two arms (%) .0; gap_two_armed: gap, two arms (%) .1; "
    "share_early[]: share after 1000 trials (%) .0; gap_early: gap after 1000 trials (%) .1; "
    "tasks: number of tasks; without_gain: tasks without possible gain; "
    "forward_kinematics: forward-kinematics evaluations (mean of runs) .0; "
    "cpu_s: CPU seconds (mean of runs)"
)
def list_scores(study: Study) -> Rows:
    """Share of the possible gain and gap of each compared method, over all tasks, by arms, and
    after a thousand trials, with what a run costs."""
    by_frame, runs = scores(study), compared_runs(study)
    if "" not in by_frame:
        return
    order = by_frame[""].sort_values("share", ascending=False, kind="stable")
    for method in order.index[order.gap.notna()]:
        of_method = runs[runs.method == method]
        row: Row = {"method": method}
        for name, frame in by_frame.items():
            for score in ("share", "gap"):
                for end in ("", "_low", "_high"):
                    row[score + name + end] = frame[score + end].get(method, np.nan)
        row |= {
            "tasks": int(order.tasks[method]),
            "without_gain": int(order.without_gain[method]),
            "forward_kinematics": of_method.forward_kinematics.mean(),
            "cpu_s": of_method.cpu_s.mean(),
        }
        yield (
            str(method),
            row | runs_of(*standings.cells_on(study, str(method), standings.common_tasks(study))),
        )
