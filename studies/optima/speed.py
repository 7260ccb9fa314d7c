"""Bound paths and ticks from below by the speed of the hands, for any number of goals.

A hand that hits one goal and then another moves at least by the distance of the goals' centres less
both radii (from the start: the distance of the first goal less one radius). By the Cauchy-Schwarz
inequality, its path is no longer than the joint-space path times :func:`fastest_hand`. Dynamic
programming over the last goal of each hand finds the hand sequence with the smallest bound.
"""

import math
from collections import defaultdict

import numpy as np

from coartic import PAPER

TOLERANCE = 1e-6
"""Length (in length units) by which bounds are lowered. It is far larger than rounding errors."""


def fastest_hand(task, hand):
    """Return the largest norm of a hand's Jacobian J: the length of its path per joint-space path.

    The column of a joint is at right angles to its lever, which is no longer than the links beyond
    it (Craig 2004). A base that moves has unit vectors as its columns. The square of the norm is
    the largest eigenvalue of J Jᵀ. It is at most the sum of the squared levers, plus 1 if the base
    can move. A straight arm at right angles to a free axis reaches this value.
    """
    levers = np.cumsum(task.robot.arm(hand).links[::-1])
    return math.sqrt((len(task.locked_base) < 2) + float(levers @ levers))


def path_between(task, hand, last, goal):
    """Return a lower bound on the joint-space path of a hand from goal ``last`` to ``goal``.

    Goals are counted from 0; -1 is the start. The bound is 0 if ``last`` is None.
    """
    if last is None:
        return 0.0
    start = task.robot.forward_kinematics(task.q0, hand)
    place, radius = (start, 0.0) if last < 0 else (task.goals[last], task.radius)
    distance = math.dist(place, task.goals[goal]) - radius - task.radius - TOLERANCE
    return max(0.0, distance) / fastest_hand(task, hand)


def soonest(task, hands, last, cost):
    """Return the earliest time at which the last of some goals can be hit.

    A goal is hit no earlier than the previous goal, and no earlier than ``cost(hand, last, goal)``
    after the last goal of the same hand. ``hands`` has pairs of a goal and its hand, or None if the
    hand is undecided. ``last`` has the last goal of each hand of the task: -1 at the start, and
    None if the hand may be anywhere.
    """
    # Times at which each hand hit its last goal, without those that cannot be the earliest.
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
    """Return the points (tuples of one or two times) that no other point dominates.

    A point dominates another if none of its times is later.
    """
    kept = []
    for point in sorted(points):
        if not kept or point[-1] < kept[-1][-1]:
            kept.append(point)
    return kept


def least_ticks(task, hands=None):
    """Return a lower bound on the ticks of every solution with the hands that are decided.

    A hand that must move takes the ticks of its path, and one tick for the arrival.
    """

    def ticks(hand, last, goal):
        path = path_between(task, hand, last, goal)
        return math.ceil(path / PAPER.step) + 1 if path else 0

    hands = hands or (None,) * len(task.goals)
    return int(soonest(task, [*enumerate(hands)], dict.fromkeys(task.hands, -1), ticks))


def spans_of(task, hands):
    """Return spans of goals, and a lower bound on the path within each span.

    Spans have shape ``(spans, G)``: 1 for goals within the span, 0 for others. Bounds are in length
    units. A span ends at a decided goal, and begins after the last goal that the same hand hit.
    Spans of undecided goals at the end begin after the last decided goal, at which the other hand
    may be anywhere.
    """
    goals, last = len(hands), dict.fromkeys(task.hands, -1)
    spans = []  # first and last goal, and the bound on the path
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
