"""Every method over all tasks of a folder: normalised scores, gaps, and their profiles.

Of the tasks whose optimum and initial solution are known, each counting the same. The
learner explores one-armed and two-armed tasks under different conditions; :func:`combined`
puts them together, so that it has a row as well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic.analysis.methods import LEARNER, TOGETHER
from coartic.analysis.statistics.across_tasks import (
    Reached,
    gap_share,
    interquartile_mean,
    normalised,
    profile,
    task_mean,
)
from coartic.analysis.statistics.estimates import FEWEST, Inference
from coartic.initial import initial_hands
from coartic.record import SEARCH
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.study import Study

NEAR = (0.01, 0.02, 0.05, 0.1)
"""Gaps, as shares of the optimum, that count as near."""
WITHIN = {f"within_{near:.0%}".rstrip("%"): near for near in NEAR}
"""The same by the columns that say how many runs came so near."""
THRESHOLDS = {"gap": np.arange(81) / 200, "score": np.arange(-10, 51) / 50}
"""Of the profiles: gaps from 0 to 40 %, normalised scores from −0.2 to 1."""
REACHED: Mapping[str, Reached] = {"gap": "at most", "score": "above"}
"""Which side of a threshold a profile counts."""
_ENDINGS = ("", "_low", "_high", "_note")
_CONDITION = re.compile(re.escape(LEARNER) + r"(EC\d)(.*)")
_VARIANT = re.compile(r"=|\bEC\d-")
_ONE_ARMED, _TWO_ARMED = "EC1", ("EC4", "EC3")


def ends(study: Study) -> dict[str, tuple[float, int]]:
    """Rewards of the initial solution and of the optimum by task, where there is a way between.

    The initial solution is the corrective process alone with the task's initial hands, the
    optimum that with all joints free.
    """
    alone = study.results.sequences.set_index(["task", "hands"]).reward
    found = {}
    for name, task in study.tasks.items():
        best = study.optima.get((name, "free"))
        start = alone.get((name, initial_hands(task, model=study.model)))
        if best is None or pd.isna(start):
            continue
        # Nothing to fall short of, or to gain; or a search that missed the optimum: no scale.
        if best.reward != 0 and best.reward > start:
            found[name] = float(start), best.reward
    return found


def variant(label: str) -> bool:
    """Whether it was run with parameters of its own, or is an ablation of the learner."""
    return bool(_VARIANT.search(label))


def normalised_scores(study: Study) -> pd.DataFrame:
    """One row a run of every task whose optimum and initial solution are known.

    Columns ``task``, ``method`` (with its variant), ``label`` (the cell's, whatever becomes of
    ``method``), ``run``, ``seed``, ``reward``; ``score``
    (:func:`~coartic.analysis.statistics.across_tasks.normalised`) and ``gap``
    (:func:`~coartic.analysis.statistics.across_tasks.gap_share`), both against the optimum with
    all joints free and the corrective process alone with the task's initial hands. A run without a
    solution has NaN for all three.
    """
    parts, known = [], ends(study)
    for cell in study.cells.values():
        if cell.task not in known:
            continue
        start, best = known[cell.task]
        rewards = cell.runs.reward.where(cell.runs.status == "ok")
        values = rewards.to_numpy(dtype=np.float64, na_value=math.nan)
        own = {
            **{"task": cell.task, "method": cell.label, "label": cell.label},
            "run": cell.runs.run.to_numpy(),
            "seed": cell.runs.seed.to_numpy(),
            "reward": values,
            "score": normalised(values, start, best),
            "gap": gap_share(values, best),
        }
        parts.append(pd.DataFrame(own))
    columns = ["task", "method", "label", "run", "seed", "reward", "score", "gap"]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def by_task(scores: pd.DataFrame, method: str, column: str = "score") -> dict[str, Array]:
    """One method's column of :func:`normalised_scores`, by task, NaN included."""
    rows = scores[scores.method == method]
    return {
        str(task): group[column].to_numpy(dtype=np.float64)
        for task, group in rows.groupby("task", sort=False)
    }


def combined(scores: pd.DataFrame) -> pd.DataFrame:
    """``scores`` with rows of the learner over one-armed and two-armed tasks.

    ``scores`` is of :func:`normalised_scores`. Where EC4 (likewise EC3) ran, its runs, elsewhere
    those of EC1, both as method ``dual-process (EC1, EC4)``; likewise variants of the two with the
    same name and parameters.
    """
    parts = [scores]
    for label in sorted(set(scores.method)):
        found = _CONDITION.fullmatch(label)
        if found is None or found[1] not in _TWO_ARMED:
            continue
        condition, variant = found.groups()
        two_armed = scores[scores.method == label]
        one_armed = scores[scores.method == f"{LEARNER}{_ONE_ARMED}{variant}"]
        elsewhere = one_armed[~one_armed.task.isin(two_armed.task)]
        if len(elsewhere):
            name = f"{TOGETHER}{_ONE_ARMED}{variant}, {condition}{variant})"
            parts.append(pd.concat([elsewhere, two_armed]).assign(method=name))
    return pd.concat(parts, ignore_index=True)


def everywhere(scores: pd.DataFrame) -> list[str]:
    """Methods with runs on all tasks of ``scores``, the optimum's searches left out.

    None where there are fewer than two tasks.
    """
    tasks = scores.groupby("method", sort=False).task.nunique()
    most = scores.task.nunique()
    found = map(str, tasks.index[tasks == most])
    return [name for name in found if most > 1 and not name.startswith(SEARCH)]


def over_tasks(scores: pd.DataFrame) -> pd.DataFrame:
    """One row a method of :func:`everywhere` of ``scores``, the least mean gap first.

    ``tasks``, ``runs`` (of all tasks), ``failed`` (without a solution); ``gap``: mean gap as a
    share of the optimum, the headline measure; ``score``: interquartile mean of the normalised
    scores, which of few tasks with one run each drops the best and the worst; ``within_1``,
    ``_2``, ``_5``, ``_10``: share of runs whose gap is at most so many %, a failed run's never.
    Each with ``_low`` and ``_high`` (95 %, stratified bootstrap) and ``_note``, why there is no
    interval. ``score`` and ``gap`` are missing where runs failed.
    """
    rows = []
    for method in everywhere(scores):
        score, gap = (by_task(scores, method, column) for column in ("score", "gap"))
        failed = int(sum(np.isnan(runs).sum() for runs in gap.values()))
        unknown = Inference(math.nan, (), "", note=f"{failed} runs without a solution")
        measures = {
            "score": unknown if failed else interquartile_mean(score),
            "gap": unknown if failed else task_mean(gap),
            **dict(zip(WITHIN, _shares(gap, NEAR, "at most"), strict=True)),
        }
        row: dict[str, Any] = {"method": method, "tasks": len(gap)}
        row |= {"runs": sum(map(len, gap.values())), "failed": failed}
        for name, found in measures.items():
            row[name] = found.estimate
            row |= {f"{name}_{part}": getattr(found, part) for part in ("low", "high", "note")}
        rows.append(row)
    names = [f"{name}{end}" for name in ("score", "gap", *WITHIN) for end in _ENDINGS]
    frame = pd.DataFrame(rows, columns=["method", "tasks", "runs", "failed", *names])
    return frame.sort_values("gap", kind="stable", ignore_index=True)


def profiles(scores: pd.DataFrame) -> pd.DataFrame:
    """Profiles of every method of :func:`everywhere` of ``scores``: one row a threshold.

    ``kind``: ``gap`` (share of runs whose gap, as a share of the optimum, is at most
    ``threshold``) or ``score`` (share of runs whose normalised score is above it); ``share``
    with its pointwise 95 % interval ``low`` to ``high``, and ``note``, why there is none.
    """
    rows = []
    for method in everywhere(scores):
        for kind, thresholds in THRESHOLDS.items():
            shares = _shares(by_task(scores, method, kind), thresholds, REACHED[kind])
            for threshold, s in zip(thresholds, shares, strict=True):
                rows.append((method, kind, threshold, s.estimate, s.low, s.high, s.note))
    columns = ["method", "kind", "threshold", "share", "low", "high", "note"]
    return pd.DataFrame(rows, columns=columns)


def _shares(values: dict[str, Array], thresholds: ArrayLike, reached: Reached) -> list[Inference]:
    """Share of runs that reach each threshold, with its interval or why there is none."""
    found = profile(values, thresholds, reached)
    shares = []
    for share, low, high in zip(found.share, found.low, found.high, strict=True):
        note = ""
        if min(found.n) < FEWEST:
            note = f"no interval: fewer than {FEWEST} runs of a task"
        elif low == high:
            note = f"no interval: no spread within tasks in {sum(found.n)} runs"
        if note:
            low = high = math.nan
        shares.append(Inference(share, found.n, "", low, high, note=note))
    return shares
