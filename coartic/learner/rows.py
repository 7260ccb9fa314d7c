"""Stored movements of a run, read back from data frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from coartic.motion.solution import Movement
from coartic.tasks.task import Task

if TYPE_CHECKING:  # workers do without pandas
    import pandas as pd


def movements_from(
    task: Task, rows: pd.DataFrame, paths: pd.DataFrame | None = None
) -> tuple[Movement, ...]:
    """The movements of one run from its rows of ``solutions``.

    ``paths`` holds the run's rows of ``paths``, for movements of kind ``path``.
    """
    joints, rows = list(task.robot.joint_names), rows.sort_values("order")
    targets = rows[joints].to_numpy(dtype=np.float64, copy=True)
    columns = (rows[name].tolist() for name in ("order", "goal", "hand", "kind", "ticks"))
    movements = []
    for target, order, goal, hand, kind, ticks in zip(targets, *columns, strict=True):
        waypoints = None
        if kind == "path":
            if paths is None:
                raise ValueError("a movement of kind 'path' needs its waypoints")
            path = paths[paths["order"] == order].sort_values("waypoint")
            waypoints = path[joints].to_numpy(dtype=np.float64)
        movements.append(Movement(int(goal), hand, kind, target, int(ticks), waypoints))
    return tuple(movements)
