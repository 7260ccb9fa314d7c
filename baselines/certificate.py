"""A proof that no solution takes fewer ticks: spatial branch and bound over relaxations.

Whatever a method does, a solution in which every goal is hit passes through one
configuration per goal, moves at most m per tick and pays one further tick for each
movement, so that its ticks are at least

    (shortest path through such configurations) / m + (goals that are moved for).

The path is bounded from below within boxes of link angles by :mod:`coartic.baselines.relaxation`;
the narrower the intervals, the tighter the bound. Three things are split, until every part
is bounded above the ticks that are to be beaten (McCormick 1976; Horst & Tuy 1996):

- an interval of a link angle, in two;
- a goal whose hand is undecided, into one part for each hand. With five goals and more the
  search begins with all of them undecided, so that what is found out about some goals' hands
  serves every sequence that
  has them so; a hand is decided where that matters more than the angles do;
- goals that may be hit without a movement, where only their ticks are still wanting: into one
  part for each, as the first that is. The part in which none is is bounded already.

Each of these leaves no solution out. The part with the least bound is next, so that the search
can end at any time: the least bound of the open parts is then what is proven, or the bound from
how fast a hand can be (:func:`ticks_for_distance`), whichever is more.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from coartic import MotionModel, Task
from coartic.baselines.relaxation import Lagrangian, PartialSequence, Relaxation
from coartic.baselines.whole_ticks import mergeable
from coartic.motion.initial import too_many_sequences
from coartic.robot import HANDS, Array, Hand

_TOLERANCE = 1e-6  # of a bound, length unit: rounding is far below
_APART = 16  # hand sequences that are bounded one by one: few are proven sooner so
_HAND_FIRST = 0.2  # of a hand's distance from its goal: angles that are less wrong can wait


@dataclass(frozen=True)
class Certificate:
    """What was proven."""

    ticks: int
    """No solution takes fewer; the reward of any is at most minus this."""
    nodes: int
    """Cone programmes solved."""
    open_nodes: int
    """Of them, those that were neither split nor bounded when the search ended."""
    iterations: int
    """Iterations of the conic solver."""


def fastest_hand(task: Task, hand: Hand) -> float:
    """Largest norm of the hand's Jacobian: its way per joint-space way, length unit.

    The column of a joint is at right angles to its lever, which is no longer than the links beyond
    it; a base that moves has the unit vectors as its columns. The square of the norm is the largest
    eigenvalue of J Jᵀ, a sum of the columns' dyads, and so at most 1, where the base moves at all,
    plus the sum of the squared levers. A straight arm at right angles to a free axis has just that.
    Source: Craig (2004), the Jacobian of a planar chain.
    """
    levers = np.cumsum(task.robot.arm(hand).links[::-1])
    return math.sqrt((len(task.locked_base) < 2) + float(levers @ levers))


def ticks_for_distance(task: Task, step: float, hands: Iterable[Sequence[Hand]]) -> int:
    """Ticks that every solution takes with one of these hand sequences: by Cauchy and Schwarz.

    A hand that is in one disc and then in another goes at least the distance of their centres less
    both radii, from the start that of the first goal less one. Per tick it goes no farther than
    ``step`` times :func:`fastest_hand`, and one movement at least is made on the way, whose arrival
    takes a tick beyond its steps. So a goal is hit no earlier than the goal before it, nor than
    that many ticks after the goal that the same hand hit last. ``step`` is in joint space.
    """
    speed = {hand: step * fastest_hand(task, hand) for hand in task.hands}
    start = {hand: task.robot.forward_kinematics(task.q0, hand) for hand in task.hands}
    least = None
    for sequence in hands:
        where, when = {hand: (start[hand], 0.0, 0) for hand in task.hands}, 0
        for hand, goal in zip(sequence, task.goals, strict=True):
            place, radius, ticks = where[hand]
            way = math.dist(place, goal) - radius - task.radius - _TOLERANCE
            if way > 0.0:
                when = max(when, ticks + math.ceil(way / speed[hand]) + 1)
            where[hand] = np.array(goal), task.radius, when
        least = when if least is None else min(least, when)
    return least or 0


@dataclass(frozen=True)
class Part:
    """Solutions with these hands, these goals hit without a movement, angles in a box."""

    hands: PartialSequence
    merged: tuple[int, ...]
    """Goals (0-based) that are hit without a movement."""
    open: tuple[int, ...]
    """Further goals that may be; all others are not."""
    box: Array
    """Intervals of the absolute link angles, shape ``(links, 2)``, rad."""

    @property
    def moves(self) -> int:
        """Least number of movements."""
        return len(self.hands) - len(self.merged) - len(self.open)


@dataclass(order=True)
class Node:
    """A part with its bound, in the order of bounds."""

    ticks: float
    """Bound, before it is rounded up."""
    number: int
    length: float = field(compare=False)
    """Bound on the path."""
    part: Part = field(compare=False)
    point: Array = field(compare=False)
    """Where the relaxation has its minimum."""
    lagrangian: Lagrangian = field(compare=False)


def certify(
    task: Task, ticks: int, *, still: bool, model: MotionModel, most_nodes: int
) -> Certificate:
    """Prove that no solution takes fewer than ``ticks``, or as much as can be proven.

    ``still`` holds the arm that is not chosen. The search ends when all is proven or after
    ``most_nodes`` cone programmes.
    """
    search = ProofSearch(task, ticks, still, model.step)
    search.begin()
    least = 0
    if too_many_sequences(task, len(task.hands)) is None:
        sequences = itertools.product(task.hands, repeat=len(task.goals))
        least = ticks_for_distance(task, model.step, sequences)
    while search.heap and search.solved < most_nodes and least < ticks:
        search.branch(heapq.heappop(search.heap))
    least = max(least, math.ceil(search.heap[0].ticks - 1e-9) if search.heap else ticks)
    return Certificate(
        ticks=min(least, ticks),
        nodes=search.solved,
        open_nodes=len(search.heap),
        iterations=search.iterations,
    )


class ProofSearch:
    """The open parts, and what was spent."""

    def __init__(self, task: Task, ticks: int, still: bool, step: float) -> None:
        self.heap: list[Node] = []
        self.solved = self.iterations = 0
        self._task, self._ticks, self._step = task, ticks, step
        self._numbers = itertools.count()
        self._robot_hands = tuple(hand for hand in HANDS if hand in task.hands)

        @lru_cache(maxsize=1024)
        def relaxation(hands: PartialSequence, merged: tuple[int, ...]) -> Relaxation:
            return Relaxation(task, hands, merged, still)

        self.relaxation = relaxation

    def longest(self, moves: int) -> float:
        """Path of any solution that takes fewer ticks with so many movements, or more."""
        return max(0, self._ticks - 1 - moves) * self._step

    def begin(self) -> None:
        """All solutions: a part for each hand sequence, or one part where they are many."""
        if not self._ticks:
            return
        goals = len(self._task.goals)
        sequences: list[PartialSequence] = [(None,) * goals]
        if len(self._robot_hands) ** goals <= _APART:
            sequences = list(itertools.product(self._robot_hands, repeat=goals))
        for hands in sequences:
            box = self.relaxation(hands, ()).first_box(self.longest(0))
            self.add(Part(hands, (), mergeable(self._task, hands), box), 0.0)

    def branch(self, node: Node) -> None:
        """Split a part into parts that together hold every solution in it."""
        part = node.part
        moves = len(part.hands) - len(part.merged)
        # Bounded but for goals that are hit without a movement.
        bounded = node.length > self.longest(moves) or moves >= self._ticks
        goal = self.goal_to_decide(node, bounded)
        if goal is not None:
            self.decide(node, goal)
        elif bounded:
            for i, first in enumerate(part.open):
                merged = (*part.merged, first)
                self.add(Part(part.hands, merged, part.open[i + 1 :], part.box), node.length)
        else:
            root = self.relaxation(part.hands, part.merged)
            for box in root.split(part.box, node.point):
                # What is known of the whole may rule a half out, without a programme.
                if self.shortfall(node.lagrangian, box, part.moves) >= 0.0:
                    half = Part(part.hands, part.merged, part.open, box)
                    self.add(half, node.length)

    def goal_to_decide(self, node: Node, bounded: bool) -> int | None:
        """The goal whose undecided hand is farthest off, if that is what comes first."""
        unknown = [g for g, hand in enumerate(node.part.hands) if hand is None]
        if not unknown:
            return None
        root, robot = self.relaxation(node.part.hands, node.part.merged), self._task.robot
        q = root.configurations(node.point)
        far = {
            g: min(
                math.dist(robot.forward_kinematics(q[g], hand), self._task.goals[g])
                for hand in self._robot_hands
            )
            for g in unknown
        }
        goal = max(unknown, key=lambda g: far[g])
        wrong = root.wrong(node.point).max(initial=0.0)
        if bounded or wrong <= max(_HAND_FIRST * (far[goal] - self._task.radius), 1e-3):
            return goal
        return None

    def decide(self, node: Node, goal: int) -> None:
        """One part for each hand, the new angles anywhere on a path of interest."""
        part = node.part
        for hand in self._robot_hands:
            hands = (*part.hands[:goal], hand, *part.hands[goal + 1 :])
            root = self.relaxation(hands, part.merged)
            of_goal = root.goal_of == goal
            box = np.empty((len(of_goal), 2))
            box[~of_goal] = part.box
            box[of_goal] = root.first_box(self.longest(part.moves))[of_goal]
            able = set(mergeable(self._task, hands))
            still_open = tuple(g for g in part.open if g in able)
            self.add(Part(hands, part.merged, still_open, box), node.length)

    def add(self, part: Part, parent: float) -> None:
        """Bound a part, and keep what is left of it."""
        if part.moves >= self._ticks:
            return
        root = self.relaxation(part.hands, part.merged)
        multipliers, point, count = root.solve(part.box)
        self.solved += 1
        self.iterations += count
        lagrangian = root.lagrangian(multipliers, self.longest(0))
        slack = self.shortfall(lagrangian, part.box, part.moves)
        length = max(parent, self.longest(part.moves) - slack)
        if slack < 0.0 or length > self.longest(part.moves):
            return
        box = lagrangian.within(part.box, slack)
        if np.any(box[:, 0] > box[:, 1]):
            return
        part = Part(part.hands, part.merged, part.open, box)
        ticks = length / self._step + part.moves
        heapq.heappush(self.heap, Node(ticks, next(self._numbers), length, part, point, lagrangian))

    def shortfall(self, lagrangian: Lagrangian, box: Array, moves: int) -> float:
        """By how much a bound is short of the longest path of interest."""
        bound = lagrangian.constant + float(lagrangian.least(box).sum()) - _TOLERANCE
        return self.longest(moves) - bound
