"""What the arm that is not chosen does meanwhile."""

from __future__ import annotations

import numpy as np

from coartic import Execution, Hand, Trajectory
from coartic.analysis.signatures.subtasks import postures_before
from coartic.robot import BASE_DOF, HANDS, Array


def other(hand: Hand) -> Hand:
    """The hand that is not chosen."""
    return "right" if hand == "left" else "left"


def readiness(path: Trajectory, initial: Execution) -> Array:
    """How much nearer the other hand is to its next goal than in the initial solution.

    1 - d/d_initial, shape ``(G,)``: d is the distance of the hand that is not chosen to the
    next goal it will hit, at the moment the current goal is hit; d_initial that of the same
    hand to the same goal at the same moment of ``initial`` (the corrective process alone
    with the task's hands). -∞ to 1: 1 is there already, 0 no nearer than initially, negative
    farther away. Base and arm both count; the other two functions have the arm's part. NaN
    where the other hand hits no later goal.
    """
    return _nearer(path, initial, path.execution.configurations)


def readiness_from_base(path: Trajectory, initial: Execution) -> Array:
    """The part of :func:`readiness` that lies in the arm's joints, shape ``(G,)``.

    1 - d/d_initial, where d is the distance of the waiting hand to its next goal if the base
    were where it is in ``initial`` at that moment, with the joint angles of the arm as they
    are. -∞ to 1: 0 where the arm's joints are as in the initial solution, whatever the base
    does; all of the readiness where the base is as in the initial solution; 1: the arm alone
    would be there already. The rest takes a base that moved otherwise. A posture that the
    arm's own last hit left counts as well; :func:`preshaping` leaves it out. NaN
    where the other hand hits no later goal.
    """
    moved = np.array(path.execution.configurations)
    moved[:, :BASE_DOF] = initial.configurations[:, :BASE_DOF]
    return _nearer(path, initial, moved)


def preshaping(path: Trajectory, initial: Execution) -> Array:
    """The part of :func:`readiness` that the arm does while it waits, shape ``(G,)``.

    (d_held - d)/d_initial, where d_held is the distance if the arm had kept its joints since
    its own last hit (since the start, before any), with the base where it is. Length per
    length, -∞ to ∞: 0 where the arm keeps still, whatever the base does (always under the
    exploration conditions 1 and 3); all of the readiness where only the arm's waiting differs
    from the initial solution. NaN where the other hand hits no later goal.
    """
    held = np.array(path.execution.configurations)
    own_last = dict.fromkeys(HANDS, path.task.q0)
    for row, hand in zip(held, path.hands, strict=True):
        own_last[hand] = row.copy()
        joints = path.task.robot.joints(other(hand))
        row[joints] = own_last[other(hand)][joints]
    return readiness(path, initial) - _nearer(path, initial, held)


def _nearer(path: Trajectory, initial: Execution, configurations: Array) -> Array:
    """1 - d/d_initial with the waiting hands of ``configurations``, (G, dof), at each hit."""
    task, hands = path.task, path.hands
    result = np.full(len(task.goals), np.nan)
    for k, waiting in enumerate(map(other, hands)):
        if waiting in hands[k:]:
            goal = task.goals[hands.index(waiting, k)]
            now, initially = (
                np.linalg.norm(task.robot.forward_kinematics(q[k], waiting) - goal)
                for q in (configurations, initial.configurations)
            )
            if initially > 0:
                result[k] = 1 - now / initially
    return result


def travel(path: Trajectory) -> Array:
    """Joint travel of the arm that is not chosen in each subtask, rad, shape ``(G,)``.

    From hit to hit, as in column ``other_arm_travel``, which is its sum; ≥ 0.
    """
    moved = path.execution.configurations - postures_before(path.execution, path.task)
    waiting = [path.task.robot.joints(other(hand)) for hand in path.hands]
    return np.array(
        [np.linalg.norm(row[joints]) for row, joints in zip(moved, waiting, strict=True)]
    )
