"""Relax the shortest path within a box of link angles to a convex programme.

The relaxation is a second-order cone programme over the configurations q_g and, for the chosen arm
at each goal, the direction u_gk = (c, s) of every link::

    min   Σ_g d_g,   |q_g - q_(g-1)| <= d_g
    s.t.  |base_g + shoulder + Σ_k l_k u_gk - goal_g| <= r,   |u_gk| <= 1
          (u_gk, φ_gk) in the half-spaces of its interval,    φ_gk = Σ_(j<=k) q_gj
          Σ_(g in span) d_g >= the path on which a hand covers its distance in this span

The only part that is not convex, u = (cos φ, sin φ), is replaced by half-spaces that contain all
points (cos φ, sin φ, φ) with φ in its interval. The offsets of the half-spaces are exact maxima.
The solver's multipliers give the bound of :mod:`lagrangian`, which holds for any multipliers. In a
box without a path, they are a ray along which the bound grows. If the hand of a goal is undecided,
either hand is within a disc around the middle of the shoulders, and both arms may move.
"""

import math
from typing import NamedTuple

import numpy as np
from lagrangian import Lagrangian, least
from programme import MAX_MULTIPLIER, Programme, finite
from speed import spans_of

from coartic.baselines.trajectory_problem import held_joints

HALF_SPACES = 9
"""Number of half-spaces of each link."""
_BASE_DOF = 2
_TOWARDS_POINT = 0.25  # share of the distance from an interval's middle to the relaxation's angle


def directions_of(angles):
    """Return unit vectors of links at absolute angles (in rad), shape ``(..., 2)``."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


class Relaxed(NamedTuple):
    """Shortest path of the relaxation in a box, and its multipliers.

    If the box has no path, or if the solver fails, the values can be any numbers.
    """

    q: np.ndarray
    """Configurations, shape ``(G, dof)``."""
    angles: np.ndarray
    """Absolute angles of the links, shape ``(links,)``, in rad."""
    wrong: np.ndarray
    """Distance between each link's relaxed end and the end at its angle, shape ``(links,)``, in
    length units."""
    multipliers: tuple
    """Multipliers p of the movements, shape ``(G, dof)``, λ of the hands at their goals, shape
    ``(G, 2)``, and μ of the spans, shape ``(spans,)``."""


class Relaxation:
    """Cone programme of one hand sequence. Its parameters are the half-spaces of a box.

    ``merged`` are the goals (from 0) that are hit without a movement; their hands must be decided.
    If ``still``, the idle arm must not move. A box has intervals (in rad) of the absolute link
    angles of the chosen arms at the goals whose hand is decided, goal by goal, shape
    ``(links, 2)``.
    """

    def __init__(self, task, hands, merged, still):
        dof, goals, q0 = task.robot.dof, len(hands), np.array(task.q0)
        discs = [disc_of(task, hand) for hand in hands]
        self._radii = np.array([radius for _, radius in discs])
        self._offsets = np.array([shoulder for shoulder, _ in discs]) - task.goal_array
        self._q0 = q0
        undecided = np.array([hand is None for hand in hands])
        self.held = held_joints(task, hands, still=still)
        self.held[undecided] = held_joints(task, hands, still=False)[undecided]
        self.held[list(merged)] = True
        self._spans, self._paths = spans_of(task, hands)

        arms = [(g, task.robot.arm(hand)) for g, hand in enumerate(hands) if hand is not None]
        links = [(g, arm, k) for g, arm in arms for k in range(len(arm.links))]
        self.goal_of = np.array([g for g, _, _ in links], dtype=np.intp)
        self._lengths = np.array([arm.links[k] for _, arm, k in links])
        # The absolute angle of a link is a sum of joints.
        sums = np.zeros((len(links), goals, dof))
        for summed, (g, arm, k) in zip(sums, links, strict=True):
            summed[g, arm.first_joint : arm.first_joint + k + 1] = 1.0
        self._sums = sums.reshape(len(links), goals * dof)
        self._slopes = np.linalg.pinv(self._sums.T).round()  # slopes of joints to slopes of angles
        self._start_angles = self._sums @ np.tile(q0, goals)
        self._programme = None

    def first_box(self, longest):
        """Return intervals that contain every link angle on a path no longer than ``longest``.

        An absolute angle is a sum of k relative ones, so it changes by at most √k times the
        joint-space distance.
        """
        reach = np.sqrt(self._sums.sum(axis=1)) * longest
        return np.stack([self._start_angles - reach, self._start_angles + reach], axis=1)

    def state(self):
        """Return the CVXPY problem, its parameter (the half-spaces), and its variables q and u."""
        import cvxpy as cp  # slow to import, and needed for proofs alone

        goals, links = len(self._radii), len(self._lengths)
        q, u, distances = cp.Variable(self.held.shape), cp.Variable((links, 2)), cp.Variable(goals)
        changes = q - cp.vstack([self._q0[None], q[:-1]])
        of_goal = (self.goal_of == np.arange(goals)[:, None]) * self._lengths
        misses = q[:, :_BASE_DOF] + of_goal @ u + self._offsets
        angles = self._sums @ cp.vec(q, order="C")
        a, b, k, most = (half_spaces := cp.Parameter((4, HALF_SPACES, links)))
        constraints = [
            changes[self.held] == 0.0,
            self._spans @ distances >= self._paths,
            cp.multiply(a, u[:, 0]) + cp.multiply(b, u[:, 1]) + cp.multiply(k, angles) <= most,
            cp.SOC(distances, changes, axis=1),
            cp.SOC(self._radii, misses, axis=1),
            cp.SOC(np.ones(links), u, axis=1),
        ]
        return cp.Problem(cp.Minimize(cp.sum(distances)), constraints), half_spaces, [q, u]

    def solve(self, box, gap=1e-3):
        """Return the relaxation's shortest path in a box, and its multipliers.

        ``gap`` is the duality gap, in length units or as a share.
        """
        values = half_spaces(box)
        self._programme = self._programme or Programme(*self.state(), values)
        (q, u), (held, speeds, _, pulls, forces, _) = self._programme.solve(values, gap)
        pulls, forces = (-each.reshape(len(q), -1)[:, 1:] for each in (pulls, forces))
        pulls[self.held] += held
        angles = self._sums @ q.ravel()
        wrong = np.hypot(*(u - directions_of(angles)).T) * self._lengths
        return Relaxed(q, angles, wrong, (pulls, forces, speeds))

    def lagrangian(self, multipliers, longest):
        """Return the Lagrangian of any multipliers, for paths no longer than ``longest``."""
        pulls, forces, speeds = map(finite, multipliers)
        size = min(
            1.0, MAX_MULTIPLIER / max(np.abs(m).max(initial=1.0) for m in (pulls, forces, speeds))
        )
        pulls, forces, speeds = size * pulls, size * forces, size * np.maximum(speeds, 0.0)
        speeds = speeds / max(1.0, (speeds @ self._spans).max(initial=0.0))
        # Multipliers of joints that may move are within the ball that the spans leave. Those of
        # other joints have no limit.
        norms = np.linalg.norm(np.where(self.held, 0.0, pulls), axis=1)
        left = np.maximum(1.0 - speeds @ self._spans, 0.0)
        shares = np.minimum(1.0, left / np.maximum(norms, 1e-300))[:, None]
        pulls = np.where(self.held, pulls, shares * pulls)
        weights = pulls.copy()  # weights of the joints' changes from the start
        weights[:-1] -= pulls[1:]
        weights[:, :_BASE_DOF] += forces
        slopes = self._slopes @ weights.ravel()
        rest = weights.ravel() - slopes @ self._sums
        constant = (
            float(speeds @ self._paths)
            + float((forces * (self._q0[:_BASE_DOF] + self._offsets)).sum())
            - float(self._radii @ np.linalg.norm(forces, axis=1))
            - longest * float(np.abs(rest).sum())
            - float(slopes @ self._start_angles)
        )
        of_link = forces[self.goal_of] * self._lengths[:, None]
        sizes, towards = np.hypot(*of_link.T), np.arctan2(of_link[:, 1], of_link[:, 0])
        return Lagrangian(constant, slopes, sizes, towards)


def disc_of(task, hand):
    """Return the position of the shoulder from the base, and the radius of a goal for a hand.

    For an undecided hand, they are the middle of the shoulders, and the largest distance of this
    middle from the goal at which either hand can be within the goal.
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
    """Return two halves of a box.

    The box is split at the link whose direction is most wrong in the relaxation. If all directions
    are right, it is split at the widest interval.
    """
    wrong, width = relaxed.wrong, box[:, 1] - box[:, 0]
    link = int(np.argmax(wrong if wrong.max() > 1e-7 else width))
    low, high = box[link]
    middle, angle = 0.5 * (low + high), np.clip(relaxed.angles[link], low, high)
    below, above = box.copy(), box.copy()
    below[link, 1] = above[link, 0] = middle + _TOWARDS_POINT * (angle - middle)
    return below, above


def half_spaces(box):
    """Return half-spaces that contain (c, s, φ) of every link with φ in its interval.

    The result has the coefficients of c, s and φ, and the maximum of the weighted sum, shape
    ``(4, HALF_SPACES, links)``. The half-spaces are the ends of the interval, the chord, tangents
    to cosine and sine, and the chord of the sine. Any normal is valid, because the offsets are
    exact.
    """
    middle, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
    # The rows are in the frame in which the middle of the interval is angle 0.
    zero, one = np.zeros_like(half), np.ones_like(half)
    cosine, sine = directions_of(np.minimum(0.5 * half, math.pi / 2)).T
    slope = np.sin(np.minimum(half, math.pi)) / np.maximum(half, 1e-12)
    rows = [
        (zero, zero, one), (zero, zero, -one), (-one, zero, zero),
        (zero, one, -cosine), (zero, -one, cosine), (one, zero, sine), (one, zero, -sine),
        (zero, one, -slope), (zero, -one, slope),
    ]  # fmt: skip
    along, across, turn = np.array(rows).swapaxes(0, 1)
    most = offset_of(along, across, turn, half) + turn * middle
    cosine, sine = directions_of(middle).T
    return np.array([along * cosine - across * sine, along * sine + across * cosine, turn, most])


def offset_of(a, b, k, half):
    """Return the maximum of ``a cos δ + b sin δ + k δ`` over |δ| <= half, exactly."""
    return -least(-k, np.hypot(a, b), np.arctan2(-b, -a), -half, half)
