"""Every method over all tasks of a folder: normalised scores, gaps, and their profiles.

Of the tasks whose optimum and initial solution are known, each counting the same. The
learner explores one-armed and two-armed tasks under different conditions; :func:`combined`
puts them together, so that it has a row as well.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pandas as pd

from analysis.comparisons.methods import LEARNER
from analysis.results.optima import METHODS as OPTIMUM
from analysis.statistics.across_tasks import by_task, interquartile_mean, profile, task_mean
from analysis.statistics.estimates import FEWEST, SEED, Inference
from coartic.robot import Array

NEAR = (0.01, 0.02, 0.05, 0.1)
"""Gaps, as shares of the optimum, that count as near."""
THRESHOLDS = {"gap": np.arange(81) / 200, "score": np.arange(-10, 51) / 50}
"""Of the profiles: gaps from 0 to 40 %, normalised scores from −0.2 to 1."""
_CONDITION = re.compile(re.escape(LEARNER) + r"(EC\d)(.*)")
_ONE_ARMED, _TWO_ARMED = "EC1", ("EC4", "EC3")


def combined(scores: pd.DataFrame) -> pd.DataFrame:
    """``scores`` with rows of the learner over one-armed and two-armed tasks.

    ``scores`` is of :func:`analysis.statistics.across_tasks.scores_frame`. Where EC4 (likewise
    EC3) ran, its runs, elsewhere those of EC1, both as method ``dual-process (EC1, EC4)``;
    likewise variants of the two with the same name and parameters.
    """
    parts = [scores]
    labels = set(scores.method)
    for label in sorted(labels):
        found = _CONDITION.fullmatch(label)
        if found is None or found[1] not in _TWO_ARMED:
            continue
        one, variant = f"{LEARNER}{_ONE_ARMED}{found[2]}", found[2]
        two_armed = scores[scores.method == label]
        elsewhere = scores[(scores.method == one) & ~scores.task.isin(two_armed.task)]
        if len(elsewhere):
            name = f"{LEARNER.rstrip('/')} ({_ONE_ARMED}{variant}, {found[1]}{variant})"
            parts.append(pd.concat([elsewhere, two_armed]).assign(method=name))
    return pd.concat(parts, ignore_index=True)


def everywhere(scores: pd.DataFrame) -> list[str]:
    """Methods with runs on all tasks of ``scores``, the optimum's searches left out.

    None where there are fewer than two tasks.
    """
    tasks = scores.groupby("method", sort=False).task.nunique()
    most = scores.task.nunique()
    return [
        str(name)
        for name, count in tasks.items()
        if most > 1 and count == most and not str(name).startswith(OPTIMUM)
    ]


def overall_frame(scores: pd.DataFrame) -> pd.DataFrame:
    """One row a method of :func:`everywhere`, the highest interquartile mean first.

    ``tasks``, ``runs`` (of all tasks), ``failed`` (without a solution); ``score``:
    interquartile mean of the normalised scores; ``gap``: mean gap as a share of the optimum;
    ``within_1``, ``_2``, ``_5``, ``_10``: share of runs whose gap is at most so many %, a
    failed run's never. Each with ``_low`` and ``_high`` (95 %, stratified bootstrap) and
    ``_note``, why there is no interval. ``score`` and ``gap`` are missing where runs failed.
    """
    rows = []
    for method in everywhere(scores):
        score, gap = (by_task(scores, method, column) for column in ("score", "gap"))
        failed = int(sum(np.isnan(runs).sum() for runs in gap.values()))
        row: dict[str, Any] = {
            "method": method,
            "tasks": len(gap),
            "runs": sum(map(len, gap.values())),
            "failed": failed,
        }
        for name, of in (
            ("score", None if failed else interquartile_mean(score, seed=SEED)),
            ("gap", None if failed else task_mean(gap, seed=SEED)),
            *((f"within_{near:.0%}".rstrip("%"), _share(gap, near)) for near in NEAR),
        ):
            found = of or Inference(math.nan, (), "", note=f"{failed} runs without a solution")
            row |= {
                name: found.estimate,
                f"{name}_low": found.low,
                f"{name}_high": found.high,
                f"{name}_note": found.note,
            }
        rows.append(row)
    columns = ["method", "tasks", "runs", "failed"]
    for name in ("score", "gap", *(f"within_{near:.0%}".rstrip("%") for near in NEAR)):
        columns += [name, f"{name}_low", f"{name}_high", f"{name}_note"]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.sort_values("score", ascending=False, kind="stable", ignore_index=True)


def profiles_frame(scores: pd.DataFrame) -> pd.DataFrame:
    """Profiles of every method of :func:`everywhere`, to be drawn: one row a threshold.

    ``kind``: ``gap`` (share of runs whose gap, as a share of the optimum, is at most
    ``threshold``) or ``score`` (share of runs whose normalised score is above it); ``share``
    with its pointwise 95 % interval ``low`` to ``high``, and ``note``, why there is none.
    """
    parts = []
    for method in everywhere(scores):
        for kind, thresholds in THRESHOLDS.items():
            reached = "at most" if kind == "gap" else "above"
            values = by_task(scores, method, kind)
            found = profile(values, thresholds, reached, seed=SEED)  # type: ignore[arg-type]
            notes = [
                _note(found.n, low, high) for low, high in zip(found.low, found.high, strict=True)
            ]
            silent = np.array([bool(note) for note in notes])
            parts.append(
                pd.DataFrame(
                    {
                        "method": method,
                        "kind": kind,
                        "threshold": found.thresholds,
                        "share": found.share,
                        "low": np.where(silent, math.nan, found.low),
                        "high": np.where(silent, math.nan, found.high),
                        "note": notes,
                    }
                )
            )
    columns = ["method", "kind", "threshold", "share", "low", "high", "note"]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def _share(gaps: dict[str, Array], near: float) -> Inference:
    """Share of runs whose gap is at most ``near``."""
    found = profile(gaps, [near], "at most", seed=SEED)
    low, high, share = float(found.low[0]), float(found.high[0]), float(found.share[0])
    note = _note(found.n, low, high)
    if note:
        low = high = math.nan
    return Inference(share, found.n, found.method, low, high, found.confidence, note=note)


def _note(n: tuple[int, ...], low: float, high: float) -> str:
    """Why a share of runs has no interval."""
    if min(n) < FEWEST:
        return f"no interval: fewer than {FEWEST} runs of a task"
    return f"no interval: no spread within tasks in {sum(n)} runs" if low == high else ""
