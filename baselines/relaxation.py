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
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic import Task
from coartic.baselines.trajectory_problem import held_joints
from coartic.robot import BASE_DOF, Arm, Array, Hand, directions

PartialSequence = tuple[Hand | None, ...]
"""A hand per goal, None where it is undecided."""

HALF_SPACES = 9
"""Half-spaces of each link."""
_TURN = 2.0 * math.pi
_TOWARDS_POINT = 0.25  # of the way from an interval's middle to the relaxation's angle
_PARABOLAS = 10  # steps by which an interval's end moves inwards
# Any multipliers give a bound: those of the solver need not be exact.
_EXACT = {"tol_gap_abs": 1e-5, "tol_gap_rel": 1e-5, "tol_feas": 1e-7}


class Relaxed(NamedTuple):
    """Shortest path of the relaxation in a box, and its multipliers; zeros where the box has no
    path."""

    q: Array
    """Configurations, shape ``(G, dof)``."""
    angles: Array
    """Absolute angles of the links, shape ``(links,)``, rad."""
    wrong: Array
    """Error of each link's end against its angle, shape ``(links,)``, length unit."""
    pulls: Array
    """p of the movements, shape ``(G, dof)``, of norm at most 1 over the joints that may move."""
    forces: Array
    """λ of the hands at their goals, shape ``(G, 2)``."""
    iterations: int
    """Iterations of the solver."""


class Relaxation:
    """Cone programme of one hand sequence; its parameters are the half-spaces of a box.

    ``merged`` are the goals (0-based) that are hit without a movement; their hands are all decided.
    A box has the intervals of the absolute link angles, shape ``(links, 2)``, rad, of the chosen
    arms at the goals whose hand is decided, goal by goal.
    """

    def __init__(
        self, task: Task, hands: PartialSequence, merged: tuple[int, ...], still: bool
    ) -> None:
        import cvxpy as cp  # slow, and a command that names methods needs none

        dof, goals, q0 = task.robot.dof, len(hands), np.array(task.q0)
        arms = [None if hand is None else task.robot.arm(hand) for hand in hands]
        discs = [disc_of(task, arm) for arm in arms]
        self._radii = np.array([radius for _, radius in discs])
        self._offsets = np.array([shoulder for shoulder, _ in discs]) - task.goal_array
        self._q0 = q0
        self._held = held_joints(task, hands, still=still)
        self._held[list(merged)] = True

        links = [(g, arm, k) for g, arm in enumerate(arms) if arm for k in range(len(arm.links))]
        self.goal_of = np.array([g for g, _, _ in links], dtype=np.intp)
        self._lengths = np.array([arm.links[k] for _, arm, k in links])
        # The absolute angle of a link is a sum of joints.
        sums = np.zeros((len(links), goals, dof))
        for summed, (g, arm, k) in zip(sums, links, strict=True):
            summed[g, arm.first : arm.first + k + 1] = 1.0
        self._sums = sums.reshape(len(links), goals * dof)
        self._slopes = np.linalg.pinv(self._sums.T).round()  # of joints, as those of angles
        self._start_angles = self._sums @ np.tile(q0, goals)

        self._q, self._u = cp.Variable((goals, dof)), cp.Variable((len(links), 2))
        lengths = cp.Variable(goals)
        changes = self._q - cp.vstack([q0[None], self._q[:-1]])
        of_goal = (self.goal_of == np.arange(goals)[:, None]) * self._lengths
        misses = self._q[:, :BASE_DOF] + of_goal @ self._u + self._offsets
        angles = self._sums @ cp.vec(self._q, order="C")
        self._half_spaces = cp.Parameter((4, HALF_SPACES, len(links)))
        a, b, k, most = (self._half_spaces[i] for i in range(4))
        self._movements = cp.SOC(lengths, changes, axis=1)
        self._hits = cp.SOC(self._radii, misses, axis=1)
        self._holds = changes[self._held] == 0.0
        constraints = [
            self._movements,
            self._hits,
            self._holds,
            cp.SOC(np.ones(len(links)), self._u, axis=1),
            cp.multiply(a, self._u[:, 0]) + cp.multiply(b, self._u[:, 1]) + cp.multiply(k, angles)
            <= most,
        ]
        self._problem = cp.Problem(cp.Minimize(cp.sum(lengths)), constraints)

    def first_box(self, longest: float) -> Array:
        """Intervals that hold every link angle on a path no longer than ``longest``.

        An absolute angle is a sum of k relative ones, so it changes by at most √k times
        the joint-space distance.
        """
        reach = np.sqrt(self._sums.sum(axis=1)) * longest
        return np.stack([self._start_angles - reach, self._start_angles + reach], axis=1)

    def solve(self, box: Array) -> Relaxed:
        """The relaxation's shortest path in a box, and multipliers for the box."""
        import cvxpy as cp

        self._half_spaces.value = half_spaces(box)
        try:
            with warnings.catch_warnings(action="ignore", category=UserWarning):  # of inexactness
                self._problem.solve(
                    cp.CLARABEL, canon_backend=cp.SCIPY_CANON_BACKEND, warm_start=False, **_EXACT
                )
            iterations = self._problem.solver_stats.num_iters
        except cp.SolverError:
            iterations = 0  # what was found for the box before serves as well
        q, u = value_of(self._q), value_of(self._u)
        angles = self._sums @ q.ravel()
        pulls = -value_of(self._movements.dual_variables[1])
        pulls[self._held] += value_of(self._holds.dual_variables[0])
        # Within the unit ball over the joints that may move; without limit over the others.
        norms = np.linalg.norm(np.where(self._held, 0.0, pulls), axis=1, keepdims=True)
        return Relaxed(
            q=q,
            angles=angles,
            wrong=np.linalg.norm(u - directions(angles), axis=1) * self._lengths,
            pulls=np.where(self._held, pulls, pulls / np.maximum(norms, 1.0)),
            forces=-value_of(self._hits.dual_variables[1]),
            iterations=iterations,
        )

    def lagrangian(self, pulls: Array, forces: Array, longest: float) -> Lagrangian:
        """The Lagrangian of multipliers, for paths that are no longer than ``longest``."""
        weights = pulls.copy()  # of the joints' changes from the start
        weights[:-1] -= pulls[1:]
        weights[:, :BASE_DOF] += forces
        slopes = self._slopes @ weights.ravel()
        rest = weights.ravel() - slopes @ self._sums
        constant = (
            float((forces * (self._q0[:BASE_DOF] + self._offsets)).sum())
            - float(self._radii @ np.linalg.norm(forces, axis=1))
            - longest * float(np.abs(rest).sum())
            - float(slopes @ self._start_angles)
        )
        of_link = forces[self.goal_of] * self._lengths[:, None]
        sizes, towards = np.hypot(*of_link.T), np.arctan2(of_link[:, 1], of_link[:, 0])
        return Lagrangian(constant, slopes, sizes, towards)


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


def split(box: Array, relaxed: Relaxed) -> tuple[Array, Array]:
    """Two halves, across the angle whose direction the relaxation has most wrong.

    Weighting the errors by the forces, or by their cost in the Lagrangian, took up to
    fifty times as many nodes.
    """
    wrong, width = relaxed.wrong, box[:, 1] - box[:, 0]
    # Where all agree, the widest one: the bound is then as good as it gets here.
    link = int(np.argmax(wrong if wrong.max() > 1e-7 else width))
    low, high = box[link]
    middle, angle = 0.5 * (low + high), np.clip(relaxed.angles[link], low, high)
    below, above = box.copy(), box.copy()
    below[link, 1] = above[link, 0] = middle + _TOWARDS_POINT * (angle - middle)
    return below, above


def value_of(variable: Any) -> Array:
    """Return the value of a variable or multiplier; zeros where the solver gives no value."""
    if variable.value is None:
        return np.zeros(variable.shape)
    return np.array(variable.value, dtype=np.float64)


def half_spaces(box: Array) -> Array:
    """Coefficients of c, s and φ, and the most of their sum, ``(4, HALF_SPACES, links)``.

    They hold (c, s, φ) of every link in its interval: its ends; the chord; tangents to cosine and
    sine; the chord of the sine. Any normal is valid: the offsets make it so. More of them bound no
    better in the same time.
    """
    middle, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
    # In the interval's own frame, where its middle is the angle zero, and from there.
    zero, one = np.zeros_like(half), np.ones_like(half)
    cosine, sine = directions(np.minimum(0.5 * half, math.pi / 2)).T
    end = directions(np.minimum(half, math.pi))
    slope = end[:, 1] / np.maximum(half, 1e-12)
    rows = [
        (zero, zero, one), (zero, zero, -one), (-one, zero, zero),
        (zero, one, -cosine), (zero, -one, cosine), (one, zero, sine), (one, zero, -sine),
        (zero, one, -slope), (zero, -one, slope),
    ]  # fmt: skip
    along, across, turn = normals = np.array(rows).swapaxes(0, 1)
    most = support_of(normals, half) + turn * middle
    cosine, sine = directions(middle).T
    return np.array([along * cosine - across * sine, along * sine + across * cosine, turn, most])


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
