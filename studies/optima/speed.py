"""Lower bounds on paths and ticks from the speed of the hands, for any number of goals.

A hand that is in one disc and then in another goes at least the distance of their centres less both
radii, from the start that of the first goal less one. Its path is no longer than the joint-space
path times :func:`fastest_hand`, by Cauchy and Schwarz. The sequence of hands that needs least is
found by dynamic programming over the goal that each hand hit last.
"""

import math
from collections import defaultdict

import numpy as np

from coartic import PAPER

TOLERANCE = 1e-6
"""Length by which bounds are lowered, length unit: far more than rounding changes."""


def fastest_hand(task, hand):
    """Return the largest norm of the hand's Jacobian: its path per joint-space path, length unit.

    The column of a joint is at right angles to its lever, which is no longer than the links beyond
    it (Craig 2004); a base that moves has unit vectors as its columns. The square of the norm is
    the largest eigenvalue of J Jᵀ, and so at most 1, where the base moves at all, plus the sum of
    the squared levers, which a straight arm at right angles to a free axis has.
    """
    levers = np.cumsum(task.robot.arm(hand).links[::-1])
    return math.sqrt((len(task.locked_base) < 2) + float(levers @ levers))


def path_between(task, hand, last, goal):
    """Return the least joint-space path from the goal ``last`` of a hand to another; 0 if None.

    Goals are counted from 0; -1 is the start.
    """
    if last is None:
        return 0.0
    start = task.robot.forward_kinematics(task.q0, hand)
    place, radius = (start, 0.0) if last < 0 else (task.goals[last], task.radius)
    distance = math.dist(place, task.goals[goal]) - radius - task.radius - TOLERANCE
    return max(0.0, distance) / fastest_hand(task, hand)


def soonest(task, hands, last, cost):
    """Return when the last of these goals is hit at the soonest.

    A goal is hit no earlier than the goal before it, nor than ``cost(hand, last, goal)`` after the
    goal that the same hand hit last. ``hands``: goals with their hand, None if it is undecided;
    ``last``: the goal that each hand of the task hit last, -1 at the start, None if it may be
    anywhere.
    """
    # When each hand hit its last goal, of all that may be the soonest in the end.
    times = {tuple(last.values()): {(0.0,) * len(last)}}
    for goal, decided in hands:
        later = defaultdict(set)
        for goals, fronts in times.items():
            for i, hand in enumerate(last):
                if decided in (hand, None):
                    added = cost(hand, goals[i], goal)
                    key = (*goals[:i], goal, *goals[i + 1 :])
                    for when in fronts:
                        hit = max(*when, when[i] + added)
                        later[key].add((*when[:i], hit, *when[i + 1 :]))
        times = {key: efficient(fronts) for key, fronts in later.items()}
    return min(max(when) for fronts in times.values() for when in fronts)


def efficient(points):
    """Return the points, tuples of one or two times, that no other point equals or precedes in
    every time."""
    kept = []
    for point in sorted(points):
        if not kept or point[-1] < kept[-1][-1]:
            kept.append(point)
    return kept


def least_ticks(task, hands=None):
    """Return ticks that every solution takes, with the hands that are decided.

    A hand that must go takes the ticks of its path, and one for the arrival of a movement.
    """

    def ticks(hand, last, goal):
        path = path_between(task, hand, last, goal)
        return math.ceil(path / PAPER.step) + 1 if path else 0

    hands = hands or (None,) * len(task.goals)
    return int(soonest(task, [*enumerate(hands)], dict.fromkeys(task.hands, -1), ticks))


def spans_of(task, hands):
    """Return spans of goals, shape ``(spans, G)``, 1 within and else 0, and the least path within
    each, length unit.

    A span ends at a decided goal and begins after the goal that its hand hit before. Spans of the
    undecided goals at the end begin after the last decided goal, where the other hand is anywhere.
    """
    goals, last = len(hands), dict.fromkeys(task.hands, -1)
    spans = []  # first and last goal, least path
    for goal, hand in enumerate(hands):
        if hand is not None:
            spans.append((last[hand] + 1, goal, path_between(task, hand, last[hand], goal)))
            last[hand] = goal
    begin = max(last.values()) + 1
    if begin:
        last = {hand: goal if goal == begin - 1 else None for hand, goal in last.items()}
    undecided = [(goal, None) for goal in range(begin, goals)]
    for count in range(1, len(undecided) + 1):
        path = soonest(task, undecided[:count], last, lambda *move: path_between(task, *move))
        spans.append((begin, begin + count - 1, path))
    spans = [span for span in spans if span[2] > 0.0]
    inside = [[first <= goal <= end for goal in range(goals)] for first, end, _ in spans]
    paths = np.array([path for _, _, path in spans])
    return np.array(inside, dtype=float).reshape(-1, goals), paths
