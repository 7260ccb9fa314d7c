"""Proof that no solution takes fewer ticks: spatial branch and bound over relaxations.

Whatever a method does, a solution in which every goal is hit passes through one configuration for
each goal, moves at most m per tick and pays one further tick for each movement, so that its ticks
are at least

    (shortest path through such configurations) / m + (goals that are moved for).

The path is bounded from below within boxes of link angles by :mod:`relaxation`; the narrower the
intervals, the tighter the bound. Three things are split, until every subproblem is bounded above
the ticks that are to be beaten (McCormick 1976; Horst & Tuy 1996):

- an interval of a link angle, in two;
- a goal whose hand is undecided, into one subproblem for each hand. With five goals and more the
  search begins with all of them undecided, so that a bound for the hands of some goals serves every
  sequence with these hands; a hand is decided where that matters more than the angles do;
- goals that may be hit without a movement, if only their ticks are still missing: into one
  subproblem for each, in which it is the first such goal. The subproblem without such goals is
  bounded already.

Each of these leaves no solution out. The subproblem with the least bound is next, so that the
search can end at any time. The proven bound is then the least bound of the open subproblems or the
bound from the speed of the hands (:func:`ticks_for_distance`), whichever is more.
"""

import heapq
import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from lagrangian import Array, Lagrangian
from relaxation import PartialSequence, Relaxation, Relaxed, split

from coartic import PAPER

_TOLERANCE = 1e-6  # of a bound, length unit: rounding is far below
_FEW_SEQUENCES = 16  # hand sequences that are bounded one by one: few are proven sooner so
_MOST_SEQUENCES = 4096  # hand sequences that are bounded by distances
_HAND_FIRST = 0.2  # of a hand's distance from its goal: angles that are less wrong can wait


def fastest_hand(task, hand):
    """Return the largest norm of the hand's Jacobian: its path per joint-space path, length unit.

    The column of a joint is at right angles to its lever, which is no longer than the links beyond
    it; a base that moves has the unit vectors as its columns. The square of the norm is the largest
    eigenvalue of J Jᵀ, a sum of the columns' dyads, and so at most 1, where the base moves at all,
    plus the sum of the squared levers. A straight arm at right angles to a free axis has just that.
    Source: Craig (2004), the Jacobian of a planar chain.
    """
    levers = np.cumsum(task.robot.arm(hand).links[::-1])
    return math.sqrt((len(task.locked_base) < 2) + float(levers @ levers))


def ticks_for_distance(task, hands):
    """Return ticks that every solution takes with one of these hand sequences: by Cauchy and
    Schwarz.

    A hand that is in one disc and then in another goes at least the distance of their centres less
    both radii, from the start that of the first goal less one. Per tick it goes no farther than a
    step in joint space times :func:`fastest_hand`, and one movement at least is made on the way,
    whose arrival takes a tick beyond its steps. So a goal is hit no earlier than the goal before
    it, nor than that many ticks after the goal that the same hand hit last.
    """
    speed = {hand: PAPER.step * fastest_hand(task, hand) for hand in task.hands}
    start = {hand: task.robot.forward_kinematics(task.q0, hand) for hand in task.hands}

    def least(sequence):
        where, when = {hand: (start[hand], 0.0, 0) for hand in task.hands}, 0
        for hand, goal in zip(sequence, task.goals, strict=True):
            place, radius, ticks = where[hand]
            distance = math.dist(place, goal) - radius - task.radius - _TOLERANCE
            if distance > 0.0:
                when = max(when, ticks + math.ceil(distance / speed[hand]) + 1)
            where[hand] = np.array(goal), task.radius, when
        return when

    return min(map(least, hands))


def mergeable(task, hands):
    """Return the goals (0-based) that may be hit without a movement.

    The hand of such a goal may be there already: at the start, or because another hand hits the
    goal before, or because the two discs overlap.
    """
    first = [hand for hand in task.hands if hands[0] in (hand, None)]
    starts = [task.robot.forward_kinematics(task.q0, hand) for hand in first]
    able = [0] if min(math.dist(q, task.goals[0]) for q in starts) <= task.radius else []
    able += [
        g
        for g in range(1, len(hands))
        if hands[g] is None
        or hands[g] != hands[g - 1]
        or math.dist(task.goals[g], task.goals[g - 1]) <= 2 * task.radius
    ]
    return tuple(able)


class Subproblem(NamedTuple):
    """Solutions with these hands, these goals hit without a movement, angles in a box."""

    hands: PartialSequence
    merged: tuple[int, ...]
    """Goals (0-based) that are hit without a movement."""
    open: tuple[int, ...]
    """Further goals that may be; all others are not."""
    box: Array
    """Intervals of the absolute link angles, shape ``(links, 2)``, rad."""

    @property
    def moves(self):
        """Least number of movements."""
        return len(self.hands) - len(self.merged) - len(self.open)


class Node(NamedTuple):
    """A subproblem with its bound, in the order of bounds, then of numbers."""

    ticks: float
    """Bound, before it is rounded up."""
    number: int
    """No other node has it."""
    length: float
    """Bound on the path."""
    problem: Subproblem
    relaxed: Relaxed
    lagrangian: Lagrangian


def certify(task, ticks, most_nodes, *, still=False):
    """Prove that no solution takes fewer than ``ticks``, or as much as can be proven.

    Returns the proven ticks, and how many cone programmes this took. The search ends when all is
    proven or after ``most_nodes`` of them. ``still`` holds the arm that is not chosen.
    """
    search = ProofSearch(task, ticks, still)
    least = 0
    if len(task.hands) ** len(task.goals) <= _MOST_SEQUENCES:
        sequences = itertools.product(task.hands, repeat=len(task.goals))
        least = ticks_for_distance(task, sequences)
    while search.heap and search.solved < most_nodes and least < ticks:
        search.branch(heapq.heappop(search.heap))
    proven = math.ceil(search.heap[0].ticks - 1e-9) if search.heap else ticks
    return min(max(least, proven), ticks), search.solved


class ProofSearch:
    """The open subproblems, and the number of cone programmes so far."""

    def __init__(self, task, ticks, still):
        self.heap = []
        self.solved = 0
        self._task, self._ticks, self._hands = task, ticks, sorted(task.hands)
        self._numbers = itertools.count()

        @lru_cache(maxsize=1024)
        def relaxation(hands, merged):
            return Relaxation(task, hands, merged, still)

        self.relaxation = relaxation
        # All solutions: by hand sequence, or in one subproblem if there are many sequences.
        goals = len(task.goals)
        sequences = [(None,) * goals]
        if len(task.hands) ** goals <= _FEW_SEQUENCES:
            sequences = list(itertools.product(self._hands, repeat=goals))
        for hands in sequences if ticks else []:
            box = relaxation(hands, ()).first_box(self.longest(0))
            self.add(Subproblem(hands, (), mergeable(task, hands), box), 0.0)

    def longest(self, moves):
        """Return the longest path of solutions that take fewer ticks with so many movements."""
        return max(0, self._ticks - 1 - moves) * PAPER.step

    def branch(self, node):
        """Split a subproblem into others that together hold every solution in it."""
        problem, q = node.problem, node.relaxed.q
        moves = len(problem.hands) - len(problem.merged)
        # Bounded but for goals that are hit without a movement.
        bounded = node.length > self.longest(moves) or moves >= self._ticks
        # How far the nearer hand is from its goal, where the hand is undecided.
        far = {
            g: min(
                math.dist(self._task.robot.forward_kinematics(q[g], hand), self._task.goals[g])
                for hand in self._hands
            )
            for g, decided in enumerate(problem.hands)
            if decided is None
        }
        goal = max(far, key=lambda g: far[g], default=None)
        wrong = node.relaxed.wrong.max(initial=0.0)
        if goal is not None and (
            bounded or wrong <= max(_HAND_FIRST * (far[goal] - self._task.radius), 1e-3)
        ):
            # One subproblem for each hand, the new angles anywhere on a path of interest.
            for hand in self._hands:
                hands = (*problem.hands[:goal], hand, *problem.hands[goal + 1 :])
                root = self.relaxation(hands, problem.merged)
                of_goal = root.goal_of == goal
                box = np.empty((len(of_goal), 2))
                box[~of_goal] = problem.box
                box[of_goal] = root.first_box(self.longest(problem.moves))[of_goal]
                able = set(mergeable(self._task, hands))
                still_open = tuple(g for g in problem.open if g in able)
                self.add(Subproblem(hands, problem.merged, still_open, box), node.length)
        elif bounded:
            for i, first in enumerate(problem.open):
                merged = (*problem.merged, first)
                self.add(problem._replace(merged=merged, open=problem.open[i + 1 :]), node.length)
        else:
            for box in split(problem.box, node.relaxed):
                # The parent's Lagrangian may rule a half out, without a programme.
                if self.shortfall(node.lagrangian, box, problem.moves) >= 0.0:
                    self.add(problem._replace(box=box), node.length)

    def add(self, problem, parent):
        """Bound a subproblem; add it to the open ones if its bound is too low."""
        if problem.moves >= self._ticks:
            return
        root = self.relaxation(problem.hands, problem.merged)
        relaxed = root.solve(problem.box)
        self.solved += 1
        lagrangian = root.lagrangian(relaxed.pulls, relaxed.forces, self.longest(0))
        slack = self.shortfall(lagrangian, problem.box, problem.moves)
        length = max(parent, self.longest(problem.moves) - slack)
        if slack < 0.0 or length > self.longest(problem.moves):
            return
        box = lagrangian.within(problem.box, slack)
        if np.any(box[:, 0] > box[:, 1]):
            return
        problem = problem._replace(box=box)
        ticks = length / PAPER.step + problem.moves
        node = Node(ticks, next(self._numbers), length, problem, relaxed, lagrangian)
        heapq.heappush(self.heap, node)

    def shortfall(self, lagrangian, box, moves):
        """Return by how much a bound is short of the longest path of interest."""
        return self.longest(moves) - (lagrangian.bound(box) - _TOLERANCE)
