"""Prove that no solution takes fewer ticks, by spatial branch and bound over relaxations.

Whatever a method does, a solution that hits every goal passes through one configuration for each
goal. It moves at most m per tick, and takes one further tick for each movement. So the number of
its ticks is at least

    (shortest path through such configurations) / m + (number of goals with a movement).

:mod:`relaxation` bounds the path from below within boxes of link angles. Subproblems are split
until all of them are bounded above the ticks that are to be beaten. A split divides

- an interval of a link angle in two;
- a goal whose hand is undecided, into one subproblem for each hand. This is done if the hand
  matters more than the angles, first at the goal that is most wrong;
- the goals that may be hit without a movement, if only their ticks are still missing, into one
  subproblem for each of them, in which it is the first such goal.

The subproblem with the smallest bound is split next, so the search can end at any time. The proven
bound is then the larger one of :func:`speed.least_ticks` and the smallest bound of the open
subproblems.
"""

import heapq
import itertools
import math
import time
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from lagrangian import Lagrangian
from relaxation import Relaxation, Relaxed, split
from speed import TOLERANCE, least_ticks

from coartic import PAPER, Hand

_FEW_SEQUENCES = 16  # up to this number, hand sequences are bounded one by one, which is faster
_NEAR = 0.97  # share of the path to be proven above which programmes are solved exactly
_HAND_FIRST = 0.2  # share of a hand's distance below which wrong angles wait for its decision


def mergeable(task, hands):
    """Return the goals (0-based) that may be hit without a movement.

    The hand may be in such a goal already: at the start, because another hand hits the previous
    goal, or because the goal overlaps the previous one.
    """
    first = [hand for hand in task.hands if hands[0] in (hand, None)]
    starts = [task.robot.forward_kinematics(task.q0, hand) for hand in first]
    able = [min(math.dist(q, task.goals[0]) for q in starts) <= task.radius]
    for g in range(1, len(hands)):
        overlap = math.dist(task.goals[g], task.goals[g - 1]) <= 2 * task.radius
        able.append(hands[g] is None or hands[g] != hands[g - 1] or overlap)
    return tuple(np.flatnonzero(able).tolist())


class Subproblem(NamedTuple):
    """The solutions with some hands, goals that are hit without a movement, and a box of angles."""

    hands: tuple[Hand | None, ...]
    """A hand for each goal, None if it is undecided."""
    merged: tuple[int, ...]
    """Goals (0-based) that are hit without a movement."""
    open: tuple[int, ...]
    """Further goals that may be hit without a movement. All others need a movement."""
    box: np.ndarray
    """Intervals of the absolute link angles, shape ``(links, 2)``, in rad."""

    @property
    def moves(self):
        """Smallest number of movements."""
        return len(self.hands) - len(self.merged) - len(self.open)


class Node(NamedTuple):
    """A subproblem with its bound. Nodes are ordered by their bounds, then by their numbers."""

    ticks: float
    """Bound on the ticks, before it is rounded up."""
    number: int
    """Number of the node, which no other node has."""
    length: float
    """Bound on the length of the path."""
    problem: Subproblem
    relaxed: Relaxed
    lagrangian: Lagrangian


def certify(task, ticks, most_nodes=math.inf, most_seconds=math.inf, *, still=False):
    """Try to prove that no solution takes fewer than ``ticks``.

    The search ends with the proof, or after ``most_nodes`` cone programmes or ``most_seconds`` of
    CPU time. The function returns the :class:`ProofSearch`, whose ``ticks`` are proven. If
    ``still``, the idle arm must not move.
    """
    begin, search = time.process_time(), ProofSearch(task, ticks, still)
    while search.ticks < ticks and search.nodes < most_nodes and search.seconds < most_seconds:
        search.branch(heapq.heappop(search.heap))
        search.seconds = time.process_time() - begin
    return search


class ProofSearch:
    """The open subproblems, and the effort so far: cone programmes and seconds of CPU time."""

    def __init__(self, task, ticks, still):
        self.heap, self.nodes, self.seconds = [], 0, 0.0
        self._task, self._claim, self._hands = task, ticks, sorted(task.hands)
        self._least, self._numbers = least_ticks(task), itertools.count()

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

    @property
    def ticks(self):
        """Proven ticks, at most the claimed ones. No solution takes fewer ticks."""
        proven = math.ceil(self.heap[0].ticks - 1e-9) if self.heap else self._claim
        return min(max(self._least, proven), self._claim)

    def chains(self, most):
        """Return hands and configurations from which solutions can be searched.

        They are those of the ``most`` subproblems with the smallest bounds whose hands are all
        decided.
        """
        decided = (node for node in self.heap if None not in node.problem.hands)
        return [(node.problem.hands, node.relaxed.q) for node in heapq.nsmallest(most, decided)]

    def longest(self, moves):
        """Return the longest path of a solution that beats the claim with this many movements."""
        return max(0, self._claim - 1 - moves) * PAPER.step

    def branch(self, node):
        """Split the subproblem of a node, and add the parts to the heap.

        The parts together contain every solution of the subproblem. The node must not be in the
        heap any more.
        """
        problem, q = node.problem, node.relaxed.q
        moves = len(problem.hands) - len(problem.merged)
        # True if only solutions with goals that are hit without a movement can beat the claim.
        bounded = node.length > self.longest(moves) or moves >= self._claim
        far = {  # distance of the nearer hand from each goal whose hand is undecided
            g: min(math.dist(self._task.robot.forward_kinematics(q[g], each), self._task.goals[g])
                   for each in self._hands)
            for g, hand in enumerate(problem.hands) if hand is None
        }  # fmt: skip
        goal = max(far, key=lambda g: far[g], default=None)
        wrong = node.relaxed.wrong.max(initial=0.0)
        if goal is not None and (
            bounded or wrong <= max(_HAND_FIRST * (far[goal] - self._task.radius), 1e-3)
        ):
            for hand in self._hands:  # the new angles can be anywhere on a path of interest
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
                # The Lagrangian of the parent may exclude a half without solving a programme.
                if self.shortfall(node.lagrangian, box, problem.moves) >= 0.0:
                    self.add(problem._replace(box=box), node.length)

    def add(self, problem, parent):
        """Bound a subproblem, and add it to the heap if a solution in it may beat the claim.

        ``parent`` is the bound on the path of the subproblem of which this is a part, or 0.
        """
        if problem.moves >= self._claim:
            return
        root = self.relaxation(problem.hands, problem.merged)
        # A duality gap of 1 % saves iterations, but may hide the last tick that a proof needs.
        is_near = parent > _NEAR * self.longest(problem.moves)
        relaxed = root.solve(problem.box, 1e-5 if is_near else 1e-2)
        self.nodes += 1
        lagrangian = root.lagrangian(relaxed.multipliers, self.longest(0))
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
        """Return the longest path of interest less the bound on the path in a box."""
        return self.longest(moves) - (lagrangian.bound(box) - TOLERANCE)
