"""What the arm that is not chosen does meanwhile."""

from __future__ import annotations

import numpy as np

from analysis.signatures.subtasks import postures_before
from coartic import Execution, Hand, Trajectory
from coartic.robot import Array


def other(hand: Hand) -> Hand:
    """The hand that is not chosen."""
    return "right" if hand == "left" else "left"


def preshaping(path: Trajectory, initial: Execution) -> Array:
    """How much nearer the other hand is to its next goal than in the initial solution.

    1 - d/d_initial, shape ``(G,)``: d is the distance of the hand that is not chosen to the
    next goal it will hit, at the moment the current goal is hit; d_initial that of the same
    hand to the same goal at the same moment of ``initial`` (the corrective process alone
    with the task's hands). -∞ to 1: 1 is there already, 0 no nearer than initially, negative
    farther away. Base and arm both count. NaN where the other hand hits no later goal.
    """
    task = path.task
    result = np.full(len(task.goals), np.nan)
    for number, hand in enumerate(path.hands, 1):
        waiting = other(hand)
        later = [k for k, later in enumerate(path.hands, 1) if k > number and later == waiting]
        if not later:
            continue
        goal = np.array(task.goals[later[0] - 1])
        distances = [
            float(np.linalg.norm(task.robot.forward_kinematics(q, waiting) - goal))
            for q in (
                path.execution.configurations[number - 1],
                initial.configurations[number - 1],
            )
        ]
        if distances[1] > 0:
            result[number - 1] = 1 - distances[0] / distances[1]
    return result


def travel(path: Trajectory) -> Array:
    """Joint travel of the arm that is not chosen in each subtask, rad, shape ``(G,)``.

    From hit to hit, as in column ``other_arm_travel``, which is its sum; ≥ 0.
    """
    execution, task = path.execution, path.task
    moved = execution.configurations - np.array(postures_before(execution, task))
    return np.array(
        [
            float(np.linalg.norm(row[task.robot.joints(other(hand))]))
            for row, hand in zip(moved, path.hands, strict=True)
        ]
    )
