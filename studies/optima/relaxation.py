"""Shortest path within a box of link angles, relaxed to a programme that is convex.

The relaxation is a second-order cone programme over the configurations q_g and, for the chosen arm
at each goal, the direction u_gk = (c, s) of every link::

    min   Σ_g |q_g - q_(g-1)|
    s.t.  |base_g + shoulder + Σ_k l_k u_gk - goal_g| <= r,   |u_gk| <= 1
          (u_gk, φ_gk) in the half-spaces of its interval,    φ_gk = Σ_(j<=k) q_gj

The only part that is not convex, u = (cos φ, sin φ), is replaced by half-spaces that hold all
points (cos φ, sin φ, φ) with φ in its interval; their offsets are exact maxima.

The solver's dual point gives good multipliers; the bound is :mod:`lagrangian`'s, which holds for
any multipliers.

The hand of a goal may be undecided. Either hand is then within a disc around the middle of the
shoulders, whatever the arms do, and both arms may move: a relaxation of either choice.
"""

import contextlib
import math
import warnings
from typing import NamedTuple

import cvxpy as cp
import numpy as np
from lagrangian import Array, Lagrangian, least

from coartic import Hand

PartialSequence = tuple[Hand | None, ...]
"""A hand for each goal, None if it is undecided."""

HALF_SPACES = 9
"""Half-spaces of each link."""
_BASE_DOF = 2
_TOWARDS_POINT = 0.25  # of the way from an interval's middle to the relaxation's angle
# Any multipliers give a bound: those of the solver need not be exact.
_EXACT = {"tol_gap_abs": 1e-5, "tol_gap_rel": 1e-5, "tol_feas": 1e-7}


class Relaxed(NamedTuple):
    """Shortest path of the relaxation in a box, and its multipliers; zeros if the box has no
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


class Relaxation:
    """Cone programme of one hand sequence; its parameters are the half-spaces of a box.

    ``merged`` are the goals (0-based) that are hit without a movement; their hands are all decided.
    ``still`` holds the arm that is not chosen. A box has the intervals of the absolute link angles,
    shape ``(links, 2)``, rad, of the chosen arms at the goals whose hand is decided, goal by goal.
    """

    def __init__(self, task, hands, merged, still):
        dof, goals, q0 = task.robot.dof, len(hands), np.array(task.q0)
        discs = [disc_of(task, hand) for hand in hands]
        self._radii = np.array([radius for _, radius in discs])
        self._offsets = np.array([shoulder for shoulder, _ in discs]) - task.goal_array
        self._q0 = q0
        self._held = held_joints(task, hands, still)
        self._held[list(merged)] = True

        arms = [(g, task.robot.arm(hand)) for g, hand in enumerate(hands) if hand is not None]
        links = [(g, arm, k) for g, arm in arms for k in range(len(arm.links))]
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
        misses = self._q[:, :_BASE_DOF] + of_goal @ self._u + self._offsets
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

    def first_box(self, longest):
        """Return intervals that hold every link angle on a path no longer than ``longest``.

        An absolute angle is a sum of k relative ones, so it changes by at most √k times the
        joint-space distance.
        """
        reach = np.sqrt(self._sums.sum(axis=1)) * longest
        return np.stack([self._start_angles - reach, self._start_angles + reach], axis=1)

    def solve(self, box):
        """Return the relaxation's shortest path in a box, and multipliers for the box."""
        self._half_spaces.value = half_spaces(box)
        # If the solver fails, what was found for the box before serves as well.
        with (
            contextlib.suppress(cp.SolverError),
            warnings.catch_warnings(action="ignore", category=UserWarning),  # of inexactness
        ):
            self._problem.solve(
                cp.CLARABEL, canon_backend=cp.SCIPY_CANON_BACKEND, warm_start=False, **_EXACT
            )
        q, u = value_of(self._q), value_of(self._u)
        angles = self._sums @ q.ravel()
        pulls = -value_of(self._movements.dual_variables[1])
        pulls[self._held] += value_of(self._holds.dual_variables[0])
        # Within the unit ball over the joints that may move; without limit over the others.
        norms = np.linalg.norm(np.where(self._held, 0.0, pulls), axis=1, keepdims=True)
        return Relaxed(
            q=q,
            angles=angles,
            wrong=np.hypot(*(u - directions(angles)).T) * self._lengths,
            pulls=np.where(self._held, pulls, pulls / np.maximum(norms, 1.0)),
            forces=-value_of(self._hits.dual_variables[1]),
        )

    def lagrangian(self, pulls, forces, longest):
        """Return the Lagrangian of multipliers, for paths that are no longer than ``longest``."""
        weights = pulls.copy()  # of the joints' changes from the start
        weights[:-1] -= pulls[1:]
        weights[:, :_BASE_DOF] += forces
        slopes = self._slopes @ weights.ravel()
        rest = weights.ravel() - slopes @ self._sums
        constant = (
            float((forces * (self._q0[:_BASE_DOF] + self._offsets)).sum())
            - float(self._radii @ np.linalg.norm(forces, axis=1))
            - longest * float(np.abs(rest).sum())
            - float(slopes @ self._start_angles)
        )
        of_link = forces[self.goal_of] * self._lengths[:, None]
        sizes, towards = np.hypot(*of_link.T), np.arctan2(of_link[:, 1], of_link[:, 0])
        return Lagrangian(constant, slopes, sizes, towards)


def held_joints(task, hands, still):
    """Return whether joints cannot move on the way to each goal, shape ``(G, dof)``.

    ``still`` holds the arm that is not chosen; neither arm if the hand is undecided.
    """
    held = np.zeros((len(hands), task.robot.dof), dtype=np.bool_)
    held[:, ["xy".index(axis) for axis in task.locked_base]] = True
    for goal, hand in enumerate(hands):
        for arm in ("left", "right"):
            if arm not in task.hands or (still and hand not in (arm, None)):
                held[goal, task.robot.joints(arm)] = True
    return held


def disc_of(task, hand):
    """Return the position of the shoulder from the base, and the radius of a goal for a hand.

    For an undecided hand: the middle of the shoulders, and how far it may be from the goal while
    either hand is within the goal.
    """
    arms = [task.robot.arm(each) for each in task.hands if hand in (each, None)]
    shoulders = np.array([[arm.shoulder_x, arm.shoulder_y] for arm in arms])
    if hand is not None:
        return shoulders[0], task.radius
    middle = shoulders.mean(axis=0)
    lengths = np.array([sum(arm.links) for arm in arms])
    away = np.linalg.norm(shoulders - middle, axis=1)
    return middle, task.radius + float(np.max(lengths + away))


def split(box, relaxed):
    """Return two halves, across the angle whose direction the relaxation has most wrong.

    Weighting the errors by the forces, or by their cost in the Lagrangian, took up to fifty times
    as many nodes.
    """
    wrong, width = relaxed.wrong, box[:, 1] - box[:, 0]
    # Where all agree, the widest one: the bound is then as good as it gets here.
    link = int(np.argmax(wrong if wrong.max() > 1e-7 else width))
    low, high = box[link]
    middle, angle = 0.5 * (low + high), np.clip(relaxed.angles[link], low, high)
    below, above = box.copy(), box.copy()
    below[link, 1] = above[link, 0] = middle + _TOWARDS_POINT * (angle - middle)
    return below, above


def half_spaces(box):
    """Return coefficients of c, s and φ, and the most of their sum, ``(4, HALF_SPACES, links)``.

    They hold (c, s, φ) of every link in its interval: its ends; the chord; tangents to cosine and
    sine; the chord of the sine. Any normal is valid: the offsets make it so. More of them bound no
    better in the same time.
    """
    middle, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
    # In the interval's own frame, where its middle is the angle zero, and from there.
    zero, one = np.zeros_like(half), np.ones_like(half)
    cosine, sine = directions(np.minimum(0.5 * half, math.pi / 2)).T
    slope = np.sin(np.minimum(half, math.pi)) / np.maximum(half, 1e-12)
    rows = [
        (zero, zero, one), (zero, zero, -one), (-one, zero, zero),
        (zero, one, -cosine), (zero, -one, cosine), (one, zero, sine), (one, zero, -sine),
        (zero, one, -slope), (zero, -one, slope),
    ]  # fmt: skip
    along, across, turn = np.array(rows).swapaxes(0, 1)
    most = offset_of(along, across, turn, half) + turn * middle
    cosine, sine = directions(middle).T
    return np.array([along * cosine - across * sine, along * sine + across * cosine, turn, most])


def offset_of(a, b, k, half):
    """Return the maximum of ``a cos δ + b sin δ + k δ`` over |δ| <= half, exactly."""
    return -least(-k, np.hypot(a, b), np.arctan2(-b, -a), -half, half)


def directions(angles):
    """Return unit vectors of links at absolute angles (rad), shape ``(..., 2)``."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def value_of(variable):
    """Return the value of a variable or multiplier; zeros if the solver gives no value."""
    if variable.value is None:
        return np.zeros(variable.shape)
    return np.array(variable.value, dtype=np.float64)
