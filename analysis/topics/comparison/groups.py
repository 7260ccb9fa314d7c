"""Every method of a results folder side by side: reward, gap, cost, and what it was told."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from coartic.analysis.methods import EC1, TOGETHER
from coartic.analysis.optima import locks_base
from coartic.analysis.statistics.estimates import standard_deviation
from coartic.analysis.statistics.instances import gap_share
from coartic.analysis.study import CellRuns, Study, cached
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
    "using the reward of each trial",
    "using the reward as a formula",
    "not using the reward",
)
"""What methods are told of the reward and make use of."""
STILL = 1e-9  # rad of joint travel that a solver's rounding leaves


@cached
def method_rows(study: Study) -> pd.DataFrame:
    """A row for every method on every task: within a task the best mean reward first.

    Searches for the optimum come before. The index is the task and the method's label.
    ``solved``: runs with a solution, of which ``reward`` is the mean, ``reward_sd`` the standard
    deviation (ticks), ``gap`` the distance of the mean to the optimum as a share of it, and
    ``hands`` the sequences, the commonest first; ``told``: a letter for each kind of information
    (:data:`TOLD`); ``corrections``: corrective movements that all solutions needed; ``other_arm``:
    whether the arm that is not chosen keeps ``still`` in all solutions or ``moves``. What was spent
    is the median over all runs, ``solve_s`` by :func:`solve_times`. NaN is for what is not known.
    """
    frame = pd.DataFrame([described(study, cell) for cell in study.cells.values()])
    tasks = list(study.tasks)
    frame["task_place"] = frame.task.map(tasks.index)
    frame["is_search"] = frame.label.str.startswith(SEARCH)
    order = ["task_place", "is_search", "reward"]
    frame = frame.sort_values(order, ascending=[True, False, False], kind="stable")
    return frame.drop(columns=order[:2]).set_index(["task", "label"])


def described(study: Study, cell: CellRuns) -> dict[str, object]:
    """A row of :func:`method_rows`."""
    good, runs, rewards = cell.good, cell.runs, cell.rewards
    mean = float(rewards.mean()) if len(rewards) else math.nan
    best = None if locks_base(runs) else study.optima.get(cell.task)
    told = set(runs.told.iloc[0].split(", ")) if len(runs) else set()
    hands = tally(good.hands.value_counts().to_dict())
    arm = "still" if (numbers(good.other_arm_travel) <= STILL).all() else "moves"
    return {
        "task": cell.task,
        "label": cell.label,
        "told": "".join(letter for item, letter in TOLD.items() if item.value in told),
        "runs": len(runs),
        "solved": len(good),
        "reward": mean,
        "reward_sd": standard_deviation(rewards),
        "gap": float(gap_share(mean, best.reward)) if best and best.reward else math.nan,
        "hands": hands if len(good) > 1 else "".join(good.hands),
        "corrections": int(good.solution_corrections.sum()),
        "other_arm": arm if len(good) else "",
        "trials": median(runs.trials),
        "movement_ticks": median(runs.movement_ticks),
        "forward_kinematics": median(runs.forward_kinematics),
        "jacobians": median(runs.jacobians),
        "solve_s": median(solve_times(good)),
    }


def group_of(study: Study, label: str) -> str:
    """Which of :data:`GROUPS` a method belongs to.

    One that makes a single trial on every task makes no use of the reward that it is told. The
    learner's conditions together are told what each of them is.
    """
    label = EC1 if label.startswith(TOGETHER) else label
    rows = method_rows(study).xs(label, level="label")
    told = "".join(rows.told)
    if TOLD[Information.REWARD_FORMULA] in told:
        return BY_FORMULA
    learns = TOLD[Information.REWARD_BY_TRIAL] in told and not (rows.trials <= 1).all()
    return BY_TRIAL if learns else UNTOLD


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Wall time of solving, s: of runs in a warm process, or of all where there are none.

    ``runs`` have a solution. Their whole time stands for methods that mark no solving.
    """
    warm = runs.warm.to_numpy(dtype=bool, na_value=False)
    solving, all_in_all = numbers(runs.solve_s), numbers(runs.wall_s)
    marked = np.where(solving > 0, solving, all_in_all)
    times = pd.Series(marked, runs.index, dtype=runs.solve_s.dtype)
    return times[warm] if warm.any() else times


def median(values: pd.Series) -> float:
    """Median of the known values; NaN where none is, as for runs that crashed."""
    present = numbers(values)
    present = present[~np.isnan(present)]
    return float(np.median(present)) if len(present) else math.nan


def numbers(values: pd.Series) -> Array:
    """A column (n,), NaN where a value is missing."""
    return np.asarray(values.to_numpy(dtype=np.float64, na_value=np.nan))
