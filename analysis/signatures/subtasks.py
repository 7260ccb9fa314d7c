"""Subtasks: what each costs within the whole, and with which hand it would be done by itself."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike

from coartic import Execution, Hand, Task, Trajectory, correct, move
from coartic.robot import Array

ROUNDING = 1
"""Ticks that a planned movement can lose to rounding alone."""


def isolated_reaches(task: Task, q: Array, goal: int) -> dict[Hand, int]:
    """Ticks in which each hand reaches a goal from ``q`` by the corrective process alone.

    ``goal`` counts from 1. Hands that the corrective process brings to no hit are left out;
    0 where the hand is there.
    """
    reaches = ((hand, isolated_reach(task, q, goal, hand)) for hand in task.hands)
    return {hand: reach[0] for hand, reach in reaches if reach is not None}


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
        waiting = task.robot.joints("left" if now == "right" else "right")
        hit[waiting] = alone[1][waiting]
        nexts = [isolated_reach(task, q, k + 2, after) for q in (alone[1], hit)]
        if nexts[0] is not None and nexts[1] is not None:
            cost_and_gain[k] = ticks[k] - alone[0], nexts[0][0] - nexts[1][0]
    return cost_and_gain


def postures_before(execution: Execution, task: Task) -> list[Array]:
    """The configuration from which each subtask starts: the hit before it, or the start."""
    return [np.array(task.q0), *execution.configurations[:-1]]


def sacrifices(change: ArrayLike) -> bool:
    """Whether the first subtask takes longer while the whole takes less.

    ``change`` has shape ``(G,)``: :func:`change_from` of a solution to the corrective process
    alone *with the same hands*, so that a choice of hand does not count as a sacrifice. Longer
    is longer by more than :data:`ROUNDING`. Source: Shah, Barto & Fagg (2013), results of EC1.
    """
    ticks = np.asarray(change)
    return bool(ticks[0] > ROUNDING and ticks.sum() < 0)


def excess(path: Trajectory) -> Array:
    """Ticks of each subtask less the best isolated reach from the same posture, ``(G,)``.

    The isolated reach is the quickest hand's by the corrective process alone. Positive: the
    subtask is done worse than by itself, for what comes after; negative: better than the
    corrective process does it. NaN where no hand reaches the goal by itself.
    """
    pairs = zip(path.execution.ticks_by_goal(), _alone(path), strict=True)
    return np.array([ticks - min(alone.values(), default=math.nan) for ticks, alone in pairs])


def isolated_agreement(path: Trajectory) -> list[bool]:
    """Whether each goal is hit with the hand that would be chosen for it by itself.

    That is the hand with which the corrective process alone reaches it in the fewest ticks
    from the posture before; equally quick ones both agree. False for a goal that it reaches
    with neither. Where False, the choice of hand serves other goals than its own.
    """
    pairs = zip(path.hands, _alone(path), strict=True)
    return [hand in alone and alone[hand] == min(alone.values()) for hand, alone in pairs]


def _alone(path: Trajectory) -> list[dict[Hand, int]]:
    """:func:`isolated_reaches` of each subtask from the posture before it."""
    befores = postures_before(path.execution, path.task)
    return [isolated_reaches(path.task, q, number) for number, q in enumerate(befores, 1)]
