"""A lower bound on the path within a box of link angles: relaxation and Lagrangian.

The relaxation is a second-order cone programme over the configurations q_g and, for the chosen arm
at each goal, the direction u_gk = (c, s) of every link::

    min   Σ_g |q_g - q_(g-1)|
    s.t.  |base_g + shoulder + Σ_k l_k u_gk - goal_g| <= r,   |u_gk| <= 1
          (u_gk, φ_gk) in the half-spaces of its interval,    φ_gk = Σ_(j<=k) q_gj

The only part that is not convex, u = (cos φ, sin φ), is replaced by half-spaces that hold all
points (cos φ, sin φ, φ) with φ in its interval; their offsets are exact maxima.

The bound does not rest on the solver. With any multipliers p_g of the movements,
‖p_g‖ <= 1, and λ_g of the hands at their goals, every path obeys

    ‖Δq_g‖ >= p_g · Δq_g   and   0 >= λ_g · (hand_g − goal_g) − radius ‖λ_g‖,

so that it is at least as long as the least value of the sum of the right sides. That sum is
separable: a linear term of each joint, and for each link ``slope φ + l λ · (cos φ, sin φ)``,
whose least value over an interval has a closed form. Joints that no link angle stands for
change by no more than the path is long. The solver's dual point is one choice of multipliers,
a good one; a bound computed from any other choice holds as well.

The same sum says more. Where its least value is short of the longest path of interest by
``slack``, an angle at which one link's term exceeds its least by more lies on no such path,
and the interval shrinks for nothing.

A goal's hand may be undecided. Either hand is then within a disc around the middle of the
shoulders, whatever the arms do, and both arms may move: a relaxation of either choice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray

from coartic import Task
from coartic.robot import BASE_DOF, HANDS, Arm, Array, Hand, directions

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

PartialSequence = tuple[Hand | None, ...]
"""A hand per goal, None where it is undecided."""

HALF_SPACES = 9
"""Half-spaces of each link."""
_TURN = 2.0 * math.pi
_TOWARDS_POINT = 0.25  # of the way from an interval's middle to the relaxation's angle
_PARABOLAS = 10  # steps by which an interval's end moves inwards


class Relaxation:
    """The cone programme of one hand sequence, all but the half-spaces of a box.

    ``merged`` are the goals (0-based) that are hit without a movement, all of whose hands
    are decided. A box has the intervals of the absolute link angles, shape ``(links, 2)``,
    rad, of the chosen arms at the goals whose hand is decided, goal by goal.
    """

    def __init__(
        self, task: Task, hands: PartialSequence, merged: tuple[int, ...], still: bool
    ) -> None:
        dof, goals = task.robot.dof, len(hands)
        chosen = [None if hand is None else task.robot.arm(hand) for hand in hands]
        arms = {g: arm for g, arm in enumerate(chosen) if arm is not None}
        links = [(g, k) for g, arm in arms.items() for k in range(len(arm.links))]
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
        self._relative = np.array([k + 1 for _, k in links], dtype=np.intp)
        self._lengths = np.array([arms[g].links[k] for g, k in links], dtype=np.float64)

        self._stiff = np.zeros((goals, dof), dtype=np.bool_)
        for g, hand in enumerate(hands):
            self._stiff[g, stiff_joints(task, hand, still)] = True
        self._stiff[list(merged)] = True
        self.goal_of = np.array([g for g, _ in links], dtype=np.intp)
        self._joint_columns = np.array(
            [g * dof + arms[g].first + k for g, k in links], dtype=np.intp
        )
        self._tip = np.array([k + 1 == len(arms[g].links) for g, k in links], dtype=np.bool_)
        discs = [disc_of(task, arm) for arm in chosen]
        shoulders = np.array([shoulder for shoulder, _ in discs])
        self._radii = np.array([radius for _, radius in discs])
        self._offset = q0[:BASE_DOF] + shoulders - task.goal_array
        cones = Cones(self._size)
        for g, joint in zip(*np.nonzero(self._stiff), strict=True):
            cones.add_change(q0, int(g), int(joint))
        self._stiff_rows = slice(0, len(cones.rows))
        cones.close(clarabel.ZeroConeT)
        self._change_rows = np.empty((goals, dof), dtype=np.intp)
        self._hand_rows = np.empty((goals, 2), dtype=np.intp)
        for g in range(goals):
            cones.add({int(lengths[g]): 1.0}, 0.0)
            self._change_rows[g] = len(cones.rows) + np.arange(dof)
            for joint in range(dof):
                cones.add_change(q0, g, joint)
            cones.close(clarabel.SecondOrderConeT)
            links_of_arm = [
                (int(self._directions[number]), float(self._lengths[number]))
                for number in np.flatnonzero(self.goal_of == g)
            ]
            cones.add({}, self._radii[g])
            self._hand_rows[g] = len(cones.rows) + np.arange(2)
            for axis in range(2):
                reach = {column + axis: link for column, link in links_of_arm}
                away = float(shoulders[g, axis]) - task.goals[g][axis]
                cones.add({g * dof + axis: 1.0, **reach}, away)
            cones.close(clarabel.SecondOrderConeT)
            for column, _ in links_of_arm:
                cones.add({}, 1.0)
                cones.add({column: 1.0}, 0.0)
                cones.add({column + 1: 1.0}, 0.0)
                cones.close(clarabel.SecondOrderConeT)
        self._right = np.array(cones.right)
        self._cones = cones.closed
        if links:
            self._cones.append(clarabel.NonnegativeConeT(HALF_SPACES * len(links)))
        self.lay_out(np.array(cones.rows))
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        # Any multipliers give a bound, so it need not be exact, nor end.
        self._settings.tol_gap_abs = self._settings.tol_gap_rel = 1e-5
        self._settings.tol_feas = 1e-7
        self._settings.max_iter = 50

    def first_box(self, longest: float) -> Array:
        """Intervals that hold every link angle on a path no longer than ``longest``.

        An absolute angle is a sum of k relative ones, so it changes by at most √k times
        the joint-space distance.
        """
        reach = np.sqrt(self._relative) * longest
        return np.stack([self._start_angles - reach, self._start_angles + reach], axis=1)

    def solve(self, box: Array) -> tuple[Multipliers, Array, int]:
        """Multipliers for a box, the relaxation's minimiser, iterations of the solver."""
        matrix, offsets = self.with_half_spaces(box)
        solution = clarabel.DefaultSolver(
            self._no_squares,
            self._objective,
            matrix,
            np.concatenate([self._right, offsets]),
            self._cones,
            self._settings,
        ).solve()
        dual = np.nan_to_num(np.array(solution.z))
        pulls = -dual[self._change_rows]
        pulls[self._stiff] -= dual[self._stiff_rows]
        # Within the unit ball over the joints that may move; without limit over the others.
        norms = np.sqrt((np.where(self._stiff, 0.0, pulls) ** 2).sum(axis=1, keepdims=True))
        pulls = np.where(self._stiff, pulls, pulls / np.maximum(norms, 1.0))
        multipliers = Multipliers(pulls, -dual[self._hand_rows])
        return multipliers, np.nan_to_num(np.array(solution.x)), solution.iterations

    def lagrangian(self, multipliers: Multipliers, longest: float) -> Lagrangian:
        """The Lagrangian of multipliers, for paths that are no longer than ``longest``."""
        weights = multipliers.pulls.copy()
        weights[:-1] -= multipliers.pulls[1:]
        turns = weights.ravel()[self._joint_columns]
        rest = weights.copy()
        rest[:, :BASE_DOF] += multipliers.forces
        rest.ravel()[self._joint_columns] = 0.0
        slopes = turns.copy()
        slopes[:-1] -= np.where(self._tip[:-1], 0.0, turns[1:])
        forces = multipliers.forces[self.goal_of] * self._lengths[:, None]
        constant = (
            float((multipliers.forces * self._offset).sum())
            - float((self._radii * np.sqrt((multipliers.forces**2).sum(axis=1))).sum())
            - longest * float(np.abs(rest).sum())
            - float(slopes @ self._start_angles)
        )
        sizes, towards = np.hypot(*forces.T), np.arctan2(forces[:, 1], forces[:, 0])
        return Lagrangian(constant, slopes, sizes, towards)

    def wrong(self, point: Array) -> Array:
        """Error of each link's end against its angle, shape ``(links,)``, length unit."""
        relaxed = np.stack([point[self._directions], point[self._directions + 1]], axis=1)
        error = np.linalg.norm(relaxed - directions(self._angles @ point), axis=1)
        return np.asarray(error * self._lengths)

    def split(self, box: Array, point: Array) -> tuple[Array, Array]:
        """Two halves, across the angle whose direction the relaxation has most wrong.

        Weighting the errors by the forces, or by their cost in the Lagrangian, took up to
        fifty times as many nodes.
        """
        wrong, width = self.wrong(point), box[:, 1] - box[:, 0]
        # Where all agree, the widest one: the bound is then as good as it gets here.
        link = int(np.argmax(wrong if wrong.max() > 1e-7 else width))
        low, high = box[link]
        middle, angle = 0.5 * (low + high), min(max(self._angles[link] @ point, low), high)
        at = middle + _TOWARDS_POINT * (angle - middle)
        below, above = box.copy(), box.copy()
        below[link, 1] = above[link, 0] = at
        return below, above

    def configurations(self, point: Array) -> Array:
        """The configurations of a minimiser, shape ``(G, dof)``."""
        return point[: self._stiff.size].reshape(self._stiff.shape)

    def lay_out(self, fixed: Array) -> None:
        """Store the places of the half-spaces' entries, below the rows that are fixed."""
        from scipy.sparse import csc_matrix  # slow, and a command that names methods needs none

        links = len(self._directions)
        turned, angle_columns = np.nonzero(self._angles)  # of each link, its angle's joints
        self._turned = turned
        link = np.concatenate([np.arange(links), np.arange(links), turned])
        column = np.concatenate([self._directions, self._directions + 1, angle_columns])
        below = np.arange(HALF_SPACES)[:, None] * links + len(fixed)
        at = np.nonzero(fixed)
        self._fixed = fixed[at]
        rows = np.concatenate([at[0], (below + link).ravel()])
        columns = np.concatenate([at[1], np.tile(column, HALF_SPACES)])
        self._order = np.lexsort((rows, columns))
        self._rows = rows[self._order]
        self._ends = np.searchsorted(columns[self._order], np.arange(self._size + 1))
        self._matrix = csc_matrix((len(fixed) + HALF_SPACES * links, self._size))
        self._no_squares = csc_matrix((self._size, self._size))

    def with_half_spaces(self, box: Array) -> tuple[csc_matrix, Array]:
        """All rows, and the right sides of the half-spaces ``A x <= b``.

        They hold (c, s, φ) of every link in its interval.
        """
        middle, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
        normals = half_space_normals(half)
        offsets = support_of(normals, half)
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


class Multipliers(NamedTuple):
    """Weights of the relaxation's constraints."""

    pulls: Array
    """p of the movements, shape ``(G, dof)``, of norm at most 1 over the joints that may move."""
    forces: Array
    """λ of the hands at their goals, shape ``(G, 2)``."""


@dataclass(frozen=True)
class Lagrangian:
    """No path of interest is shorter than ``constant`` plus a term of each link angle.

    The terms are ``slope φ + size cos(φ - towards)``, over the links of a box.
    """

    constant: float
    slopes: Array
    sizes: Array
    towards: Array

    def at(self, angles: Array) -> Array:
        """Each link's term at its angle, shape ``(links,)``."""
        return self.slopes * angles + self.sizes * directions(angles - self.towards)[..., 0]

    def least(self, box: Array) -> Array:
        """Least of each link's term over its interval, exactly."""
        low, high = box.T
        best = np.minimum(self.at(low), self.at(high))
        # Stationary and convex where the cosine is negative; of such points, one turn apart,
        # the first is the least where the slope is upwards, else the last.
        steep = np.clip(self.slopes / np.maximum(self.sizes, 1e-300), -1.0, 1.0)
        inside = self.towards + (math.pi - np.arcsin(steep))
        up = self.slopes >= 0.0
        first = inside + _TURN * np.ceil((low - inside) / _TURN)
        last = inside + _TURN * np.floor((high - inside) / _TURN)
        inside = np.where(up, first, last)
        value = self.at(inside)
        exists = (np.abs(self.slopes) <= self.sizes) & (low <= inside) & (inside <= high)
        return np.where(exists, np.minimum(best, value), best)

    def within(self, box: Array, slack: float) -> Array:
        """The part of the box in which no term exceeds its least by more than ``slack``.

        An end moves inwards while a parabola below the term is above that; a term bends by no
        more than its size. A low end above the high one says that nothing is left.
        """
        limit = self.least(box) + slack
        size = np.maximum(self.sizes, 1e-12)
        narrowed = box.copy()
        for side, sign in ((0, 1.0), (1, -1.0)):
            angles = narrowed[:, side]
            for _ in range(_PARABOLAS):
                excess = np.maximum(self.at(angles) - limit, 0.0)
                rise = sign * (self.slopes - self.sizes * directions(angles - self.towards)[..., 1])
                safe = (rise + np.sqrt(rise**2 + 2.0 * size * excess)) / size
                angles = np.where(excess > 0.0, angles + sign * safe, angles)
            narrowed[:, side] = angles
        return narrowed


def disc_of(task: Task, arm: Arm | None) -> tuple[Array, float]:
    """Position of the shoulder from the base, and the radius of the goal for that arm's hand.

    For an undecided hand (None): the middle of the shoulders, and how far it may be from the
    goal while either hand is within the goal.
    """
    if arm is not None:
        return np.array([arm.shoulder_x, arm.shoulder_y]), task.radius
    arms = [task.robot.arm(hand) for hand in task.hands]
    shoulders = np.array([[arm.shoulder_x, arm.shoulder_y] for arm in arms])
    middle = shoulders.mean(axis=0)
    away = np.linalg.norm(shoulders - middle, axis=1)
    reaches = [sum(arm.links) + float(far) for arm, far in zip(arms, away, strict=True)]
    return middle, task.radius + max(reaches)


class Cones:
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


def stiff_joints(task: Task, hand: Hand | None, still: bool) -> list[int]:
    """Joints that cannot move on the way to a goal of this hand, or of an undecided one."""
    stiff = {"xy".index(axis) for axis in task.locked_base}
    for other in HANDS:
        if other not in task.hands or (still and hand is not None and other != hand):
            stiff |= set(range(task.robot.dof)[task.robot.joints(other)])
    return sorted(stiff)


def half_space_normals(half: Array) -> Array:
    """Normals of the half-spaces for (cos δ, sin δ, δ), |δ| <= half; ``(3, HALF_SPACES, links)``.

    The interval's ends; the chord; tangents to cosine and sine; the chord of the sine. Any
    normal is valid: the offsets make it so. More of them bound no better in the same time.
    """
    zero, one = np.zeros_like(half), np.ones_like(half)
    normals = [(zero, zero, one), (zero, zero, -one), (-one, zero, zero)]
    cosine, sine = directions(np.minimum(0.5 * half, math.pi / 2)).T
    end = directions(np.minimum(half, math.pi))
    normals += [(zero, one, -cosine), (zero, -one, cosine), (one, zero, sine), (one, zero, -sine)]
    slope = end[:, 1] / np.maximum(half, 1e-12)
    normals += [(zero, one, -slope), (zero, -one, slope)]
    return np.array(normals).swapaxes(0, 1)


def support_of(normals: Array, half: Array) -> Array:
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
