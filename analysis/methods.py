"""Every method of a results folder side by side: reward, gap, cost, and what it was told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from analysis.optimum import METHODS as OPTIMUM
from analysis.optimum import Optimum, optima
from analysis.results import CellRuns, Results
from analysis.table import NONE, Table
from coartic.method import Information

TOLD = {
    Information.GOALS: "G",
    Information.FORWARD_KINEMATICS: "F",
    Information.JACOBIAN: "J",
    Information.CORRECTIVE_PROCESS: "A",
    Information.REWARD_BY_TRIAL: "T",
    Information.KINEMATIC_MODEL: "K",
    Information.REWARD_FORMULA: "R",
    Information.SECONDARY_OBJECTIVES: "S",
}
"""A letter for each kind of information, in the order in which the tables show them."""
_SPENT = (
    "trials",
    "movement_ticks",
    "forward_kinematics",
    "jacobians",
    "solver_iterations",
)


def methods_frame(results: Results) -> pd.DataFrame:
    """One row per task and method, best mean reward first within a task.

    Rewards are of runs with a solution; what was spent is the median over all runs. The
    gaps are the optimum's reward less the mean: ``gap`` to what is best with all joints
    free, ``gap_still`` to what is best with the arm that is not chosen kept still, for
    methods whose solutions keep it so. ``beaten`` counts runs above the optimum, which
    there cannot be. Times are wall time in s of runs in a warm process, where there are any.
    """
    references = optima(results)
    rows = [_row(cell, references) for cell in results.cells]
    frame = pd.DataFrame(rows)
    order = {name: place for place, name in enumerate(results.tasks)}
    by_task = frame.task.map(order)
    return (
        frame.assign(by_task=by_task)
        .sort_values(["by_task", "reward"], ascending=[True, False], kind="stable")
        .drop(columns="by_task")
        .reset_index(drop=True)
    )


def methods_tables(results: Results) -> list[Table]:
    """:func:`methods_frame` as a table of text per task."""
    frame, references = methods_frame(results), optima(results)
    tables = []
    for name, rows in frame.groupby("task", sort=False):
        tables.append(
            Table(
                _title(str(name), references, results),
                (
                    "method",
                    "told",
                    "reward: mean ± SD (n)",
                    "gap",
                    "other arm",
                    "hands",
                    "trials",
                    "ticks",
                    "kinematics",
                    "Jacobians",
                    "iterations",
                    "solve s",
                ),
                tuple(_cells(row) for row in rows.to_dict("records")),
            )
        )
    return tables


def methods_notes(results: Results) -> list[str]:
    """What the tables' columns mean, and what does not fit."""
    frame = methods_frame(results)
    letters = ", ".join(f"{letter} {item.value}" for item, letter in TOLD.items())
    notes = [
        f"Told: {letters}.",
        "Gap: ticks from the optimum of the task to the mean reward, and as a share of the "
        "optimum; in brackets the gap to the optimum with the other arm still, where a method's "
        "solutions keep still the arm that is not chosen. The optimum is the best of three "
        "searches; a bound is proven by branch and bound (docs/model.md).",
        "Trials, control ticks of those trials, forward kinematics, Jacobians, solver iterations "
        "and solve time are medians over runs, of one run each; what a robot would do while it "
        "executes the solution is not part of them. Solve time leaves out what is built once.",
    ]
    failed = frame[frame.runs > frame.solved]
    for row in failed.to_dict("records"):
        notes.append(
            f"{row['task']} x {row['method']}: {row['runs'] - row['solved']} of {row['runs']} "
            "runs have no solution; they are counted, not part of the mean."
        )
    for row in frame[frame.beaten > 0].to_dict("records"):
        notes.append(
            f"**{row['beaten']} runs of {row['task']} x {row['method']} are better than the "
            "optimum: it is not one. Report this.**"
        )
    for row in frame[frame.corrections > 0].to_dict("records"):
        if "T" not in row["told"]:
            notes.append(
                f"{row['task']} x {row['method']}: its solutions needed {row['corrections']} "
                "corrective movements in all."
            )
    return notes


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Wall time of solving, s: of runs in a warm process, or of all where there are none.

    ``runs`` have a solution. Their whole time stands for methods that mark no solving.
    """
    warm = runs.warm.astype(bool)
    times: pd.Series = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    return times[warm] if warm.any() else times


def _row(cell: CellRuns, references: dict[tuple[str, str], Optimum]) -> dict[str, Any]:
    good = cell.good
    rewards = good.reward.to_numpy(dtype=np.float64)
    still = bool(len(good)) and bool((good.other_arm_travel == 0.0).all())
    best = references.get((cell.task, "free"))
    best_still = references.get((cell.task, "still")) if still else None
    mean = float(rewards.mean()) if len(rewards) else math.nan
    told = set(cell.runs.told.iloc[0].split(", ")) if len(cell.runs) else set()
    return {
        "task": cell.task,
        "method": cell.label,
        "told": "".join(letter for item, letter in TOLD.items() if item.value in told),
        "runs": len(cell.runs),
        "solved": len(good),
        "reward": mean,
        "reward_sd": float(np.std(rewards, ddof=1)) if len(rewards) > 1 else math.nan,
        "gap": best.reward - mean if best else math.nan,
        "gap_share": (best.reward - mean) / abs(best.reward) if best else math.nan,
        "gap_still": best_still.reward - mean if best_still else math.nan,
        "beaten": int((rewards > best.reward).sum()) if best else 0,
        "other_arm": "still" if still else "moves" if len(good) else NONE,
        "hands": ", ".join(
            f"{hands} {count}" if len(good) > 1 else str(hands)
            for hands, count in good.hands.value_counts().items()
        ),
        "corrections": int(good.solution_corrections.sum()) if len(good) else 0,
        **{name: _median(cell.runs[name]) for name in _SPENT},
        "build_s": _median(cell.runs.build_s),
        "solve_s": _median(solve_times(good)),
    }


def _median(values: pd.Series) -> float:
    """NaN where there is no value, as for runs that crashed."""
    known = values.dropna()
    return float(known.median()) if len(known) else math.nan


def _cells(row: Mapping[Any, Any]) -> tuple[str, ...]:
    gap = NONE
    if not math.isnan(row["gap"]):
        gap = f"{row['gap']:.1f}".removesuffix(".0") + f" ({row['gap_share']:.1%})"
        if not math.isnan(row["gap_still"]):
            gap += f" [{row['gap_still']:.1f}]".replace(".0]", "]")
    reward = f"{NONE} (0)"
    if row["solved"]:
        reward = f"{row['reward']:.1f}" if row["solved"] > 1 else f"{row['reward']:.0f}"
        if not math.isnan(row["reward_sd"]):
            reward += f" ± {row['reward_sd']:.1f}"
        reward += f" ({row['solved']})"
    return (
        row["method"],
        row["told"] or NONE,
        reward,
        gap,
        row["other_arm"],
        row["hands"] or NONE,
        *(_count(row[name]) for name in _SPENT),
        _seconds(row["solve_s"]),
    )


def _seconds(value: float) -> str:
    if math.isnan(value):
        return NONE
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def _count(value: float) -> str:
    """A count with three figures: 950, 12.3 k, 4.98 M."""
    if not value or math.isnan(value):
        return NONE
    for size, unit in ((1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.0f}"


def _title(name: str, references: dict[tuple[str, str], Optimum], results: Results) -> str:
    known = [
        f"{arm} {found.reward} {found.hands}"
        + (
            " (proven)"
            if found.proven
            else f" (proven bound {found.bound})"
            if found.bound is not None
            else " (no bound proven)"
        )
        for arm in ("free", "still")
        if (found := references.get((name, arm))) is not None
    ]
    mark = " †" if results.tasks[name].reconstructed else ""
    if not known:
        return f"{name}{mark}: all methods; its optimum is not among the runs (methods {OPTIMUM}*)"
    return f"{name}{mark}: all methods; optimum, by the other arm: {', '.join(known)}"
