"""Plan without a goal ahead, but with the hands of the full plan: what do postures alone lose?

    python studies/horizon/given_hands.py

Takes the hands of the plans with all goals in view from runs.csv.xz, and plans each goal of a task
for itself, with the hand that the full plan has there: i000 to i009 of the families for two arms.
Writes given_hands.csv.xz, a row for each task, and given_hands.csv, the mean gaps.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from coartic import execute, load_task
from coartic.analysis import means
from coartic.baselines.receding_horizon import RecedingHorizon, RecedingHorizonParameters
from coartic.method import run_method

HERE = Path(__file__)
HANDS = {"L": "left", "R": "right"}
FIRST = "010"
"""Number of the first instance that is left out."""
PLANNER = RecedingHorizon(RecedingHorizonParameters(horizon=0, nodes=100))
"""As many postures for a hand as the planner has that may choose between two hands."""


def plans_of(runs):
    """Return the plans with 200 postures of tasks for two arms, a row for each task: the hands of
    the plan with all goals in view, its ticks, and the ticks of the plan without a goal ahead."""
    repeated = runs.setting.str.contains("nodes", na=False)
    plans = runs[(runs.method == "receding-horizon") & ~repeated]
    horizon = plans.setting.str.extract(r"horizon=(\d+)", expand=False).fillna("1").astype(int)
    plans = plans.assign(horizon=horizon, goals=plans.hands.str.len()).reset_index(drop=True)
    full = plans[plans.horizon >= plans.goals - 1].set_index("task")
    blind = plans[plans.horizon == 0].set_index("task")
    table = full[["hands", "best_known"]].assign(full=-full.reward, chosen=-blind.reward)
    table = table[table.index.str[-3:] < FIRST]
    return table[[len(load_task(name).hands) == 2 for name in table.index]]


def ticks_one_by_one(task, hands):
    """Return the ticks of the shortest paths from goal to goal, each planned for itself, with these
    hands."""
    q, ticks = np.array(task.q0), 0
    for goal, letter in zip(task.goals, hands, strict=True):
        arms = {name: tuple(q[task.robot.joints(name)].tolist()) for name in HANDS.values()}
        start = task.start.model_copy(update={"base": tuple(q[:2].tolist()), **arms})
        one = {"goals": (goal,), "hands": (HANDS[letter],), "initial_hands": letter}
        alone = task.model_copy(update={**one, "start": start})
        execution = execute(alone, run_method(PLANNER, alone)[0].solution)
        ticks, q = ticks - execution.reward, execution.configurations[-1]
    return ticks


def tabulate(rows):
    """Return the mean gaps over tasks without a goal ahead, per cent, by who chooses the hands."""
    gaps = pd.concat(
        rows.assign(hands=name, gap=100 * (rows[name] + rows.best_known) / -rows.best_known)
        for name in ("chosen", "given", "full")
    )
    return means(gaps, ["hands"], ["gap"]).rename(columns={"rows": "tasks"}).set_index("hands")


def main():
    """Plan all tasks, and write the rows and the table."""
    rows = plans_of(pd.read_csv(HERE.with_name("runs.csv.xz")))
    rows["given"] = [ticks_one_by_one(load_task(name), row.hands) for name, row in rows.iterrows()]
    rows.to_csv(HERE.with_suffix(".csv.xz"))
    tabulate(rows).to_csv(HERE.with_suffix(".csv"), float_format="%.6g")


if __name__ == "__main__":
    main()
