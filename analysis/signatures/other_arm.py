"""What the arm that is not chosen does meanwhile."""

from __future__ import annotations

import numpy as np

from coartic import Execution, Hand, Trajectory
from coartic.analysis.signatures.subtasks import postures_before
from coartic.robot import HANDS, Array


def other(hand: Hand) -> Hand:
    """The hand that is not chosen."""
    return "right" if hand == "left" else "left"


def preshaping(path: Trajectory, initial: Execution) -> Array:
    """How much nearer the arm brings its hand to its next goal while it waits, shape ``(G,)``.

    (d_held - d)/d_initial: d is the distance of the hand that is not chosen to the next goal it
    will hit, at the moment the current goal is hit; d_held the same if the arm had kept its joints
    since its own last hit (since the start, before any), with the base where it is; d_initial that
    of ``initial`` (the corrective process alone with the task's hands). -∞ to ∞: 0 where the arm
    keeps still, whatever the base does (always under the exploration conditions 1 and 3). NaN
    where the other hand hits no later goal.
    """
    task, hands = path.task, path.hands
    now = path.execution.configurations
    held = np.array(now)
    own_last = dict.fromkeys(HANDS, task.q0)
    for row, hand in zip(held, hands, strict=True):
        own_last[hand] = row.copy()
        joints = task.robot.joints(other(hand))
        row[joints] = own_last[other(hand)][joints]
    nearer = np.full(len(task.goals), np.nan)
    for k, waiting in enumerate(map(other, hands)):
        if waiting in hands[k:]:
            goal = task.goals[hands.index(waiting, k)]
            reached, kept, initially = (
                np.linalg.norm(task.robot.forward_kinematics(q[k], waiting) - goal)
                for q in (now, held, initial.configurations)
            )
            if initially > 0:
                nearer[k] = (1 - reached / initially) - (1 - kept / initially)
    return nearer


def travel(path: Trajectory) -> Array:
    """Joint travel of the arm that is not chosen in each subtask, rad, shape ``(G,)``.

    From hit to hit, as in column ``other_arm_travel``, which is its sum; ≥ 0.
    """
    moved = path.execution.configurations - postures_before(path.execution, path.task)
    waiting = [path.task.robot.joints(other(hand)) for hand in path.hands]
    return np.array(
        [np.linalg.norm(row[joints]) for row, joints in zip(moved, waiting, strict=True)]
    )
