"""Every method of a results folder side by side: reward, gap, cost, and what it was told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from coartic.analysis.cells import CellIdentity, CellKey, CellRuns
from coartic.analysis.optima import locks_base
from coartic.analysis.statistics.spread import sd
from coartic.analysis.study import Study, cached
from coartic.analysis.words import tally
from coartic.method import Information
from coartic.robot import Array
from coartic.runs.plan import SEARCH

TOLD = {
    Information.GOALS: "G",
    Information.FORWARD_KINEMATICS: "F",
    Information.JACOBIAN: "J",
    Information.CORRECTIVE_PROCESS: "A",
    Information.REWARD_BY_TRIAL: "T",
    Information.REWARD_BY_SUBTASK: "U",
    Information.KINEMATIC_MODEL: "K",
    Information.REWARD_FORMULA: "R",
    Information.SECONDARY_OBJECTIVES: "S",
}
"""A letter for each kind of information, in the order in which the tables show them."""
BY_TRIAL, BY_FORMULA, UNTOLD = GROUPS = (
    "learn from the reward of each trial",
    "know the reward as a formula",
    "do not know the reward",
)
"""What methods know of the reward: those that learn it, compute it, or neither."""
_SPENT = (
    *("trials", "movement_ticks", "forward_kinematics", "jacobians"),
    *("solver_iterations", "build_s"),
)
STILL = 1e-9  # rad of joint travel that a solver's rounding leaves


@dataclass(frozen=True)
class MethodRow(CellIdentity):
    """A method on a task; NaN is for what is not known, such as times of runs that crashed.

    Rewards are of runs with a solution; what was spent is the median over all runs.
    """

    told: str
    """A letter for each kind of information (:data:`TOLD`)."""
    runs: int
    solved: int
    """Runs with a solution."""
    reward: float
    """Mean, ticks."""
    reward_sd: float
    gap: float
    """Reward of the optimum with all joints free less the mean, ticks."""
    gap_share: float
    """The same as a share of that optimum."""
    gap_still: float
    """To the optimum with the arm that is not chosen still, where all solutions keep it so."""
    beaten: int
    """Runs above the optimum, which there cannot be."""
    other_arm: str
    """Whether it keeps ``still`` in all solutions, as executed, or ``moves``; or nothing."""
    hands: str
    """Hand sequences with their runs, the commonest first; alone where there is one run."""
    corrections: int
    """Corrective movements that the solutions needed in all."""
    trials: float
    movement_ticks: float
    """Of all trials."""
    forward_kinematics: float
    jacobians: float
    solver_iterations: float
    build_s: float
    """Wall time of what is built once."""
    solve_s: float
    """:func:`solve_times`."""
    evaluations: float
    """Forward kinematics and Jacobians together."""


def knows(told: str) -> str:
    """What letters of :data:`TOLD` say that a method knows of the reward: of :data:`GROUPS`."""
    if TOLD[Information.REWARD_FORMULA] in told:
        return BY_FORMULA
    return BY_TRIAL if TOLD[Information.REWARD_BY_TRIAL] in told else UNTOLD


@cached
def method_rows(study: Study) -> dict[CellKey, MethodRow]:
    """Every method on every task: within a task the optimum, then the best mean reward first."""
    order = {name: place for place, name in enumerate(study.tasks)}

    def place(row: MethodRow) -> tuple[int, bool, float]:
        worst_last = math.inf if math.isnan(row.reward) else -row.reward
        return order[row.task], not row.method.startswith(SEARCH), worst_last

    rows = sorted((_row(study, cell) for cell in study.cells.values()), key=place)
    return {(row.task, row.label): row for row in rows}


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Wall time of solving, s: of runs in a warm process, or of all where there are none.

    ``runs`` have a solution. Their whole time stands for methods that mark no solving.
    """
    warm = runs.warm.to_numpy(dtype=bool, na_value=False)
    solving, whole = numbers(runs.solve_s), numbers(runs.wall_s)
    marked = np.where(solving > 0, solving, whole)
    times = pd.Series(marked, runs.index, dtype=runs.solve_s.dtype)
    return times[warm] if warm.any() else times


def _row(study: Study, cell: CellRuns) -> MethodRow:
    good, runs = cell.good, cell.runs
    rewards = cell.rewards
    mean = float(rewards.mean()) if len(rewards) else math.nan
    still = bool(len(good)) and keeps_still(good)
    locked = locks_base(runs)
    best = None if locked else study.optima.get((cell.task, "free"))
    best_still = study.optima.get((cell.task, "still")) if still and not locked else None
    told = set(runs.told.iloc[0].split(", ")) if len(runs) else set()
    return MethodRow(
        task=cell.task,
        method=cell.method,
        variant=cell.variant,
        told="".join(letter for item, letter in TOLD.items() if item.value in told),
        runs=len(runs),
        solved=len(good),
        reward=mean,
        reward_sd=sd(rewards),
        gap=best.reward - mean if best else math.nan,
        gap_share=(best.reward - mean) / -best.reward if best and best.reward else math.nan,
        gap_still=best_still.reward - mean if best_still else math.nan,
        beaten=sum(int((rewards > known.reward).sum()) for known in (best, best_still) if known),
        other_arm="still" if still else "moves" if len(good) else "",
        hands=tally(good.hands.value_counts().to_dict()) if len(good) > 1 else "".join(good.hands),
        corrections=int(good.solution_corrections.sum()),
        **{name: median(runs[name]) for name in _SPENT},
        solve_s=median(solve_times(good)),
        evaluations=_median(numbers(runs.forward_kinematics) + numbers(runs.jacobians)),
    )


def keeps_still(good: pd.DataFrame) -> bool:
    """Whether the arm that is not chosen stands still in every solution of these runs."""
    return bool((numbers(good.other_arm_travel) <= STILL).all())


def median(values: pd.Series) -> float:
    """Of the values that are known; NaN where none is, as for runs that crashed."""
    return _median(numbers(values))


def _median(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else math.nan


def numbers(values: pd.Series) -> Array:
    """A column (n,), NaN where a value is missing."""
    found: Array = values.to_numpy(dtype=np.float64, na_value=np.nan)
    return found
