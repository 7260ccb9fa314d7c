"""Runs as tidy data frames: one row a run, a movement, or a trial."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from coartic.learner.learning import LearningRun
from coartic.motion.solution import Movement
from coartic.tasks.task import Task

if TYPE_CHECKING:  # pandas is imported where a frame is made: workers make none
    import pandas as pd


def run_row(run: LearningRun) -> dict[str, Any]:
    """One run as a flat record; rewards and hands are None where there are none."""
    return {
        "task": run.task.name,
        "method": run.method,
        "seed": run.seed,
        "status": run.status,
        "reason": run.reason,
        "hands": run.hands,
        "reward": run.reward,
        "replay_reward": run.replay_reward,
        "replay_hands": run.replay_hands,
        "initial_reward": run.initial_reward,
        "initial_hands": run.first_hands,
        "best_trial": run.best_trial,
        **asdict(run.counters),
        "wall_s": run.wall_s,
        "cpu_s": run.cpu_s,
    }


def movement_rows(task: Task, movements: Iterable[Movement]) -> list[dict[str, Any]]:
    """One record per movement: order, goal, hand, kind, ticks and target by joint name."""
    rows = []
    for order, movement in enumerate(movements):
        row: dict[str, Any] = {
            "order": order,
            "goal": movement.goal,
            "hand": movement.hand,
            "kind": movement.kind,
            "ticks": movement.ticks,
        }
        names = task.robot.joint_names
        if movement.target is not None:
            row.update(zip(names, movement.target.tolist(), strict=True))
        if movement.waypoints is not None:
            row["waypoints"] = [
                dict(zip(names, point.tolist(), strict=True)) for point in movement.waypoints
            ]
        rows.append(row)
    return rows


def movements_from(
    task: Task, rows: pd.DataFrame, paths: pd.DataFrame | None = None
) -> tuple[Movement, ...]:
    """The movements of one run, read back from its rows of ``solutions``.

    ``paths`` holds the run's rows of ``paths``, for movements of kind ``path``.
    """
    names = list(task.robot.joint_names)
    rows = rows.sort_values("order")
    targets = rows[names].to_numpy(dtype=np.float64, copy=True)
    columns = (rows[name].tolist() for name in ("order", "goal", "hand", "kind", "ticks"))
    movements = []
    for target, order, goal, hand, kind, ticks in zip(targets, *columns, strict=True):
        waypoints = None
        if kind == "path":
            if paths is None:
                raise ValueError("a movement of kind 'path' needs its waypoints")
            own = paths[paths["order"] == order].sort_values("waypoint")
            waypoints = own[names].to_numpy(dtype=np.float64)
        movements.append(Movement(int(goal), hand, kind, target, int(ticks), waypoints))
    return tuple(movements)


def runs_table(runs: Iterable[LearningRun]) -> pd.DataFrame:
    """One row a run, in the order given; column ``run`` counts them from 0."""
    import pandas as pd

    frame = pd.DataFrame([run_row(run) for run in runs])
    frame.insert(2, "run", range(len(frame)))
    integers = ["reward", "replay_reward", "initial_reward", "best_trial"]
    return frame.astype(dict.fromkeys(integers, "Int64"))


def solutions_table(runs: Iterable[LearningRun]) -> pd.DataFrame:
    """One row a movement of each run's best trial."""
    import pandas as pd

    return pd.DataFrame(
        [
            {"run": index, **row}
            for index, run in enumerate(runs)
            for row in movement_rows(run.task, run.solution)
        ]
    )


def learning_table(runs: Iterable[LearningRun]) -> pd.DataFrame:
    """One row a trial of each run: its total reward, missing where the trial failed."""
    import pandas as pd

    parts = [
        pd.DataFrame(
            {
                "run": index,
                "trial": np.arange(run.rewards.size),
                "reward": pd.arrays.IntegerArray(run.rewards.data, ~run.completed),
            }
        )
        for index, run in enumerate(runs)
    ]
    return pd.concat(parts, ignore_index=True)
