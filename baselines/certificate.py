"""A proof that no solution takes fewer ticks: spatial branch and bound over relaxations.

Whatever a method does, a solution in which every goal is hit passes through one
configuration per goal, moves at most m per tick and pays one further tick for each
movement, so that its ticks are at least

    (shortest path through such configurations) / m + (goals that are moved for).

The path is bounded from below by a second-order cone programme. Its variables are the
configurations and, for the chosen arm at each goal, the direction (c, s) of every link.
What is not convex is that (c, s) are the cosine and sine of the link's absolute angle φ.
For φ within an interval the points (c, s, φ) lie within a set of half-spaces, whose
offsets are exact maxima; the narrower the interval, the tighter they are. Intervals are
split until every one of them is bounded above the ticks that are to be beaten
(McCormick 1976; Horst & Tuy 1996). Every hand sequence, with every choice of goals that
are hit without a movement, is a root. The proof holds up to the accuracy of the conic
solver (Clarabel; Goulart & Chen 2024): each bound is lowered by ``_TOLERANCE``.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from baselines.whole_ticks import mergers
from coartic import MotionModel, Task
from coartic.initial import hand_sequences
from coartic.robot import HANDS, Array, Hand, directions
from coartic.task import hands_of, letters_of

_TOLERANCE = 1e-6  # of a bound, length unit
_RESIDUAL = 1e-8  # of dual feasibility
_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Certificate:
    """What was proven."""

    ticks: int
    """No solution takes fewer; the reward of any is at most minus this."""
    proven: bool
    """Whether that is the number of ticks that was to be proven least."""
    nodes: int
    """Cone programmes solved."""
    open_nodes: int
    """Of them, those that were neither split nor bounded when the search ended."""
    root_length: float
    """Bound on the path before any split, length unit and rad; 0 where the solver could not
    say for one of the roots."""
    iterations: int
    """Iterations of the conic solver."""


@dataclass(order=True)
class _Node:
    ticks: int
    length: float
    number: int
    root: _Relaxation = field(compare=False)
    box: Array = field(compare=False)
    """Intervals of the absolute link angles, shape ``(links, 2)``, rad."""
    point: Array = field(compare=False)
    """Where the relaxation has its minimum."""


def certify(
    task: Task, ticks: int, *, still: bool, model: MotionModel, most_nodes: int
) -> Certificate:
    """Prove that no solution takes fewer than ``ticks``, or as much as can be proven.

    ``still`` holds the arm that is not chosen. The search ends when all is proven or after
    ``most_nodes`` cone programmes.
    """
    heap: list[_Node] = []
    numbers = itertools.count()
    longest = max(0, ticks - 1) * model.step  # path of any solution that takes fewer
    solved = iterations = 0
    trivial = ticks  # bound of hand sequences that were not looked at

    def bound(root: _Relaxation, box: Array, parent: float) -> None:
        nonlocal solved, iterations
        length, point, count = root.solve(box)
        solved += 1
        iterations += count
        length = max(length, parent)
        least = root.moves + math.ceil(length / model.step - 1e-9) if length < math.inf else ticks
        if least < ticks:
            heapq.heappush(heap, _Node(least, length, next(numbers), root, box, point))

    for root in _roots(task, still):
        if solved >= most_nodes:  # what is left unsolved has the trivial bound
            trivial = min(trivial, root.moves)
            continue
        bound(root, root.first_box(longest), 0.0)
    root_length = min((node.length for node in heap), default=longest)
    while heap and solved < most_nodes:
        node = heapq.heappop(heap)
        for box in node.root.split(node.box, node.point):
            bound(node.root, box, node.length)
    least = min(trivial, heap[0].ticks if heap else ticks)
    return Certificate(
        ticks=least,
        proven=least == ticks,
        nodes=solved,
        open_nodes=len(heap),
        root_length=root_length,
        iterations=iterations,
    )


def _roots(task: Task, still: bool) -> Iterator[_Relaxation]:
    """Every hand sequence with every set of goals that can be hit without a movement."""
    for letters in hand_sequences(task):
        hands = hands_of(letters)
        for merged in mergers(task, hands):
            yield _Relaxation(task, hands, merged, still)


class _Relaxation:
    """The cone programme of one hand sequence, all but the half-spaces of a box."""

    def __init__(
        self, task: Task, hands: tuple[Hand, ...], merged: tuple[int, ...], still: bool
    ) -> None:
        dof, goals = task.robot.dof, len(hands)
        arms = [task.robot.arm(hand) for hand in hands]
        self.hands = letters_of(hands)
        self.moves = goals - len(merged)
        links = [(g, k) for g in range(goals) for k in range(len(arms[g].links))]
        q0 = np.array(task.q0)

        # Variables: configurations, link directions, lengths of the movements.
        self._directions = goals * dof + 2 * np.arange(len(links))
        lengths = goals * dof + 2 * len(links) + np.arange(goals)
        self._size = int(lengths[-1]) + 1
        self._objective = np.zeros(self._size)
        self._objective[lengths] = 1.0
        # Absolute angle of each link, as a row over the variables.
        self._angles = np.zeros((len(links), self._size))
        for row, (g, k) in zip(self._angles, links, strict=True):
            first = g * dof + arms[g].first
            row[first : first + k + 1] = 1.0
        start = np.zeros(self._size)
        start[: goals * dof] = np.tile(q0, goals)
        self._start_angles = self._angles @ start
        self._relative = np.array([k + 1 for _, k in links])
        self._lengths = np.array([arms[g].links[k] for g, k in links])

        cones = _Cones(self._size)
        for g, hand in enumerate(hands):
            stiff = range(dof) if g in merged else _stiff_joints(task, hand, still)
            for joint in stiff:
                cones.add_change(q0, g, joint)
        cones.close(clarabel.ZeroConeT)
        for g, arm in enumerate(arms):
            cones.add({int(lengths[g]): 1.0}, 0.0)
            for joint in range(dof):
                cones.add_change(q0, g, joint)
            cones.close(clarabel.SecondOrderConeT)
            own = [
                (int(column), arm.links[k])
                for column, (goal, k) in zip(self._directions, links, strict=True)
                if goal == g
            ]
            cones.add({}, task.radius)
            for axis, shoulder in enumerate((arm.shoulder_x, arm.shoulder_y)):
                reach = {column + axis: link for column, link in own}
                cones.add({g * dof + axis: 1.0, **reach}, shoulder - task.goals[g][axis])
            cones.close(clarabel.SecondOrderConeT)
            for column, _ in own:
                cones.add({}, 1.0)
                cones.add({column: 1.0}, 0.0)
                cones.add({column + 1: 1.0}, 0.0)
                cones.close(clarabel.SecondOrderConeT)
        self._right = np.array(cones.right)
        self._cones = [*cones.closed, clarabel.NonnegativeConeT(_NORMALS * len(links))]
        self._quadratic = sparse.csc_matrix((self._size, self._size))
        self._lay_out(np.array(cones.rows))
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        self._settings.max_threads = 1

    def first_box(self, longest: float) -> Array:
        """Intervals that hold every link angle on a path no longer than ``longest``.

        An absolute angle is a sum of k relative ones, so it changes by at most √k times
        the joint-space distance.
        """
        reach = np.sqrt(self._relative) * longest
        return np.stack([self._start_angles - reach, self._start_angles + reach], axis=1)

    def solve(self, box: Array) -> tuple[float, Array, int]:
        """Lower bound on the path within a box, the minimiser, iterations.

        Infinite where the box holds no path, minus infinite where the solver does not say.
        """
        matrix, offsets = self._with_half_spaces(box)
        solution = clarabel.DefaultSolver(
            self._quadratic,
            self._objective,
            matrix,
            np.concatenate([self._right, offsets]),
            self._cones,
            self._settings,
        ).solve()
        point, status = np.array(solution.x), str(solution.status)
        if status == "PrimalInfeasible":
            return math.inf, np.nan_to_num(point), solution.iterations
        # A dual feasible point bounds the minimum, however good the primal one is.
        if status not in ("Solved", "AlmostSolved") or solution.r_dual > _RESIDUAL:
            return -math.inf, np.nan_to_num(point), solution.iterations
        return solution.obj_val_dual - _TOLERANCE, point, solution.iterations

    def split(self, box: Array, point: Array) -> tuple[Array, Array]:
        """Two halves, across the angle whose direction the relaxation has most wrong."""
        angles = self._angles @ point
        relaxed = np.stack([point[self._directions], point[self._directions + 1]], axis=1)
        wrong = np.linalg.norm(relaxed - directions(angles), axis=1) * self._lengths
        # Where all agree, the widest one: the bound is then as good as it gets here.
        width = box[:, 1] - box[:, 0]
        link = int(np.argmax(wrong if wrong.max() > 1e-7 else width))
        low, high = box[link]
        at = 0.5 * (0.5 * (low + high) + min(max(angles[link], low), high))
        at = min(max(at, low + 0.1 * width[link]), high - 0.1 * width[link])
        below, above = box.copy(), box.copy()
        below[link, 1] = above[link, 0] = at
        return below, above

    def _lay_out(self, fixed: Array) -> None:
        """Where the entries of the half-spaces stand, below the rows that are fixed."""
        links = len(self._directions)
        turned, angle_columns = np.nonzero(self._angles)  # of each link, its angle's joints
        self._turned = turned
        link = np.concatenate([np.arange(links), np.arange(links), turned])
        column = np.concatenate([self._directions, self._directions + 1, angle_columns])
        below = np.arange(_NORMALS)[:, None] * links + len(fixed)
        at = np.nonzero(fixed)
        self._fixed = fixed[at]
        rows = np.concatenate([at[0], (below + link).ravel()])
        columns = np.concatenate([at[1], np.tile(column, _NORMALS)])
        self._order = np.lexsort((rows, columns))
        self._rows = rows[self._order]
        self._ends = np.searchsorted(columns[self._order], np.arange(self._size + 1))
        self._matrix = sparse.csc_matrix((len(fixed) + _NORMALS * links, self._size))

    def _with_half_spaces(self, box: Array) -> tuple[sparse.csc_matrix, Array]:
        """All rows, and the right sides of the half-spaces ``A x <= b``.

        They hold (c, s, φ) of every link in its interval.
        """
        middle, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
        normals = _normals(half)
        offsets = _support(normals, half)
        along, across, turn = normals
        # From the interval's own frame, where its middle is the angle zero.
        cosine, sine = directions(middle).T
        c = along * cosine - across * sine
        s = along * sine + across * cosine
        below = np.concatenate([c, s, turn[:, self._turned]], axis=1).ravel()
        values = np.concatenate([self._fixed, below])[self._order]
        kept = values != 0.0
        matrix = self._matrix  # of the right shape, and consistent as it is laid out
        matrix.data, matrix.indices = values[kept], self._rows[kept]
        matrix.indptr = np.concatenate([[0], np.cumsum(kept)])[self._ends]
        return matrix, (offsets + turn * middle).ravel()


class _Cones:
    """Rows ``constant + entries · x`` of cones, as Clarabel has them, one cone after another."""

    def __init__(self, size: int) -> None:
        self._size = size
        self.rows: list[Array] = []
        self.right: list[float] = []
        self.closed: list[object] = []
        self._in_closed = 0

    def add(self, entries: dict[int, float], constant: float) -> None:
        """A row of the cone that is closed next."""
        dense = np.zeros(self._size)
        for column, value in entries.items():
            dense[column] -= value
        self.rows.append(dense)
        self.right.append(constant)

    def add_change(self, q0: Array, g: int, joint: int) -> None:
        """The change of a joint on the way to a goal, from 0."""
        if g:
            self.add({g * len(q0) + joint: 1.0, (g - 1) * len(q0) + joint: -1.0}, 0.0)
        else:
            self.add({joint: 1.0}, -q0[joint])

    def close(self, kind: Callable[[int], object]) -> None:
        """Make a cone of the rows since the last one, if there are any."""
        count = len(self.rows) - self._in_closed
        if count:
            self.closed.append(kind(count))
        self._in_closed = len(self.rows)


def _stiff_joints(task: Task, hand: Hand, still: bool) -> list[int]:
    """Joints that cannot move on the way to a goal of this hand."""
    stiff = {{"x": 0, "y": 1}[axis] for axis in task.locked_base}
    for other in HANDS:
        if other != hand and (still or other not in task.hands):
            stiff |= set(range(task.robot.dof)[task.robot.joints(other)])
    return sorted(stiff)


_NORMALS = 22  # half-spaces of each link


def _normals(half: Array) -> Array:
    """Normals of the half-spaces for (cos δ, sin δ, δ), |δ| <= half; ``(3, _NORMALS, links)``.

    The interval's ends; the chord; tangents to cosine and sine; the chord of the sine.
    Any normal is valid: the offsets make it so.
    """
    zero, one = np.zeros_like(half), np.ones_like(half)
    found = [(zero, zero, one), (zero, zero, -one), (-one, zero, zero), (one, zero, zero)]
    touched = np.minimum(np.multiply.outer([0.25, 0.5, 0.75, 1.0], half), math.pi / 2)
    *tangents, end = directions(np.vstack([touched, np.minimum(half, math.pi)]))
    for direction in tangents:
        cosine, sine = direction.T
        found += [
            (zero, one, -cosine),
            (zero, -one, cosine),
            (one, zero, sine),
            (one, zero, -sine),
        ]
    slope = end[:, 1] / np.maximum(half, 1e-12)
    found += [(zero, one, -slope), (zero, -one, slope)]
    return np.array(found).swapaxes(0, 1)


def _support(normals: Array, half: Array) -> Array:
    """Maximum of ``a cos δ + b sin δ + k δ`` over |δ| <= half, exactly; ``(n, links)``."""
    a, b, k = normals
    cosine, sine = directions(half).T
    best = np.asarray(
        np.maximum(a * cosine + b * sine + k * half, a * cosine - b * sine - k * half)
    )
    # Stationary where r sin(δ - θ) = k, with (a, b) = r (cos θ, sin θ).
    r, theta = np.hypot(a, b), np.arctan2(b, a)
    exists = np.abs(k) <= r
    angle = np.arcsin(np.clip(k / np.maximum(r, 1e-300), -1.0, 1.0))
    turns = int(np.ceil(half.max(initial=0.0) / _TURN)) + 1
    starts = np.stack([theta + angle, theta + (math.pi - angle)])
    delta = starts[:, None] + (np.arange(-turns, turns + 1) * _TURN)[:, None, None]
    inside: NDArray[np.bool_] = exists & (np.abs(delta) <= half)
    *_, normal, link = at = np.nonzero(inside)
    value = np.full(delta.shape, -np.inf)
    reached = directions(delta[at] - theta[normal, link])[..., 0]
    value[at] = r[normal, link] * reached + k[normal, link] * delta[at]
    return np.asarray(np.maximum(best, value.max(axis=(0, 1))))
