"""Subtasks: what each costs within the whole, with which hand it would be done by itself, and what
the arm that is not chosen does meanwhile."""

from __future__ import annotations

import itertools

import numpy as np

from coartic import Execution, Hand, Task, Trajectory, correct, move
from coartic.robot import HANDS, Array

ROUNDING = 1
"""Ticks that a planned movement can lose to rounding alone."""
NO_LENGTH = 1e-9
"""Length of a displacement in joint space below which it is rounding."""


def other(hand: Hand) -> Hand:
    """The hand that is not chosen."""
    return "right" if hand == "left" else "left"


def isolated_reach(task: Task, q: Array, goal: int, hand: Hand) -> tuple[int, Array] | None:
    """Ticks in which a hand reaches a goal from ``q`` by the corrective process alone, and where.

    ``goal`` counts from 1; 0 ticks and ``q`` where the hand is there. None where the corrective
    process brings it to no hit.
    """
    centre, robot = task.goals[goal - 1], task.robot
    if np.hypot(*(robot.forward_kinematics(q, hand) - centre)) <= task.radius:
        return 0, q
    target = correct(robot, q, hand, centre, locked_base=task.locked_base)
    if not target.converged:
        return None
    reached = move(robot, q, target.q, hand, centre, task.radius, stop_on_arrival=False)
    return (reached.ticks, reached.q) if reached.hit else None


def served(path: Trajectory) -> Array:
    """What the way each goal is hit costs there and gains at the next, shape ``(G − 1, 2)``.

    In ticks, with the hands of the path, for each goal that another follows, against the
    corrective process from the same posture before. First: how much longer the path's own way to
    the goal is. Second: how much sooner the corrective process reaches the next goal from where
    base and chosen arm of the path hit this one than from where it would have hit it itself;
    what the other arm does meanwhile is left out. NaN where the corrective process does not hit.
    """
    task, execution = path.task, path.execution
    befores, ticks = postures_before(execution, task), execution.ticks_by_goal()
    cost_and_gain = np.full((len(task.goals) - 1, 2), np.nan)
    for k, (now, after) in enumerate(itertools.pairwise(path.hands)):
        alone = isolated_reach(task, befores[k], k + 1, now)
        if alone is None:
            continue
        hit = np.array(execution.configurations[k])
        waiting = task.robot.joints(other(now))
        hit[waiting] = alone[1][waiting]
        nexts = [isolated_reach(task, q, k + 2, after) for q in (alone[1], hit)]
        if nexts[0] is not None and nexts[1] is not None:
            cost_and_gain[k] = ticks[k] - alone[0], nexts[0][0] - nexts[1][0]
    return cost_and_gain


def postures_before(execution: Execution, task: Task) -> list[Array]:
    """The configuration from which each subtask starts: the hit before it, or the start."""
    return [np.array(task.q0), *execution.configurations[:-1]]


def ticks_slower(path: Trajectory) -> Array:
    """Ticks by which each goal's hand is slower for that goal alone, shape ``(G,)``.

    Slower than the hand with which the corrective process alone reaches the goal in the fewest
    ticks from the posture before; 0 for that hand and one as quick. Where it is above 0, the choice
    of hand serves other goals than its own. Infinite where the corrective process does not reach
    the goal with the hand.
    """
    slower = np.empty(len(path.hands))
    befores = postures_before(path.execution, path.task)
    for k, (hand, q) in enumerate(zip(path.hands, befores, strict=True)):
        reaches = {each: isolated_reach(path.task, q, k + 1, each) for each in path.task.hands}
        ticks = {each: reach[0] for each, reach in reaches.items() if reach is not None}
        slower[k] = ticks[hand] - min(ticks.values()) if hand in ticks else np.inf
    return slower


def turning_angles(postures: Array) -> Array:
    """Angles between successive displacements in joint space, rad, shape ``(G - 1,)``.

    ``postures`` has shape ``(G + 1, dof)``: the start and the configuration at each hit. 0
    goes straight on, π turns back. NaN next to a displacement of no length. The base's length
    unit and the joints' rad count alike, as in the model's joint-space distance.
    """
    steps = np.diff(postures, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    units = np.divide(steps, lengths, out=np.full_like(steps, np.nan), where=lengths > NO_LENGTH)
    # Accurate near 0 and π, unlike the arc cosine.
    apart = np.linalg.norm(units[1:] - units[:-1], axis=1)
    along = np.linalg.norm(units[1:] + units[:-1], axis=1)
    angles: Array = 2 * np.arctan2(apart, along)
    return angles


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


def waiting_travel(path: Trajectory) -> Array:
    """Joint travel of the arm that is not chosen, from hit to hit, rad, shape ``(G,)``."""
    moved = path.execution.configurations - postures_before(path.execution, path.task)
    waiting = [path.task.robot.joints(other(hand)) for hand in path.hands]
    return np.array(
        [np.linalg.norm(row[joints]) for row, joints in zip(moved, waiting, strict=True)]
    )
