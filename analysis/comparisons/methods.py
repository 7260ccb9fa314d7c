"""Every method of a results folder side by side: reward, gap, cost, and what it was told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from analysis.markup import escaped
from analysis.methods import LEARNER as LEARNER
from analysis.results.folder import CellRuns, Results
from analysis.results.optima import METHODS as OPTIMUM
from analysis.results.optima import Optimum, locks_base, optima
from analysis.statistics.spread import sd
from analysis.table import NONE, Table, short, tally
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
STILL = 1e-9  # rad of joint travel that a solver's rounding leaves
_SPENT = (
    "trials",
    "movement_ticks",
    "forward_kinematics",
    "jacobians",
    "solver_iterations",
)


def methods_frame(results: Results) -> pd.DataFrame:
    """One row per task and method: within a task the optimum, then the best mean reward first.

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
    reference = ~frame.method.str.startswith(OPTIMUM)
    return (
        frame.assign(by_task=frame.task.map(order), reference=reference)
        .sort_values(
            ["by_task", "reference", "reward"], ascending=[True, True, False], kind="stable"
        )
        .drop(columns=["by_task", "reference"])
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
                    "reward: mean ± SD (n)",
                    "gap",
                    "told",
                    "hands",
                    "other arm",
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
    """What the tables' columns mean, and what does not fit; in inline markup."""
    frame = methods_frame(results)
    letters = ", ".join(f"{letter} {item.value}" for item, letter in TOLD.items())
    notes = [
        f"Told: {letters}.",
        "Reward: of the runs that have a solution, n of them; other arm: whether the arm that is "
        "not chosen keeps still in all of a method's solutions, as executed.",
        "Gap: ticks from the optimum of the task to the mean reward, and as a share of the "
        "optimum; in brackets the gap to the optimum with the other arm still, where a method's "
        "solutions keep still the arm that is not chosen (EC1 uses the right hand alone; its gap "
        "is to the optimum with both hands all the same). The optimum is the best of two "
        "independent searches, and *proven* where branch and bound leaves nothing above it "
        "(docs/model.md); its rows come first and are references, not competitors.",
        "Trials, control ticks of those trials, forward kinematics, Jacobians, solver iterations "
        "and solve time are medians over runs, of one run each; what a robot would do while it "
        "executes the solution is not part of them. Solve time leaves out what is built once.",
    ]
    for row in frame[frame.beaten > 0].to_dict("records"):
        notes.append(
            f"**{row['beaten']} runs of {escaped(_pair(row))} are better than the "
            "optimum: it is not one. Report this.**"
        )
    for row in frame[frame.corrections > 0].to_dict("records"):
        if "T" not in row["told"]:
            notes.append(
                f"{escaped(_pair(row))}: its solutions needed {row['corrections']} "
                "corrective movements in all."
            )
    return notes


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Wall time of solving, s: of runs in a warm process, or of all where there are none.

    ``runs`` have a solution. Their whole time stands for methods that mark no solving.
    """
    warm = runs.warm.astype("boolean").fillna(False).astype(bool)
    times: pd.Series = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    return times[warm] if warm.any() else times


def _row(cell: CellRuns, references: dict[tuple[str, str], Optimum]) -> dict[str, Any]:
    good = cell.good
    rewards = good.reward.to_numpy(dtype=np.float64)
    still = bool(len(good)) and bool((good.other_arm_travel <= STILL).all())
    locked = locks_base(cell.runs)
    best = None if locked else references.get((cell.task, "free"))
    best_still = references.get((cell.task, "still")) if still and not locked else None
    mean = float(rewards.mean()) if len(rewards) else math.nan
    told = set(cell.runs.told.iloc[0].split(", ")) if len(cell.runs) else set()
    return {
        "task": cell.task,
        "method": cell.method,
        "variant": cell.variant,
        "told": "".join(letter for item, letter in TOLD.items() if item.value in told),
        "runs": len(cell.runs),
        "solved": len(good),
        "reward": mean,
        "reward_sd": sd(rewards),
        "gap": best.reward - mean if best else math.nan,
        "gap_share": (best.reward - mean) / -best.reward if best and best.reward else math.nan,
        "gap_still": best_still.reward - mean if best_still else math.nan,
        "beaten": int(
            sum((rewards > known.reward).sum() for known in (best, best_still) if known)
        ),
        "other_arm": "still" if still else "moves" if len(good) else "",
        "hands": tally(good.hands.value_counts().to_dict())
        if len(good) > 1
        else "".join(good.hands),
        "corrections": int(good.solution_corrections.sum()) if len(good) else 0,
        **{name: _median(cell.runs[name]) for name in _SPENT},
        "build_s": _median(cell.runs.build_s),
        "solve_s": _median(solve_times(good)),
    }


def _pair(row: Mapping[Any, Any]) -> str:
    return f"{row['task']} x {row['method']}"


def _median(values: pd.Series) -> float:
    """NaN where there is no value, as for runs that crashed."""
    known = values.dropna()
    return float(known.median()) if len(known) else math.nan


def _cells(row: Mapping[Any, Any]) -> tuple[str, ...]:
    gap = NONE
    if not math.isnan(row["gap"]):
        gap = f"{row['gap']:.1f}".removesuffix(".0")
        if not math.isnan(row["gap_share"]):
            gap += f" ({row['gap_share']:.1%})"
        if not math.isnan(row["gap_still"]):
            gap += f" [{row['gap_still']:.1f}]".replace(".0]", "]")
    reward = f"{NONE} (0)"
    if row["solved"]:
        reward = f"{row['reward']:.1f}" if row["solved"] > 1 else f"{row['reward']:.0f}"
        if not math.isnan(row["reward_sd"]):
            reward += f" ± {row['reward_sd']:.1f}"
        reward += f" ({row['solved']})"
    return (
        f"{row['method']} {row['variant']}".strip(),
        reward,
        gap,
        row["told"] or NONE,
        row["hands"] or NONE,
        row["other_arm"] or NONE,
        *(short(row[name] or math.nan) for name in _SPENT),
        _seconds(row["solve_s"]),
    )


def _seconds(value: float) -> str:
    if math.isnan(value):
        return NONE
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


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
