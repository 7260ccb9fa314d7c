"""Posture-based planning: stored postures, a constraint hierarchy, diffusion.

For every goal a posture is planned first, then the straight joint-space movement to it
(Rosenbaum, Meulenbroek, Vaughan & Jansen 2001):

1. *Instance retrieval.* Of the stored postures, corrected, first all survive whose hand is at the
   goal, then the posture with the least cost of travel.
2. *Instance generation.* Postures that resemble it are generated and evaluated in the same way
   until a deadline. What a generated posture lacks in accuracy, feedforward correction makes up for
   (Rosenbaum, Loukopoulos, Meulenbroek, Vaughan & Engelbrecht 1995).
3. An internal simulation says where the movement ends; the planned postures join the store.

With a horizon of two goals the cost of travel includes the way on to a posture for the next goal.
Only the first movement is made; the second posture is planned again from there. The authors name
anticipation as an extension (1995); this form is ours.

Where this differs from the theory: the cost of travel is the joint-space distance, which the tasks
charge, not each joint's expense. The hierarchy has two levels: there are no obstacles. The store
begins with random postures of the arms about the start, with the base wherever that takes the hand
to the goal. Diffusion gets narrower until the deadline, about a weighted sum of the better postures
(the rule of 1995), so that it converges. The hand is planned with the posture.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic import Movement
from coartic.baselines.posture_graph import KINEMATICS, HandSequence, Layers
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.method.optimisers import explored_joints
from coartic.motion.compile import chain_by, entry, joint_lever
from coartic.robot import BASE_DOF, Array, Hand

Mask = NDArray[np.bool_]

PER_ROUND = 60
"""Postures generated in a round for each hand sequence."""
# Feedforward correction: damped Gauss-Newton steps on the hand's error.
_DAMPING = 1e-3  # length unit squared: the Jacobian of a straight arm is singular
_LONGEST = 0.5  # length unit: most of the error that one step takes on
_RETRIEVED = 40  # steps for a stored posture, which may be far off
_GENERATED = 3  # steps for a generated one, which is close by
_INSIDE = 0.999  # part of the tolerated error that is aimed at
_SPREAD = 1.0  # largest SD of stored postures about the starting posture, rad
_FIRST_SD = 0.3  # first SD of the diffusion, length unit (base) or rad (joints)
_LAST_SD = 0.01  # last SD of the diffusion, as a part of the first


class PostureBasedParameters(Parameters):
    """Parameters of posture-based planning.

    Tried by hand: over 5 seeds on each shipped task 50, 300 and 1000 stored postures (mean rewards
    within 3 of each other); over 6 seeds on the first two goals of three tasks 60 and 100 rounds of
    60, 40 of 100, first SDs of 0.1 and 0.3, last ones of 0.001 and 0.01 of these (within 3 ticks),
    equal weights, and diffusion at all widths in each round (up to 4 ticks).
    """

    stored: Annotated[int, Field(ge=0, le=2000)] = 300
    """Random postures in the first store, in addition to the starting posture."""
    rounds: Annotated[int, Field(ge=0)] = 60
    """Rounds of generation for each goal, until the deadline."""


class PostureBased(Method):
    """Posture-based planning that looks at ``horizon`` goals at a time, one or two."""

    version = 2
    horizon: ClassVar[Literal[1, 2]]
    tuned_on = "the paper's tasks, by hand"
    citation = (
        "D. A. Rosenbaum, R. J. Meulenbroek, J. Vaughan, C. Jansen (2001). Posture-based "
        "motion planning: applications to grasping. Psychological Review 108(4), 709-734, "
        "doi:10.1037/0033-295X.108.4.709."
    )
    information = KINEMATICS | {Information.REWARD_FORMULA}
    Parameters = PostureBasedParameters
    quick: ClassVar[Mapping[str, Any]] = {"stored": 50, "rounds": 15}

    def solve(self, session: Session) -> Result:
        """Plan a movement for each goal, from where the movement before it is expected to end;
        return the movements. Raises MethodError if correction brings no posture to a goal."""
        with session.building():
            planner = PosturePlanner(session, self.parameters, self.horizon)
        with session.solving():
            movements, ticks = planner.plan()
        return Result(movements, {"expected_ticks": ticks})


class OneGoal(PostureBased):
    """Posture-based planning of each posture for its own goal alone."""

    name = "posture-based/one-goal"
    title = "Posture-based planning, one goal at a time"
    horizon = 1


class TwoGoals(PostureBased):
    """Posture-based planning of each posture together with a posture for the next goal."""

    name = "posture-based/two-goals"
    title = "Posture-based planning, one goal ahead"
    horizon = 2


METHODS: tuple[type[Method], ...] = (OneGoal, TwoGoals)


class PosturePlanner:
    """Plan movements from ``store``, postures of shape ``(n, dof)``; ``q`` is the configuration in
    which the movements planned so far are expected to end."""

    def __init__(
        self, session: Session, parameters: PostureBasedParameters, horizon: Literal[1, 2]
    ) -> None:
        self.session = session
        self.rounds = parameters.rounds
        self.horizon = horizon
        self.robot = session.reveal(Information.FORWARD_KINEMATICS, Information.JACOBIAN).robot
        self.goals = session.goals
        # ‖F(q) − x_g‖ of a target at most θ^g − θ^a: the movement hits before it arrives.
        arrival, _ = session.model.tolerances(session.radius)
        self.tolerance = session.radius - arrival
        self.base_and_arm = {hand: np.zeros(session.dof, bool) for hand in session.hands}
        for hand, mask in self.base_and_arm.items():
            mask[:BASE_DOF] = mask[session.joints(hand)] = True
        self.movable: Mask = explored_joints(session)
        self.free = {hand: self.movable & mask for hand, mask in self.base_and_arm.items()}
        """True for joints that may move towards a posture for each hand, shape ``(dof,)``."""
        # SDs from zero up: dense near the start, sparse far from it.
        sds = _SPREAD * session.rng.uniform(size=(parameters.stored, 1))
        noise = session.rng.standard_normal((parameters.stored, session.dof))
        self.q = session.q0
        self.store = np.vstack([session.q0, session.q0 + sds * noise * self.movable])
        # Weights of the better postures, best first: logarithmic in the rank.
        better = math.ceil(PER_ROUND / 4)
        self.weights = np.log(better + 0.5) - np.log(np.arange(1, better + 1))

    def plan(self) -> tuple[tuple[Movement, ...], list[int]]:
        """Return the movement to each goal, and the ticks that each movement is expected to take.
        To be called once: ``q`` and ``store`` of the planner change. Raises MethodError if there is
        a goal to which correction brings no posture (:meth:`retrieve`)."""
        movements, ticks, step = [], [], self.session.model.step
        for goal in range(len(self.goals)):
            ahead = range(goal, min(goal + self.horizon, len(self.goals)))
            retrieved = self.retrieve(ahead)
            promising, noise = dict[HandSequence, Array](), list[Array]()
            for hands in itertools.product(self.session.hands, repeat=len(ahead)):
                layers = [retrieved[key] for key in zip(ahead, hands, strict=True)]
                if all(len(layer) for layer in layers):
                    shape = self.rounds, PER_ROUND, len(ahead), self.session.dof
                    noise.append(self.session.rng.standard_normal(shape))
                    promising[hands] = self.most_promising(hands, layers)
            if not promising:
                able = {goal for (goal, _), postures in retrieved.items() if len(postures)}
                raise MethodError(
                    "infeasible",
                    f"goal {min({*ahead} - able) + 1}: no correction of any of {len(self.store)} "
                    f"stored postures puts the {' or '.join(self.session.hands)} hand within "
                    f"{self.tolerance:g} of it",
                )
            chains = self.generate(promising, np.stack(noise), ahead)
            _, (hand, *_), postures = min(chains, key=lambda chain: chain[0])
            self.store = np.vstack([self.store, postures])
            movements.append(Movement(goal + 1, hand, "planned", postures[0]))
            # Internal simulation: where the movement hits the goal, and the ticks until then.
            distance = float(np.linalg.norm(postures[0] - self.q))
            along = np.arange(math.ceil(distance / step))[:, None] * step
            line = self.q + along / max(distance, step) * (postures[0] - self.q)
            line = np.vstack([line, postures[0]])
            miss = self.session.forward_kinematics(line, hand) - self.goals[goal]
            hit = int(np.argmax(np.hypot(miss[:, 0], miss[:, 1]) <= self.session.radius))
            self.q = line[hit]
            ticks.append(hit + 1)
        return tuple(movements), ticks

    def retrieve(self, goals: range) -> Layers:
        """Return, by goal (from 0) and hand, postures ``(n, dof)`` with the hand at the goal. Each
        has the angles of the hand's arm from a posture of the planner's ``store``, and all else
        from the planner's ``q``, where the robot is to stand. Each free base coordinate is moved by
        the way from hand to goal; then base and arm are corrected (:meth:`correct`). Postures that
        are not at the goal then are left out."""
        retrieved: Layers = {}
        for goal, hand in itertools.product(goals, self.session.hands):
            postures = np.tile(self.q, (len(self.store), 1))
            arm = self.session.joints(hand)
            postures[:, arm] = self.store[:, arm]
            miss = self.goals[goal] - self.session.forward_kinematics(postures, hand)
            postures[:, :BASE_DOF] += miss * self.movable[:BASE_DOF]
            retrieved[goal, hand] = postures[self.correct(postures, goal, hand, _RETRIEVED)]
        return retrieved

    def most_promising(self, hands: HandSequence, layers: list[Array]) -> Array:
        """Return the sequence of postures with the shortest joint-space path from the planner's
        ``q``, one out of each of ``layers``, the retrieved postures ``(n, dof)`` for one goal or
        for two goals in turn, hit by ``hands``; shape ``(goals, dof)``. From the first to the
        second only base and arm of the second hand move: the other arm stays as in the first."""
        first = layers[0]
        cost = np.linalg.norm(first - self.q, axis=1)
        if len(layers) == 1:
            return first[[np.argmin(cost)]]
        second = layers[1]
        used = self.base_and_arm[hands[1]]
        # No posture that alone costs more than some pair can be the first of the best pair.
        onward = np.linalg.norm(first[np.argmin(cost)][used] - second[:, used], axis=1)
        near = np.flatnonzero(cost <= cost.min() + onward.min())
        onward = np.linalg.norm(first[near][:, None, used] - second[None][:, :, used], axis=2)
        i, j = np.unravel_index(np.argmin(cost[near][:, None] + onward), onward.shape)
        i = near[i]
        return np.stack([first[i], np.where(used, second[j], first[i])])

    def generate(
        self, promising: dict[HandSequence, Array], noises: Array, goals: range
    ) -> list[tuple[float, HandSequence, Array]]:
        """Return for each hand sequence the cheapest postures ``(goals, dof)`` found around its
        ``promising`` postures, these included, as a triple: their cost (joint-space length of the
        path from the planner's ``q``), the hands, the postures. ``noises`` are standard normal,
        shape ``(hand sequences, rounds, PER_ROUND, goals, dof)``; ``goals`` are from 0."""
        sequences = [*promising]
        centre = best = np.stack([*promising.values()])
        costs = _path_length(self.q, best)
        for number, sd in enumerate(_FIRST_SD * np.geomspace(1.0, _LAST_SD, self.rounds)):
            noise = sd * noises[:, number]
            noise[:, 0] = 0.0  # the weighted sum itself is evaluated, too
            postures = centre[:, None] + noise
            # Corrected goal by goal, the arm that is not chosen standing where it stood before.
            accurate = np.ones(postures.shape[:2], bool)
            before = np.broadcast_to(self.q, (*postures.shape[:2], postures.shape[-1])).copy()
            for k, goal in enumerate(goals):
                for hand in self.session.hands:
                    chosen = [i for i, hands in enumerate(sequences) if hands[k] == hand]
                    if chosen:
                        posture = np.where(self.free[hand], postures[chosen, :, k], before[chosen])
                        accurate[chosen] &= self.correct(posture, goal, hand, _GENERATED)
                        postures[chosen, :, k] = before[chosen] = posture
            lengths = np.where(accurate, _path_length(self.q, postures), np.inf)
            order = np.argsort(lengths, axis=1, kind="stable")
            centre, best = centre.copy(), best.copy()
            for k, count in enumerate(accurate.sum(axis=1)):
                better = order[k, : min(len(self.weights), count)]
                if not len(better):
                    continue
                weights = self.weights[: len(better)]
                centre[k] = np.tensordot(weights / weights.sum(), postures[k, better], axes=1)
                if lengths[k, better[0]] < costs[k]:
                    best[k], costs[k] = postures[k, better[0]], lengths[k, better[0]]
        return list(zip(costs.tolist(), sequences, best, strict=True))

    def correct(self, postures: Array, goal: int, hand: Hand, steps: int) -> Mask:
        """Bring a hand of contiguous postures ``(..., dof)``, in place, towards a goal (from 0), in
        at most ``steps`` steps each; return True where the hand is then within the planner's
        ``tolerance`` of the goal's centre, shape ``(...)``. The session counts the evaluations."""
        flat = postures.reshape(-1, postures.shape[-1])
        arm = self.robot.arm(hand)
        far = np.arange(len(flat))
        wanted = np.empty((len(far), 2, 1))
        jacobian = np.zeros((len(far), 2, flat.shape[-1]))
        jacobian[:, [0, 1], [0, 1]] = self.movable[:BASE_DOF]
        joints = np.empty((2, len(arm.links) + 1))
        x, y = self.goals[goal]
        for step in range(steps + 1):
            left = _linearise_far(flat, far, arm, x, y, self.tolerance, wanted, jacobian, *joints)
            self.session.spend(forward_kinematics=len(far))
            far = far[:left]
            if step == steps or not left:
                break
            self.session.spend(jacobians=left)
            across = jacobian[:left]
            transpose = across.transpose(0, 2, 1)
            gram = across @ transpose + _DAMPING * np.eye(2)
            flat[far] += (transpose @ np.linalg.solve(gram, wanted[:left]))[..., 0]
        there = np.ones(len(flat), bool)
        there[far] = False
        return there.reshape(postures.shape[:-1])


@entry
def _linearise_far(
    postures: Any,
    far: Any,
    arm: Any,
    x: float,
    y: float,
    tolerance: float,
    wanted: Any,
    jacobian: Any,
    xs: Any,
    ys: Any,
) -> int:
    """Keep at the beginning of ``far``, indices of rows of ``postures``, the indices of postures
    whose hand is farther than ``tolerance`` from (x, y); return their number. For each kept index
    fill a row of ``wanted``, the hand's step towards (x, y), shortened, and of ``jacobian``, the
    columns of the arm's joints. ``xs`` and ``ys`` are space for the points of an arm."""
    tip = len(arm.links)
    left = 0
    for row in far:  # with the C library's cosine and sine, as in the robot's own kinematics
        chain_by(postures[row], arm, xs, ys, math.cos, math.sin)
        miss_x = x - xs[tip]
        miss_y = y - ys[tip]
        distance = math.hypot(miss_x, miss_y)
        if distance > tolerance:
            share = min(distance - _INSIDE * tolerance, _LONGEST) / distance
            wanted[left, 0, 0] = miss_x * share
            wanted[left, 1, 0] = miss_y * share
            for k in range(tip):
                dx, dy = joint_lever(xs, ys, k, tip)
                jacobian[left, 0, arm.first_joint + k] = dx
                jacobian[left, 1, arm.first_joint + k] = dy
            far[left] = row
            left += 1
    return left


def _path_length(q: Array, postures: Array) -> Array:
    """Return the joint-space length of the path from ``q`` ``(dof,)`` through k postures in turn,
    shape ``(...)`` for postures ``(..., k, dof)``."""
    start = np.broadcast_to(q, (*postures.shape[:-2], 1, postures.shape[-1]))
    legs = np.diff(np.concatenate([start, postures], axis=-2), axis=-2)
    length: Array = np.linalg.norm(legs, axis=-1).sum(axis=-1)
    return length
