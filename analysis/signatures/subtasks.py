"""Subtasks: what each costs within the whole, and what it would cost by itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coartic import PAPER, Execution, Hand, MotionModel, Task, Trajectory, correct, move
from coartic.robot import Array


def isolated_reaches(
    task: Task, q: Array, goal: int, model: MotionModel = PAPER
) -> dict[Hand, int]:
    """Ticks in which each hand reaches a goal from ``q`` by the corrective process alone.

    ``goal`` counts from 1. Hands that the corrective process brings to no hit are left out;
    0 where the hand is there.
    """
    found: dict[Hand, int] = {}
    centre = task.goals[goal - 1]
    for hand in task.hands:
        miss = task.robot.forward_kinematics(q, hand) - centre
        if np.hypot(*miss) <= task.radius:
            found[hand] = 0
            continue
        target = correct(task.robot, q, hand, centre, locked_base=task.locked_base, model=model)
        if target.converged:
            reached = move(
                task.robot, q, target.q, hand, centre, task.radius,
                stop_on_arrival=False, model=model,
            )  # fmt: skip
            if reached.hit:
                found[hand] = reached.ticks
    return found


def postures_before(execution: Execution, task: Task) -> list[Array]:
    """The configuration from which each subtask starts: the hit before it, or the start."""
    return [np.array(task.q0), *execution.configurations[:-1]]


def change_from_initial(execution: Execution, initial: Execution) -> NDArray[np.int64]:
    """Ticks of each subtask less those of the initial solution, shape ``(G,)``.

    Negative is faster. The first subtask is sacrificed for the whole where its entry is
    positive and the sum negative (Shah, Barto & Fagg 2013, results of EC1).
    """
    ticks, before = execution.ticks_by_goal(), initial.ticks_by_goal()
    return np.array([a - b for a, b in zip(ticks, before, strict=True)], dtype=np.int64)


def sacrifices(execution: Execution, initial: Execution) -> bool:
    """Whether the first subtask takes longer than initially while the whole takes less.

    By any number of ticks: a plan's movement can lose one to rounding alone, so read it beside
    :func:`change_from_initial`.
    """
    change = change_from_initial(execution, initial)
    return bool(change[0] > 0 > change.sum())


def excess(path: Trajectory) -> Array:
    """Ticks of each subtask less the best isolated reach from the same posture, ``(G,)``.

    The isolated reach is the quickest hand's by the corrective process alone. Positive: the
    subtask is done worse than by itself, for what comes after; negative: better than the
    corrective process does it. NaN where no hand reaches the goal by itself.
    """
    result = np.full(len(path.task.goals), np.nan)
    ticks = path.execution.ticks_by_goal()
    for number, q in enumerate(postures_before(path.execution, path.task), 1):
        alone = isolated_reaches(path.task, q, number)
        if alone:
            result[number - 1] = ticks[number - 1] - min(alone.values())
    return result
